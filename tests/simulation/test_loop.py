"""Guards the simulation along p(t): against an LTI loop, an integrator of differential equations, and energy."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from scipy.integrate import solve_ivp

from lpvhinf.checks import Array
from lpvhinf.codesign import Specification
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.design import Design
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct import Evaluations
from lpvhinf.plant import ModalModel
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.simulation import Actuators, ModalPlant, MotionLimits, Trajectory, hold, point_to_point, simulate
from lpvhinf.simulation.controller_steps import ControllerSteps, FewFunctions
from lpvhinf.statespace.lpv import LPVStateSpace

T = 1e-4
LIMITS = MotionLimits(velocity=[0.5, 0.1], acceleration=[8.0, 1.0], jerk=2e3, snap=1e6)
SCAN = point_to_point([-0.09, 0.0], [0.09, 1e-4], LIMITS, period=T)
TILT = point_to_point([0.03, 0.0], [0.03, 1e-3], LIMITS, period=T)  # p rests


def controller_of(plant: DecoupledPlant, architecture: str, schedule: dict[str, int] | None = None) -> LPVStateSpace:
    """By rule of thumb."""
    specification = Specification(f_bw=[5.0, 6.0], expected_error=[2e-6, 5e-5], schedule=schedule or {})
    assembly = Assembly(plant=plant, specification=specification, architecture=architecture)
    centre = np.mean(plant.box, axis=1)
    return Design(
        assembly=assembly, parameters=assembly.start(np.vstack([centre, plant.box.T])), positions=centre[None],
        gammas=np.ones(1), gamma_worst=1.0, worst_position=centre, optimality=np.nan, status="given", seconds=0.0,
        evaluations=Evaluations(trials=0, exact=0, every_model=0),
    ).controller  # fmt: skip


@pytest.fixture(scope="module")
def conventional(small_modal: ModalModel) -> DecoupledPlant:
    """Its rigid-body inputs drive every mode."""
    return decouple(small_modal, n_flex=1, input_decoupling="rigid-body", degree=12)


@pytest.fixture(scope="module")
def observer(small_plant: DecoupledPlant) -> LPVStateSpace:
    return controller_of(small_plant, "output-observer")


@pytest.fixture(scope="module")
def rigid(small_plant: DecoupledPlant) -> LPVStateSpace:
    return controller_of(small_plant, "rigid-body")


def silent(plant: DecoupledPlant, sign: float = 0.0) -> LPVStateSpace:
    """No feedback, or a static one."""
    D = np.zeros((plant.n_rb, plant.n_rb + plant.n_out))
    D[:, : plant.n_rb] = sign * np.eye(plant.n_rb)
    n = plant.n_rb
    return LPVStateSpace.from_coefficients(
        np.zeros((0, 0)), np.zeros((0, n + plant.n_out)), np.zeros((n, 0)), D, box=plant.box
    )


def lti_loop(plant: Any, controller: Any, trajectory: Trajectory, delay: float, w: Array) -> tuple[Array, Array]:
    """Error and inputs of a frozen loop by matrix exponentials and SciPy's bilinear rule; 1 < delay / T <= 2."""
    A, B, C, D = plant
    n_c = controller.n_y
    B, D = B[:, :n_c], D[:, :n_c]
    n, n_rb = len(A), trajectory.n_axes
    late = 2 * T - delay
    force = np.zeros((n, w.shape[1]))
    force[1 : 2 * w.shape[1] : 2] = np.eye(w.shape[1])

    def held(inputs: Array, t: float) -> tuple[Array, Array]:
        m = inputs.shape[1]
        both = scipy.linalg.expm(t * np.block([[A, inputs], [np.zeros((m, n + m))]]))
        return both[:n, :n], both[:n, n:]

    _, early_B = held(B, T - late)
    late_A, late_B = held(B, late)
    whole_A, w_B = held(force, T)
    position = np.mean(controller.box, axis=1)
    K = scipy.signal.cont2discrete(tuple(m[0] for m in controller.sample(position[None])), T, method="bilinear")
    times = trajectory.times(T)
    r = trajectory.position(times)
    ahead = (trajectory.velocity(times + T + delay) - trajectory.velocity(times + delay)) / T
    ahead[0] += trajectory.velocity(times[0] + delay) / T
    x, c = np.zeros(n), np.zeros(len(K[0]))
    x[0 : 2 * n_rb : 2] = r[0]
    u1, u2 = np.zeros(n_c), np.zeros(n_c)  # u[k - 1], u[k - 2]
    error, sent = [], []
    for k in range(len(times)):
        y = C @ x + D @ u2
        error.append(r[k] - y[:n_rb])
        v = np.concatenate([error[-1], -error[-1], y[n_rb:]])
        u = K[2] @ c + K[3] @ v
        c = K[0] @ c + K[1] @ v
        u[:n_rb] += ahead[k]
        sent.append(u)
        x = whole_A @ x + late_A @ early_B @ u2 + late_B @ u1 + w_B @ w[k]
        u1, u2 = u, u1
    return np.array(error), np.array(sent)


@pytest.mark.parametrize("delay", [1.5e-4, 2e-4, 1.13e-4])
def test_at_a_frozen_position_it_is_the_lti_loop(
    small_plant: DecoupledPlant, observer: LPVStateSpace, delay: float
) -> None:
    w = np.random.default_rng(1).normal(0.0, 1e-2, (len(TILT.times(T)), 4))
    found = simulate(small_plant, observer, TILT, delay=delay, disturbance=w)
    here = LPVStateSpace.from_system(observer.at([0.03]), small_plant.box)
    plant = [m[0] for m in small_plant.system.sample(np.array([[0.03]]))]
    error, sent = lti_loop(plant, here, TILT, delay, w)
    assert found.status == "completed"
    assert np.max(np.abs(error)) > 1e-7
    assert np.max(np.abs(found.error - error)) < 1e-9 * np.max(np.abs(error))
    assert np.max(np.abs(found.inputs - sent)) < 1e-9 * np.max(np.abs(sent))


def test_a_moving_plant_is_that_of_its_differential_equation(conventional: DecoupledPlant) -> None:
    found = simulate(conventional, silent(conventional), SCAN, substeps=8, error_bound=1.0)
    plant = ModalPlant.of(conventional.system)
    x, delay = found.states[0], 1.5e-4

    def slope(t: float, x: Array, u: Array) -> Array:
        out = np.empty_like(x)
        eta, speed = x[0::2], x[1::2]
        force = plant.B.at(SCAN.position(t)[:1])[:, :2] @ u
        out[0::2], out[1::2] = speed, force - 2 * plant.zeta * plant.omega * speed - plant.omega**2 * eta
        return out

    n = 400
    for k in range(n):
        for begin, end, i in ((0.0, 2 * T - delay, k - 2), (2 * T - delay, T, k - 1)):
            u = found.inputs[i] if i >= 0 else np.zeros(2)
            t = found.times[k]
            x = solve_ivp(slope, (t + begin, t + end), x, "RK45", args=(u,), rtol=1e-10, atol=1e-13).y[:, -1]
    flexible = slice(2 * plant.n_rb, None)
    assert np.max(np.abs(x[flexible])) > 1e-5
    assert np.max(np.abs(found.states[n] - x)[flexible]) < 2e-6 * np.max(np.abs(x[flexible]))


def test_finer_steps_converge_with_second_order(conventional: DecoupledPlant) -> None:
    def end(substeps: int, period: float = 1e-3) -> Array:
        return simulate(
            conventional, silent(conventional), SCAN, period=period, delay=1.5 * period, substeps=substeps,
            error_bound=1.0,
        ).states[:, 4:]  # fmt: skip

    exact = end(64)
    errors = [np.max(np.abs(end(n) - exact)) for n in (2, 4, 8)]
    slopes = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all((slopes > 1.8) & (slopes < 2.3)), slopes


def test_shorter_samples_converge(small_plant: DecoupledPlant, observer: LPVStateSpace) -> None:
    # the delay stays the same, the hold and the trapezoidal rule get finer
    w = np.zeros((10**4, 1))
    w[:] = 0.1

    def end(factor: int) -> Array:
        period = 1e-3 / factor
        move = point_to_point([-0.05, 0.0], [0.05, 0.0], LIMITS, period=1e-3)
        return simulate(small_plant, observer, move, period=period, delay=2e-3, disturbance=w).error[::factor]

    exact = end(32)
    errors = [np.max(np.abs(end(n) - exact)) for n in (1, 2, 4)]
    slopes = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(slopes > 0.8), (errors, slopes)


def test_energy(conventional: DecoupledPlant) -> None:
    plant = dataclasses.replace(ModalPlant.of(conventional.system), zeta=np.zeros(5))
    pushed, n = 200, len(TILT.times(T))
    w = np.random.default_rng(2).normal(0.0, 1.0, (n, 5))
    w[pushed:] = 0.0
    rest = hold([0.0, 0.0], T * (n - 1))
    found = simulate(plant, silent(conventional), rest, disturbance=w, error_bound=1.0)
    energy = plant.energy(found.states)
    moved = np.diff(found.states[:, 0::2], axis=0)
    work = np.cumsum(w[:-1] * moved, axis=0)
    assert np.allclose(energy[1:], work, rtol=1e-9, atol=1e-11 * np.max(energy))
    free = np.sum(energy[pushed:], axis=1)
    assert np.ptp(free) < 1e-11 * np.max(free)


def test_the_extended_decoupling_leaves_the_mode_alone(
    small_plant: DecoupledPlant, conventional: DecoupledPlant, rigid: LPVStateSpace
) -> None:
    # decoupled, the feedforward drives discarded modes only, which move the rest by feedback
    extended, plain = (
        np.max(np.abs(simulate(plant, rigid, SCAN).states[:, 4])) for plant in (small_plant, conventional)
    )
    assert extended < 0.1 * plain


@pytest.mark.parametrize("delay", [0.5e-4, 1e-4, 1.5e-4, 3.2e-4])
def test_a_rigid_body_follows_the_feedforward(small_plant: DecoupledPlant, delay: float) -> None:
    found = simulate(small_plant, silent(small_plant), SCAN, delay=delay)
    lag = found.setpoint - found.states[:, [0, 2]]
    # at rest at the end, and during the move off by what a mean acceleration cannot know
    assert np.max(np.abs(lag[-1])) < 1e6 * (delay + T) ** 4 / 6  # moved before the first input arrives
    assert np.max(np.abs(lag)) < 8.0 * T**2


def test_an_unstable_loop_stops_with_the_time(small_plant: DecoupledPlant) -> None:
    found = simulate(small_plant, silent(small_plant, sign=-1e4), SCAN, error_bound=1e-3)
    assert found.stopped is not None
    assert f"stopped at t = {found.stopped:.6g} s: the error of axis" in found.status
    assert found.stopped == found.times[-1] < SCAN.duration
    assert np.max(np.abs(found.error[:-1])) <= 1e-3 < np.max(np.abs(found.error[-1]))
    assert len(found.states) == len(found.inputs) == len(found.times)
    assert np.all(np.isfinite(found.states))


def actuators(plant: DecoupledPlant, limit: float, **more: Any) -> Actuators:
    return Actuators(matrix=lambda points: plant.matrices(points)[1], limit=limit, **more)


def test_limits_are_kept_and_reported(small_plant: DecoupledPlant, observer: LPVStateSpace) -> None:
    free = simulate(small_plant, observer, SCAN, actuators=actuators(small_plant, 1e9, every=1))
    assert not np.any(free.saturated)
    T_u = small_plant.matrices(free.positions)[1]
    currents = np.einsum("nui,ni->nu", T_u, free.inputs)
    assert np.allclose(np.max(np.abs(currents), axis=1), free.peak_current, rtol=1e-12)
    limit = 0.9 * np.max(free.peak_current)
    found = simulate(small_plant, observer, SCAN, settle=1.0, actuators=actuators(small_plant, limit, every=1))
    currents = np.einsum("nui,ni->nu", small_plant.matrices(found.positions)[1], found.inputs)
    assert np.max(np.abs(currents)) == pytest.approx(limit, rel=1e-9)
    assert np.any(found.saturated)
    assert found.status.startswith(f"completed, with limits reached in {np.count_nonzero(found.saturated)} of")
    assert f"{found.times[np.argmax(found.saturated)]:.6g} s" in found.status
    coarse = simulate(small_plant, observer, SCAN, actuators=actuators(small_plant, 1e9, every=20))
    assert np.allclose(coarse.peak_current, free.peak_current, rtol=1e-2)


def test_integrators_wait_at_a_limit(small_plant: DecoupledPlant, rigid: LPVStateSpace) -> None:
    leaking = LPVStateSpace(rigid.A + -1e-9 * np.eye(rigid.n_x), rigid.B, rigid.C, rigid.D)  # hides what integrates
    limit = 0.8 * np.max(simulate(small_plant, rigid, SCAN, actuators=actuators(small_plant, 1e9)).peak_current)
    waiting, winding = (
        simulate(small_plant, one, SCAN, settle=1.0, actuators=actuators(small_plant, limit)).error
        for one in (rigid, leaking)
    )
    after = len(SCAN.times(T)) + 1000
    assert np.sqrt(np.mean(waiting[after:, 0] ** 2)) < 0.9 * np.sqrt(np.mean(winding[after:, 0] ** 2))


def test_noise_and_rounding(small_plant: DecoupledPlant, rigid: LPVStateSpace) -> None:
    runs = [simulate(small_plant, rigid, TILT, noise=1e-9, seed=seed).error for seed in (0, 0, 1)]
    quiet = simulate(small_plant, rigid, TILT).error
    assert np.array_equal(runs[0], runs[1])
    assert 1e-12 < np.std(runs[0] - quiet) < 1e-8
    assert np.std(runs[0] - runs[2]) > 1e-12
    coarse = simulate(small_plant, rigid, TILT, quantisation=[1e-8, 1e-8, 0.0]).error
    assert 1e-11 < np.max(np.abs(coarse - quiet)) < 1e-7


def test_the_error_at_another_place(small_plant: DecoupledPlant, rigid: LPVStateSpace) -> None:
    found = simulate(small_plant, rigid, SCAN)
    plant = ModalPlant.of(small_plant.system)
    sensors = plant.C.sample(found.positions)[:, :2]
    delayed = np.vstack([np.zeros((2, 2)), found.inputs[:-2]])
    compliance = np.einsum("noi,ni->no", plant.D.sample(found.positions)[:, :2, :2], delayed)
    assert np.allclose(found.error_of(sensors) - compliance, found.error, atol=1e-14)


def test_controller_steps_are_those_of_the_frozen_controller(small_plant: DecoupledPlant) -> None:
    K = controller_of(small_plant, "output-observer", {"L": 2})
    steps = ControllerSteps(K, T)
    points = np.linspace(-0.1, 0.1, 7)[:, None]
    for p, matrix in zip(points, steps.at(points), strict=True):
        n, z = K.n_x, np.exp(0.3j)
        A, B, C, D = matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:]
        a, b, c, d = (m[0] for m in K.sample(p[None]))
        s = 2.0 / T * (z - 1.0) / (z + 1.0)
        wanted = c @ np.linalg.solve(s * np.eye(n) - a, b) + d
        assert np.allclose(C @ np.linalg.solve(z * np.eye(n) - A, B) + D, wanted, rtol=1e-9, atol=1e-9)
    assert steps.integrators.tolist() == [0, 1]


def test_few_functions_of_p_are_as_good_as_all() -> None:
    rng = np.random.default_rng(3)
    coefficients = np.einsum("fij,f...->...ij", rng.normal(size=(3, 6, 5)), rng.normal(size=(3, 7, 5)))
    matrix = ChebyshevMatrix(coefficients, [[-1.0, 1.0], [0.0, 2.0]])
    points = rng.uniform([-1.0, 0.0], [1.0, 2.0], (20, 2))
    few = FewFunctions(matrix)
    assert few._factors is not None
    assert few._factors[1].shape == (3, 30)
    assert np.allclose(few.sample(points), matrix.sample(points), rtol=0.0, atol=1e-12)
    full = ChebyshevMatrix(rng.normal(size=(7, 5, 6, 5)), matrix.box)
    assert np.array_equal(FewFunctions(full).sample(points), full.sample(points))


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"delay": 0.0}, DomainError, "delay is 0.0"),
        ({"period": -1.0}, DomainError, "period is -1.0"),
        ({"settle": -1.0}, DomainError, "settle is -1.0"),
        ({"noise": [1.0, 2.0]}, DimensionError, "noise has shape"),
        ({"quantisation": -1.0}, DomainError, "quantisation is"),
        ({"disturbance": np.zeros((3, 2))}, DimensionError, "disturbance has shape"),
        ({"substeps": 0}, DomainError, "substeps is 0"),
        ({"trajectory": hold([0.0], 0.1)}, DimensionError, "trajectory has 1 axes, wanted 2"),
        (
            {"trajectory": point_to_point([0.0, 0.0], [0.2, 0.0], LIMITS)},
            DomainError,
            "leaves P at t = .*axis 0",
        ),
        ({"plant": 3.0}, DomainError, "plant is a float"),
    ],
)
def test_bad_input(
    small_plant: DecoupledPlant, rigid: LPVStateSpace, change: dict[str, Any], error: type[Exception], message: str
) -> None:
    given: dict[str, Any] = {"plant": small_plant, "controller": rigid, "trajectory": TILT} | change
    with pytest.raises(error, match=message):
        simulate(**given)


def test_systems_that_do_not_fit(small_plant: DecoupledPlant, rigid: LPVStateSpace) -> None:
    with pytest.raises(AssumptionError, match="not grouped in pairs"):
        simulate(rigid, rigid, TILT)
    small = LPVStateSpace.from_system(rigid.at([0.0]), [[-0.01, 0.01]])
    with pytest.raises(DomainError, match="controller has the box"):
        simulate(small_plant, small, TILT)
    with pytest.raises(DimensionError, match="controller has 2 inputs, wanted 5"):
        simulate(
            small_plant,
            LPVStateSpace.from_coefficients([[0.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], box=small.box),
            TILT,
        )
    fast = LPVStateSpace(rigid.A + 2.0 / T * np.eye(rigid.n_x), rigid.B, rigid.C, rigid.D)
    with pytest.raises(AssumptionError, match=r"singular at p = .* pole at 2/T = 2e\+04"):
        simulate(small_plant, fast, TILT)
    with pytest.raises(DomainError, match="the bias alone takes 2"):
        actuators(small_plant, 1.0, bias=lambda p: np.full((len(p), 7), 2.0)).along(np.zeros((3, 1)), 2)
    with pytest.raises(DomainError, match="every is 0"):
        actuators(small_plant, 1.0, every=0)
