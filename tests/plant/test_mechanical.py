"""The mechanical model: what it accepts, what it rejects, and its local models."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant import MechanicalModel
from lpvhinf.plant.maps import project_left, project_right

EYE, ZERO = np.eye(2), np.zeros((2, 2))
SPRING = np.array([[1.0, -1.0], [-1.0, 1.0]])


def moving_force(points):
    return np.stack([1.0 - points, points], axis=1)


def build(**changes):
    given = {
        "M": EYE,
        "D": 0.1 * SPRING,
        "K": SPRING,
        "input_map": moving_force,
        "output_map": EYE,
        "box": [[0.0, 1.0]],
    }
    return MechanicalModel(**(given | changes))


def test_sizes_and_read_only_arrays():
    model = build(input_names=["force"])
    assert (model.n_q, model.n_u, model.n_y, model.n_p) == (2, 1, 2, 1)
    assert model.input_names == ("force",)
    assert model.output_names == ("y1", "y2")
    assert not model.M.flags.writeable
    with pytest.raises(FrozenInstanceError):
        model.M = EYE
    with pytest.raises(TypeError):
        MechanicalModel(EYE, ZERO, ZERO, EYE, EYE, [[0.0, 1.0]])


def test_caller_keeps_the_arrays():
    M = np.eye(2)
    build(M=M)
    M[0, 0] = 3.0
    assert M.flags.writeable


def test_maps_are_vectorised():
    model = build()
    p = np.linspace(0.0, 1.0, 7)[:, None]
    assert np.array_equal(model.input_map_at(p)[:, 1, 0], p[:, 0])
    assert model.output_map_at(p).shape == (7, 2, 2)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"M": [[1.0, 0.1], [0.0, 1.0]]}, AssumptionError, "M is not symmetric"),
        ({"M": np.diag([1.0, 0.0])}, AssumptionError, "positive definite"),
        ({"M": np.diag([1.0, -1.0])}, AssumptionError, "positive definite"),
        ({"K": np.diag([1.0, -0.1])}, AssumptionError, "K has the eigenvalue -0.1"),
        ({"D": [[0.0, 1.0], [-1.0, 0.0]]}, AssumptionError, "D is not symmetric"),
        ({"D": np.diag([0.0, -1.0])}, AssumptionError, "negative damping"),
        ({"K": np.eye(3)}, DimensionError, r"K has shape \(3, 3\)"),
        ({"M": np.ones((2, 3))}, DimensionError, "square"),
        ({"M": np.ones(2)}, DimensionError, "M has shape"),
        ({"K": [[np.nan, 0.0], [0.0, 1.0]]}, DomainError, r"K\[0, 0\] is nan"),
        ({"M": "abc"}, DomainError, "M is not an array of real numbers"),
        ({"input_map": np.eye(3)}, DimensionError, "input_map returned shape"),
        ({"input_map": lambda p: np.zeros((2, 1))}, DimensionError, "input_map returned shape"),
        ({"input_map": lambda p: np.full((len(p), 2, 1), np.nan)}, DomainError, "not finite"),
        ({"input_map": lambda p: p @ np.ones((5, 5))}, DomainError, "input_map failed"),
        ({"output_map": np.ones(2)}, DimensionError, "output_map has shape"),
        ({"box": [[1.0, 0.0]]}, DomainError, "lower < upper"),
        ({"box": [0.0, 1.0]}, DimensionError, "box has shape"),
        ({"input_names": ["a", "b"]}, DimensionError, "input_names"),
        ({"output_names": ["a", "a"]}, DimensionError, "output_names"),
    ],
)
def test_bad_input_is_named(changes, error, words):
    with pytest.raises(error, match=words):
        build(**changes)


def test_positions_outside_the_box_are_rejected():
    model = build()
    with pytest.raises(DomainError, match="outside the box"):
        model.input_map_at([[1.1]])
    with pytest.raises(DomainError, match="outside the box"):
        model.local_model([-0.1])
    with pytest.raises(DimensionError, match="holds 3 positions"):
        model.local_model([[0.1], [0.2], [0.3]])


def test_round_off_asymmetry_and_semidefiniteness_are_accepted():
    K = SPRING.copy()
    K[0, 1] *= 1 + 1e-14
    assert np.array_equal(build(K=K).K, build(K=K).K.T)
    build(K=SPRING - 1e-14 * EYE)


def test_local_model_is_the_equation_of_motion():
    M = np.array([[2.0, 0.3], [0.3, 1.0]])
    model = build(M=M)
    omega, p = 0.7, 0.3
    wanted = np.linalg.solve(-(omega**2) * M + 1j * omega * model.D + model.K, model.input_map_at([p])[0])
    system = model.local_model([p])
    assert system.input_labels == ["u1"]
    assert np.allclose(system(1j * omega), wanted, rtol=1e-12)


class ProjectingMap:
    """A map that counts how often its large matrix is formed."""

    def __init__(self):
        self.formed = 0

    def __call__(self, points):
        self.formed += 1
        return moving_force(points)

    def left_project(self, V):
        return lambda points: V.T @ moving_force(points)


def test_a_map_may_project_itself():
    own, V, p = ProjectingMap(), np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[0.25]])
    composed = project_left(moving_force, V)(p)
    assert np.allclose(project_left(own, V)(p), composed)
    assert own.formed == 0
    assert np.allclose(project_right(lambda points: moving_force(points).transpose(0, 2, 1), V)(p)[0], composed[0].T)
