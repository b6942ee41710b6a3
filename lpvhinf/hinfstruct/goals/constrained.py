"""Minimise an objective under constraints, from a stabilising controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.hinfstruct.bundle import bundle
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.goals.combined import CombinedOracle, Parts
from lpvhinf.hinfstruct.goals.descriptions import Goal
from lpvhinf.hinfstruct.goals.goal_oracle import GoalOracle
from lpvhinf.hinfstruct.oracle import NormOracle
from lpvhinf.hinfstruct.problem import Budget, Oracle, Point
from lpvhinf.hinfstruct.quasi_newton import bfgs
from lpvhinf.hinfstruct.subproblem import shortest_combination

#: Relative distance from their bounds at which constraints are held while minimising.
MARGIN = 1e-6
#: Parts within this distance of the maximum count as active in the optimality measure.
ACTIVE = 1e-4
#: Largest optimality measure at which constraints count as infeasible.
STATIONARY = 1e-2


@dataclass(frozen=True, kw_only=True, eq=False)
class ConstrainedDescent:
    r"""Where a constrained minimisation ended.

    Attributes
    ----------
    theta : (n_parameters,)
    objective : float
        Value of the objective (a logarithm, for norms).
    violation : float
        Largest level of the constraints; not above zero where all are met.
    optimality : float
        Length of the shortest convex combination of the gradients of the active parts of objective and constraints:
        zero at a Karush-Kuhn-Tucker point (Fritz John form).
    multipliers : (n_constraints,)
        Weights of the constraints there, relative to that of the objective: to first order the logarithm of the
        optimum falls by this much for each relative unit by which a bound is raised.
    reason : str
    rounds : int
        Levels that were tried.
    """

    theta: Array
    objective: float
    violation: float
    optimality: float
    multipliers: Array
    reason: str
    rounds: int

    @property
    def feasible(self) -> bool:
        """True if all constraints are met."""
        return self.violation <= 0.0


def objective_oracle(goal: Goal | None, loops: ClosedLoops, budget: Budget) -> Oracle:
    """The function to minimise: a goal without bound, or the norm of the whole loop if there is none."""
    return NormOracle(loops, budget) if goal is None else GoalOracle([goal], loops, budget)


def minimise_constrained(
    objective: Oracle,
    constraints: GoalOracle,
    theta: Array,
    budget: Budget,
    *,
    rounds: int = 10,
    max_iterations: int = 300,
    tolerance: float = 1e-6,
    accepted: Callable[[Point], None] | None = None,
) -> ConstrainedDescent:
    r"""Minimise f subject to g <= 0 from a theta where both are finite; it need not be feasible.

    With :math:`h(\ell) = \min_\theta \max(f(\theta) - \ell, g(\theta))` the constrained minimum is the root of h, and
    :math:`h'(\ell) = -\lambda_f`, the multiplier of the objective: Newton's method on the level finds it in a few
    rounds, each an unconstrained minimisation of a maximum by BFGS (in the first two rounds) and the bundle method. At
    last the bundle method runs with the constraints as hard cuts from the best feasible point.

    Parameters
    ----------
    objective : Oracle
        See `objective_oracle`.
    constraints : GoalOracle
        With a small `margin`, such as MARGIN, so that the result is feasible to the last digit.
    theta : (n_parameters,)
        Stabilises every plant.
    budget : Budget
    rounds : int
        Most levels that are tried.
    max_iterations : int
        Of each minimisation.
    tolerance : float
        Relative accuracy of the minimum.
    accepted : callable, optional
        Hears every accepted point of the combined function; its `data` holds `Parts`.

    References
    ----------
    Apkarian, Noll and Rondepierre (2008), SIAM Journal on Control and Optimization 47, 1516-1546.
    """
    first = objective.evaluate(theta)
    level = first.value
    share = 1.0
    best: Point | None = None
    reason, done = "round limit", 0
    shares = np.zeros(len(constraints.goals))
    optimality = np.inf
    if not np.isfinite(level):
        return _ended(theta, np.inf, np.inf, np.inf, shares, "not stabilising", 0)
    last = theta
    for done in range(1, rounds + 1):
        soft = CombinedOracle(objective, constraints, level=level)
        point = soft.confirm(soft.evaluate(last))
        if not np.isfinite(point.value):
            return _ended(theta, np.inf, np.inf, np.inf, shares, "not stabilising", done)
        if done <= 2:
            run = bfgs(soft, point, budget, max_iterations=max_iterations, tolerance=1e-3, accepted=accepted)
            point = run.point
        run = bundle(soft, point, budget, max_iterations=max_iterations, tolerance=0.1 * tolerance, accepted=accepted)
        point, last = run.point, run.point.theta
        best = _better(best, point, constraints.margin)
        optimality, share, shares = _stationarity(soft, point)
        if budget.spent:
            reason = "time limit"
            break
        if share < 1e-3 and point.value > tolerance and optimality < STATIONARY:
            reason = "infeasible: constraints are at a local minimum of their violation"
            break
        if abs(point.value) <= tolerance:
            reason = "converged"
            break
        # Newton on the level; a distance of a factor ten at most
        level += float(np.clip(point.value / max(share, 0.02), -2.3, 2.3))
    if best is None:
        parts: Parts = point.data
        assert parts.objective is not None and parts.constraint is not None
        violation = parts.constraint.value - constraints.margin
        return _ended(last, parts.objective.value, violation, optimality, shares, reason, done)
    assert best.data.objective is not None
    hard = CombinedOracle(
        objective, constraints, level=best.data.objective.value, hard=True, slack=0.5 * constraints.margin
    )
    start = hard.confirm(hard.evaluate(best.theta))
    if np.isfinite(start.value) and not budget.spent:
        run = bundle(hard, start, budget, max_iterations=max_iterations, tolerance=tolerance, accepted=accepted)
        best = _better(best, run.point, constraints.margin) or best
    parts = best.data
    assert parts.objective is not None and parts.constraint is not None
    value = parts.objective.value
    at_best = CombinedOracle(objective, constraints, level=value)
    here = at_best.confirm(at_best.evaluate(best.theta))
    optimality, _, shares = _stationarity(at_best, here)
    return _ended(best.theta, value, here.data.constraint.value - constraints.margin, optimality, shares, reason, done)


def _better(best: Point | None, point: Point, margin: float) -> Point | None:
    """The feasible one with the smaller objective."""
    parts: Parts = point.data
    if parts.objective is None or parts.constraint is None or parts.constraint.value > 0.5 * margin:
        return best
    if best is None or parts.objective.value < best.data.objective.value:
        return point
    return best


def _stationarity(oracle: CombinedOracle, point: Point) -> tuple[float, float, Array]:
    """Optimality, the weight of the objective, and those of the constraints relative to it."""
    cuts = [cut for cut in oracle.cuts(point) if not cut.hard and cut.value >= point.value - ACTIVE]
    length, weights = shortest_combination(np.array([cut.gradient for cut in cuts]))
    shares = np.zeros(len(oracle.constraints.goals))
    share = 0.0
    for cut, weight in zip(cuts, weights, strict=True):
        if cut.label[0] == "objective":
            share += float(weight)
        else:
            shares[oracle.constraints.goal_of(cut.label[1])] += weight
    return length, share, shares / share if share > 0.0 else shares


def _ended(
    theta: Array, objective: float, violation: float, optimality: float, shares: Array, reason: str, rounds: int
) -> ConstrainedDescent:
    return ConstrainedDescent(
        theta=read_only(theta),
        objective=objective,
        violation=violation,
        optimality=optimality,
        multipliers=read_only(shares),
        reason=reason,
        rounds=rounds,
    )
