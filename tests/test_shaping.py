"""Guards the shaping filters (eq. 16-18) and the scaling of the plant's channels (eq. 12-13)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.shaping import Filter, ShapingFilters, pade_delay, scaling

SETTINGS: dict[str, Any] = {
    "f_I": np.array([10.0, 12.0]),
    "f_r": np.array([160.0, 170.0]),
    "alpha": 20.0,
    "K_s": 0.5,
    "K_r": 0.6,
    "epsilon": np.array([0.03, 0.1, 0.2]),
    "beta_1": 0.5,
    "beta_2": 0.05,
    "omega_flex": 2 * np.pi * np.array([139.0, 206.0, 260.0]),
}
OMEGA = 2 * np.pi * np.array([0.01, 1.0, 139.0, 206.5, 1e3, 1e5])
F_BW, ERROR = np.array([20.0, 35.0]), np.array([2e-6, 5e-5])


def response(filter_: Filter, omega: float) -> Array:
    A, B, C, D = filter_
    return np.asarray(C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B) + D)


@pytest.mark.parametrize("omega", OMEGA)
def test_filters_are_those_of_the_paper(omega: float) -> None:
    filters, s = ShapingFilters(**SETTINGS), 1j * omega
    w_I, w_r, w = 2 * np.pi * SETTINGS["f_I"], 2 * np.pi * SETTINGS["f_r"], SETTINGS["omega_flex"]
    eq_16 = 0.5 * (s + w_I) / s
    eq_17 = 0.6 * (s + w_r) / (s / 20.0 + w_r)
    eq_18 = SETTINGS["epsilon"] * (s**2 / w**2 + 2 * 0.5 * s / w + 1) / (s**2 / w**2 + 2 * 0.05 * s / w + 1)
    at = np.array([omega])
    for found, formula in ((filters.W_z1(at), eq_16), (filters.W_z2(at), eq_17), (filters.W_w3(at), eq_18)):
        assert np.allclose(found[0], formula, rtol=1e-12, atol=0)
    for filter_, formula in ((filters.realize_W_z2(), eq_17), (filters.realize_W_w3(), eq_18)):
        assert np.allclose(response(filter_, omega), np.diag(formula), rtol=0, atol=1e-12 * np.max(np.abs(formula)))


def test_shapes_mean_what_they_should() -> None:
    filters = ShapingFilters(**SETTINGS)
    assert np.allclose(np.abs(filters.W_z1(np.array([1e6]))), 0.5, rtol=1e-3)  # sensitivity bound of 6 dB
    assert np.allclose(np.abs(filters.W_z2(np.array([1e-3]))), 0.6, rtol=1e-6)
    assert np.allclose(np.abs(filters.W_z2(np.array([1e9]))), 0.6 * 20.0, rtol=1e-3)
    peaks = np.abs(np.diagonal(filters.W_w3(SETTINGS["omega_flex"])))
    assert np.allclose(peaks, SETTINGS["epsilon"] * 0.5 / 0.05, rtol=1e-12)


@pytest.mark.parametrize("name", ["alpha", "K_s", "K_r", "beta_1", "beta_2", "f_I", "f_r", "epsilon", "omega_flex"])
def test_values_must_be_above_zero(name: str) -> None:
    for factor in (0.0, -1.0, np.nan):
        with pytest.raises(DomainError, match=name):
            ShapingFilters(**{**SETTINGS, name: factor * SETTINGS[name]})


def test_filters_that_do_not_fit_together() -> None:
    with pytest.raises(DomainError, match="wanted beta_1 > beta_2"):
        ShapingFilters(**{**SETTINGS, "beta_1": 0.05})
    for name in ("epsilon", "f_r"):
        with pytest.raises(DimensionError, match=name):
            ShapingFilters(**{**SETTINGS, name: np.ones(5)})


def test_no_controlled_mode() -> None:
    filters = ShapingFilters(**{**SETTINGS, "epsilon": np.zeros(0), "omega_flex": np.zeros(0)})
    assert [m.shape for m in filters.realize_W_w3()] == [(0, 0)] * 4


def test_rigid_axes_cross_0_dB_at_their_bandwidths(small_plant: DecoupledPlant) -> None:
    units = scaling(small_plant, F_BW, ERROR)
    assert np.allclose(units.output, [1 / ERROR[0], 1 / ERROR[1], 1 / ERROR[0]], rtol=1e-15)  # and a redundant sensor
    system = units.apply(small_plant.system)
    for axis, f in enumerate(F_BW):
        s = 2j * np.pi * f
        nominal = units.output[axis] / s**2 * units.input[axis]  # eq. 13
        assert abs(nominal) == pytest.approx(1.0, rel=1e-13)
        A, B, C, _ = (m[0] for m in system.sample(small_plant.box[:, 0]))
        rigid = C[:, :4] @ np.linalg.solve(s * np.eye(4) - A[:4, :4], B[:4])
        assert abs(rigid[axis, axis]) == pytest.approx(1.0, rel=1e-12)


def test_scaled_system_is_the_scaled_response(small_plant: DecoupledPlant) -> None:
    units = scaling(small_plant, F_BW, ERROR)
    p, s = [0.03], 2j * np.pi * 58.0
    wanted = np.diag(units.output) @ small_plant.system.at(p)(s) @ np.diag(units.input)
    assert np.allclose(
        units.apply(small_plant.system).at(p)(s), wanted, rtol=1e-11, atol=1e-11 * np.max(np.abs(wanted))
    )
    D = small_plant.system.D
    assert np.allclose(units.correction(D).at(p), units.apply(small_plant.system).D.at(p), rtol=1e-14)
    assert isinstance(units.correction(D), ChebyshevMatrix)


def test_modal_unit_gives_static_outputs_of_norm_one_at_worst(small_plant: DecoupledPlant) -> None:
    units = scaling(small_plant, F_BW, ERROR)
    mode, omega = small_plant.n_rb, small_plant.omega[small_plant.n_rb]
    points = np.vstack([spread_points(small_plant.box, 400, seed=3), small_plant.box.T])
    C = small_plant.sample(points).C[:, :2, mode]
    static = np.linalg.norm(units.output[:2] * C / omega**2 * units.input[small_plant.n_rb], axis=1)
    assert np.max(static) == pytest.approx(1.0, abs=0.02)
    assert np.max(static) > 1.5 * np.min(static)  # the worst position is one of many
    scaled = units.apply(small_plant.system)
    assert np.allclose(np.max(np.linalg.norm(scaled.C.sample(points)[:, :2, 2 * mode], axis=1)), 1.0, atol=0.02)


@pytest.mark.parametrize("wrong", [np.array([20.0, 0.0]), np.array([20.0, -3.0]), np.array([np.nan, 1.0])])
def test_scaling_needs_values_above_zero(small_plant: DecoupledPlant, wrong: Array) -> None:
    with pytest.raises(DomainError, match="f_bw"):
        scaling(small_plant, wrong, ERROR)
    with pytest.raises(DomainError, match="expected_error"):
        scaling(small_plant, F_BW, wrong)
    with pytest.raises(DimensionError, match="f_bw"):
        scaling(small_plant, np.array([20.0]), ERROR)


@pytest.mark.parametrize(("order", "reach"), [(1, 0.5), (2, 1.5), (4, 4.0)])
def test_pade_delay(order: int, reach: float) -> None:
    delay = 3e-4
    filter_ = pade_delay(delay, order, 2)
    assert filter_[0].shape == (2 * order, 2 * order)
    for omega in np.linspace(0.0, reach / delay, 7):
        H = response(filter_, omega)
        assert np.allclose(np.abs(np.diag(H)), 1.0, rtol=1e-10)
        assert abs(H[0, 1]) < 1e-12
        assert abs(np.angle(H[0, 0] * np.exp(1j * omega * delay))) < 0.03
    assert abs(np.angle(response(filter_, 2.0)[0, 0]) + 2.0 * delay) < 1e-9
    assert np.max(np.linalg.eigvals(filter_[0]).real) < 0.0


@pytest.mark.parametrize(("delay", "order"), [(0.0, 2), (-1e-4, 2), (np.nan, 2), (1e-4, 0)])
def test_invalid_delays(delay: float, order: int) -> None:
    with pytest.raises(DomainError):
        pade_delay(delay, order, 1)
