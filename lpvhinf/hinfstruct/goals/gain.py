"""The largest gain of a channel, over all frequencies or over a band."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.curvature import log_gain_hessian
from lpvhinf.hinfstruct.goals.state import (
    ChannelResponse,
    GoalValue,
    LoopState,
    Measure,
    RawCut,
    channel_loop,
)
from lpvhinf.hinfstruct.gradient import peak_gain
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.norm import TOLERANCE, above_level
from lpvhinf.hinfstruct.peaks import Peaks, find_peaks
from lpvhinf.hinfstruct.response import Response, largest_sigma

#: Gains below this share of the bound count as zero.
SMALLEST = 1e-12
#: Singular values within this share of the largest at a peak become cuts.
CLUSTER = 0.15
#: Singular values of a cluster, at most.
MOST = 8
#: Frequencies of a band that are looked at besides those placed by the poles.
POINTS = 24


class GainEvaluator:
    r"""The level :math:`\log(\max_\omega \bar\sigma(T(j\omega)) / at\_most)` of a channel.

    Parameters
    ----------
    rows, columns : sequence of int
        Of z and w.
    at_most : float
    band : (low, high) [rad/s]
    """

    def __init__(
        self,
        rows: tuple[int, ...],
        columns: tuple[int, ...],
        at_most: float,
        band: tuple[float, float] = (0.0, np.inf),
    ) -> None:
        self.rows, self.columns, self.at_most = list(rows), list(columns), at_most
        self.low, self.high = band
        self._hints, self._missed = np.zeros(0), np.zeros(0)

    def _channel(self, state: LoopState) -> tuple[ClosedLoop, Response]:
        return (
            channel_loop(state.loop, self.rows, self.columns),
            ChannelResponse(state.response, self.rows, self.columns),
        )

    def _level(self, gain: float) -> float:
        return float(np.log(max(gain / self.at_most, SMALLEST)))

    def _peaks(self, T: Response, fraction: float, floor: float = 0.0) -> Peaks:
        extra = np.concatenate([self._hints, self._missed])
        return band_peaks(T, self.low, self.high, extra, fraction, floor)

    def measure(self, state: LoopState) -> Measure:
        """The level by tracked peaks."""
        peaks = self._peaks(self._channel(state)[1], 0.98)
        return Measure(self._level(float(peaks.sigma[0])), peaks)

    def confirm(self, state: LoopState, measure: Measure) -> Measure:
        """The level after a Hamiltonian level test; missed peaks are remembered."""
        loop, T = self._channel(state)
        peaks: Peaks = measure.data
        top = float(peaks.sigma[0])
        if top > SMALLEST * self.at_most:
            found = band_above_level(loop, T, top * (1.0 + 1e-6), self.low, self.high)
            if found.size:
                self._missed = np.concatenate([self._missed, found[np.isfinite(found)]])[-8:]
                peaks = self._peaks(T, 0.98)
        self._hints = peaks.omega[np.isfinite(peaks.omega)][:6]
        return Measure(self._level(float(peaks.sigma[0])), peaks)

    def cuts(self, state: LoopState, measure: Measure, lowest: float) -> list[RawCut]:
        """Every peak above a level, at each the cluster of singular values."""
        loop, T = self._channel(state)
        peaks = self._peaks(T, 0.0, self.at_most * float(np.exp(lowest)))
        out = [self._at(loop, float(omega), CLUSTER) for omega in peaks.omega]
        return sorted(out, key=lambda cut: -cut.level)

    def again(self, state: LoopState, key: tuple[Any, ...]) -> list[RawCut]:
        """The gain at the same frequency."""
        return [self._at(self._channel(state)[0], float(key[0]), 0.02)]

    def keys(self, measure: Measure) -> list[tuple[Any, ...]]:
        """The highest peaks."""
        return [(float(omega),) for omega in measure.data.omega[:3]]

    def _at(self, loop: ClosedLoop, omega: float, cluster: float) -> RawCut:
        gain = peak_gain(loop, omega, cluster, MOST)
        return RawCut(self._level(float(gain.sigma[0])), None, (omega,), peak=gain, height=-float(np.log(self.at_most)))

    def curvature(self, state: LoopState, key: tuple[Any, ...], dK: Array) -> tuple[Array, Array]:
        """Hessian of the logarithm of a peak, its frequency moving along."""
        return log_gain_hessian(self._channel(state)[0], key[0], key[1], dK)

    def exact(self, state: LoopState, plant: int) -> GoalValue:
        """The gain after level tests until nothing lies above it."""
        loop, T = self._channel(state)
        extra = np.concatenate([self._hints, self._missed])
        peaks = band_peaks(T, self.low, self.high, extra, 0.99)
        for _ in range(30):
            top = float(peaks.sigma[0])
            if top == 0.0:
                break
            found = band_above_level(loop, T, top * (1.0 + TOLERANCE), self.low, self.high)
            if found.size == 0:
                break
            extra = np.concatenate([extra, found[np.isfinite(found)]])
            better = band_peaks(T, self.low, self.high, extra, 0.99)
            if better.sigma[0] <= top * (1.0 + TOLERANCE):
                break
            peaks = better
        value = float(peaks.sigma[0])
        return GoalValue(value=value, where=float(peaks.omega[0]), plant=plant, level=self._level(value))


def band_peaks(T: Response, low: float, high: float, extra: Array, fraction: float, floor: float = 0.0) -> Peaks:
    """Local maxima of the gain over a band, its ends included, above a fraction of the largest."""
    if low == 0.0 and np.isinf(high):
        return find_peaks(T, extra=extra, fraction=fraction, floor=floor)
    top = high if np.isfinite(high) else 10.0 * max(low, float(np.max(np.abs(T.poles), initial=1.0)))
    ends = np.array([low, high])
    inside = np.geomspace(max(low, 1e-3 * top), top, POINTS)
    peaks = find_peaks(T, extra=np.concatenate([extra, inside, ends[np.isfinite(ends)]]), fraction=0.0)
    within = (peaks.omega >= low) & (peaks.omega <= high)
    omega = np.concatenate([peaks.omega[within], ends])
    sigma = np.concatenate([peaks.sigma[within], largest_sigma(T.at(ends))])
    # an end that a peak sits on is one
    order = np.argsort(-sigma, kind="stable")
    omega, sigma = omega[order], sigma[order]
    first = np.array([not np.any(np.isclose(omega[:k], omega[k], rtol=1e-9, atol=0.0)) for k in range(omega.size)])
    chosen = first & (sigma >= max(fraction * sigma[0], min(floor, sigma[0])))
    return Peaks(omega[chosen], sigma[chosen])


def band_above_level(loop: ClosedLoop, T: Response, level: float, low: float, high: float) -> Array:
    r"""Frequencies of a band with a gain above `level`, one in each interval; empty if the largest is below it.

    Between two frequencies where :math:`j\omega` is an eigenvalue of the Hamiltonian matrix no singular value
    passes the level. So one value between each two of them, the ends of the band included, decides.
    """
    if low == 0.0 and np.isinf(high):
        return above_level(loop.A, loop.B, loop.C, loop.D, T, level)
    crossings = _crossings(loop, level)
    inside = crossings[(crossings > low) & (crossings < high)]
    last = high if np.isfinite(high) else 2.0 * max(low, float(np.max(inside, initial=1.0)))
    edges = np.concatenate([[low], inside, [last]])
    candidates = np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1]), [high]])
    return np.asarray(np.unique(candidates[largest_sigma(T.at(candidates)) > level]))


def _crossings(loop: ClosedLoop, level: float) -> Array:
    """Frequencies at which a singular value may pass the level."""
    if loop.A.shape[0] == 0:
        return np.zeros(0)
    A, (scale, _) = scipy.linalg.matrix_balance(loop.A, permute=False, separate=True)
    B, C = loop.B / scale[:, None], loop.C * scale
    size, other = float(np.linalg.norm(B)), float(np.linalg.norm(C))
    if size == 0.0 or other == 0.0:
        return np.zeros(0)
    weight = np.sqrt(other / (size * level))
    B, C, D = B * weight, C / (level * weight), loop.D / level
    gap = np.eye(D.shape[1]) - D.T @ D
    # the gap may be indefinite (the band may leave a larger feed-through out), but not singular
    if np.min(np.abs(np.linalg.eigvalsh(gap))) < 1e-9:
        gap = gap + 2e-9 * np.eye(D.shape[1])
    RD, RB = np.linalg.solve(gap, D.T), np.linalg.solve(gap, B.T)
    F = A + B @ RD @ C
    eigenvalues = np.linalg.eigvals(np.block([[F, B @ RB], [-C.T @ (C + D @ RD @ C), -F.T]]))
    near = np.abs(eigenvalues.real) <= 1e-4 * np.abs(eigenvalues) + 1e-10 * np.max(np.abs(eigenvalues))
    return np.asarray(np.unique(np.abs(eigenvalues[near].imag)))
