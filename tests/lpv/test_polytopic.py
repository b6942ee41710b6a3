"""Polytopic synthesis: vertices, weights, and the blend that keeps its level."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.lpv import lpvsyn, polytope_weights, with_constant_channels
from lpvhinf.lpv.bounded_real import frozen_norm, proven_level
from lpvhinf.lpv.plant_family import plant_family
from lpvhinf.lpv.polytopic import blended_plant
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.lpv.small_plants import moving_mode

SQUARE = np.array([[0.0, -1.0], [0.0, 1.0], [2.0, -1.0], [2.0, 1.0]])
HEXAGON = np.array([[np.cos(a), np.sin(a)] for a in np.pi / 3 * np.arange(6)])
TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.2], [0.1, 1.5]])


def stiff(p: Array) -> GeneralizedPlant:
    """The stiffness and damping of the mode depend on p: B2, C2 do not."""
    P, A = moving_mode(np.array([0.5])), np.array(moving_mode(np.array([0.5])).A)
    A[3, 2] -= 4.0 * p[0]
    A[3, 3] -= 0.3 * (p[1] + 1.5)
    return GeneralizedPlant(A, P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21)


@pytest.mark.parametrize("vertices", [SQUARE, HEXAGON, TRIANGLE, np.array([[1.0], [3.0]])])
def test_weights_blend_to_the_position(vertices: Array) -> None:
    weights = polytope_weights(vertices)
    rng = np.random.default_rng(0)
    for share in rng.dirichlet(np.ones(len(vertices)), 20):
        p = share @ vertices
        w = weights(p)
        assert np.all(w >= 0.0)
        assert w.sum() == pytest.approx(1.0, abs=1e-12)
        assert np.allclose(w @ vertices, p, atol=1e-9)
        assert np.linalg.norm(weights(p + 1e-7 * (vertices.mean(axis=0) - p)) - w) < 1e-4  # continuous
    for k, vertex in enumerate(vertices):
        assert weights(vertex)[k] == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(DomainError, match="is outside the"):
        weights(vertices.mean(axis=0) + 3.0 * np.ptp(vertices, axis=0))


def test_the_blend_keeps_the_level_of_the_vertices() -> None:
    result = lpvsyn([stiff(p) for p in SQUARE], SQUARE, method="polytopic")
    assert result.gamma <= result.gamma_achieved <= 1.02 * result.gamma
    assert np.max(result.frozen_norms_between) <= result.gamma_achieved
    family = plant_family([stiff(p) for p in SQUARE], SQUARE)
    P, P_dot = result.loop_lyapunov(SQUARE[0])
    assert np.max(np.abs(P_dot)) == 0.0
    for share in np.random.default_rng(1).dirichlet(np.ones(4), 10):
        p = share @ SQUARE
        K = result.controller.matrices(p)
        loop = blended_plant(family, polytope_weights(SQUARE)(p)).close(*K)
        assert proven_level(*loop, P, P_dot) <= result.gamma_achieved * (1 + 1e-9)
        assert frozen_norm(*stiff(p).close(*K)) <= result.gamma_achieved
    K = result.to_lpv(1)
    assert K.fit_error < 1e-9  # products of linear functions
    R, S = result.lyapunov(SQUARE[1])
    assert np.linalg.eigvalsh(np.block([[R, np.eye(4)], [np.eye(4), S]]))[0] > 0.0


def test_weights_of_another_position() -> None:
    vertices = np.array([[1.0], [4.0]])
    plants = [stiff(np.array([v[0] / 2, 0.0])) for v in vertices]

    def weights(p: Array) -> Array:
        share = (float(p[0]) ** 2 - 1.0) / 3.0
        return np.array([1.0 - share, share])

    result = lpvsyn(plants, vertices, method="polytopic", weights=weights, box=[[1.0, 2.0]])
    K1, K2 = (result.controller.matrices([p]) for p in (1.0, 2.0))
    assert np.allclose(result.controller.matrices([np.sqrt(2.5)])[0], 0.5 * (K1[0] + K2[0]))
    assert result.to_lpv(2).fit_error < 1e-9
    with pytest.raises(DomainError, match="Pass box"):
        lpvsyn(plants, vertices, method="polytopic", weights=weights)
    bad = lpvsyn(plants, vertices, method="polytopic", weights=lambda p: np.ones(2), box=[[1.0, 2.0]])
    with pytest.raises(DomainError, match="of sum 1"):
        bad.controller.at([1.5])


def test_moving_output_is_arranged_by_lags() -> None:
    points = np.array([[-1.0], [1.0]])
    plants = [moving_mode(p) for p in points]
    with pytest.raises(AssumptionError, match=r"C2 at the vertex \[1.0\] differs .*wants constant B2, C2, D12, D21"):
        lpvsyn(plants, points, method="polytopic")
    lagged = with_constant_channels(plants, 500.0)
    assert lagged[0].n_x == 5
    s = 2.0j
    for P, Q in zip(plants, lagged, strict=True):
        slow, fast = (X.C2 @ np.linalg.solve(s * np.eye(X.n_x) - X.A, X.B2) + X.D22 for X in (P, Q))
        assert np.allclose(fast, slow / (1 + s / 500.0))
    result = lpvsyn(lagged, points, method="polytopic")
    assert result.gamma_achieved <= 1.02 * result.gamma
    # the lags change little: the controller serves the plants without them
    for p, P in zip(points, plants, strict=True):
        assert frozen_norm(*P.close(*result.controller.matrices(p))) <= 1.05 * result.gamma_achieved


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        (np.vstack([SQUARE, [[1.0, 0.0]]]), r"points\[4\] = \[1.0, 0.0\] is no vertex"),
        (np.array([[0.0, 0.0], [1.0, 1.0], [0.5, 0.5]]), "no polytope in 2 dimensions"),
        (np.array([[0.0, 1.0], [2.0, 1.0]]), "no polytope in 2 dimensions: they span 1"),
    ],
)
def test_vertices_of_no_polytope(vertices: Array, message: str) -> None:
    with pytest.raises(AssumptionError, match=message):
        lpvsyn([stiff(p) for p in vertices], vertices, method="polytopic")


def test_options_of_the_other_method() -> None:
    plants = [stiff(p) for p in SQUARE]
    with pytest.raises(DomainError, match="method is 'grid'"):
        lpvsyn(plants, SQUARE, method="grid")
    with pytest.raises(DomainError, match="constant R and S"):
        lpvsyn(plants, SQUARE, method="polytopic", constant="S")
    with pytest.raises(DomainError, match="belong to method 'polytopic'"):
        lpvsyn(plants, SQUARE, weights=polytope_weights(SQUARE))
