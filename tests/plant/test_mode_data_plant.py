"""A user's plant against the same plant from equations of motion, and against a finite-element solid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg
from numpy.polynomial import legendre

from lpvhinf.checks import Array
from lpvhinf.codesign import Specification
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.positions import norms_at
from lpvhinf.decoupling import decouple
from lpvhinf.errors import AssumptionError, DimensionError, DomainError, LpvHinfError
from lpvhinf.plant import Actuator, MechanicalModel, ModalModel, ModeData, RigidBody, Sensor, modal_form, own_plant
from lpvhinf.plant.mmpa import RitzPlate

SIDE, BOX = 0.3, np.array([[-0.04, 0.05], [-0.03, 0.04]])
N_FLEX = 5
PLATE = RitzPlate(
    side=SIDE,
    stiffness=3000.0,
    poisson=0.33,
    area_density=30.0,
    degree=8,
    masses=[0.5, 0.3],
    places=[[0.12, 0.03], [-0.05, 0.14]],
)
LOWER, UPPER = -0.02, 0.012  # heights of horizontal actuators and of horizontal beams [m]
ACTUATORS = (
    *(Actuator(place=[a * 0.10, b * 0.10], fixed_to="frame", gain=12.0) for a in (-1, 1) for b in (-1, 1)),
    Actuator(place=[0.02, 0.01], fixed_to="mover", gain=9.0),
    Actuator(place=[0.13, 0.02, LOWER], fixed_to="mover", direction="x", gain=7.0),
    Actuator(place=[-0.02, 0.12, LOWER], fixed_to="mover", direction="y", gain=7.0),
    Actuator(place=[0.02, -0.12, LOWER], fixed_to="mover", direction=[0.0, -2.0, 0.0], gain=7.0),
)
SENSORS = (
    *(Sensor(place=[a * 0.09, b * 0.10], fixed_to="frame") for a in (-1, 1) for b in (-1, 1)),
    *(Sensor(place=[SIDE / 2, y, UPPER], fixed_to="frame", direction="x") for y in (0.1, -0.1)),
    Sensor(place=[0.03, SIDE / 2, UPPER], fixed_to="frame", direction="y", gain=2.0),
)


@dataclass(frozen=True)
class Reference:
    """The plate with q = (x, y, rz about the centre of gravity, Ritz coefficients), rows of the maps by hand."""

    body: RigidBody
    mechanical: MechanicalModel
    modal: ModalModel


def in_plane(at: Array, axis: int, height: float, centre: Array) -> Array:
    """Rows (..., 3 + n_ritz) of the displacement along x (0) or y (1) at the height above the plate."""
    arm = -(at[..., 1] - centre[1]) if axis == 0 else at[..., 0] - centre[0]
    zero, one = np.zeros_like(arm), np.ones_like(arm)
    rigid = np.stack([one, zero, arm] if axis == 0 else [zero, one, arm], axis=-1)
    tilt = PLATE.rows(at, (1, 0) if axis == 0 else (0, 1))
    return np.concatenate([rigid, -height * tilt], axis=-1)


def vertical(at: Array) -> Array:
    rows = PLATE.rows(at)
    return np.concatenate([np.zeros((*rows.shape[:-1], 3)), rows], axis=-1)


@pytest.fixture(scope="module")
def reference() -> Reference:
    one, x, y = PLATE.function(1, 0, 0), PLATE.function(0, 1, 0), PLATE.function(0, 0, 1)
    mass = float(one @ PLATE.M @ one)
    centre = np.array([one @ PLATE.M @ x, one @ PLATE.M @ y]) / mass
    rx, ry = y - centre[1] * one, -(x - centre[0] * one)
    tilt = np.array([[a @ PLATE.M @ b for b in (rx, ry)] for a in (rx, ry)])
    inertia = scipy.linalg.block_diag(tilt, np.trace(tilt))
    E = np.zeros((3 + PLATE.n_ritz, 6))
    E[0, 0] = E[1, 1] = E[2, 5] = 1.0
    E[3:, 2], E[3:, 3], E[3:, 4] = one, rx, ry
    M = scipy.linalg.block_diag(mass, mass, inertia[2, 2], PLATE.M)
    K = scipy.linalg.block_diag(np.zeros((3, 3)), PLATE.K)
    values, V = scipy.linalg.eigh(PLATE.K, PLATE.M)
    values[:3] = 0.0
    D = PLATE.M @ V @ np.diag(0.01 * 2.0 * np.sqrt(np.maximum(values, 0.0))) @ V.T @ PLATE.M

    def inputs(p: Array) -> Array:
        frame = np.array([[a * 0.10, b * 0.10] for a in (-1, 1) for b in (-1, 1)])
        rows = [12.0 * vertical(frame - p[:, None])]
        fixed = [
            9.0 * vertical(np.array([0.02, 0.01])),
            7.0 * in_plane(np.array([0.13, 0.02]), 0, LOWER, centre),
            7.0 * in_plane(np.array([-0.02, 0.12]), 1, LOWER, centre),
            -7.0 * in_plane(np.array([0.02, -0.12]), 1, LOWER, centre),
        ]
        rows.append(np.broadcast_to(np.stack(fixed), (len(p), 4, 3 + PLATE.n_ritz)))
        return np.swapaxes(np.concatenate(rows, axis=1), 1, 2)

    def outputs(p: Array) -> Array:
        frame = np.array([[a * 0.09, b * 0.10] for a in (-1, 1) for b in (-1, 1)])
        edge = np.full(len(p), SIDE / 2)
        mirror = [in_plane(np.column_stack([edge, y - p[:, 1]]), 0, UPPER, centre) for y in (0.1, -0.1)]
        mirror.append(2.0 * in_plane(np.column_stack([0.03 - p[:, 0], edge]), 1, UPPER, centre))
        return np.concatenate([vertical(frame - p[:, None]), np.stack(mirror, axis=1)], axis=1)

    mechanical = MechanicalModel(
        M=M,
        D=scipy.linalg.block_diag(np.zeros((3, 3)), 0.5 * (D + D.T)),
        K=K,
        input_map=inputs,
        output_map=outputs,
        box=BOX,
    )
    return Reference(
        body=RigidBody(mass=mass, centre_of_gravity=centre, inertia=inertia),
        mechanical=mechanical,
        modal=modal_form(mechanical, n_modes=6 + N_FLEX, rigid_body_modes=E, compliance=False),
    )


def as_nodes(reference: Reference) -> ModeData:
    nodes = np.stack(np.meshgrid(*[np.linspace(-SIDE / 2, SIDE / 2, 13)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    assert reference.modal.V is not None
    return ModeData(
        frequency_hz=reference.modal.omega[6:] / (2 * np.pi),
        damping=reference.modal.zeta[6:],
        body=reference.body,
        points=nodes,
        shapes=PLATE.rows(nodes) @ reference.modal.V[3:, 6:],
    )


def as_polynomials(reference: Reference) -> ModeData:
    """The Ritz coefficients as powers of x and y, with modal masses of 4 kg."""
    assert reference.modal.V is not None
    n = PLATE.degree + 1
    T = np.zeros((n, n))
    for i in range(n):
        T[: i + 1, i] = legendre.leg2poly(np.eye(n)[i, : i + 1]) / (SIDE / 2) ** np.arange(i + 1)
    c = np.einsum("ai,bj,ijk->abk", T, T, reference.modal.V[3:, 6:].reshape(n, n, N_FLEX))
    return ModeData(
        frequency_hz=reference.modal.omega[6:] / (2 * np.pi),
        damping=reference.modal.zeta[6:],
        body=reference.body,
        polynomials=2.0 * c,
        area=[[-SIDE / 2, SIDE / 2]] * 2,
        modal_mass=np.full(N_FLEX, 4.0),
    )


def positions(n: int) -> Array:
    unit = np.random.default_rng(0).random((n, 2))
    return np.asarray(BOX[:, 0] + unit * np.ptp(BOX, axis=1))


AXES = ("x", "y", "z", "rx", "ry", "rz")
HALL: dict[str, Any] = {"actuators": ACTUATORS, "sensors": SENSORS, "box": BOX, "axes": AXES}


@pytest.mark.parametrize(("make", "tolerance"), [(as_polynomials, 1e-9), (as_nodes, 1e-5)])
def test_gains_are_those_of_the_equations_of_motion(reference: Reference, make: Any, tolerance: float) -> None:
    plant = own_plant(make(reference), **HALL, **({"degree": 8} if make is as_nodes else {}))
    p = positions(40)
    assert np.allclose(plant.modal.omega, reference.modal.omega, rtol=1e-12)
    assert np.allclose(plant.modal.zeta, reference.modal.zeta, rtol=1e-12)
    assert np.allclose(plant.modal.rigid_body_scaling, reference.modal.rigid_body_scaling, rtol=1e-12)
    for name in ("input_gains", "output_gains"):
        found, wanted = getattr(plant.modal, name)(p), getattr(reference.modal, name)(p)
        assert np.max(np.abs(found - wanted)) < tolerance * np.max(np.abs(wanted))


def test_modes_without_dynamics_keep_their_compliance(reference: Reference) -> None:
    whole = own_plant(as_polynomials(reference), **HALL)
    cut = own_plant(as_polynomials(reference), **HALL, n_flex=2)
    assert (cut.modal.n_flex, cut.fit.shapes.n_modes) == (2, 5)
    p = positions(6)
    gains = whole.modal.gains(p)
    tail = gains.output_gains[:, :, 8:] / whole.modal.omega[8:] ** 2 @ gains.input_gains[:, 8:]
    assert np.allclose(cut.modal.compliance(p), tail, rtol=1e-12, atol=1e-12 * np.max(np.abs(tail)))
    assert not np.any(whole.modal.compliance(p))
    one, other = (plant.modal.local_model(p[0])(30.0j) for plant in (whole, cut))  # far below the modes that were cut
    assert np.max(np.abs(one - other)) < 1e-3 * np.max(np.abs(tail[0]))
    assert "(compliance only)" in cut.report()


def test_decoupling_and_design_take_it_unchanged(reference: Reference) -> None:
    """The same decoupled plant, and the same norms of the weighted loop at the same parameters."""
    p = positions(2)
    specification = Specification(f_bw=40.0)
    norms = []
    for plant in (reference.modal, own_plant(as_polynomials(reference), **HALL)):
        decoupled = decouple(plant, n_flex=1, degree=6)
        assert decoupled.verify(p).rigid_body < 1e-10
        per_architecture = []
        for architecture in ("rigid-body", "output-observer"):
            assembly = Assembly(plant=decoupled, specification=specification, architecture=architecture)
            theta = assembly.start(p)
            per_architecture.append(norms_at(assembly, theta, p))
        norms.append(per_architecture)
    assert np.all(np.isfinite(norms))
    assert np.allclose(norms[0], norms[1], rtol=1e-6)
    assert np.ptp(norms[0]) > 0.0


def test_nodes_instead_of_the_plate_change_the_norms_by_the_error_of_the_fit(reference: Reference) -> None:
    p = positions(2)
    plant = own_plant(as_nodes(reference), **HALL)
    found, wanted = (
        norms_at(assembly, assembly.start(p), p)
        for assembly in (
            Assembly(plant=decouple(one, n_flex=1), specification=Specification(f_bw=40.0), architecture="rigid-body")
            for one in (plant, reference.modal)
        )
    )
    assert np.max(plant.fit.left_out) < 1e-3
    assert np.allclose(found, wanted, rtol=20.0 * np.max(plant.fit.left_out))


def test_stations_move_as_frame_and_mover_do() -> None:
    p = np.array([[0.01, -0.02]])
    E = np.eye(3)[:, :2]
    for station, met in (
        (Sensor(place=[0.1, 0.0], fixed_to="mover"), [0.0, 0.0, 0.0]),
        (Sensor(place=[0.1, 0.0], fixed_to="frame"), [-0.01, 0.02, 0.0]),
        (Sensor(place=[0.1, 0.0], fixed_to="frame", direction="x"), [0.0, 0.02, 0.0]),
        (Sensor(place=[0.1, 0.0], fixed_to="frame", direction=[1.0, 0.0, 1.0]), [-0.005, 0.02, 0.005]),
        (Actuator(place=[0.1, 0.0], fixed_to="frame", direction="x"), [-0.01, 0.02, 0.0]),
    ):
        assert np.allclose(station.travel() @ E @ p[0], met)
    # an oblique beam stays on its line in space and on its mirror on the mover
    beam = Sensor(place=[0.1, 0.0, 0.0], fixed_to="frame", direction=[1.0, 0.0, 1.0])
    point = np.asarray(beam.place) + beam.travel() @ E @ p[0]
    line = point + E @ p[0] - beam.place
    assert np.allclose(np.cross(line, beam.direction), 0.0)
    assert (point - beam.place) @ beam.direction == pytest.approx(0.0)


def test_position_axes_name_what_p_is(reference: Reference) -> None:
    data = as_polynomials(reference)
    both = own_plant(data, **HALL).modal
    along_y = own_plant(data, **(HALL | {"box": BOX[1:]}), position_axes=("y",)).modal
    at = np.array([[-0.02], [0.03]])
    assert np.allclose(along_y.output_gains(at), both.output_gains(np.hstack([np.zeros((2, 1)), at])))
    along_x = own_plant(data, **(HALL | {"box": BOX[:1]})).modal
    assert np.allclose(along_x.input_gains(at), both.input_gains(np.hstack([at, np.zeros((2, 1))])))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        (
            {"sensors": [*SENSORS, Sensor(place=[0.12, 0.0], fixed_to="frame")]},
            DomainError,
            r"sensors\[7\] at \[0.12, 0.0\] m, fixed to the frame, meets the mover point \[0.16, .* at p = \[-0.04, .*"
            "outside the mover: x -0.15 to 0.15.*make the box smaller",
        ),
        (
            {"actuators": [*ACTUATORS, Actuator(place=[0.12, 0.2], fixed_to="mover")]},
            DomainError,
            r"actuators\[8\] at \[0.12, 0.2\] m, fixed to the mover, lies outside the mover",
        ),
        (
            {"sensors": [*SENSORS, Sensor(place=[150.0, 80.0, 12.0], fixed_to="mover")]},
            DomainError,
            "outside the mover",
        ),
        ({"box": [[-0.3, 0.3], [-0.1, 0.1]]}, DomainError, r"actuators\[2\] .* outside the mover"),
        ({"axes": ("z", "rx", "ry")}, AssumptionError, r"actuators\[5\] has the direction .* x is not among the axes"),
        ({"axes": ("z", "tilt")}, DomainError, "axes is"),
        ({"actuators": []}, DimensionError, "actuators is empty"),
        ({"actuators": SENSORS}, DomainError, "actuators has a Sensor, wanted objects of the type Actuator"),
        ({"position_axes": ("x",)}, DimensionError, "position_axes is .*box has 2 rows"),
        ({"position_axes": ("x", "rz")}, DimensionError, "position_axes is"),
        ({"n_flex": 6}, DomainError, "n_flex is 6, wanted at most 5"),
        ({"n_flex": 1.5}, DomainError, "n_flex is 1.5"),
        ({"degree": 4}, DomainError, "polynomials already"),
        (
            {"sensors": [Sensor(place=[0.0, 0.0], fixed_to="mover", name="a")] * 2},
            DimensionError,
            "names of the sensors has 1 distinct labels, wanted 2",
        ),
    ],
)
def test_plants_that_cannot_be_are_named(
    reference: Reference, changes: dict[str, Any], error: type[LpvHinfError], words: str
) -> None:
    with pytest.raises(error, match=words):
        own_plant(as_polynomials(reference), **(HALL | changes))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"place": [0.0]}, DimensionError, "place has shape"),
        ({"place": [0.0, np.nan]}, DomainError, r"place\[1\] is nan"),
        ({"fixed_to": "stator"}, DomainError, "fixed_to is 'stator', wanted 'mover'"),
        ({"direction": "up"}, DomainError, "direction is 'up'"),
        ({"direction": [0.0, 0.0, 0.0]}, DomainError, "wanted a vector"),
        ({"direction": [0.0, 1.0]}, DimensionError, "direction has shape"),
        ({"gain": 0.0}, DomainError, "gain is 0.0"),
        ({"gain": np.inf}, DomainError, "gain is inf"),
    ],
)
def test_stations_that_cannot_be_are_named(changes: dict[str, Any], error: type[LpvHinfError], words: str) -> None:
    for kind in (Actuator, Sensor):
        with pytest.raises(error, match=words):
            kind(**({"place": [0.0, 0.0], "fixed_to": "mover"} | changes))


def test_a_solid_of_finite_elements() -> None:
    """A block with u, v, w at its nodes: six rigid-body modes and lumped masses agree, gains are those of the mesh."""
    skfem = pytest.importorskip("skfem")
    from skfem.helpers import ddot, dot, sym_grad, trace

    sides, rho = (0.20, 0.16, 0.04), 2700.0
    mesh = skfem.MeshHex.init_tensor(*(np.linspace(0.0, side, n + 1) for side, n in zip(sides, (6, 5, 1))))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex2()), intorder=4)
    mu, lam = 26.3e9, 51.1e9

    @skfem.BilinearForm
    def stiffness(u: Any, v: Any, _: Any) -> Any:
        strain, virtual = sym_grad(u), sym_grad(v)
        return lam * trace(strain) * trace(virtual) + 2.0 * mu * ddot(strain, virtual)

    @skfem.BilinearForm
    def inertia(u: Any, v: Any, _: Any) -> Any:
        return rho * dot(u, v)

    K, M = stiffness.assemble(basis).tocsc(), inertia.assemble(basis).tocsc()
    values, V = scipy.sparse.linalg.eigsh(K, k=9, M=M, sigma=-1e6, v0=np.ones(K.shape[0]))
    frequency = np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)
    assert np.all(frequency[:6] < 1.0)
    scalar = basis.with_element(skfem.ElementHex2())
    nodes = scalar.doflocs.T
    probes = basis.probes(nodes.T)
    shapes = (probes @ V).reshape(3, len(nodes), 9).transpose(1, 0, 2)
    mass = rho * float(np.prod(sides))
    squares = np.array(sides) ** 2
    body = RigidBody(mass=mass, centre_of_gravity=np.array(sides) / 2, inertia=mass / 12.0 * (squares.sum() - squares))
    lumped = inertia_of_nodes(scalar, rho)
    data = ModeData(frequency_hz=frequency, damping=0.005, body=body, points=nodes, shapes=shapes, node_mass=lumped)
    assert (data.n_zero, data.n_flex) == (6, 3)
    inner = np.array([[0.03, 0.05, 0.01], [0.11, 0.13, 0.04], [0.19, 0.02, 0.0]])
    directions = ("x", "y", "z")
    plant = own_plant(
        data,
        actuators=[Actuator(place=at, fixed_to="mover", direction=d) for at in inner for d in directions],
        sensors=[Sensor(place=at, fixed_to="frame", direction="z") for at in ([0.05, 0.05, 0.04], [0.15, 0.1, 0.04])],
        box=[[-0.03, 0.04]],
    )
    assert plant.axes == AXES
    assert plant.fit.shapes.degree[2] == 2
    # (components, points) of the mesh's own interpolation
    wanted = (basis.probes(inner.T) @ V[:, 6:]).reshape(3, 3, 3).transpose(1, 0, 2).reshape(9, 3)
    gains = plant.modal.input_gains([0.0])[0]
    assert np.allclose(gains[6:].T, wanted, atol=0.01 * np.max(np.abs(wanted)))
    rigid = (basis.probes(inner.T) @ V[:, :6]).reshape(3, 3, 6).transpose(1, 0, 2).reshape(9, 6)
    assert np.allclose(gains[:6].T @ gains[:6], rigid @ rigid.T, rtol=1e-6, atol=1e-6)  # the same mobility
    p = 0.037
    seen = (basis.probes(np.array([[0.05 - p, 0.15 - p], [0.05, 0.1], [0.04, 0.04]])) @ V[:, 6:]).reshape(3, 2, 3)[2]
    assert np.allclose(plant.modal.output_gains([p])[0, :, 6:], seen, atol=0.01 * np.max(np.abs(seen)))


def inertia_of_nodes(scalar: Any, rho: float) -> Array:
    """Row sums of the mass matrix, positive for these elements."""
    import skfem

    @skfem.BilinearForm
    def density(u: Any, v: Any, _: Any) -> Any:
        return rho * u * v

    lumped = np.asarray(density.assemble(scalar).sum(axis=1)).ravel()
    assert np.all(lumped > 0.0)
    return lumped
