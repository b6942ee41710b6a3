"""An objective and constraints as one function for the minimisers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.goals.goal_oracle import GoalOracle
from lpvhinf.hinfstruct.problem import Cut, Family, Oracle, Point

#: Constraints whose level is below this are no cuts where they are hard.
FAR = -1.0


@dataclass(slots=True, eq=False)
class Parts:
    """The objective's and the constraints' points; None where it was not evaluated."""

    objective: Point | None
    constraint: Point | None


@dataclass(frozen=True, slots=True, eq=False)
class _RenamedFamily:
    """The cuts of a family as those of one part."""

    family: Family
    rename: Callable[[Cut], Cut]

    def best(self, d: Array) -> Cut:
        """The one that is the largest, to first order, after the step d."""
        cut = self.rename(self.family.best(d))
        cut.family = self
        return cut


def _renamed(cuts: Sequence[Cut], rename: Callable[[Cut], Cut]) -> list[Cut]:
    families: dict[int, _RenamedFamily] = {}
    out = []
    for cut in cuts:
        new = rename(cut)
        if cut.family is not None:
            new.family = families.setdefault(id(cut.family), _RenamedFamily(cut.family, rename))
        out.append(new)
    return out


class CombinedOracle:
    r"""An objective f and constraints g <= 0, softly or hard.

    .. math:: \max(f(\theta) - level,\; g(\theta)) \qquad\text{or, hard,}\qquad
              f(\theta) - level \;\text{ where } g(\theta) \le slack, \text{ else infinity}

    With the soft function, and the level at the smallest f that is feasible, the minimum is zero;
    `minimise_constrained` finds that level. For objectives that are logarithms of norms the soft function is
    :math:`\log \max(\text{norm}/\gamma, \text{constraint}/at\_most)`. In the hard form constraints are hard cuts.

    Parameters
    ----------
    objective : Oracle
        Such as `NormOracle`, or a `GoalOracle` of a goal without bound.
    constraints : GoalOracle
    level : float
    hard : bool
    slack : float
        Level of the constraints that still counts as feasible in the hard form.
    """

    def __init__(
        self,
        objective: Oracle,
        constraints: GoalOracle,
        *,
        level: float = 0.0,
        hard: bool = False,
        slack: float = 0.0,
    ) -> None:
        self.objective, self.constraints = objective, constraints
        self.level, self.hard, self.slack = level, hard, slack

    def _value(self, objective: float, constraint: float) -> float:
        if self.hard:
            return objective - self.level if constraint <= self.slack else np.inf
        return max(objective - self.level, constraint)

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        """The value; constraints first, and the objective only where they allow it."""
        constraint = self.constraints.evaluate(theta, self.slack if self.hard else cutoff)
        if constraint.value > (self.slack if self.hard else cutoff):
            return Point(theta, np.inf if self.hard else constraint.value, Parts(None, constraint))
        objective = self.objective.evaluate(theta, cutoff + self.level)
        return Point(theta, self._value(objective.value, constraint.value), Parts(objective, constraint))

    def confirm(self, point: Point) -> Point:
        """The point with both parts checked by exact means."""
        parts: Parts = point.data
        if parts.objective is None or parts.constraint is None or not np.isfinite(parts.objective.value):
            return point
        parts.objective, parts.constraint = (
            self.objective.confirm(parts.objective),
            self.constraints.confirm(parts.constraint),
        )
        point.value = self._value(parts.objective.value, parts.constraint.value)
        return point

    def gradient(self, point: Point) -> Array:
        """Gradient of the part that is the maximum."""
        parts: Parts = point.data
        assert parts.objective is not None and parts.constraint is not None
        if self.hard or parts.objective.value - self.level >= parts.constraint.value:
            return self.objective.gradient(parts.objective)
        return self.constraints.gradient(parts.constraint)

    def cuts(self, point: Point, missed: Sequence[Point] = (), earlier: Sequence[Cut] = ()) -> list[Cut]:
        """Cuts of both parts; those of the constraints are hard in the hard form."""
        parts: Parts = point.data
        assert parts.objective is not None and parts.constraint is not None
        others: list[Parts] = [other.data for other in missed if other.data is not None]
        before = [[cut.label[1] for cut in earlier if cut.label[0] == name] for name in ("objective", "constraint")]
        objective = self.objective.cuts(
            parts.objective,
            [o.objective for o in others if o.objective is not None and o.objective.data is not None],
            before[0],
        )
        lowest = FAR if self.hard else min(parts.constraint.value, point.value) - 0.5
        constraint = self.constraints.cuts(
            parts.constraint,
            [o.constraint for o in others if o.constraint is not None and o.constraint.data is not None],
            before[1],
            lowest,
        )
        return _renamed(objective, self._of_objective) + _renamed(constraint, self._of_constraint)

    def _of_objective(self, cut: Cut) -> Cut:
        value = cut.value - (0.0 if cut.hard else self.level)
        return Cut(value, cut.gradient, ("objective", cut), cut.hard)

    def _of_constraint(self, cut: Cut) -> Cut:
        value = min(cut.value, 0.0) if self.hard else cut.value
        return Cut(value, cut.gradient, ("constraint", cut), self.hard)

    def hessians(self, point: Point, cuts: Sequence[Cut]) -> Array | None:
        """Hessians by both parts; None if one has none."""
        parts: Parts = point.data
        out = np.zeros((len(cuts), point.theta.size, point.theta.size))
        both = (("objective", self.objective, parts.objective), ("constraint", self.constraints, parts.constraint))
        for name, oracle, own in both:
            places = [k for k, cut in enumerate(cuts) if cut.label[0] == name]
            if not places:
                continue
            assert own is not None
            found = oracle.hessians(own, [cuts[k].label[1] for k in places])
            if found is None:
                return None
            out[places] = found
        return out

    def metric(self, point: Point) -> Array | None:
        """The sum of both metrics; None if neither has one."""
        parts: Parts = point.data
        assert parts.objective is not None and parts.constraint is not None
        found = [self.objective.metric(parts.objective), self.constraints.metric(parts.constraint)]
        known = [M for M in found if M is not None]
        return np.asarray(np.sum(known, axis=0)) if known else None
