"""The function that is minimised: the largest norm over the plants, its peaks and its derivatives."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.curvature import log_gain_hessian
from lpvhinf.hinfstruct.gradient import PeakGain, directions, peak_gain
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.norm import NormResult, above_level, exact_norm
from lpvhinf.hinfstruct.peaks import Peaks, find_peaks
from lpvhinf.hinfstruct.response import Response

#: Norms below this count as zero (their logarithm must stay finite).
SMALLEST = 1e-10


@dataclass(slots=True, eq=False)
class Point:
    """Parameters with the value of the function there; infinite outside its domain."""

    theta: Array
    value: float
    data: Any = None


@dataclass(slots=True, eq=False)
class Cut:
    """One smooth function: value and gradient at a point, and what it is.

    Below the maximum; where `hard`, one that a step must keep at or below zero.
    """

    value: float
    gradient: Array
    label: tuple[Any, ...]
    hard: bool = False


class Oracle(Protocol):
    """What the minimisers ask of a maximum of smooth functions."""

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        """The value; above `cutoff` any number above it will do."""

    def gradient(self, point: Point) -> Array:
        """Gradient of the function that is the maximum."""

    def confirm(self, point: Point) -> Point:
        """The point with its value checked by exact means."""

    def cuts(self, point: Point, missed: Sequence[Point] = ()) -> list[Cut]:
        """The functions near the maximum; those that decided at the points `missed` too."""

    def hessian(self, point: Point, weights: Sequence[float], cuts: Sequence[Cut]) -> Array | None:
        """Weighted sum of the Hessians of cuts at a point; None if not available."""


@dataclass(slots=True)
class Budget:
    """Wall time and a count of evaluations."""

    deadline: float = np.inf
    evaluations: int = 0
    started: float = field(default_factory=time.monotonic)

    @property
    def spent(self) -> bool:
        """True if the time is over."""
        return time.monotonic() >= self.deadline


@dataclass(slots=True, eq=False)
class _Models:
    """What is known of the closed loops at a point."""

    loops: list[ClosedLoop | None]
    responses: list[Response | None]
    peaks: list[Peaks | None]
    decisive: int = -1
    top: float = 0.0


class NormOracle:
    r"""The largest H-infinity norm over the plants as a function to minimise.

    .. math:: f(\theta) = \log(\max_i \|T_i(\theta)\|_\infty + \delta)
              + \tfrac{\mu}{2} \log(1 + \|\theta\|^2)

    and infinity where a loop is not Hurwitz. The logarithm tames the huge norms of poor starts; the offset delta
    makes f regular where the norm falls to zero; the guard mu keeps early iterations from infinite gains.

    Parameters
    ----------
    loops : ClosedLoops
    budget : Budget
    fraction : float
        Peaks above this fraction of the largest become cuts.
    cluster : float
        Singular values within this fraction of the largest at a peak become cuts.
    offset, guard : float
        delta and mu; both zero or positive.
    """

    def __init__(
        self,
        loops: ClosedLoops,
        budget: Budget,
        *,
        fraction: float = 0.7,
        cluster: float = 0.15,
        offset: float = 0.0,
        guard: float = 0.0,
    ) -> None:
        self.loops, self.budget, self.offset, self.guard = loops, budget, offset, guard
        self.fraction, self.cluster = fraction, cluster
        n = len(loops.factories)
        self._hints = [np.zeros(0) for _ in range(n)]
        self._missed = [np.zeros(0) for _ in range(n)]
        self._order = list(range(n))
        self._turn = 0
        self._scale = loops.scale

    def _value(self, theta: Array, top: float) -> float:
        return float(np.log(max(top, SMALLEST) + self.offset) + 0.5 * self.guard * np.log1p(theta @ theta))

    def _guard_gradient(self, theta: Array) -> Array:
        return np.asarray(self.guard * theta / (1.0 + theta @ theta))

    @staticmethod
    def gamma(point: Point) -> float:
        """The norm at a point; infinite if not stable."""
        return float(point.data.top) if point.data is not None else np.inf

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        """The value by tracked peaks; the plants that decided last come first, and end a hopeless trial early."""
        self.budget.evaluations += 1
        n = len(self._order)
        models = _Models([None] * n, [None] * n, [None] * n)
        top = 0.0
        cutoff += 1e-12 * (1.0 + abs(cutoff))
        with np.errstate(over="ignore", invalid="ignore"):
            gains = self.loops.gains(theta)
        if not all(np.all(np.isfinite(K)) for K in gains):
            return Point(theta, np.inf)
        for rank, i in enumerate(self._order):
            loop = self.loops.factories[i].close(gains[i])
            if loop is None or not np.all(np.isfinite(loop.A)):
                self._promote(rank)
                return Point(theta, np.inf)
            try:
                response = Response(loop.A, loop.B, loop.C, loop.D)
            except np.linalg.LinAlgError:
                return Point(theta, np.inf)
            if response.abscissa >= 0.0:
                self._promote(rank)
                return Point(theta, np.inf)
            extra = np.concatenate([self._hints[i], self._missed[i]])
            peaks = find_peaks(response, extra=extra, fraction=0.98, floor=top)
            models.loops[i], models.responses[i], models.peaks[i] = loop, response, peaks
            if peaks.sigma[0] > top or models.decisive < 0:
                top, models.decisive = float(peaks.sigma[0]), i
            if self._value(theta, top) > cutoff:
                self._promote(rank)
                break
        models.top = top
        return Point(theta, self._value(theta, top), models)

    def _promote(self, rank: int) -> None:
        self._order.insert(0, self._order.pop(rank))

    def _gain(self, point: Point, plant: int, omega: float, cluster: float) -> PeakGain:
        loop = point.data.loops[plant]
        return peak_gain(loop, omega, cluster)

    def gradient(self, point: Point) -> Array:
        """Gradient of the logarithm of the highest peak."""
        models: _Models = point.data
        i = models.decisive
        peaks = models.peaks[i]
        assert peaks is not None
        gain = self._gain(point, i, float(peaks.omega[0]), 0.0)
        one = np.ones(1, dtype=complex)
        pulled = self.loops.pullback(point.theta, i, gain.gradient(one))
        return np.asarray(pulled / (max(gain.sigma[0], SMALLEST) + self.offset) + self._guard_gradient(point.theta))

    def confirm(self, point: Point) -> Point:
        """Level tests on the plants near the maximum and on one more in turn; missed peaks are remembered."""
        models: _Models = point.data
        if models.top <= 2.0 * SMALLEST:
            return point
        known = [i for i, peaks in enumerate(models.peaks) if peaks is not None]
        heights = {i: float(models.peaks[i].sigma[0]) for i in known}  # type: ignore[union-attr]
        top = max(heights.values())
        near = sorted((i for i in known if heights[i] >= 0.9 * top), key=lambda i: -heights[i])[:3]
        self._turn = (self._turn + 1) % len(self._order)
        if self._turn in known and self._turn not in near:
            near.append(self._turn)
        for i in near:
            loop, response = models.loops[i], models.responses[i]
            assert loop is not None and response is not None
            found = above_level(loop.A, loop.B, loop.C, loop.D, response, top * (1.0 + 1e-6))
            if found.size:
                finite = found[np.isfinite(found)]
                self._missed[i] = np.concatenate([self._missed[i], finite])[-8:]
                peaks = find_peaks(response, extra=np.concatenate([self._hints[i], finite]), fraction=0.98)
                models.peaks[i] = peaks
                if peaks.sigma[0] > top:
                    top, models.decisive = float(peaks.sigma[0]), i
        for i in known:
            peaks_i = models.peaks[i]
            assert peaks_i is not None
            self._hints[i] = peaks_i.omega[np.isfinite(peaks_i.omega)][:6]
        self._order.sort(key=lambda i: -heights.get(i, 0.0))
        models.top = top
        point.value = self._value(point.theta, top)
        return point

    def cuts(self, point: Point, missed: Sequence[Point] = ()) -> list[Cut]:
        """Every peak above the fraction, at each the cluster of singular values; then the missed frequencies."""
        models: _Models = point.data
        top = models.top
        out: list[Cut] = []
        seen: dict[int, Array] = {}
        for i, response in enumerate(models.responses):
            peaks_i = models.peaks[i]
            assert response is not None and peaks_i is not None
            if peaks_i.sigma[0] < self.fraction * top:
                continue
            extra = np.concatenate([self._hints[i], self._missed[i]])
            peaks = find_peaks(response, extra=extra, fraction=0.0, floor=self.fraction * top)
            seen[i] = peaks.omega
            for omega in peaks.omega:
                out += self._cuts_at(point, i, float(omega), self.cluster)
        for other in missed:
            if other.data is None:
                continue
            i = other.data.decisive
            for omega in other.data.peaks[i].omega[:3]:
                if i not in seen or not np.any(np.isclose(seen[i], omega, rtol=1e-6)):
                    out += self._cuts_at(point, i, float(omega), 0.02)
        return out + self._poles_at_risk(point)

    def _cuts_at(self, point: Point, plant: int, omega: float, cluster: float) -> list[Cut]:
        gain = self._gain(point, plant, omega, cluster)
        out = []
        for c in directions(gain.sigma, 0.03):
            value = gain.value(c)
            gradient = self.loops.pullback(point.theta, plant, gain.gradient(c))
            gradient = gradient / (max(value, SMALLEST) + self.offset) + self._guard_gradient(point.theta)
            out.append(Cut(self._value(point.theta, value), gradient, (plant, omega, np.trim_zeros(c, "b"))))
        return out

    def _poles_at_risk(self, point: Point) -> list[Cut]:
        """Poles near the axis: a step may use nine tenths of their distance."""
        models: _Models = point.data
        out = []
        for i, response in enumerate(models.responses):
            loop = models.loops[i]
            assert response is not None and loop is not None
            if response.left is None or response.right is None:
                continue
            poles = response.poles
            risky = np.flatnonzero((poles.imag >= 0.0) & (-poles.real < 0.02 * np.abs(poles) + 1e-3 * self._scale))
            for k in risky[np.argsort(-poles.real[risky])][:4]:
                G = np.outer(response.left[k] @ loop.Bi, loop.Ci @ response.right[:, k]).real
                gradient = self.loops.pullback(point.theta, i, G) / -poles[k].real
                out.append(Cut(-0.9, gradient, (i, complex(poles[k])), hard=True))
        return out

    def hessian(self, point: Point, weights: Sequence[float], cuts: Sequence[Cut]) -> Array | None:
        """Exact Hessian of the weighted sum of logarithms of peaks; the guard is left out."""
        models: _Models = point.data
        n = point.theta.size
        out = np.zeros((n, n))
        pushed: dict[int, Array] = {}
        for plant in {cut.label[0] for cut in cuts}:
            dK = self.loops.directions(point.theta, plant)
            G = np.zeros(dK.shape[1:])
            for weight, cut in zip(weights, cuts, strict=True):
                if cut.label[0] == plant:
                    loop = models.loops[plant]
                    assert loop is not None
                    part, gradient = log_gain_hessian(loop, cut.label[1], cut.label[2], dK, self.offset)
                    out += weight * part
                    G += weight * gradient
            pushed[plant] = G
        for plant, G in pushed.items():
            out += self.loops.bend(point.theta, plant, G)
        return out

    def exact(self, theta: Array) -> list[NormResult]:
        """The exact norm of every plant's loop, by the controller that `theta` gives."""
        out = []
        for i, (factory, K) in enumerate(zip(self.loops.factories, self.loops.gains(theta), strict=True)):
            loop = factory.close(K)
            if loop is None:
                out.append(NormResult(norm=np.inf, omega=np.nan))
            else:
                hints = np.concatenate([self._hints[i], self._missed[i]])
                out.append(exact_norm(loop.A, loop.B, loop.C, loop.D, hints=hints))
        return out
