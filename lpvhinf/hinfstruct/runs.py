"""The work of one start, in this process or in another one."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.bundle import bundle
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.metric import unit_steps
from lpvhinf.hinfstruct.oracle import SMALLEST, NormOracle
from lpvhinf.hinfstruct.problem import Budget, Point
from lpvhinf.hinfstruct.quasi_newton import bfgs
from lpvhinf.hinfstruct.result import PhaseRecord
from lpvhinf.hinfstruct.stabilise import AbscissaOracle, stabilise
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Random draws of one start until one can be stabilised.
DRAWS = 4
#: Every fourth random start is larger by this factor: good minima may lie at large gains.
LARGE = 10.0
#: Scales of a random draw that are tried.
SCALES = (1.0, 0.3, 0.1, 0.03, 0.01)
#: Reasons that leave a polish open; optimality of a minimum; relative gain of another attempt by BFGS.
LIMITS, MINIMAL, RETRY_GAIN = ("iteration limit", "time limit"), 1e-3, 1e-4
#: BFGS iterations of another attempt, and the window in which it must gain; where an iteration costs far less than one
#: of the bundle, long attempts follow the curved valleys that lead to large gains.
RETRY, LONG_RETRY = (100, 15), (1000, 60)
#: Guard mu against infinite gains, in the first descent of every other random start.
GUARD = 0.02
#: Tolerance of a descent that was to be left out, from a start that does not stabilise.
DESCENT = 0.05
#: A first descent ends this much earlier than the second one.
EARLIER = 3.0

#: Asked between evaluations; a worker process puts the interruption of its caller here.
stopped: Callable[[], bool] | None = None

Listener = Callable[[str, Array, float], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """Everything a worker needs; `theta` None means a random start.

    A descent begins at `theta`, moved at random by `kick` unit steps of the metric; a polish has the trust region of
    `radius` at first (None: the usual one), takes at most `iterations`, and with `anew` begins by BFGS (at most
    `retry` iterations, ended by a window of the other length; again from points moved by `shakes` unit steps, which
    `turn` draws) and the usual trust region.
    """

    plants: tuple[GeneralizedPlant, ...]
    structure: ControllerStructure
    points: tuple[Array | None, ...]
    start: int
    theta: Array | None
    seed: int
    seconds: float
    max_iterations: int
    tolerance: float
    descent_tolerance: float | None
    kick: float = 0.0
    iterations: int = 150
    radius: float | None = None
    anew: bool = False
    retry: tuple[int, int] = RETRY
    shakes: tuple[float, ...] = ()
    turn: int = 0


@dataclass(slots=True, kw_only=True, eq=False)
class Outcome:
    """Where a start ended: its norm (infinite if not stabilised), or the spectral abscissa.

    `finished` where a polish would not gain more; else `radius` is that of the trust region, to go on with.
    """

    start: int
    theta: Array
    gamma: float
    abscissa: float
    optimality: float
    reason: str
    history: tuple[PhaseRecord, ...]
    finished: bool = False
    radius: float | None = None


def _budget(task: Task) -> Budget:
    return Budget(deadline=time.monotonic() + task.seconds, stop=stopped)


def _record(task: Task, phase: str, budget: Budget, gamma: float, reason: str) -> PhaseRecord:
    return PhaseRecord(
        start=task.start,
        phase=phase,
        evaluations=budget.evaluations,
        exact=budget.exact,
        seconds=time.monotonic() - budget.started,
        gamma=gamma,
        reason=reason,
    )


def descend(task: Task, listen: Listener | None = None) -> Outcome:
    """Stabilise, then BFGS."""
    budget = _budget(task)
    loops = ClosedLoops(task.plants, task.structure, task.points)
    rng = np.random.default_rng([task.seed, task.start])
    theta = task.structure.initial(rng) if task.theta is None else task.theta
    margin = 1e-7 * loops.scale
    if task.kick > 0.0:
        theta = _kicked(loops, theta, task.kick, rng)

    best = AbscissaOracle(loops, budget).evaluate(theta)
    at_once = task.theta is not None and task.descent_tolerance is None and best.value < -margin
    reason = "stable already"
    for draw in range(DRAWS if task.theta is None else 1):
        if draw:
            theta = task.structure.initial(rng)
        if task.theta is None:
            theta = _scaled(loops, (LARGE if task.start % 4 == 3 else 1.0) * theta, budget)
        run = stabilise(
            loops,
            theta,
            budget,
            margin=margin,
            max_iterations=task.max_iterations,
            accepted=None if listen is None else (lambda point: listen("stabilise", point.theta, point.value)),
        )
        if run.point.value < best.value or draw == 0:
            best, reason = run.point, run.reason
        if best.value < -margin or budget.spent:
            break
    history = [_record(task, "stabilise", budget, np.inf, reason)]

    def outcome(theta: Array, gamma: float, reason: str) -> Outcome:
        return Outcome(
            start=task.start,
            theta=theta,
            gamma=gamma,
            abscissa=best.value,
            optimality=np.inf,
            reason=reason,
            history=tuple(history),
        )

    if best.value >= 0.0:
        return outcome(best.theta, np.inf, reason)
    budget = Budget(deadline=budget.deadline, stop=stopped)
    theta, gamma = best.theta, np.inf
    if at_once:
        oracle = NormOracle(loops, budget)
        gamma = oracle.gamma(oracle.evaluate(theta))
        if np.isfinite(gamma):
            return outcome(theta, gamma, "left to the polish")
    tight = DESCENT if task.descent_tolerance is None else task.descent_tolerance
    # every other random start is kept from infinite gains at first: both ways find minima that the other misses
    guards = (GUARD if task.theta is None and task.start % 2 == 0 else 0.0, 0.0)
    for guard, tolerance in zip(guards, (EARLIER * tight, tight), strict=True):
        # the logarithm at first, then about linear in the norm
        offset = gamma if np.isfinite(gamma) else 0.0
        oracle = NormOracle(loops, budget, guard=guard, offset=offset)
        start = oracle.evaluate(theta)
        if not np.isfinite(start.value):
            return outcome(theta, np.inf, "on the stability limit")
        run = bfgs(
            oracle,
            oracle.confirm(start),
            budget,
            max_iterations=task.max_iterations,
            tolerance=tolerance,
            # a caller scales the parameters of his start by what he knows of them
            scaled=task.theta is None or task.kick > 0.0,
            accepted=_heard(oracle, listen, "descend"),
        )
        theta, gamma, reason = run.point.theta, oracle.gamma(run.point), run.reason
    history.append(_record(task, "descend", budget, gamma, reason))
    return outcome(theta, gamma, reason)


def _scaled(loops: ClosedLoops, theta: Array, budget: Budget) -> Array:
    """The largest of several scales at which theta stabilises; else that of the smallest abscissa."""
    oracle = AbscissaOracle(loops, budget)
    tried = []
    for scale in SCALES:
        point = oracle.evaluate(scale * theta)
        if point.value < 0.0:
            return point.theta
        tried.append(point)
    return min(tried, key=lambda point: point.value).theta


def _kicked(loops: ClosedLoops, theta: Array, size: float, rng: np.random.Generator) -> Array:
    """A random step of a size in the metric at theta."""
    oracle = NormOracle(loops, Budget())
    point = oracle.evaluate(theta)
    M = oracle.metric(point) if point.data is not None else None
    step = rng.standard_normal(theta.size)
    step *= size / np.linalg.norm(step)
    return np.asarray(theta + (step if M is None else unit_steps(M) @ step))


def _heard(oracle: NormOracle, listen: Listener | None, phase: str) -> Callable[[Point], None] | None:
    return None if listen is None else (lambda point: listen(phase, point.theta, oracle.gamma(point)))


def polish(task: Task, listen: Listener | None = None) -> Outcome:
    """Bundle / SQP from a stabilising theta; where it stalls off a minimum, BFGS and a new trust region try again."""
    assert task.theta is not None
    budget = _budget(task)
    loops = ClosedLoops(task.plants, task.structure, task.points)
    first = NormOracle(loops, budget)
    gamma = first.gamma(first.evaluate(task.theta))
    theta, radius, left, anew = task.theta, task.radius, task.iterations, task.anew
    rng = np.random.default_rng([task.seed, task.start, task.turn])
    history = []
    while True:
        before = gamma
        if anew:
            theta, gamma, record = _again(task, loops, theta, gamma, rng, listen)
            history.append(record)
            radius = None
        oracle = NormOracle(loops, budget, offset=gamma)
        run = bundle(
            oracle,
            oracle.confirm(oracle.evaluate(theta)),
            budget,
            max_iterations=left,
            tolerance=task.tolerance,
            radius=radius,
            thorough=len(task.plants) == 1,
            accepted=_heard(oracle, listen, "polish"),
        )
        gained = before - oracle.gamma(run.point)
        left -= run.iterations
        limited = run.reason in LIMITS
        stalled = radius is None and gained <= RETRY_GAIN * gamma
        theta, radius, gamma = run.point.theta, run.radius, oracle.gamma(run.point)
        if limited or left <= 0 or run.optimality <= MINIMAL or stalled:
            break
        anew = True
    return Outcome(
        start=task.start,
        theta=theta,
        gamma=gamma,
        abscissa=-np.inf,
        optimality=run.optimality * (gamma + oracle.offset) / max(gamma, SMALLEST),
        reason=run.reason,
        history=(*history, _record(task, "polish", budget, gamma, run.reason)),
        finished=not limited,
        radius=radius,
    )


def _again(
    task: Task, loops: ClosedLoops, theta: Array, gamma: float, rng: np.random.Generator, listen: Listener | None
) -> tuple[Array, float, PhaseRecord]:
    """BFGS from theta, then from the best point moved at random: at a kink itself it finds no descent."""
    budget = _budget(task)
    most, window = task.retry
    reason = "no descent"
    for kick in (0.0, *task.shakes):
        oracle = NormOracle(loops, budget, offset=gamma)
        start = oracle.evaluate(theta if kick == 0.0 else _kicked(loops, theta, kick, rng))
        if not np.isfinite(start.value) or budget.spent:
            continue
        run = bfgs(
            oracle,
            oracle.confirm(start),
            budget,
            max_iterations=most,
            tolerance=RETRY_GAIN,
            window=window,
            accepted=_heard(oracle, listen, "polish"),
        )
        found = oracle.gamma(run.point)
        if found < gamma or kick == 0.0:
            theta, gamma, reason = run.point.theta, found, run.reason
    return theta, gamma, _record(task, "descend", budget, gamma, reason)
