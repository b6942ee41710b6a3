"""Modal data: what is accepted, and units and shapes that cannot be right."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError, LpvHinfError
from lpvhinf.plant import ModeData, Plausibility, RigidBody
from lpvhinf.plant.mmpa import RitzPlate

SIDE, N = 0.3, 11
PLATE = RitzPlate(
    side=SIDE,
    stiffness=3000.0,
    poisson=0.33,
    area_density=30.0,
    degree=8,
    masses=[0.5, 0.3],
    places=[[0.12, 0.03], [-0.05, 0.14]],
)
NODES = np.stack(np.meshgrid(*[np.linspace(-SIDE / 2, SIDE / 2, N)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)


def plate_body() -> RigidBody:
    one, x, y = PLATE.function(1, 0, 0), PLATE.function(0, 1, 0), PLATE.function(0, 0, 1)
    mass = one @ PLATE.M @ one
    centre = np.array([one @ PLATE.M @ x, one @ PLATE.M @ y]) / mass
    rx, ry = y - centre[1] * one, -(x - centre[0] * one)
    tilt = np.array([[a @ PLATE.M @ b for b in (rx, ry)] for a in (rx, ry)])
    return RigidBody(mass=float(mass), centre_of_gravity=centre, inertia=scipy.linalg.block_diag(tilt, np.trace(tilt)))


BODY = plate_body()
VALUES, VECTORS = (part[..., :8] for part in scipy.linalg.eigh(PLATE.K, PLATE.M))  # 3 rigid-body and 5 flexible modes
FREQUENCY = np.sqrt(np.maximum(np.where(VALUES < 1.0, 0.0, VALUES), 0.0)) / (2 * np.pi)
SHAPES = PLATE.rows(NODES) @ VECTORS


def node_mass() -> Array:
    """Masses by Simpson's rule, exact enough for the products of modes, and the lumped ones at their nearest nodes."""
    weights = np.ones(N)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    mass = 30.0 * SIDE**2 * np.outer(weights, weights).ravel() / (3.0 * (N - 1)) ** 2
    for m, place in zip(PLATE.masses, PLATE.places, strict=True):
        mass[np.argmin(np.linalg.norm(NODES - place, axis=1))] += m
    return np.asarray(mass)


def given(**changes: Any) -> dict[str, Any]:
    """Arguments of a sound ModeData, with the changes."""
    sound = {
        "frequency_hz": FREQUENCY,
        "damping": 0.01,
        "body": BODY,
        "points": NODES,
        "shapes": SHAPES,
        "node_mass": node_mass(),
    }
    return {name: value for name, value in (sound | changes).items() if value is not None}


def body(**changes: Any) -> RigidBody:
    sound = {"mass": BODY.mass, "centre_of_gravity": BODY.centre_of_gravity, "inertia": BODY.inertia}
    return RigidBody(**(sound | changes))


def scaled(factor: float) -> Array:
    return SHAPES * factor


def changed(array: Array, place: Any, value: float) -> Array:
    out = np.array(array)
    out[place] = value
    return out


def test_sound_data_are_accepted_and_keep_what_was_given() -> None:
    data = ModeData(**given())
    assert (data.n_zero, data.n_flex, data.out_of_plane) == (3, 5, True)
    assert np.allclose(data.omega_flex, np.sqrt(VALUES[3:]))
    assert np.array_equal(data.shapes, SHAPES)  # type: ignore[arg-type]
    assert not data.shapes.flags.writeable  # type: ignore[union-attr]
    assert "121 nodes, 5 flexible modes from" in repr(data)


def test_rigid_body_modes_of_the_export_are_optional() -> None:
    data = ModeData(**given(frequency_hz=FREQUENCY[3:], shapes=SHAPES[:, 3:], node_mass=None))
    assert (data.n_zero, data.n_flex) == (0, 5)
    assert np.allclose(data.smooth().shapes.coefficients, ModeData(**given()).smooth().shapes.coefficients)


def test_modal_masses_undo_another_normalisation() -> None:
    largest = np.max(np.abs(SHAPES), axis=0)
    data = ModeData(**given(shapes=SHAPES / largest, modal_mass=largest**-2.0))
    assert np.allclose(data.smooth().shapes.coefficients, ModeData(**given()).smooth().shapes.coefficients)


def test_a_mixture_of_rigid_body_modes_and_all_six_are_the_same_body() -> None:
    turned = scipy.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    ModeData(**given(shapes=np.hstack([SHAPES[:, :3] @ turned, SHAPES[:, 3:]])))
    spatial_modes = (BODY.motions(np.column_stack([NODES, np.zeros(len(NODES))])) @ BODY.scaling())[:, 2]
    ModeData(**given(frequency_hz=np.append([0.0] * 3, FREQUENCY), shapes=np.hstack([spatial_modes, SHAPES[:, 3:]])))


def test_noise_of_an_eigensolver_at_zero_frequency_does_no_harm() -> None:
    noisy = np.concatenate([[0.02, 0.0, 0.01], FREQUENCY[3:]])
    assert ModeData(**given(frequency_hz=noisy)).n_zero == 3


CASES: list[tuple[dict[str, Any], type[LpvHinfError], str]] = [
    # wrong shapes
    ({"shapes": SHAPES.T}, DimensionError, r"shapes has shape \(8, 121\), wanted \(121, 8\).*Transpose it"),
    ({"shapes": SHAPES[:, :7]}, DimensionError, r"shapes has shape \(121, 7\).*8 frequencies.*column for every"),
    ({"shapes": SHAPES[:-1]}, DimensionError, "shapes has shape"),
    ({"points": NODES[:, :1]}, DimensionError, r"points has shape \(121, 1\)"),
    ({"damping": [0.01] * 5}, DimensionError, r"damping has shape \(5,\), wanted \(8\)"),
    ({"modal_mass": np.ones(5)}, DimensionError, "modal_mass has shape"),
    ({"node_mass": np.ones(120)}, DimensionError, "node_mass has shape"),
    ({"shapes": None}, DomainError, "given by points and node_mass, wanted points and shapes"),
    ({"points": None, "shapes": None, "node_mass": None}, DomainError, "given by nothing"),
    ({"polynomials": np.zeros((3, 3, 8))}, DomainError, "given by points, shapes, polynomials"),
    ({"body": {"mass": 3.0}}, DomainError, "body is a dict, wanted a RigidBody"),
    # numbers
    ({"shapes": changed(SHAPES, (5, 2), np.nan)}, DomainError, r"shapes\[5, 2\] is nan"),
    ({"frequency_hz": changed(FREQUENCY, 4, np.inf)}, DomainError, r"frequency_hz\[4\] is inf"),
    ({"frequency_hz": changed(FREQUENCY, 0, -0.2)}, DomainError, "frequency_hz of mode 1 is -0.2.*set it to 0"),
    ({"frequency_hz": FREQUENCY[[0, 1, 2, 4, 3, 5, 6, 7]]}, DomainError, "falls from .* at mode 5.*Sort the modes"),
    ({"frequency_hz": np.zeros(8)}, DomainError, "wanted at least one flexible mode"),
    ({"damping": -0.01}, DomainError, r"damping of mode 1 .* is -0.01, wanted at least 0"),
    ({"damping": 0.8}, DomainError, r"damping of mode 1 .* is 0.8.*In percent\? Divide by 100"),
    ({"damping": 1.5}, DomainError, "damping .* is 1.5.*In percent"),
    ({"modal_mass": np.zeros(8)}, DomainError, "modal_mass has the entry 0, wanted entries above 0 kg"),
    ({"node_mass": -node_mass()}, DomainError, "node_mass has the entry"),
    # units that cannot be right
    ({"points": 1e3 * NODES}, DomainError, "points span 300 m.*In mm"),
    ({"points": 1e-3 * NODES}, DomainError, "points span 0.0003 m"),
    ({"body": body(centre_of_gravity=[11.0, 3.0])}, DomainError, r"centre_of_gravity is \[11.0, 3.0, 0.0\] m, outside"),
    ({"body": body(inertia=1e6 * BODY.inertia)}, DomainError, "radius of gyration of .*1 kg mm2 is 1e-6 kg m2"),
    ({"body": body(mass=1e3 * BODY.mass)}, DomainError, "radius of gyration"),
    ({"shapes": scaled(1000**0.5)}, AssumptionError, "belong to a body of 0.0035 kg .*but mass is 3.5 kg"),
    (
        {"shapes": scaled(1000**0.5)[:, 3:], "frequency_hz": FREQUENCY[3:], "node_mass": None},
        AssumptionError,
        r"mode 1 \(214.* Hz\) have rms\(\|phi\|\) sqrt\(mass\) = 3.*in tonnes gives 31.6",
    ),
    (
        {"shapes": scaled(1000**-0.5)[:, 3:], "frequency_hz": FREQUENCY[3:], "node_mass": None},
        AssumptionError,
        "wanted 0.2 to 5",
    ),
    (
        {"shapes": SHAPES / np.max(np.abs(SHAPES), axis=0)},
        AssumptionError,
        "largest entry 1 in every flexible mode.*Give modal_mass",
    ),
    ({"shapes": SHAPES / np.linalg.norm(SHAPES, axis=0)}, AssumptionError, "sum of squares 1 in every"),
    # a rigid body that disagrees with the mode shapes
    ({"body": body(mass=1.4 * BODY.mass)}, AssumptionError, "belong to a body of 3.5 kg .along z., but mass is 4.9 kg"),
    (
        {"body": body(centre_of_gravity=BODY.centre_of_gravity + [0.02, 0.0, 0.0])},
        AssumptionError,
        r"another centre of gravity: it lies 0.02 m from",
    ),
    ({"body": body(inertia=1.3 * BODY.inertia)}, AssumptionError, "body with Ixx, Iyy = .*but inertia has"),
    (
        {"shapes": np.hstack([SHAPES[:, :2], SHAPES[:, 3:4], SHAPES[:, 3:]])},
        AssumptionError,
        r"shapes of mode 3 \(0 Hz\) deform the body: 1 of the shape",
    ),
    ({"shapes": SHAPES[:, [0, 1, 1, 3, 4, 5, 6, 7]]}, AssumptionError, "span fewer than 3 rigid-body motions"),
    ({"shapes": SHAPES[:, 1:], "frequency_hz": FREQUENCY[1:]}, AssumptionError, r"2 modes lie below .* all 3 .*or 6"),
    # node masses
    ({"node_mass": 1e3 * node_mass()}, AssumptionError, "node_mass adds up to 3500 kg, but mass is 3.5 kg"),
    ({"node_mass": np.full(121, BODY.mass / 121)}, AssumptionError, "node_mass has its centre at"),
    (
        {"shapes": np.hstack([SHAPES[:, :3], 1.2 * SHAPES[:, 3:]])},
        AssumptionError,
        r"node_mass gives mode \d .* the modal mass 1.[345]\d+, wanted 1 within 0.15",
    ),
    (
        {"shapes": np.hstack([SHAPES[:, :3], 0.95 * SHAPES[:, 3:] + 0.3 * SHAPES[:, [0]]])},
        AssumptionError,
        "move the body along .*is 0.[23]\\d*, wanted 0 within",
    ),
]


@pytest.mark.parametrize(("changes", "error", "words"), CASES, ids=[words[:40] for *_, words in CASES])
def test_data_that_cannot_be_right_are_named(changes: dict[str, Any], error: type[LpvHinfError], words: str) -> None:
    with pytest.raises(error, match=words):
        ModeData(**given(**changes))


def test_limits_can_be_widened_where_the_data_are_right() -> None:
    with pytest.raises(AssumptionError):
        ModeData(**given(body=body(mass=1.12 * BODY.mass)))
    ModeData(**given(body=body(mass=1.12 * BODY.mass), limits=Plausibility(agreement=0.15)))
    ModeData(**given(damping=0.4, limits=Plausibility(damping=0.5)))
    with pytest.raises(DomainError, match="damping is 0"):
        Plausibility(damping=0)
    with pytest.raises(DomainError, match="side is"):
        Plausibility(side=(1.0, 0.1))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"mass": 0.0}, DomainError, "mass is 0.0, wanted a finite number above 0 kg"),
        ({"mass": np.nan}, DomainError, "mass is nan"),
        ({"centre_of_gravity": [0.0]}, DimensionError, "centre_of_gravity has shape"),
        ({"inertia": [1.0, 1.0]}, DimensionError, "inertia has shape"),
        ({"inertia": np.diag([0.05, 0.05, 0.2])}, AssumptionError, "none above the sum of the other two"),
        ({"inertia": np.diag([0.05, -0.05, 0.08])}, AssumptionError, "principal moment -0.05"),
        ({"inertia": [[0.05, 0.1, 0], [0.1, 0.05, 0], [0, 0, 0.1]]}, AssumptionError, "principal moment -0.05"),
        ({"inertia": [[0.05, 0.01, 0], [0, 0.05, 0], [0, 0, 0.1]]}, AssumptionError, "not symmetric"),
    ],
)
def test_bodies_that_cannot_be_are_named(changes: dict[str, Any], error: type[LpvHinfError], words: str) -> None:
    with pytest.raises(error, match=words):
        body(**changes)


def test_rotations_follow_the_right_hand_and_the_scaling_normalises() -> None:
    axes = ("z", "rx", "ry")
    at = np.array([0.1, 0.2, 0.3])
    assert np.allclose(
        BODY.motions(at, axes)[2], [1.0, 0.2 - BODY.centre_of_gravity[1], BODY.centre_of_gravity[0] - 0.1]
    )
    S = BODY.scaling(axes)
    assert np.allclose(S @ BODY.mass_matrix(axes) @ S, np.eye(3))
    with pytest.raises(DomainError, match="axes is"):
        BODY.mass_matrix(("z", "tilt"))
    with pytest.raises(DomainError, match="axes is"):
        BODY.mass_matrix(("z", "z"))
