"""From a stabilising outcome to one that meets hard constraints or minimises another objective."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct.bundle import bundle
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.goals import MARGIN, Goal, GoalOracle, GoalValue, minimise_constrained, objective_oracle
from lpvhinf.hinfstruct.oracle import NormOracle
from lpvhinf.hinfstruct.problem import Budget
from lpvhinf.hinfstruct.quasi_newton import bfgs
from lpvhinf.hinfstruct.runs import Outcome


@dataclass(frozen=True, kw_only=True, eq=False)
class Met:
    """What became of one outcome.

    Attributes
    ----------
    outcome : Outcome
        With the new parameters.
    value : float
        The objective, recomputed exactly.
    constraints : tuple of GoalValue
        Every constraint, recomputed exactly.
    """

    outcome: Outcome
    value: float
    constraints: tuple[GoalValue, ...]

    @property
    def violation(self) -> float:
        """The largest level; above zero where a constraint is not met."""
        return max((c.level for c in self.constraints), default=-np.inf)

    @property
    def feasible(self) -> bool:
        """Whether the loop is stable and every constraint is met."""
        return bool(np.isfinite(self.value) and self.violation <= 0.0)

    @property
    def message(self) -> str:
        """The constraints that are not met, with their values."""
        parts = [
            f"constraints[{k}] reaches {c.value:.6g} on plants[{c.plant}], {100 * np.expm1(c.level):.3g} % too much"
            for k, c in enumerate(self.constraints)
            if c.level > 0.0
        ]
        return "; ".join(parts) + ". Relax the bounds, give the controller more freedom, or raise starts."


def check_goals(constraints: Sequence[Goal], objective: Goal | None) -> None:
    """Constraints need a bound, an objective must not have one.

    Raises
    ------
    DomainError
        If an object is no goal, or its bound is missing or too many.
    """
    for k, goal in enumerate(constraints):
        if not isinstance(goal, Goal):
            raise DomainError(f"constraints[{k}] is a {type(goal).__name__}, wanted a goal such as ChannelNorm.")
        if hasattr(goal, "at_most") and goal.at_most is None:
            raise DomainError(f"constraints[{k}] has no bound. Give at_most.")
    if objective is None:
        return
    if not isinstance(objective, Goal):
        raise DomainError(f"objective is a {type(objective).__name__}, wanted a goal such as H2Norm, or None.")
    if getattr(objective, "at_most", 0.0) is not None:
        raise DomainError("objective has a bound or cannot be minimised, wanted a norm without at_most.")


def meet_goals(
    outcome: Outcome,
    loops: ClosedLoops,
    constraints: Sequence[Goal],
    objective: Goal | None,
    deadline: float,
    max_iterations: int,
) -> Met:
    """Go on from a stabilising outcome under constraints, or for another objective."""
    budget = Budget(deadline=deadline)
    target = objective_oracle(objective, loops, budget)
    if constraints:
        limits = GoalOracle(constraints, loops, Budget(), margin=MARGIN)
        run = minimise_constrained(target, limits, outcome.theta, budget, max_iterations=min(max_iterations, 300))
        theta, optimality, reason = run.theta, run.optimality, run.reason
    else:
        start = target.confirm(target.evaluate(outcome.theta))
        descent = bfgs(target, start, budget, max_iterations=max_iterations, tolerance=1e-3)
        descent = bundle(target, descent.point, budget, max_iterations=max_iterations)
        theta, optimality, reason = descent.point.theta, descent.optimality, descent.reason
    values = tuple(GoalOracle(constraints, loops, Budget()).exact(theta)) if constraints else ()
    return Met(
        outcome=replace(outcome, theta=theta, optimality=optimality, reason=reason),
        value=_exact_objective(objective, loops, theta),
        constraints=values,
    )


def _exact_objective(objective: Goal | None, loops: ClosedLoops, theta: Array) -> float:
    if objective is not None:
        return float(GoalOracle([objective], loops, Budget()).exact(theta)[0].value)
    return max(norm.norm for norm in NormOracle(loops, Budget()).exact(theta))
