"""Guards the exact response to a setpoint: against integration, superposition, and the plant's own state space."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError
from lpvhinf.plant import ModalModel
from lpvhinf.plant.mmpa import MMPA
from lpvhinf.simulation import FourthOrderStep, step_error, step_response
from lpvhinf.simulation.oscillator import oscillator_response

SHORT = FourthOrderStep(distance=1e-3, snap_time=5e-3)
LONG = FourthOrderStep(distance=2e-3, snap_time=2e-3, jerk_time=3e-3, acceleration_time=5e-3, velocity_time=7e-3)


def integrated(slope: Callable[[float, Array], Array], n: int, step: FourthOrderStep, times: Array) -> Array:
    """By Runge-Kutta, piece by piece: (n, n_t)."""
    out, state = np.zeros((n, len(times))), np.zeros(n)
    ends = np.append(step.knots, max(float(times[-1]), step.duration) + 1e-3)
    for begin, end in itertools.pairwise(ends):
        here = (times > begin) & (times <= end)
        found = solve_ivp(slope, (begin, end), state, "DOP853", dense_output=True, rtol=1e-11, atol=1e-16)
        out[:, here] = found.sol(times[here])
        state = found.y[:, -1]
    return out


# The setpoint


@pytest.mark.parametrize("step", [SHORT, LONG])
def test_the_step_arrives_and_its_derivatives_fit_together(step: FourthOrderStep) -> None:
    times = np.linspace(-0.01, step.duration + 0.01, 40001)
    r, v, a = step.position(times), step.velocity(times), step.acceleration(times)
    assert r[0] == v[0] == a[0] == 0.0
    assert (r[-1], v[-1], a[-1]) == (step.distance, 0.0, 0.0)
    h = times[1] - times[0]
    assert np.allclose(np.gradient(r, h), v, atol=1e-6 * np.max(v))
    assert np.allclose(np.gradient(v, h), a, atol=1e-3 * np.max(a))
    assert np.max(np.abs(a)) == pytest.approx(step.peak_acceleration, rel=1e-4)
    assert np.max(np.abs(np.diff(a))) < 2e-3 * step.peak_acceleration  # no jumps


def test_the_snap_is_constant_between_the_knots() -> None:
    assert len(LONG.knots) == 16  # eight pieces with snap, four of jerk, two of acceleration, one of velocity
    snap = LONG.accelerations[:, 2]
    assert np.allclose(np.abs(snap[snap != 0.0]), np.max(snap))
    assert np.count_nonzero(snap) == 8
    assert len(SHORT.knots) == 9
    assert LONG.duration == pytest.approx(8 * 2e-3 + 4 * 3e-3 + 2 * 5e-3 + 7e-3)


def test_known_figures_of_the_shortest_step() -> None:
    """Eight equal pieces T: distance 8 s T^4, largest acceleration s T^2."""
    assert SHORT.peak_acceleration == pytest.approx(1e-3 / (8 * 5e-3**2), rel=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [{"distance": 0.0}, {"snap_time": 0.0}, {"snap_time": np.nan}, {"jerk_time": -1.0}, {"velocity_time": np.inf}],
)
def test_wrong_steps(wrong: dict[str, float]) -> None:
    with pytest.raises(DomainError, match=next(iter(wrong))):
        FourthOrderStep(**{"distance": 1.0, "snap_time": 1e-3, **wrong})


# Oscillators


@pytest.mark.parametrize("step", [SHORT, LONG])
@pytest.mark.parametrize(("hertz", "zeta"), [(5.0, 0.0), (139.4, 0.008), (260.0, 0.6), (1000.0, 0.01)])
def test_oscillators_move_as_integration_says(step: FourthOrderStep, hertz: float, zeta: float) -> None:
    w, times = 2 * np.pi * hertz, np.linspace(0.0, step.duration + 0.02, 301)

    def slope(t: float, x: Array) -> Array:
        return np.array([x[1], float(step.acceleration([t])[0]) - 2 * zeta * w * x[1] - w**2 * x[0]])

    found = oscillator_response([w], [zeta], step, times)[0]
    wanted = integrated(slope, 2, step, times)[0]
    assert np.max(np.abs(found - wanted)) < 1e-6 * np.max(np.abs(wanted))
    assert found[0] == 0.0


def test_energy_of_an_undamped_oscillator_stays_after_the_step() -> None:
    w = 2 * np.pi * 100.0
    times = SHORT.duration + np.linspace(1e-3, 10.0, 5000)
    h = oscillator_response([w], [0.0], SHORT, times)[0]
    first, last = np.max(np.abs(h[:1000])), np.max(np.abs(h[-1000:]))
    assert last == pytest.approx(first, rel=1e-2)


@pytest.mark.parametrize(("omega", "zeta"), [([0.0], [0.0]), ([1.0], [1.0]), ([1.0], [-0.1])])
def test_wrong_oscillators(omega: list[float], zeta: list[float]) -> None:
    with pytest.raises(DomainError, match=r"omega has|zeta is"):
        oscillator_response(omega, zeta, SHORT, [0.0])


# The error of a plant


def by_state_space(plant: DecoupledPlant, p: Array, axis: int, times: Array) -> Array:
    """r - y of the frozen decoupled plant, from its state space by integration, (n_t, n_rb)."""
    (A, B, C, D), n_rb = (m[0] for m in plant.frozen(p)[0].sample(p)), plant.n_rb

    def slope(t: float, x: Array) -> Array:
        return np.asarray(A @ x + B[:, axis] * float(SHORT.acceleration([t])[0]))

    x = integrated(slope, len(A), SHORT, times)
    y = C[:n_rb] @ x + np.outer(D[:n_rb, axis], SHORT.acceleration(times))
    return np.asarray(np.outer(SHORT.position(times), np.eye(n_rb)[axis]) - y.T)


@pytest.mark.parametrize("options", [{}, {"input_decoupling": "rigid-body"}, {"actuation": "full", "mode_weight": 2.0}])
def test_the_error_is_that_of_the_state_space(small_modal: ModalModel, options: dict[str, str]) -> None:
    plant = decouple(small_modal, n_flex=1, degree=0, **options)  # type: ignore[arg-type]
    p, times = np.array([[0.037]]), np.linspace(0.0, 0.06, 61)
    found = step_response(plant, SHORT, p, times)
    assert found.shape == (1, 61, 2, 2)
    for axis in range(2):
        wanted = by_state_space(plant, p, axis, times)
        scale = max(np.max(np.abs(wanted)), 1e-4 * SHORT.distance)
        assert np.max(np.abs(found[0, :, :, axis] - wanted)) < 1e-6 * scale


def test_peaks_are_those_of_the_response(small_modal: ModalModel, small_positions: Array) -> None:
    plant = decouple(small_modal, n_flex=1, input_decoupling="rigid-body", degree=0)
    times = np.linspace(0.0, SHORT.duration + 0.03, 4001)
    found = np.abs(step_response(plant, SHORT, small_positions, times))
    error = step_error(plant, SHORT, small_positions, settle=0.03)
    moving = times <= SHORT.duration
    assert np.allclose(error.during, np.max(found[:, moving], axis=1), rtol=0.02)
    assert np.allclose(error.after, np.max(found[:, ~moving], axis=1), rtol=0.02)
    part = np.abs(step_response(plant, SHORT, small_positions, times, preserved_only=True))
    assert np.allclose(error.preserved_after, np.max(part[:, ~moving], axis=1), rtol=0.02)


def test_the_error_is_linear_in_the_distance(small_plant: DecoupledPlant, small_positions: Array) -> None:
    double = FourthOrderStep(distance=2e-3, snap_time=5e-3)
    one, two = (step_error(small_plant, step, small_positions) for step in (SHORT, double))
    assert np.allclose(two.during, 2.0 * one.during)
    assert np.allclose(two.after, 2.0 * one.after)


def test_extended_decoupling_removes_what_the_preserved_mode_adds(mmpa: MMPA) -> None:
    points = np.array([[0.0, 0.0], [0.043, -0.021], [-0.06, 0.06]])
    plain = decouple(mmpa, n_flex=1, input_decoupling="rigid-body", degree=0)
    for outputs in (None, mmpa.performance_gains):
        with_it, without = (
            step_error(plant, SHORT, points, outputs=outputs) for plant in (decouple(mmpa, n_flex=1, degree=0), plain)
        )
        assert np.max(with_it.preserved_during) < 1e-10 * np.max(without.preserved_during)
        assert np.max(without.preserved_after) > 1e-9 * SHORT.distance
        # the torsion mode is most of what a tilting step leaves
        assert np.max(without.after[:, 3, 3]) > 3.0 * np.max(with_it.after[:, 3, 3])


def test_the_point_of_control_moves_as_the_modes_say(mmpa: MMPA) -> None:
    p, times = np.array([[0.02, -0.03]]), np.linspace(0.0, 0.06, 31)
    plant = decouple(mmpa, n_flex=1, input_decoupling="rigid-body", degree=0)
    found = step_response(plant, SHORT, p, times, outputs=mmpa.performance_gains)[0, :, 2, 2]
    flexible = slice(6, None)
    h = oscillator_response(mmpa.modal.omega[flexible], mmpa.modal.zeta[flexible], SHORT, times)
    force = mode_forces(mmpa, plant, p)
    wanted = -(mmpa.performance_gains(p)[0, 2, flexible] * force) @ h
    assert np.allclose(found, wanted, rtol=0, atol=1e-9 * np.max(np.abs(wanted)) + 1e-15)


def mode_forces(mmpa: MMPA, plant: DecoupledPlant, p: Array) -> Array:
    """Force on every flexible mode per unit of vertical acceleration."""
    currents = plant.matrices(p)[1][0, :, 2]
    return np.asarray(mmpa.modal.input_gains(p)[0, 6:] @ currents)


def test_wrong_arguments(small_plant: DecoupledPlant) -> None:
    with pytest.raises(DomainError, match="settle is 0"):
        step_error(small_plant, SHORT, [[0.0]], settle=0.0)
    with pytest.raises(DomainError, match="outside the box"):
        step_error(small_plant, SHORT, [[1.0]])
