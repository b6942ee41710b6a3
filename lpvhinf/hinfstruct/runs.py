"""The work of one start, in this process or in another one."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.bundle import bundle
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.oracle import SMALLEST, Budget, NormOracle, Point
from lpvhinf.hinfstruct.quasi_newton import bfgs
from lpvhinf.hinfstruct.result import PhaseRecord
from lpvhinf.hinfstruct.stabilise import AbscissaOracle, stabilise
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Random draws of one start until one can be stabilised.
DRAWS = 4
#: Guard mu against infinite gains, in the first descent of every other random start.
GUARD = 0.02
#: A first descent ends this much earlier than the second one.
EARLIER = 3.0

Listener = Callable[[str, Array, float], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """Everything a worker needs; `theta` None means a random start."""

    plants: tuple[GeneralizedPlant, ...]
    structure: ControllerStructure
    points: tuple[Array | None, ...]
    start: int
    theta: Array | None
    seed: int
    seconds: float
    max_iterations: int
    tolerance: float
    descent_tolerance: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """Where a start ended: its norm (infinite if not stabilised), or the spectral abscissa."""

    start: int
    theta: Array
    gamma: float
    abscissa: float
    optimality: float
    reason: str
    history: tuple[PhaseRecord, ...]


def _budget(task: Task) -> Budget:
    return Budget(deadline=time.monotonic() + task.seconds)


def _record(task: Task, phase: str, budget: Budget, gamma: float, reason: str) -> PhaseRecord:
    return PhaseRecord(
        start=task.start,
        phase=phase,
        evaluations=budget.evaluations,
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

    best = AbscissaOracle(loops, budget).evaluate(theta)
    reason = "stable already"
    for draw in range(DRAWS if task.theta is None else 1):
        if draw:
            theta = task.structure.initial(rng)
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
    budget = Budget(deadline=budget.deadline)
    theta, gamma = best.theta, np.inf
    # every other random start is kept from infinite gains at first: both ways find minima that the other misses
    guards = (GUARD if task.theta is None and task.start % 2 == 0 else 0.0, 0.0)
    for guard, tolerance in zip(guards, (EARLIER * task.descent_tolerance, task.descent_tolerance), strict=True):
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
            accepted=_heard(oracle, listen, "descend"),
        )
        theta, gamma, reason = run.point.theta, oracle.gamma(run.point), run.reason
    history.append(_record(task, "descend", budget, gamma, reason))
    return outcome(theta, gamma, reason)


def _heard(oracle: NormOracle, listen: Listener | None, phase: str) -> Callable[[Point], None] | None:
    return None if listen is None else (lambda point: listen(phase, point.theta, oracle.gamma(point)))


def polish(task: Task, listen: Listener | None = None) -> Outcome:
    """Bundle / SQP from a stabilising theta."""
    assert task.theta is not None
    budget = _budget(task)
    loops = ClosedLoops(task.plants, task.structure, task.points)
    first = NormOracle(loops, budget)
    gamma = first.gamma(first.evaluate(task.theta))
    oracle = NormOracle(loops, budget, offset=gamma)
    run = bundle(
        oracle,
        oracle.confirm(oracle.evaluate(task.theta)),
        budget,
        max_iterations=task.max_iterations,
        tolerance=task.tolerance,
        accepted=_heard(oracle, listen, "polish"),
    )
    gamma = oracle.gamma(run.point)
    return Outcome(
        start=task.start,
        theta=run.point.theta,
        gamma=gamma,
        abscissa=-np.inf,
        optimality=run.optimality * (gamma + oracle.offset) / max(gamma, SMALLEST),
        reason=run.reason,
        history=(_record(task, "polish", budget, gamma, run.reason),),
    )
