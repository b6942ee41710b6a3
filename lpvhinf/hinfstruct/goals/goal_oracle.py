"""The largest level of several goals over several plants, as a function for the minimisers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.cluster import cluster_at
from lpvhinf.hinfstruct.goals.descriptions import ChannelNorm, ClosedLoopPoles, FrequencyBand, Goal, H2Norm
from lpvhinf.hinfstruct.goals.gain import GainEvaluator
from lpvhinf.hinfstruct.goals.h2 import ZERO, H2Evaluator
from lpvhinf.hinfstruct.goals.poles import PolesEvaluator
from lpvhinf.hinfstruct.goals.state import Evaluator, GoalValue, LoopState, Measure, RawCut
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.metric import loop_metric
from lpvhinf.hinfstruct.problem import Budget, Cut, Point
from lpvhinf.hinfstruct.response import Response

#: Parts of goals whose level is so far below the largest are no cuts.
SPREAD = 0.5
#: Goals whose level is so far below the largest are not tested by exact means at accepted steps.
NEAR = 0.1


@dataclass(slots=True, eq=False)
class _Task:
    """One goal on one plant."""

    goal: int
    plant: int
    evaluator: Evaluator


@dataclass(slots=True, eq=False)
class _Levels:
    """What is known of the goals at a point."""

    states: dict[int, LoopState]
    measures: list[Measure | None]
    decisive: int = -1


class GoalOracle:
    r"""The largest level of goals, :math:`\max_j g_j(\theta)`, zero where all of them are just met.

    For norms the level is :math:`\log(\text{norm} / at\_most)`, for poles see `PolesEvaluator`. It is infinite where a
    loop is not Hurwitz. It is an `Oracle`: alone it serves to meet goals or to minimise one; beside an objective
    it holds the constraints (`CombinedOracle`).

    Parameters
    ----------
    goals : sequence of Goal
    loops : ClosedLoops
    budget : Budget
    margin : float
        Added to every level: goals are then met with a relative margin of this size.

    Raises
    ------
    DomainError
        If there is no goal, or an object is not one.
    DimensionError
        If a goal names plants or channels that do not exist.
    AssumptionError
        If the channel of an H2 norm has a feed-through.
    """

    def __init__(self, goals: Sequence[Goal], loops: ClosedLoops, budget: Budget, *, margin: float = 0.0) -> None:
        self.goals, self.loops, self.budget, self.margin = tuple(goals), loops, budget, margin
        if not self.goals:
            raise DomainError("goals is empty, wanted at least one goal.")
        sample = self._samples()
        self._tasks: list[_Task] = []
        for number, goal in enumerate(self.goals):
            if not isinstance(goal, Goal):
                raise DomainError(
                    f"goals[{number}] is {type(goal).__name__}, wanted ChannelNorm, FrequencyBand, ClosedLoopPoles "
                    "or H2Norm."
                )
            for plant in goal.used_plants(len(loops.factories)):
                evaluator = _evaluator(goal, sample[0][plant])
                if isinstance(evaluator, H2Evaluator):
                    _check_feedthrough(number, plant, evaluator, [each[plant] for each in sample])
                self._tasks.append(_Task(number, plant, evaluator))
        self._order = list(range(len(self._tasks)))

    def _samples(self) -> list[list[ClosedLoop]]:
        """The loops with two random controllers: for their sizes and feed-through."""
        rng = np.random.default_rng(0)
        n = self.loops.structure.n_parameters
        out: list[list[ClosedLoop]] = []
        for _ in range(20):
            gains = self.loops.gains(rng.standard_normal(n))
            closed = [factory.close(K) for factory, K in zip(self.loops.factories, gains, strict=True)]
            if all(loop is not None for loop in closed):
                out.append([loop for loop in closed if loop is not None])
            if len(out) == 2:
                return out
        raise AssumptionError("the loops are not well posed for any of 20 random controllers. Check D22.")

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        """The largest level; goals that decided last come first."""
        self.budget.evaluations += 1
        with np.errstate(over="ignore", invalid="ignore"):
            gains = self.loops.gains(theta)
        levels = _Levels({}, [None] * len(self._tasks))
        value = -np.inf
        cutoff += 1e-12 * (1.0 + abs(cutoff))
        for rank, k in enumerate(self._order):
            task = self._tasks[k]
            state = levels.states.get(task.plant) or self._state(gains, task.plant)
            if state is None:
                return Point(theta, np.inf)
            levels.states[task.plant] = state
            measure = task.evaluator.measure(state)
            measure.level += self.margin
            levels.measures[k] = measure
            if measure.level > value or levels.decisive < 0:
                value, levels.decisive = measure.level, k
            if value > cutoff:
                self._order.insert(0, self._order.pop(rank))
                break
        return Point(theta, value, levels)

    def _state(self, gains: list[Array], plant: int) -> LoopState | None:
        K = gains[plant]
        loop = self.loops.factories[plant].close(K) if np.all(np.isfinite(K)) else None
        if loop is None or not np.all(np.isfinite(loop.A)):
            return None
        try:
            response = Response(loop.A, loop.B, loop.C, loop.D)
        except np.linalg.LinAlgError:
            return None
        return LoopState(loop, response) if response.abscissa < 0.0 else None

    def confirm(self, point: Point) -> Point:
        """Exact tests of the goals near the largest level."""
        if point.data is None:
            return point
        levels: _Levels = point.data
        for k, measure in enumerate(levels.measures):
            if measure is not None and measure.level >= point.value - NEAR:
                task = self._tasks[k]
                tested = task.evaluator.confirm(levels.states[task.plant], measure)
                if tested is not measure:
                    tested.level += self.margin
                    levels.measures[k] = tested
        known = [(m.level, k) for k, m in enumerate(levels.measures) if m is not None]
        point.value, levels.decisive = max(known, key=lambda item: item[0])
        return point

    def gradient(self, point: Point) -> Array:
        """Gradient of the largest level."""
        return self._task_cuts(point, point.data.decisive, point.value - 1e-9)[0].gradient

    def _task_cuts(self, point: Point, k: int, lowest: float) -> list[Cut]:
        levels: _Levels = point.data
        task, measure = self._tasks[k], levels.measures[k]
        assert measure is not None
        raw = task.evaluator.cuts(levels.states[task.plant], measure, lowest - self.margin)
        return [cut for part in raw for cut in self._cuts_of(point, k, part)]

    def _cuts_of(self, point: Point, k: int, part: RawCut) -> list[Cut]:
        plant = self._tasks[k].plant
        if part.peak is not None:
            return cluster_at(
                part.peak,
                self.loops,
                point.theta,
                plant,
                label=lambda c: (k, (*part.key, c)),
                height=part.height + self.margin,
            ).cuts()
        assert part.gradient is not None
        gradient = self.loops.pullback(point.theta, plant, part.gradient)
        return [Cut(part.level + self.margin, gradient, (k, part.key))]

    def cuts(
        self,
        point: Point,
        missed: Sequence[Point] = (),
        earlier: Sequence[Cut] = (),
        lowest: float | None = None,
    ) -> list[Cut]:
        """The parts of goals near the largest level (or above `lowest`), and those that decided elsewhere."""
        levels: _Levels = point.data
        bottom = point.value - SPREAD if lowest is None else lowest
        out: list[Cut] = []
        for k, measure in enumerate(levels.measures):
            if measure is not None and measure.level >= bottom:
                out += self._task_cuts(point, k, bottom)
        wanted = [(cut.label[0], cut.label[1]) for cut in earlier]
        for other in missed:
            if other.data is not None and other.data.decisive >= 0:
                k = other.data.decisive
                wanted += [(k, key) for key in self._tasks[k].evaluator.keys(other.data.measures[k])]
        present = {(cut.label[0], _rough(cut.label[1])) for cut in out}
        for k, key in wanted:
            if levels.measures[k] is None or (k, _rough(key)) in present:
                continue
            for part in self._tasks[k].evaluator.again(levels.states[self._tasks[k].plant], key):
                if (k, _rough(part.key)) not in present:
                    out += self._cuts_of(point, k, part)
            present |= {(cut.label[0], _rough(cut.label[1])) for cut in out}
        return out

    def hessians(self, point: Point, cuts: Sequence[Cut]) -> Array | None:
        """Exact Hessian of every part."""
        levels: _Levels = point.data
        n = point.theta.size
        out = np.zeros((len(cuts), n, n))
        directions = {
            plant: self.loops.directions(point.theta, plant)
            for plant in {self._tasks[cut.label[0]].plant for cut in cuts}
        }
        for i, cut in enumerate(cuts):
            k, key = cut.label
            task = self._tasks[k]
            dK = directions[task.plant]
            part, G = task.evaluator.curvature(levels.states[task.plant], key, dK)
            out[i] = part + self.loops.bend(point.theta, task.plant, G)
        return out

    def metric(self, point: Point) -> Array | None:
        """How far a step moves the loops of the goals, see `loop_metric`."""
        levels: _Levels = point.data
        out = np.zeros((point.theta.size, point.theta.size))
        for plant, state in levels.states.items():
            dK = self.loops.directions(point.theta, plant)
            out += loop_metric(state.loop, state.response, np.zeros(0), dK, self.loops.scale)
        return out

    def goal_of(self, cut: Cut) -> int:
        """The number of the goal that a cut belongs to."""
        return self._tasks[int(cut.label[0])].goal

    def exact(self, theta: Array) -> list[GoalValue]:
        """Every goal by exact means, the worst plant of each; infinite where a loop is not stable."""
        gains = self.loops.gains(theta)
        states = {task.plant: self._state(gains, task.plant) for task in self._tasks}
        out: list[GoalValue] = []
        for number in range(len(self.goals)):
            values = []
            for task in self._tasks:
                if task.goal == number:
                    state = states[task.plant]
                    unstable = GoalValue(value=np.inf, where=np.nan, plant=task.plant, level=np.inf)
                    values.append(unstable if state is None else task.evaluator.exact(state, task.plant))
            out.append(max(values, key=lambda value: value.level))
        return out


def _evaluator(goal: Goal, loop: ClosedLoop) -> Evaluator:
    n_z, n_w = loop.D.shape
    if isinstance(goal, ClosedLoopPoles):
        return PolesEvaluator(goal)
    if isinstance(goal, ChannelNorm | FrequencyBand | H2Norm):
        rows, columns = goal.channels(n_z, n_w)
        limit = 1.0 if goal.at_most is None else goal.at_most
        if isinstance(goal, H2Norm):
            return H2Evaluator(rows, columns, limit)
        return GainEvaluator(rows, columns, limit, goal.band if isinstance(goal, FrequencyBand) else (0.0, np.inf))
    raise DomainError(
        f"{type(goal).__name__} is no known goal, wanted ChannelNorm, FrequencyBand, ClosedLoopPoles or H2Norm."
    )


def _check_feedthrough(number: int, plant: int, evaluator: H2Evaluator, loops: list[ClosedLoop]) -> None:
    feedthrough = max(evaluator.feedthrough(loop) for loop in loops)
    if feedthrough > ZERO:
        raise AssumptionError(
            f"goals[{number}]: the channel has a feed-through in plant {plant} (relative size {feedthrough:.2g}), so "
            "its H2 norm is infinite; wanted D = 0 for every controller. Use a strictly proper controller "
            "(strictly_proper=True, or a low-pass in the chain), filter z or w, or choose other channels."
        )


def _rough(key: object) -> object:
    """A key with numbers rounded to five digits and without directions: equal for the same peak or pole."""
    if isinstance(key, tuple):
        return tuple(_rough(part) for part in key if not isinstance(part, np.ndarray))
    if isinstance(key, float | complex) and np.isfinite(key):
        return f"{key:.5g}"
    return key
