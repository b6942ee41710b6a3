"""The model of a maximum of smooth functions around a point: quadratic cuts, completed by members of their families."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.problem import Cut, Family, Oracle, Point
from lpvhinf.hinfstruct.subproblem import Subproblem, curved_step, quadratic_model, shortest_combination

#: Cuts this close to the maximum are active.
ACTIVE = 1e-4
#: Cuts lower than this multiple of the decrease of the linear model count as straight.
MET = 3.0
#: Rounds in which curvature and members of families join, and what change of the prediction, relatively, is worth one.
ROUNDS, WORTH = 12, 0.05


class CutModel:
    """Cuts at a point, their curvature in unit steps, and what follows from them.

    Attributes
    ----------
    cuts : list of Cut
        Those of the oracle, and members of families that have mattered.
    members : list of Cut
        The latter.
    F : (n, n)
        Columns are unit steps.
    straight_decrease : float
        What straight cuts promised within the radius of the last step.
    """

    def __init__(self, oracle: Oracle, point: Point, cuts: Sequence[Cut], members: Sequence[Cut] = ()) -> None:
        self.oracle, self.point, self.members = oracle, point, list(members)
        self.cuts = [*cuts, *members]
        n = point.theta.size
        self.F = np.eye(n)
        self.straight_decrease = 0.0
        self._bent: list[int] = []
        self._H = self._room = np.zeros((0, n, n))
        self._gather()

    def _gather(self) -> None:
        self.G = np.array([cut.gradient for cut in self.cuts])
        self.hard = np.array([cut.hard for cut in self.cuts])
        values = np.array([cut.value for cut in self.cuts]) - np.where(self.hard, 0.0, self.point.value)
        self.values = np.minimum(values, 0.0)

    def _families(self, which: NDArray[np.intp]) -> list[Family]:
        found = {id(f): f for f in (self.cuts[k].family for k in which) if f is not None}
        return list(found.values())

    def _join(self, cuts: Sequence[Cut]) -> None:
        self.members += cuts
        self.cuts += cuts
        self._gather()

    def optimality(self) -> tuple[float, Array]:
        """Length of the shortest convex combination of active gradients, families included, and the weights (m,)."""
        for _ in range(ROUNDS):
            active = np.flatnonzero(~self.hard & (self.values >= -ACTIVE))
            length, weights = shortest_combination(self.G[active])
            d = -(weights @ self.G[active])
            steepest = float(np.max(self.G[active] @ d))
            members = [family.best(ACTIVE * d / max(length, 1e-300)) for family in self._families(active)]
            new = [
                cut
                for cut in members
                if cut.gradient @ d > steepest + WORTH * length**2 and cut.value >= self.point.value - ACTIVE
            ]
            if not new:
                break
            self._join(new)
        out = np.zeros(len(self.cuts))
        out[active] = weights
        return length, out

    def step(self, weights: Array, radius: float) -> Subproblem | None:
        """The step that minimises the model within the radius.

        At first all cuts are straight. The curvature of those that then decide joins, and the members of families
        that lie above them, until neither matters: both are far too many to have all of them.
        """
        n = self.F.shape[1]
        found = linear = quadratic_model(self.values, self.G @ self.F, self.hard, 1e-9 * np.eye(n), radius)
        self.straight_decrease = 0.0 if linear is None else linear.decrease
        if linear is None:
            return None
        depth = MET * linear.decrease
        for _ in range(ROUNDS):
            if found is None:
                return None
            weights = found.multipliers
            if not self._complete(found, depth) and found is not linear:
                return found
            weights = np.append(weights, np.zeros(len(self.cuts) - weights.size))
            found = curved_step(self.values, self.G @ self.F, self._H, self._bent, self.hard, weights, radius)
        return found

    def _complete(self, found: Subproblem, depth: float) -> bool:
        """Add what would change the prediction for a step; True if there was anything."""
        d = self.F @ found.step
        after = self.values + self.G @ d
        low, deciding = -(1.0 - WORTH) * found.decrease, -(1.0 + WORTH) * found.decrease
        bends = 0.5 * (self._H @ found.step) @ found.step if found.bends is None else found.bends
        reach = after + max(0.0, float(np.max(bends, initial=0.0)))
        near = ~self.hard & (self.values >= -max(depth, ACTIVE))
        straight = np.setdiff1d(np.flatnonzero(near & (reach > deciding)), self._bent)
        if straight.size:
            H = self.oracle.hessians(self.point, [self.cuts[k] for k in straight])
            if H is None or not np.all(np.isfinite(H)):
                return False
            self._add(self.F.T @ H @ self.F)
            self._bent += [int(k) for k in straight]
        members = (family.best(d) for family in self._families(np.flatnonzero(~self.hard)))
        new = [cut for cut in members if cut.value - self.point.value + cut.gradient @ d > low]
        # a member that is there already would come back for ever
        new = [cut for cut in new if cut.value - self.point.value + cut.gradient @ d > self._family_top(cut, after)]
        self._join(new)
        return bool(straight.size or new)

    def _add(self, H: Array) -> None:
        """Append Hessians (k, n, n); the room doubles, as copying all of them each time costs more than using them."""
        count, size = len(self._H), len(self._H) + len(H)
        if size > len(self._room):
            self._room = np.concatenate([self._H, np.empty((size, *H.shape[1:]))])
        self._room[count:size] = H
        self._H = self._room[:size]

    def _family_top(self, member: Cut, after: Array) -> float:
        """The highest value after the step of the cuts of the same family, with a margin for round-off."""
        same = [float(after[k]) for k, cut in enumerate(self.cuts) if cut.family is member.family]
        return max(same) + 1e-3 * abs(max(same)) + 1e-12
