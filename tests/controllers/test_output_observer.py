"""Guards the modal observer: its truncated model and the Riccati gain that starts its tuning."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.controllers import initial_gain, observer_model, riccati_gain
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.fitting import interpolate, spread_points
from lpvhinf.plant import ModalModel
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.shaping import scaling
from lpvhinf.statespace import LPVStateSpace

F_BW = np.array([20.0, 25.0])


def scaled_model(plant: DecoupledPlant) -> LPVStateSpace:
    units = scaling(plant, F_BW, np.array([1e-6, 1e-5]))
    correction = interpolate(plant.static_correction, box=plant.box, degree=plant.degree).matrix
    return observer_model(units.apply(plant.system), plant.n_rb + plant.n_flex, units.correction(correction))


def flexible(plant: DecoupledPlant) -> Array:
    return np.asarray(plant.omega[plant.n_rb : plant.n_rb + plant.n_flex])


@pytest.mark.parametrize("n_flex", [1, 2])
def test_model_is_the_truncated_plant(small_modal: ModalModel, n_flex: int) -> None:
    plant = decouple(small_modal, n_flex=n_flex, degree=12)
    kept = 2 + n_flex
    points = spread_points(plant.box, 6)
    correction = interpolate(plant.static_correction, box=plant.box, degree=12).matrix
    model = observer_model(plant.system, kept, correction)
    assert (model.n_x, model.n_u, model.n_y) == (2 * kept, kept, 3)
    assert model.A.is_constant
    assert model.B.is_constant  # the decoupling takes the position out of the kept modes' inputs
    assert not model.C.is_constant
    assert np.array_equal(model.at(points[0]).B, np.kron(np.eye(kept), [[0.0], [1.0]]))
    # truncation with compliance keeps the static gain next to the rigid axes; without it, it does not
    s = 1e-2j
    for p in points:
        whole, kept_part = plant.system.at(p)(s), model.at(p)(s)
        rigid = np.diag([1.0, 1.0, 0.0, 0.0][: max(3, kept)])[:3, :kept] / s**2
        flexible_gain = whole - rigid
        assert np.allclose(kept_part - rigid, flexible_gain, rtol=0, atol=1e-3 * np.max(np.abs(flexible_gain)))


@pytest.mark.parametrize("p", [[-0.1], [0.0], [0.07]])
def test_gain_solves_the_riccati_equation(small_plant: DecoupledPlant, p: list[float]) -> None:
    model = scaled_model(small_plant)
    Q, R = np.array([1.0, 30.0, 2.0, 20.0, 0.5, 40.0]), np.array([0.01, 0.02, 0.05])
    L = riccati_gain(model, p, Q, R)
    frozen = model.at(p)
    A, C = frozen.A, frozen.C
    assert np.max(np.linalg.eigvals(A - L @ C).real) < 0.0
    # X is the solution of the Lyapunov equation of the closed observer, and L = X C' / R follows from it
    X = lyapunov(A - L @ C, np.diag(Q) + L @ np.diag(R) @ L.T)
    residual = A @ X + X @ A.T - X @ C.T @ np.diag(1.0 / R) @ C @ X + np.diag(Q)
    assert np.max(np.abs(residual)) < 1e-8 * np.max(np.abs(A @ X))
    assert np.allclose(X @ C.T / R, L, rtol=1e-8, atol=1e-8 * np.max(np.abs(L)))
    assert np.min(np.linalg.eigvalsh(X)) > 0.0


def lyapunov(A: Array, Q: Array) -> Array:
    """X of A X + X A' + Q = 0, by the Kronecker product."""
    eye = np.eye(len(A))
    return np.asarray(np.linalg.solve(np.kron(A, eye) + np.kron(eye, A), -Q.ravel())).reshape(A.shape)


@pytest.mark.parametrize("n_flex", [1, 2])
def test_initial_gain_is_stable_at_all_positions(small_modal: ModalModel, n_flex: int) -> None:
    plant = decouple(small_modal, n_flex=n_flex, degree=12)
    model, points = scaled_model(plant), spread_points(plant.box, 40)
    L, ratio = initial_gain(
        model, points, omega_bw=2 * np.pi * F_BW, omega_flex=flexible(plant), measurement_noise=np.full(3, 0.01)
    )
    poles = np.linalg.eigvals(model.A.sample(points) - L @ model.C.sample(points))
    assert L.shape == (model.n_x, 3)
    assert np.max(poles.real) < 0.0
    assert 0.0 < ratio <= 1.0
    rigid = poles[np.abs(poles) < 0.5 * flexible(plant)[0]]
    assert np.max(rigid.real) < -0.1 * 2 * np.pi * F_BW[0]  # none is left at zero


def mode(omega: float, zeta: float, gain: ChebyshevMatrix | float) -> LPVStateSpace:
    """One mode seen with a gain over p in [-1, 1]."""
    box = [[-1.0, 1.0]]
    A = ChebyshevMatrix([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]], box)
    seen = gain if isinstance(gain, ChebyshevMatrix) else ChebyshevMatrix([[gain]], box)
    return LPVStateSpace(A, np.array([[0.0], [1.0]]), seen @ np.array([[1.0, 0.0]]), np.zeros((1, 1)))


def test_an_unobservable_mode_has_no_gain() -> None:
    with pytest.raises(AssumptionError, match=r"no stabilising solution at p = \[0.0\].*not observable there"):
        riccati_gain(mode(0.0, 0.0, 0.0), [0.0], np.ones(2), np.ones(1))
    with pytest.raises(AssumptionError, match="not observable there"):
        riccati_gain(mode(3.0, 0.0, 0.0), [0.0], np.ones(2), np.ones(1))


def test_noise_of_another_size(small_plant: DecoupledPlant) -> None:
    model = scaled_model(small_plant)
    with pytest.raises(DimensionError, match="measurement_noise"):
        riccati_gain(model, [0.0], np.ones(6), np.ones(2))
    with pytest.raises(DimensionError, match="process_noise"):
        riccati_gain(model, [0.0], np.ones(5), np.ones(3))


def test_a_rigid_mode_that_changes_sign_has_no_constant_gain() -> None:
    slope = ChebyshevMatrix(np.reshape([0.1, 1.0], (2, 1, 1)), [[-1.0, 1.0]])  # C = 0.1 + p
    points = np.array([[-1.0], [1.0]])
    with pytest.raises(AssumptionError, match=r"stable at all 2 positions.*schedule L"):
        initial_gain(
            mode(0.0, 0.0, slope),
            points,
            omega_bw=np.array([10.0]),
            omega_flex=np.zeros(0),
            measurement_noise=np.array([0.1]),
        )
