"""Guards the error-based observer: its model of flexible states alone, its Riccati gain, and modes that nobody sees."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.controllers import check_observable, error_observer_model, initial_gain, observer_model
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import AssumptionError
from lpvhinf.fitting import interpolate, spread_points
from lpvhinf.plant import ModalModel
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.shaping import scaling
from lpvhinf.statespace import LPVStateSpace

F_BW = np.array([20.0, 25.0])


def correction_of(plant: DecoupledPlant) -> ChebyshevMatrix:
    return interpolate(plant.static_correction, box=plant.box, degree=plant.degree).matrix


def scaled_model(plant: DecoupledPlant) -> LPVStateSpace:
    units = scaling(plant, F_BW, np.array([1e-6, 1e-5]))
    compliance = units.correction(correction_of(plant))
    return error_observer_model(units.apply(plant.system), plant.n_rb, plant.n_flex, compliance)


@pytest.mark.parametrize("n_flex", [1, 3])
def test_model_is_the_flexible_part_of_the_output_based_one(small_modal: ModalModel, n_flex: int) -> None:
    plant = decouple(small_modal, n_flex=n_flex, degree=12)
    correction = correction_of(plant)
    whole = observer_model(plant.system, 2 + n_flex, correction)
    model = error_observer_model(plant.system, 2, n_flex, correction)
    assert (model.n_x, model.n_u, model.n_y) == (2 * n_flex, n_flex, 3)
    assert model.n_x == whole.n_x - 2 * plant.n_rb
    for p in spread_points(plant.box, 5):
        ours, theirs = model.at(p), whole.at(p)
        assert np.array_equal(ours.A, theirs.A[4:, 4:])
        assert np.array_equal(ours.B, theirs.B[4:, 2:])
        assert not np.any(theirs.B[4:, :2])  # u_RB does not reach the modes: nothing is lost by leaving it out
        assert np.allclose(ours.C, theirs.C[:, 4:], rtol=1e-12)
        assert np.allclose(ours.D, theirs.D[:, 2:], rtol=1e-12)


@pytest.mark.parametrize("n_flex", [1, 2])
def test_initial_gain_is_stable_at_all_positions(small_modal: ModalModel, n_flex: int) -> None:
    plant = decouple(small_modal, n_flex=n_flex, degree=12)
    model, points = scaled_model(plant), spread_points(plant.box, 40)
    omega = plant.omega[2 : 2 + n_flex]
    L, ratio = initial_gain(model, points, omega_bw=np.zeros(0), omega_flex=omega, measurement_noise=np.full(3, 0.01))
    poles = np.linalg.eigvals(model.A.sample(points) - L @ model.C.sample(points)).real
    without = np.max(np.linalg.eigvals(model.A.sample(points)).real)
    assert L.shape == (2 * n_flex, 3)
    assert 0.0 < ratio <= 1.0
    assert np.max(poles) < 0.0
    assert np.mean(np.max(poles, axis=1)) < without  # the correction makes the observer faster than the modes decay


def test_modes_that_are_seen_everywhere_pass(small_plant: DecoupledPlant) -> None:
    check_observable(scaled_model(small_plant), small_plant.omega[2:3])


def seen_with(gains: list[list[float]], omega: Array, box: Array) -> LPVStateSpace:
    """Modes whose displacements are seen with power-series gains of one coordinate, one list a mode and output."""
    n = len(omega)
    A = np.zeros((2 * n, 2 * n))
    for i, w in enumerate(omega):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, w], [-w, -0.01 * w]]
    C = np.zeros((4, len(gains) // n, 2 * n))
    for k, series in enumerate(gains):
        C[: len(series), k // n, 2 * (k % n)] = series
    B, D = np.kron(np.eye(n), [[0.0], [1.0]]), np.zeros((len(gains) // n, n))
    return LPVStateSpace.from_coefficients(A, B, C, D, box=box, basis="power")


BOX = np.array([[-1.0, 1.0]])


@pytest.mark.parametrize("zero", [0.0, 0.31234567, -0.998])
def test_a_gain_that_changes_sign_is_found(zero: float) -> None:
    """The position lies between those that are looked at; it is named to six digits."""
    model = seen_with([[1.0], [-zero, 1.0]], np.array([50.0, 80.0]), BOX)
    with pytest.raises(AssumptionError, match=r"flexible mode 2 \(12\.7 Hz\) is not observable at p = \[") as caught:
        check_observable(model, np.array([50.0, 80.0]))
    named = float(str(caught.value).split("p = [")[1].split("]")[0])
    assert named == pytest.approx(zero, abs=2e-6)


def test_a_second_output_without_that_zero_is_enough() -> None:
    omega = np.array([50.0])
    with pytest.raises(AssumptionError, match="flexible mode 1"):
        check_observable(seen_with([[-0.2, 1.0], [-0.1, 0.5]], omega, BOX), omega)  # both vanish at 0.2
    check_observable(seen_with([[-0.2, 1.0], [0.1, 1.0]], omega, BOX), omega)


def test_two_modes_of_one_frequency_need_two_outputs() -> None:
    omega = np.array([50.0, 50.0])
    with pytest.raises(AssumptionError, match=r"flexible mode 1 .* is not observable"):
        check_observable(seen_with([[1.0], [2.0]], omega, BOX), omega)
    check_observable(seen_with([[1.0], [2.0]], np.array([50.0, 60.0]), BOX), np.array([50.0, 60.0]))
    check_observable(seen_with([[1.0], [2.0], [1.0], [-2.0]], omega, BOX), omega)


def test_a_mode_that_no_sensor_sees() -> None:
    omega = np.array([50.0])
    with pytest.raises(AssumptionError, match=r"flexible mode 1 .* is not observable at p = \[0\.0\]"):
        check_observable(seen_with([[0.0]], omega, BOX), omega)
