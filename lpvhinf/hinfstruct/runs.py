"""The work of one start, in this process or in another one."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.bundle import bundle
from lpvhinf.hinfstruct.oracle import Budget, ClosedLoops, NormOracle, Point
from lpvhinf.hinfstruct.quasi_newton import bfgs
from lpvhinf.hinfstruct.result import PhaseRecord
from lpvhinf.hinfstruct.stabilise import AbscissaOracle, stabilise
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Random draws of one start until one can be stabilised.
DRAWS = 4

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


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """Where a start ended: log of the norm (infinite if not stabilised), or the spectral abscissa."""

    start: int
    theta: Array
    value: float
    abscissa: float
    optimality: float
    reason: str
    history: tuple[PhaseRecord, ...]


def _budget(task: Task) -> Budget:
    return Budget(deadline=time.monotonic() + task.seconds)


def _record(task: Task, phase: str, budget: Budget, value: float, reason: str) -> PhaseRecord:
    return PhaseRecord(
        start=task.start,
        phase=phase,
        evaluations=budget.evaluations,
        seconds=time.monotonic() - budget.started,
        gamma=float(np.exp(value)) if value < 700.0 else np.inf,
        reason=reason,
    )


def descend(task: Task, listen: Listener | None = None) -> Outcome:
    """Stabilise, then BFGS."""
    budget = _budget(task)
    loops = ClosedLoops(task.plants, task.structure, task.points)
    rng = np.random.default_rng([task.seed, task.start])
    theta = task.structure.initial(rng) if task.theta is None else task.theta
    margin = 1e-7 * loops.scale

    def heard(phase: str) -> Callable[[Point], None] | None:
        return None if listen is None else (lambda point: listen(phase, point.theta, point.value))

    best = AbscissaOracle(loops, budget).evaluate(theta)
    reason = "stable already"
    for draw in range(DRAWS if task.theta is None else 1):
        if draw:
            theta = task.structure.initial(rng)
        run = stabilise(
            loops, theta, budget, margin=margin, max_iterations=task.max_iterations, accepted=heard("stabilise")
        )
        if run.point.value < best.value or draw == 0:
            best, reason = run.point, run.reason
        if best.value < -margin or budget.spent:
            break
    history = [_record(task, "stabilise", budget, np.inf, reason)]

    def outcome(theta: Array, value: float, reason: str) -> Outcome:
        return Outcome(
            start=task.start,
            theta=theta,
            value=value,
            abscissa=best.value,
            optimality=np.inf,
            reason=reason,
            history=tuple(history),
        )

    if best.value >= 0.0:
        return outcome(best.theta, np.inf, reason)
    budget = Budget(deadline=budget.deadline)
    oracle = NormOracle(loops, budget)
    start = oracle.evaluate(best.theta)
    if not np.isfinite(start.value):
        return outcome(best.theta, np.inf, "on the stability limit")
    start = oracle.confirm(start)
    descent = bfgs(
        oracle,
        start,
        budget,
        max_iterations=task.max_iterations,
        tolerance=100.0 * task.tolerance,
        accepted=heard("descend"),
    )
    history.append(_record(task, "descend", budget, descent.point.value, descent.reason))
    return outcome(descent.point.theta, descent.point.value, descent.reason)


def polish(task: Task, listen: Listener | None = None) -> Outcome:
    """Bundle / SQP from a stabilising theta."""
    assert task.theta is not None
    budget = _budget(task)
    oracle = NormOracle(ClosedLoops(task.plants, task.structure, task.points), budget)
    start = oracle.confirm(oracle.evaluate(task.theta))
    run = bundle(
        oracle,
        start,
        budget,
        max_iterations=task.max_iterations,
        tolerance=task.tolerance,
        accepted=None if listen is None else (lambda point: listen("polish", point.theta, point.value)),
    )
    return Outcome(
        start=task.start,
        theta=run.point.theta,
        value=run.point.value,
        abscissa=-np.inf,
        optimality=run.optimality,
        reason=run.reason,
        history=(_record(task, "polish", budget, run.point.value, run.reason),),
    )
