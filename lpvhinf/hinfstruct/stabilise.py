"""Parameters that stabilise every plant: minimise the largest real part of the closed-loop poles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.bundle import bundle
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.oracle import Budget, Cut, Point
from lpvhinf.hinfstruct.quasi_newton import Descent, bfgs
from lpvhinf.hinfstruct.response import Complex


class AbscissaOracle:
    r"""The largest real part of the closed-loop poles over the plants.

    With left and right eigenvectors w and v of a simple pole its derivative with
    respect to the augmented gain is :math:`\mathrm{Re}\,(w^* B_i)^T (C_i v)^T / (w^* v)`. At a
    nearly defective pole :math:`w^* v` vanishes; it is then bounded from below, which
    keeps the direction and limits the length.

    Parameters
    ----------
    loops : ClosedLoops
    budget : Budget
    """

    def __init__(self, loops: ClosedLoops, budget: Budget) -> None:
        self.loops, self.budget = loops, budget

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        """The value; infinite if a loop is not well posed."""
        self.budget.evaluations += 1
        closed: list[tuple[ClosedLoop, Complex]] = []
        value = -np.inf
        with np.errstate(over="ignore", invalid="ignore"):
            gains = self.loops.gains(theta)
        for factory, K in zip(self.loops.factories, gains, strict=True):
            loop = factory.close(K) if np.all(np.isfinite(K)) else None
            if loop is None or not np.all(np.isfinite(loop.A)):
                return Point(theta, np.inf)
            poles = np.linalg.eigvals(loop.A).astype(complex)
            closed.append((loop, poles))
            value = max(value, float(np.max(poles.real, initial=-np.inf)))
            if value > cutoff:
                break
        return Point(theta, value, closed)

    def confirm(self, point: Point) -> Point:
        """The point: its value is exact already."""
        return point

    def gradient(self, point: Point) -> Array:
        """Gradient of the rightmost pole."""
        return self._gradients(point, 0.0, 1)[0].gradient

    def cuts(self, point: Point, missed: Sequence[Point] = (), earlier: Sequence[Cut] = ()) -> list[Cut]:
        """The poles within a tenth of the spread behind the rightmost one."""
        spread = max(1e-6, 0.1 * abs(point.value))
        return self._gradients(point, spread, 6)

    def hessians(self, point: Point, cuts: Sequence[Cut]) -> Array | None:
        """Not available."""
        return None

    def metric(self, point: Point) -> Array | None:
        """Not available."""
        return None

    def _gradients(self, point: Point, spread: float, most: int) -> list[Cut]:
        found: list[tuple[float, int, complex]] = []
        for i, (_, poles) in enumerate(point.data):
            upper = poles[(poles.imag >= 0.0) & (poles.real >= point.value - spread)]
            found += [(float(pole.real), i, complex(pole)) for pole in upper]
        found.sort(key=lambda item: -item[0])
        return [self._pole_cut(point, i, point.data[i][0], pole) for _, i, pole in found[:most]]

    def _pole_cut(self, point: Point, plant: int, loop: ClosedLoop, pole: complex) -> Cut:
        poles, W, V = scipy.linalg.eig(loop.A, left=True, right=True)
        k = int(np.argmin(np.abs(poles - pole)))
        w, v = W[:, k], V[:, k]
        product = np.vdot(w, v)
        if abs(product) < 1e-8:
            product = 1e-8 * (product / abs(product) if product != 0.0 else 1.0)
        G = (np.outer(w.conj() @ loop.Bi, loop.Ci @ v) / product).real
        return Cut(float(poles[k].real), self.loops.pullback(point.theta, plant, G), (plant, pole))


def stabilise(
    loops: ClosedLoops,
    theta: Array,
    budget: Budget,
    *,
    margin: float,
    max_iterations: int = 300,
    accepted: Callable[[Point], None] | None = None,
) -> Descent:
    """Move theta until every closed-loop pole is left of -margin; BFGS first, then cuts of several poles."""
    oracle = AbscissaOracle(loops, budget)
    start = oracle.evaluate(theta)
    if not np.isfinite(start.value):
        return Descent(start, "not well posed", 0)
    run = bfgs(
        oracle,
        start,
        budget,
        max_iterations=max_iterations,
        tolerance=1e-6,
        window=40,
        target=-margin,
        accepted=accepted,
    )
    if run.point.value >= -margin and not budget.spent:
        run = bundle(oracle, run.point, budget, max_iterations=60, target=-margin, accepted=accepted)
    return run
