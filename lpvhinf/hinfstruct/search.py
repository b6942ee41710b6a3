"""Which starts are begun, which are polished, and when to stop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.oracle import SMALLEST
from lpvhinf.hinfstruct.result import PhaseRecord
from lpvhinf.hinfstruct.runner import Runner
from lpvhinf.hinfstruct.runs import LONG_RETRY, MINIMAL, Outcome, Task, descend, polish

#: Starts whose norm is above this multiple of the best one are not polished.
HOPELESS = 1.5
#: Loops that are cheap to evaluate, in evaluations of a small loop; starts of a batch for them and for others.
CHEAP = 4.0
BATCH, SMALL_BATCH = 8, 2
#: Rounds of the polish: iterations, and the part of a batch that takes part.
ROUNDS = ((25, 0.5), (50, 0.25))
#: Starts that are polished at least: who leads after the descent need not lead at the end.
LEAST_POLISHED = 2
#: Evaluations that an adaptive search may take, in evaluations of a small loop.
EFFORT = 8500.0
#: What an iteration of the polish costs, in such evaluations, and more for every parameter.
POLISH_COST, POLISH_COST_EACH = 10.0, 0.8
#: With limited effort the best start is polished on by so many iterations as long as they gain this part of the norm,
#: up to this multiple of the effort.
CHUNK, GAIN, LONGEST = 50, 1e-3, 3.0
#: Iterations of the bundle after BFGS where that is cheap; the gain that a way not yet tried is taken to have.
SHORT, LARGE_GAIN = 15, 0.05
#: Ends within this of each other are the same minimum; so many starts must agree on the best one.
SAME, AGREE = 1e-4, 4
#: Parameters closer than this, relatively, are on the way to the same minimum.
NEAR = 0.1
#: Batches at least, where there is more than one parameter: a wide basin may hide a better minimum.
LEAST_BATCHES = 2
#: A polish that ends this much higher, relatively, has not lost: tracked and exact peaks differ by as much.
ROUND_OFF = 1e-7
#: Sizes of the perturbations of the best point, in unit steps of the metric, and of those before a cheap polish.
KICKS, SHAKES = (1.0, 4.0), (0.1, 0.3)


@dataclass(slots=True, eq=False)
class Pool:
    """What the search has found: the latest outcome of every start, and the history."""

    latest: dict[int, Outcome] = field(default_factory=dict)
    history: list[PhaseRecord] = field(default_factory=list)
    work: float = 0.0
    polish_cost: float = POLISH_COST

    def add(self, outcomes: list[Outcome]) -> None:
        """Take in new outcomes."""
        for outcome in outcomes:
            known = self.latest.get(outcome.start)
            if known is None or outcome.gamma <= known.gamma * (1.0 + ROUND_OFF):
                self.latest[outcome.start] = outcome
            else:
                # nothing was to be gained there
                known.finished, known.reason = True, outcome.reason
                known.optimality = min(known.optimality, outcome.optimality)
            self.history += outcome.history
            for record in outcome.history:
                self.work += record.evaluations * (self.polish_cost if record.phase == "polish" else 1.0)

    def ranked(self) -> list[Outcome]:
        """Stabilising outcomes, the best first."""
        found = [o for o in self.latest.values() if np.isfinite(o.gamma)]
        return sorted(found, key=lambda o: (o.gamma, o.start))

    def agreeing(self) -> int:
        """How many starts ended in the best minimum, or were on the way to it."""
        ranked = self.ranked()
        level = (1.0 + SAME) * ranked[0].gamma + SMALLEST
        return sum((o.finished and o.gamma <= level) or _close(o, ranked[0]) for o in ranked)


def search(
    runner: Runner,
    make: Callable[[int, Array | None], Task],
    given: list[Array],
    starts: int | None,
    cost: float,
    parameters: int,
    max_iterations: int,
) -> Pool:
    """Descend from many starts, polish the hopeful ones in rounds of successive halving, the best one to the end.

    With `starts` None batches of new starts and of perturbations of the best point follow one another until
    several starts agree on the best minimum or the effort is spent; else there is one batch.

    Parameters
    ----------
    runner : Runner
    make : callable
        (number of the start, theta or None) -> Task.
    given : list of (n_parameters,)
        Starts of the caller, tried first.
    starts : int or None
        Random starts.
    cost : float
        Of an evaluation, relative to that of a small loop.
    parameters : int
        Length of theta.
    max_iterations : int
        Of the polish of one start.
    """
    pool = Pool(polish_cost=POLISH_COST + POLISH_COST_EACH * parameters)
    size = BATCH if cost < CHEAP else SMALL_BATCH
    tasks = [make(k, theta) for k, theta in enumerate(given)]
    tasks += [make(len(given) + k, None) for k in range(size if starts is None else starts)]
    adaptive = starts is None

    def attempt(start: int, theta: Array | None) -> Task:
        # iterations of BFGS that cost next to nothing come before every part of the polish
        task = make(start, theta)
        if cost >= CHEAP:
            return task
        return replace(task, anew=True, retry=LONG_RETRY, shakes=SHAKES, turn=len(pool.history))

    least = LEAST_BATCHES if parameters > 1 else 1
    batches = 0
    while True:
        batches += 1
        pool.add(runner.map(descend, tasks, share=0.4 if not adaptive or not pool.latest else 0.2))
        if pool.ranked():
            spent = _polish(runner, pool, attempt, [t.start for t in tasks], max_iterations)
            effort = LONGEST * EFFORT / cost if adaptive else np.inf
            _finish(runner, pool, attempt, spent, max_iterations, effort, cost < CHEAP and adaptive)
        if runner.over or not adaptive:
            return pool
        if pool.work * cost >= EFFORT or (batches >= least and pool.ranked() and pool.agreeing() >= AGREE):
            return pool
        tasks = _next(pool, make, size)


def _polish(
    runner: Runner, pool: Pool, make: Callable[[int, Array | None], Task], batch: list[int], max_iterations: int
) -> dict[int, int]:
    """Rounds of successive halving over a batch; the iterations that each start has had."""
    spent = dict.fromkeys(pool.latest, 0)
    for k, (iterations, part) in enumerate(ROUNDS):
        ranked = [o for o in pool.ranked() if o.start in batch]
        level = max(HOPELESS * pool.ranked()[0].gamma, SMALLEST)
        chosen = [o for o in _distinct(ranked) if o.gamma <= level and not o.finished]
        chosen = chosen[: max(LEAST_POLISHED, round(part * len(batch)))]
        chosen = [o for o in chosen if spent[o.start] < max_iterations]
        counts = [min(iterations, max_iterations - spent[o.start]) for o in chosen]
        tasks = [
            replace(task := make(o.start, o.theta), iterations=count, radius=o.radius, anew=task.anew and k > 0)
            for o, count in zip(chosen, counts, strict=True)
        ]
        pool.add(runner.map(polish, tasks, share=0.4))
        for o, count in zip(chosen, counts, strict=True):
            spent[o.start] += count
    return spent


def _finish(
    runner: Runner,
    pool: Pool,
    make: Callable[[int, Array | None], Task],
    spent: dict[int, int],
    max_iterations: int,
    effort: float,
    cheap: bool,
) -> None:
    """Polish the best start to its end: as long as it gains, where the effort is limited.

    With cheap loops the next best start has its turn then, unless the best one is at a minimum.
    """
    rates: dict[int, list[float]] = {}
    while not runner.over and pool.work < effort:
        ranked = pool.ranked()
        if ranked[0].finished and (not cheap or ranked[0].optimality <= MINIMAL):
            return
        # a polish that ended off a minimum is open: moved at random, BFGS may leave its kink
        open_ones = [
            o
            for o in _distinct(ranked)
            if not (o.finished and o.optimality <= MINIMAL) and max(_rates(rates, o)) > GAIN
        ]
        best = next(iter(open_ones), ranked[0]) if cheap else ranked[0]
        left = max_iterations - spent.get(best.start, 0)
        known = _rates(rates, best)
        if left <= 0 or max(known) <= GAIN or best.gamma > HOPELESS * ranked[0].gamma:
            return
        # on from the trust region, or anew by BFGS: what has gained more for its cost
        anew = known[1] > known[0]
        count = min(left, SHORT if anew and cheap else CHUNK) if np.isfinite(effort) else left
        task = replace(make(best.start, best.theta), iterations=count, radius=best.radius, anew=anew)
        before, work = best.gamma, pool.work
        pool.add(runner.map(polish, [task], share=1.0))
        spent[best.start] = spent.get(best.start, 0) + count
        if np.isfinite(effort):
            gained = 1.0 - pool.latest[best.start].gamma / max(before, SMALLEST)
            known[int(anew)] = gained * CHUNK * pool.polish_cost / max(pool.work - work, 1.0)


def _rates(rates: dict[int, list[float]], outcome: Outcome) -> list[float]:
    """Relative gain of a start by the work of a chunk: on from the trust region, and anew; at first both are open."""
    return rates.setdefault(outcome.start, [np.inf, LARGE_GAIN])


def _distinct(ranked: list[Outcome]) -> list[Outcome]:
    """One start of every neighbourhood: places in the polish go to starts that may end elsewhere."""
    out: list[Outcome] = []
    for outcome in ranked:
        if not any(_close(outcome, other) for other in out):
            out.append(outcome)
    return out


def _close(a: Outcome, b: Outcome) -> bool:
    distance, size = np.linalg.norm(a.theta - b.theta), max(np.linalg.norm(a.theta), np.linalg.norm(b.theta))
    return bool(distance <= NEAR * size)


def _next(pool: Pool, make: Callable[[int, Array | None], Task], size: int) -> list[Task]:
    first = max(pool.latest, default=-1) + 1
    ranked = pool.ranked()
    tasks = []
    for k in range(size):
        if ranked and k % 3 == 2:
            kick = KICKS[(k // 3) % len(KICKS)]
            tasks.append(replace(make(first + k, ranked[0].theta), kick=kick))
        else:
            tasks.append(make(first + k, None))
    return tasks
