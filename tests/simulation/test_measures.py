"""Guards the measures of a motion: against sums written out, known signals, and Parseval's theorem."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.simulation import (
    cumulative_power,
    floor_acceleration,
    moving_statistics,
    rms_and_peak,
    settling_time,
    window_errors,
)

T = 1e-3
TIMES = T * np.arange(1000)


def test_moving_statistics_are_the_sums_of_their_definition() -> None:
    e = 1e-3 + 1e-9 * np.random.default_rng(0).normal(size=(60, 2))  # an offset must not cost digits
    average, deviation = moving_statistics(e, 7)
    assert average.shape == deviation.shape == (54, 2)
    for k in range(54):
        part = e[k : k + 7]
        assert np.allclose(average[k], np.mean(part, axis=0), rtol=1e-13)
        assert np.allclose(deviation[k], np.std(part, axis=0), rtol=1e-6)


def test_window_errors_look_at_the_lines_alone() -> None:
    e = np.where((TIMES > 0.1) & (TIMES < 0.2), 2.0, 50.0)[:, None]
    found = window_errors(TIMES, e, [[0.11, 0.19]], 0.02)
    assert found.moving_average == found.peak == found.rms == 2.0
    assert found.moving_deviation == 0.0
    both = window_errors(TIMES, e, [[0.11, 0.19], [0.4, 0.5]], 0.02)
    assert both.moving_average == 50.0
    assert both.moving_deviation == 0.0  # no window reaches from one line into another


def test_settling() -> None:
    e = np.exp(-TIMES / 0.1)[:, None] * [1.0, -0.5, 1e-9]
    found = settling_time(TIMES, e, 0.01, after=0.0)
    assert np.allclose(found, [0.1 * np.log(100.0), 0.1 * np.log(50.0), 0.0], atol=1.01 * T)
    assert np.isinf(settling_time(TIMES, np.ones((1000, 1)), 0.5, after=0.3)[0])


def test_rms_and_peak() -> None:
    rms, peak = rms_and_peak([[1.0, -2.0], [1.0, 0.0]])
    assert np.allclose(rms, [1.0, np.sqrt(2.0)])
    assert peak.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("n", [1000, 999])
def test_the_cumulative_power_ends_at_the_variance(n: int) -> None:
    x = np.random.default_rng(1).normal(3.0, 2.0, (n, 2))
    found = cumulative_power(x, T)
    assert np.allclose(found.power[-1], np.var(x, axis=0), rtol=1e-12)
    assert np.allclose(np.cumsum(found.density, axis=0) * found.hertz[1], found.power, rtol=1e-12)
    assert np.all(np.diff(found.rms, axis=0) >= 0.0)


def test_the_floor_has_the_velocity_and_the_band_that_were_asked_for() -> None:
    a = floor_acceleration(10000, 2, period=T, velocity_rms=3e-6, band=(5.0, 50.0), seed=4)
    found = cumulative_power(a, T)
    hertz = found.hertz[1:, None]
    velocity = np.diff(found.power, axis=0) / (2 * np.pi * hertz) ** 2
    assert np.allclose(np.sum(velocity, axis=0), 9e-12, rtol=1e-9)
    outside = (hertz[:, 0] < 4.95) | (hertz[:, 0] > 50.05)
    assert np.max(velocity[outside]) < 1e-20 * 9e-12 + 1e-24
    assert not np.allclose(a[:, 0], a[:, 1])
    assert np.array_equal(a, floor_acceleration(10000, 2, period=T, velocity_rms=3e-6, band=(5.0, 50.0), seed=4))


E = np.ones((1000, 1))


@pytest.mark.parametrize(
    ("call", "arguments", "error", "message"),
    [
        (moving_statistics, {"error": E, "width": 1001}, DomainError, "width is 1001"),
        (moving_statistics, {"error": E, "width": 1.5}, DomainError, "width is 1.5"),
        (
            window_errors,
            {"times": TIMES, "error": E, "windows": [[0.5, 2.0]], "width": 0.1},
            DomainError,
            "0.5 to 2 s.*Was the motion stopped",
        ),
        (
            window_errors,
            {"times": TIMES, "error": E, "windows": [[0.5, 0.6]], "width": 0.2},
            DomainError,
            "at most the line of 0.1 s",
        ),
        (window_errors, {"times": TIMES[:9], "error": E, "windows": [[0.0, 0.1]], "width": 0.1}, DimensionError, "9"),
        (settling_time, {"times": TIMES, "error": E, "tolerance": 0.0, "after": 0.0}, DomainError, "tolerance is"),
        (settling_time, {"times": TIMES, "error": E, "tolerance": 1.0, "after": 2.0}, DomainError, "after is 2.0"),
        (cumulative_power, {"signal": E[:1], "period": T}, DimensionError, "1 samples"),
        (
            floor_acceleration,
            {"n_samples": 100, "n_axes": 1, "period": T, "velocity_rms": 1.0, "band": (1.0, 2.0)},
            DomainError,
            "Take a wider band",
        ),
        (
            floor_acceleration,
            {"n_samples": 100, "n_axes": 1, "period": T, "velocity_rms": -1.0, "band": (1.0, 20.0)},
            DomainError,
            "velocity_rms is -1.0",
        ),
    ],
)
def test_bad_input(call: Any, arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call(**arguments)
