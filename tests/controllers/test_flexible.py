"""Guards K_FM: the band-pass of eq. 11 and the selection of modal velocities."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.controllers import band_pass, velocity_selection
from lpvhinf.errors import DimensionError, DomainError


@pytest.mark.parametrize("Q", [0.3, 1.0, 5.0])
def test_band_pass_is_eq_11(Q: float) -> None:
    omega = np.array([100.0, 870.0, 1300.0])
    A, B, C, D = band_pass(omega, Q)
    assert A.shape == (6, 6)
    for w in [0.0, 30.0, 100.0, 870.0, 5000.0]:
        s = 1j * w
        formula = (omega / Q * s) / (s**2 + omega / Q * s + omega**2)
        H = C @ np.linalg.solve(s * np.eye(6) - A, B) + D
        assert np.allclose(H, np.diag(formula), rtol=0, atol=1e-13)


def test_band_pass_has_unit_gain_and_no_phase_at_its_mode() -> None:
    A, B, C, D = band_pass([870.0], 3.0)
    H = C @ np.linalg.solve(870j * np.eye(2) - A, B) + D
    assert H[0, 0] == pytest.approx(1.0, abs=1e-13)


def test_no_mode_no_filter() -> None:
    A, B, C, D = band_pass([], 1.0)
    assert (A.shape, B.shape, C.shape, D.shape) == ((0, 0), (0, 0), (0, 0), (0, 0))


@pytest.mark.parametrize("Q", [0.0, -1.0, np.nan, np.inf, "1", None, 1j])
def test_invalid_quality(Q: float) -> None:
    with pytest.raises(DomainError, match="Q is"):
        band_pass([1.0], Q)


def test_invalid_frequencies() -> None:
    with pytest.raises(DomainError):
        band_pass([np.nan], 1.0)
    with pytest.raises(DimensionError):
        band_pass([[1.0]], 1.0)


def test_velocity_selection() -> None:
    state = np.arange(10.0)  # two rigid-body and three flexible modes, grouped
    assert (velocity_selection(2, 3) @ state).tolist() == [5.0, 7.0, 9.0]
    assert velocity_selection(2, 0).shape == (0, 4)
