"""The function that is minimised: the largest norm over the plants, its peaks and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.cluster import SMALLEST as SMALLEST
from lpvhinf.hinfstruct.cluster import cluster_at
from lpvhinf.hinfstruct.curvature import log_gain_hessian
from lpvhinf.hinfstruct.gradient import peak_gain
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.metric import OFF_AXIS, SLOW, loop_metric
from lpvhinf.hinfstruct.norm import NormResult, above_level, exact_norm, slicot_peak
from lpvhinf.hinfstruct.peaks import Peaks, find_peaks, plateau
from lpvhinf.hinfstruct.problem import Budget as Budget
from lpvhinf.hinfstruct.problem import Cut as Cut
from lpvhinf.hinfstruct.problem import Oracle as Oracle
from lpvhinf.hinfstruct.problem import Point as Point
from lpvhinf.hinfstruct.response import Response, spectral_abscissa

#: Parameters beyond this count as infinite.
LARGEST = 1e9
#: Loops of up to so many states are cheaper to evaluate by the exact norm than by peaks.
SMALL = 20
#: Plants above this part of the largest norm are tested by exact means, and make the metric.
NEAR = 0.9
#: Between peaks the response counts as a plateau above this part of the largest norm.
FLAT = 0.98
#: Singular values of a cluster, at most.
MOST = 8
#: Frequencies that differ by less, relatively, are one.
CLOSE = 1e-4


@dataclass(slots=True, eq=False)
class Models:
    """What is known of the closed loops at a point."""

    loops: list[ClosedLoop | None]
    responses: list[Response | None]
    peaks: list[Peaks | None]
    decisive: int = -1
    top: float = 0.0
    hessians: dict[tuple[int, float, bytes], Array] = field(default_factory=dict)
    cuts: list[Cut] | None = None

    def response(self, i: int) -> Response:
        """The response of loop i, factorised when first asked for."""
        response, loop = self.responses[i], self.loops[i]
        if response is None:
            assert loop is not None
            response = self.responses[i] = Response(loop.A, loop.B, loop.C, loop.D)
        return response

    def height(self, i: int) -> float:
        """The highest peak known of loop i."""
        peaks = self.peaks[i]
        return 0.0 if peaks is None else float(peaks.sigma[0])


class NormOracle:
    r"""The largest H-infinity norm over the plants as a function to minimise.

    .. math:: f(\theta) = \log(\max_i \|T_i(\theta)\|_\infty + \delta)
              + \tfrac{\mu}{2} \log(1 + \|\theta\|^2)

    and infinity where a loop is not Hurwitz. The logarithm tames the huge norms of poor starts; the offset delta
    makes f regular where the norm falls to zero; the guard mu keeps early iterations from infinite gains. A single
    small loop is evaluated by its exact norm; else peaks are tracked and accepted steps tested.

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
        self._small = n == 1 and loops.n_states <= SMALL

    def _value(self, theta: Array, top: float) -> float:
        return float(np.log(max(top, SMALLEST) + self.offset) + 0.5 * self.guard * np.log1p(theta @ theta))

    def _guard_gradient(self, theta: Array) -> Array:
        return np.asarray(self.guard * theta / (1.0 + theta @ theta))

    @staticmethod
    def gamma(point: Point) -> float:
        """The norm at a point; infinite if not stable."""
        return float(point.data.top) if point.data is not None else np.inf

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        """The value; the plants that decided last come first, and end a hopeless trial early."""
        self.budget.evaluations += 1
        n = len(self._order)
        models = Models([None] * n, [None] * n, [None] * n)
        top = 0.0
        if np.max(np.abs(theta), initial=0.0) > LARGEST:
            return Point(theta, np.inf)
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
            models.loops[i] = loop
            try:
                peaks = self._peaks(models, i, top)
            except np.linalg.LinAlgError:
                return Point(theta, np.inf)
            if peaks is None:
                self._promote(rank)
                return Point(theta, np.inf)
            models.peaks[i] = peaks
            if peaks.sigma[0] > top or models.decisive < 0:
                top, models.decisive = float(peaks.sigma[0]), i
            if self._value(theta, top) > cutoff:
                self._promote(rank)
                break
        models.top = top
        return Point(theta, self._value(theta, top), models)

    def _peaks(self, models: Models, i: int, floor: float) -> Peaks | None:
        """Highest peaks of loop i, None if it is not stable."""
        loop = models.loops[i]
        assert loop is not None
        if self._small and loop.A.shape[0]:
            if spectral_abscissa(np.linalg.eigvals(loop.A).astype(complex)) >= 0.0:
                return None
            self.budget.exact += 1
            found = slicot_peak(loop.A, loop.B, loop.C, loop.D)
            if found is not None:
                return Peaks(np.array([found[1]]), np.array([found[0]]))
        response = models.response(i)
        if response.abscissa >= 0.0:
            return None
        extra = np.concatenate([self._hints[i], self._missed[i]])
        return find_peaks(response, extra=extra, fraction=0.98, floor=floor)

    def _promote(self, rank: int) -> None:
        self._order.insert(0, self._order.pop(rank))

    def gradient(self, point: Point) -> Array:
        """Gradient of the logarithm of the highest peak."""
        models: Models = point.data
        i = models.decisive
        peaks, loop = models.peaks[i], models.loops[i]
        assert peaks is not None and loop is not None
        gain = peak_gain(loop, float(peaks.omega[0]), 0.0, 1)
        pulled = self.loops.pullback(point.theta, i, gain.gradient(np.ones(1, dtype=complex)))
        return np.asarray(pulled / (max(gain.sigma[0], SMALLEST) + self.offset) + self._guard_gradient(point.theta))

    def confirm(self, point: Point) -> Point:
        """Level tests on the plants near the maximum and on one more in turn; missed peaks are remembered."""
        models: Models = point.data
        if models.top <= 2.0 * SMALLEST or self._small:
            return point
        known = [i for i, peaks in enumerate(models.peaks) if peaks is not None]
        heights = {i: models.height(i) for i in known}
        top = max(heights.values())
        near = sorted((i for i in known if heights[i] >= NEAR * top), key=lambda i: -heights[i])[:3]
        self._turn = (self._turn + 1) % len(self._order)
        if self._turn in known and self._turn not in near:
            near.append(self._turn)
        for i in near:
            loop, response = models.loops[i], models.response(i)
            assert loop is not None
            self.budget.exact += 1
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

    def cuts(self, point: Point, missed: Sequence[Point] = (), earlier: Sequence[Cut] = ()) -> list[Cut]:
        """Every peak above the fraction, at each the cluster of singular values; missed and earlier frequencies too.

        A peak may merge with its neighbour for a step and part from it in the next one: a model without the second
        peak would step into it again and again.
        """
        models: Models = point.data
        if models.cuts is None:
            models.cuts = self._peak_cuts(point) + self._poles_at_risk(point)
        out = list(models.cuts)
        seen: dict[int, Array] = {}
        for i in range(len(models.loops)):
            seen[i] = np.array([cut.label[1] for cut in out if not cut.hard and cut.label[0] == i])
        wanted = [(cut.label[0], float(cut.label[1])) for cut in earlier if not cut.hard]
        for other in missed:
            if other.data is not None and other.data.decisive >= 0:
                i = other.data.decisive
                wanted += [(i, float(omega)) for omega in other.data.peaks[i].omega[:3]]
        for i, omega in wanted:
            if not np.any(np.isclose(seen[i], omega, rtol=CLOSE, atol=0.0)):
                out += self._cuts_at(point, i, omega, 0.02)
                seen[i] = np.append(seen[i], omega)
        return out

    def _peak_cuts(self, point: Point) -> list[Cut]:
        """Every peak above the fraction, at each the cluster of singular values."""
        models: Models = point.data
        floor = self.fraction * models.top
        out: list[Cut] = []
        for i, known in enumerate(models.peaks):
            assert known is not None
            if known.sigma[0] < floor:
                continue
            extra = np.concatenate([self._hints[i], self._missed[i], known.omega])
            peaks = find_peaks(models.response(i), extra=extra, fraction=0.0, floor=floor)
            for omega in peaks.omega:
                out += self._cuts_at(point, i, float(omega), self.cluster)
            if self._small:  # among many plants the others' peaks do the same, and plateaus would multiply the cuts
                for omega in plateau(models.response(i), peaks.omega, FLAT * models.top):
                    out += self._cuts_at(point, i, float(omega), 0.02)
        return out

    def _cuts_at(self, point: Point, plant: int, omega: float, cluster: float) -> list[Cut]:
        return cluster_at(
            peak_gain(point.data.loops[plant], omega, cluster, MOST),
            self.loops,
            point.theta,
            plant,
            label=lambda c: (plant, omega, c),
            offset=self.offset,
            height=0.5 * self.guard * float(np.log1p(point.theta @ point.theta)),
            ascent=self._guard_gradient(point.theta),
        ).cuts()

    def _poles_at_risk(self, point: Point) -> list[Cut]:
        """Poles near the axis: a step may use nine tenths of their distance."""
        models: Models = point.data
        out = []
        for i, loop in enumerate(models.loops):
            response = models.response(i)
            assert loop is not None
            if response.left is None or response.right is None:
                continue
            poles = response.poles
            risky = np.flatnonzero((poles.imag >= 0.0) & (-poles.real < OFF_AXIS * np.abs(poles) + SLOW * self._scale))
            for k in risky[np.argsort(-poles.real[risky])][:4]:
                G = np.outer(response.left[k] @ loop.Bi, loop.Ci @ response.right[:, k]).real
                gradient = self.loops.pullback(point.theta, i, G) / -poles[k].real
                out.append(Cut(-0.9, gradient, (i, complex(poles[k])), hard=True))
        return out

    def hessians(self, point: Point, cuts: Sequence[Cut]) -> Array | None:
        """Exact Hessians of the logarithms of peaks; zero for hard cuts, and the guard is left out."""
        models: Models = point.data
        n = point.theta.size
        out = np.zeros((len(cuts), n, n))
        for k, cut in enumerate(cuts):
            if cut.hard:
                continue
            plant, omega, c = cut.label
            key = (plant, omega, c.tobytes())
            if key in models.hessians:
                out[k] = models.hessians[key]
                continue
            loop = models.loops[plant]
            assert loop is not None
            dK = self.loops.directions(point.theta, plant)
            part, G = log_gain_hessian(loop, omega, c, dK, self.offset)
            out[k] = models.hessians[key] = part + self.loops.bend(point.theta, plant, G)
        return out

    def metric(self, point: Point) -> Array | None:
        """How far a step moves the loops near the maximum, see `loop_metric`."""
        models: Models = point.data
        out = np.zeros((point.theta.size, point.theta.size))
        for i, peaks in enumerate(models.peaks):
            loop = models.loops[i]
            if peaks is None or loop is None or models.height(i) < NEAR * models.top:
                continue
            dK = self.loops.directions(point.theta, i)
            out += loop_metric(loop, models.response(i), peaks.omega, dK, self._scale)
        return out

    def exact(self, theta: Array) -> list[NormResult]:
        """The exact norm of every plant's loop, by the controller that `theta` gives."""
        out = []
        for i, (factory, K) in enumerate(zip(self.loops.factories, self.loops.gains(theta), strict=True)):
            loop = factory.close(K)
            self.budget.exact += 1
            if loop is None:
                out.append(NormResult(norm=np.inf, omega=np.nan))
            else:
                hints = np.concatenate([self._hints[i], self._missed[i]])
                out.append(exact_norm(loop.A, loop.B, loop.C, loop.D, hints=hints))
        return out
