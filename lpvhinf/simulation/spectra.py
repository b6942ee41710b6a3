"""Spectra of signals over time: where the error's power lies, and a floor that moves as wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only, whole_number
from lpvhinf.errors import DimensionError, DomainError


@dataclass(frozen=True, kw_only=True, eq=False)
class CumulativePower:
    """Power of signals up to each frequency.

    Attributes
    ----------
    hertz : (n_f,) [Hz]
    density : (n_f, n)
        One-sided power spectral density [unit^2/Hz].
    power : (n_f, n)
        Its sum up to each frequency [unit^2]; the last is the mean square without the mean.
    """

    hertz: Array
    density: Array
    power: Array

    @property
    def rms(self) -> Array:
        """Root of the cumulative power, (n_f, n)."""
        return np.asarray(np.sqrt(self.power))


def cumulative_power(signal: ArrayLike, period: float) -> CumulativePower:
    """The periodogram of signals (N, n) without their mean, summed; exact by Parseval's theorem.

    Examples
    --------
    >>> t = 1e-3 * np.arange(1000)
    >>> found = cumulative_power(np.sin(2 * np.pi * 50 * t)[:, None], 1e-3)
    >>> found.power[[49, 50], 0].round(9).tolist(), found.hertz[50].item()
    ([0.0, 0.5], 50.0)
    """
    x, T = finite_array("signal", signal, (None, None)), positive("period", period, "s")
    N = len(x)
    if N < 2:
        raise DimensionError(f"signal has {N} samples, wanted at least 2.")
    lines = np.abs(np.fft.rfft(x - np.mean(x, axis=0), axis=0)) ** 2 / N**2
    lines[1 : len(lines) - 1 + N % 2] *= 2.0  # a frequency and its mirror image; half the sampling rate has none
    return CumulativePower(
        hertz=read_only(np.fft.rfftfreq(N, T)),
        density=read_only(lines * (N * T)),
        power=read_only(np.cumsum(lines, axis=0)),
    )


def floor_acceleration(
    n_samples: int, n_axes: int, *, period: float, velocity_rms: float, band: tuple[float, float], seed: int = 0
) -> Array:
    """Acceleration (N, n_axes) of a floor whose velocity has an even spectrum between two frequencies.

    Vibration criteria of laboratory floors (VC-A to VC-G) limit the velocity in every third of an octave, evenly over
    frequency; here the density is even.

    Parameters
    ----------
    velocity_rms : float
        Of every axis [m/s], exact over the samples.
    band : (low, high) [Hz]
        Below half the sampling rate.
    seed : int
        Of the phases.

    Examples
    --------
    >>> a = floor_acceleration(10000, 3, period=1e-4, velocity_rms=1e-6, band=(2.0, 100.0))
    >>> a.shape, float(abs(a).max()) < 3e-3
    ((10000, 3), True)
    """
    N, T = whole_number("n_samples", n_samples, 2), positive("period", period, "s")
    n = whole_number("n_axes", n_axes, 1)
    if not np.isfinite(velocity_rms) or velocity_rms < 0.0:
        raise DomainError(f"velocity_rms is {velocity_rms}, wanted 0 or more m/s.")
    hertz = np.fft.rfftfreq(N, T)
    inside = (hertz >= band[0]) & (hertz <= band[1]) & (hertz > 0.0) & (hertz < 0.5 / T)
    if not np.any(inside) or band[1] >= 0.5 / T:
        raise DomainError(
            f"band is {tuple(band)} Hz, wanted frequencies below {0.5 / T:.6g} Hz, of which {N} samples have at least "
            "one. Take a wider band, or more samples."
        )
    phase = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, (int(np.count_nonzero(inside)), n))
    # a sine of amplitude a has mean square a^2 / 2
    amplitude = velocity_rms * np.sqrt(2.0 / len(phase))
    lines = np.zeros((len(hertz), n), dtype=complex)
    lines[inside] = 0.5 * N * amplitude * np.exp(1j * phase) * (2j * np.pi * hertz[inside])[:, None]
    return np.asarray(np.fft.irfft(lines, N, axis=0))
