"""Amplifier and sensor errors: limits, steps, voltage and noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.plant.mmpa import Amplifier, SensorErrors

AMPLIFIER = Amplifier()
SMOOTH = Amplifier(bits=None)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_current_loop_has_its_bandwidth_and_no_static_error(order):
    loop = Amplifier(bandwidth_hz=2500.0, order=order).state_space()
    assert loop.nstates == order
    assert abs(loop(2j * np.pi * 2500.0)) == pytest.approx(1 / np.sqrt(2), rel=1e-9)
    assert abs(loop(2j * np.pi * 25e3)) == pytest.approx(10.0**-order, rel=0.01)
    assert loop(0.0) == pytest.approx(1.0)
    assert loop.poles().real.max() < 0.0


def test_an_infinitely_fast_current_loop_is_one():
    loop = Amplifier(bandwidth_hz=None).state_space()
    assert loop.nstates == 0
    assert loop(2j * np.pi * 1e4) == 1.0


def test_current_is_limited_and_rounded():
    wanted = np.linspace(-6.0, 6.0, 1201)
    limited = SMOOTH.apply(wanted)
    assert np.array_equal(limited, np.clip(wanted, -4.0, 4.0))
    assert AMPLIFIER.step == pytest.approx(8.0 / 65536)
    rounded = AMPLIFIER.apply(wanted)
    inside = np.abs(wanted) < 3.999
    assert np.abs(rounded - wanted)[inside].max() <= 0.5 * AMPLIFIER.step * (1 + 1e-9)
    assert np.abs(rounded - wanted)[inside].max() > 0.4 * AMPLIFIER.step
    codes = rounded / AMPLIFIER.step
    assert np.allclose(codes, np.round(codes), atol=1e-9)
    assert (codes.min(), codes.max()) == pytest.approx((-32768, 32767))
    coarse = np.unique(replace(AMPLIFIER, bits=2).apply(wanted))
    assert coarse.tolist() == [-4.0, -2.0, 0.0, 2.0]


def test_noise_has_its_size_and_comes_from_the_generator():
    zero = np.zeros(20_000)
    noise = AMPLIFIER.apply(zero, np.random.default_rng(1))
    assert noise.std() == pytest.approx(100e-6, rel=0.03)
    assert np.array_equal(noise, AMPLIFIER.apply(zero, np.random.default_rng(1)))
    assert not np.any(AMPLIFIER.apply(zero))


def test_voltage_limits_the_change():
    # from rest, 48 V over 1.2 ohm and 1 mH: i(t) = 40 A (1 - exp(-t / 0.833 ms))
    T = 20e-6
    first = SMOOTH.apply([4.0, -4.0, 0.5], previous=np.zeros(3), interval=T)
    reach = 40.0 * (1.0 - np.exp(-T / (1e-3 / 1.2)))
    assert first == pytest.approx([reach, -reach, 0.5])
    assert reach == pytest.approx(48.0 / 1e-3 * T, rel=0.02)
    # falling is quicker than rising: the resistance helps
    assert SMOOTH.apply([-4.0], previous=[4.0], interval=T) == pytest.approx([4.0 * np.exp(-T * 1200.0) - reach])
    assert SMOOTH.apply([4.0], previous=[-4.0], interval=10e-3) == pytest.approx([4.0])
    with pytest.raises(DomainError, match="previous and interval go together"):
        SMOOTH.apply([1.0], previous=[0.0])
    with pytest.raises(DimensionError, match="previous has shape"):
        SMOOTH.apply([1.0], previous=[0.0, 0.0], interval=T)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"current_limit": 0.0}, "current_limit is 0.0"),
        ({"voltage": -48.0}, "voltage is -48.0"),
        ({"voltage": 4.0}, "4.0 V drive at most 3.333 A through 1.2 ohm"),
        ({"bandwidth_hz": 0.0}, "bandwidth_hz is 0.0"),
        ({"order": 0}, "order is 0"),
        ({"order": 9}, "order is 9, wanted a current loop of at most order 8"),
        ({"bits": 0}, "bits is 0"),
        ({"bits": 64}, "bits is 64"),
        ({"noise_rms": -1.0}, "noise_rms is -1.0"),
        ({"inductance": np.nan}, "inductance is nan"),
    ],
)
def test_bad_amplifiers_are_named(changes, words):
    with pytest.raises(DomainError, match=words):
        Amplifier(**changes)


def test_readings_have_noise_and_steps():
    y = np.linspace(-1e-6, 1e-6, 5001)
    assert np.array_equal(SensorErrors().read(y, np.random.default_rng(0)), y)
    stepped = SensorErrors(quantisation=0.15e-9).read(y)
    assert np.abs(stepped - y).max() <= 0.075e-9 * (1 + 1e-6)
    assert np.allclose(stepped / 0.15e-9, np.round(stepped / 0.15e-9), atol=1e-6)
    both = SensorErrors(noise_rms=0.3e-9, quantisation=0.15e-9).read(y, np.random.default_rng(0)) - y
    # rounding adds a variance of step^2 / 12
    assert both.std() == pytest.approx(np.hypot(0.3e-9, 0.15e-9 / np.sqrt(12)), rel=0.05)
    for name in ("noise_rms", "quantisation"):
        with pytest.raises(DomainError, match=f"{name} is -1e-09 m"):
            SensorErrors(**{name: -1e-9})
