"""Trust-region bundle / SQP: minimise the largest of several cuts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.cut_model import CutModel
from lpvhinf.hinfstruct.metric import unit_steps
from lpvhinf.hinfstruct.problem import Budget, Cut, Oracle, Point
from lpvhinf.hinfstruct.quasi_newton import Descent

#: First radius of the trust region, in unit steps of the metric.
FIRST_RADIUS = 1.0
#: Accepted steps for which cuts that decided are remembered.
MEMORY = 3
#: Iterations without a gain of the tolerance in all after which the polish ends.
PATIENCE = 12
#: Parts of the radius that are tried before a model is given up.
SHRINK = (1.0, 0.1, 0.01, 1e-3)
#: A step that gains less than this part of what straight cuts promise within the same radius is defeated by curvature;
#: to look for a better radius is `thorough`, and dear where there are many plants and parameters.
DEFEAT = 0.05


def bundle(
    oracle: Oracle,
    start: Point,
    budget: Budget,
    *,
    max_iterations: int = 150,
    tolerance: float = 1e-7,
    target: float = -np.inf,
    radius: float | None = None,
    thorough: bool = False,
    accepted: Callable[[Point], None] | None = None,
) -> Descent:
    r"""Polish a minimiser of a maximum of smooth functions.

    Each step minimises the largest of the quadratic cuts over a trust region: Newton's method along the kink. The
    region is a box in unit steps of the oracle's metric, so that it does not depend on units and gains. After a
    failed step the functions that decided there join the cuts. The optimality measure is the length of
    the shortest convex combination of the gradients of the cuts within 1e-4 of the maximum.

    References
    ----------
    Apkarian and Noll (2006), IEEE Transactions on Automatic Control 51, 71-86;
    Apkarian, Noll and Prot (2008), SIAM Journal on Optimization 19, 281-306.
    """
    point = start
    n = point.theta.size
    F: Array | None = None
    radius = FIRST_RADIUS if radius is None else radius
    missed: list[Point] = []
    earlier: list[list[Cut]] = []
    slow = 0
    level, since = start.value, 0
    model: CutModel | None = None
    for iteration in range(max_iterations):
        cuts = oracle.cuts(point, missed, [cut for step in earlier for cut in step])
        # a peak that only the search for cuts has found
        point.value = max(point.value, max(cut.value for cut in cuts if not cut.hard))
        model = CutModel(
            oracle, point, cuts, members=[] if model is None or model.point is not point else model.members
        )
        optimality, weights = model.optimality()
        if point.value < target:
            return Descent(point, "target reached", iteration, optimality)
        if budget.spent:
            return Descent(point, "time limit", iteration, optimality)
        if point.value < level - tolerance:
            level, since = point.value, iteration
        if iteration - since >= PATIENCE:
            return Descent(point, "converged", iteration, optimality)
        if F is None:
            M = oracle.metric(point)
            size = max(1.0, float(np.linalg.norm(point.theta, np.inf)))
            F = size * np.eye(n) if M is None else unit_steps(M)
        model.F = F
        step, part = None, 1.0
        for shrink in SHRINK:
            # curvature far larger than the decrease may defeat the model of a large region
            found = model.step(weights, shrink * radius)
            if found is not None and (step is None or found.decrease > step.decrease):
                step, part = found, shrink
            if step is not None and step.decrease > max(1e-2 * tolerance, DEFEAT * model.straight_decrease * thorough):
                break
        if step is None or step.decrease <= 1e-2 * tolerance:
            return Descent(point, "no predicted decrease", iteration, optimality)
        radius *= part
        trial = oracle.evaluate(point.theta + F @ step.step, point.value - 0.01 * step.decrease)
        if trial.value <= point.value - 0.01 * step.decrease:
            trial = oracle.confirm(trial)
        ratio = (point.value - trial.value) / step.decrease
        length = float(np.max(np.abs(step.step)))
        if ratio >= 0.01:
            growing = ratio > 0.7 and length > 0.8 * radius
            # a small step that the region held back says nothing about convergence
            slow = slow + 1 if point.value - trial.value < tolerance and not growing else 0
            # cuts that joined for a smaller radius come last, and have no multiplier
            deciding = [cut for cut, w in zip(model.cuts, step.multipliers, strict=False) if w > 1e-3]
            earlier = [*earlier, deciding][-MEMORY:]
            point, missed, F = trial, [], None
            if accepted is not None:
                accepted(point)
            if growing:
                radius *= 2.5
            elif ratio < 0.2:
                radius *= 0.5
            if slow >= 5:
                return Descent(point, "converged", iteration + 1, optimality)
        else:
            missed = [*missed, trial][-4:]
            radius = 0.3 * length
            if radius < 1e-10:
                return Descent(point, "trust region vanished", iteration, optimality)
    return Descent(point, "iteration limit", max_iterations, optimality, radius)
