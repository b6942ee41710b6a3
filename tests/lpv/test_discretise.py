"""Discretised controllers: exact at frozen p, of second order where p moves."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.integrate

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.lpv import discretisation_error, discretise, lpvsyn, monomials
from lpvhinf.statespace.lpv import LPVStateSpace
from tests.lpv.small_plants import moving_mode

GRID = np.linspace(-1.0, 1.0, 5)[:, None]


def scheduled() -> LPVStateSpace:
    """A mode whose frequency, gains and feed-through depend on p."""
    A = np.array([[[0.0, 1.0], [-900.0, -12.0]], [[0.0, 0.0], [400.0, -4.0]]])
    B, C = np.array([[[0.0], [30.0]], [[0.0], [10.0]]]), np.array([[[10.0, 0.0]], [[3.0, 0.2]]])
    return LPVStateSpace.from_coefficients(A, B, C, [[[0.1]], [[0.05]]], box=[[-1.0, 1.0]])


def trajectory(t: Array) -> tuple[Array, Array]:
    return np.sin(40.0 * t)[:, None], np.cos(25.0 * t)[:, None]


@pytest.mark.parametrize(("method", "theirs"), [("exact", "zoh"), ("trapezoidal", "bilinear")])
def test_frozen_steps_are_those_of_known_methods(method: str, theirs: str) -> None:
    K, T = scheduled(), 1e-3
    for p in (-1.0, 0.4):
        ours, known = discretise(K, period=T, method=method).at([p]), control.c2d(K.at([p]), T, theirs)
        assert ours.dt == T
        z = np.exp(1j * T * np.array([1.0, 30.0, 500.0]))
        assert np.allclose([ours(s) for s in z], [known(s) for s in z], rtol=1e-9)


def test_simulation_agrees_with_an_integrator() -> None:
    K, T, n = scheduled(), 1e-4, 1001
    times = T * np.arange(n)

    def slope(t: float, x: Array) -> Array:
        p, u = trajectory(np.array([t]))
        return np.asarray(K.A.at(p[0]) @ x + K.B.at(p[0]) @ u[0])

    p, u = trajectory(times)
    x = scipy.integrate.solve_ivp(slope, (0.0, times[-1]), np.zeros(2), t_eval=times, rtol=1e-10, atol=1e-12).y.T
    truth = np.array([K.C.at(a) @ b + K.D.at(a) @ c for a, b, c in zip(p, x, u, strict=True)])
    scale = np.max(np.abs(truth))
    measured = discretisation_error(K, discretise(K, period=T), [[0.0]], trajectory=trajectory, duration=times[-1])
    actual = np.max(np.abs(discretise(K, period=T).simulate(p, u) - truth)) / scale
    # the own reference gives the same error as the independent integrator
    assert measured.moving == pytest.approx(actual, rel=0.02)
    assert actual < 1e-4


def test_trapezoidal_is_of_second_order_and_exact_of_first() -> None:
    K = scheduled()
    orders = {}
    for method in ("trapezoidal", "exact"):
        errors = [
            discretisation_error(
                K, discretise(K, period=T, method=method), [[0.0]], trajectory=trajectory, refinement=8
            ).moving
            for T in (1e-3, 5e-4)
        ]
        orders[method] = np.log2(errors[0] / errors[1])
    assert 1.9 < orders["trapezoidal"] < 2.1
    assert 0.8 < orders["exact"] < 1.2


def test_frozen_error() -> None:
    K = scheduled()
    held = discretisation_error(K, discretise(K, method="exact"), [[-1.0], [1.0]], omega_max=300.0)
    rule = discretisation_error(K, discretise(K), [[-1.0], [1.0]], omega_max=300.0)
    # but for aliasing exact, once the delay of the hold is taken out; the feed-through is not delayed
    assert held.frozen < 2e-3
    assert 0.0 < rule.frozen < 1e-3
    assert np.isnan(rule.moving)
    # the rule is of second order at frozen positions, too
    finer = discretisation_error(K, discretise(K, period=5e-5), [[-1.0], [1.0]], omega_max=300.0)
    assert rule.frozen / finer.frozen == pytest.approx(4.0, rel=0.05)


def test_a_designed_controller() -> None:
    result = lpvsyn(moving_mode, GRID, basis=monomials(1, box=[[-1.0, 1.0]]), rate=[[-0.1, 0.1]])
    error = discretisation_error(result.controller, discretise(result.controller), GRID, omega_max=100.0)
    assert error.frozen < 1e-2
    both = lpvsyn(moving_mode, GRID, basis=monomials(1, box=[[-1.0, 1.0]]), rate=[[-0.1, 0.1]], constant="none")
    with pytest.raises(AssumptionError, match="depends on dp/dt"):
        discretise(both.controller)


def test_refusals() -> None:
    K = scheduled()
    with pytest.raises(DomainError, match="method is 'tustin'"):
        discretise(K, method="tustin")
    with pytest.raises(DomainError, match="period is 0"):
        discretise(K, period=0.0)
    with pytest.raises(DomainError, match="controller is StateSpace"):
        discretise(K.at([0.0]))  # type: ignore[arg-type]
    with pytest.raises(DimensionError, match="u has 2 columns"):
        discretise(K).simulate(np.zeros((3, 1)), np.zeros((3, 2)))
    unstable = LPVStateSpace.from_coefficients([[[2e4]]], [[1.0]], [[1.0]], [[0.0]], box=[[0.0, 1.0]])
    with pytest.raises(AssumptionError, match="shorter period"):
        discretise(unstable).matrices([0.0])
