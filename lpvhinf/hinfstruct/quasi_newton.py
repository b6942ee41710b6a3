"""Nonsmooth BFGS with a weak Wolfe line search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.metric import unit_steps
from lpvhinf.hinfstruct.problem import Budget, Oracle, Point

ARMIJO, WOLFE = 1e-4, 0.5
#: Longest step, relative to theta.
REACH = 1.0
#: Trials of a line search.
TRIALS = 30


@dataclass(slots=True, eq=False)
class Descent:
    """Where a minimiser ended: the point, the reason, its iterations, its optimality measure and trust region."""

    point: Point
    reason: str
    iterations: int
    optimality: float = np.inf
    radius: float | None = None


def weak_wolfe(
    oracle: Oracle, point: Point, start: Array, direction: Array, budget: Budget, longest: float = np.inf
) -> tuple[Point | None, Array | None, bool]:
    """Step along a direction of descent by bisection and doubling.

    `start` is the gradient at the point; no step is more than `longest` times the
    direction. Returns the point, its gradient and whether the curvature condition holds
    too; None without descent.
    """
    slope = float(start @ direction)
    low, high, t = 0.0, np.inf, min(1.0, longest)
    best: tuple[Point, Array] | None = None
    for _ in range(TRIALS):
        limit = point.value + ARMIJO * t * slope
        trial = oracle.evaluate(point.theta + t * direction, limit)
        if trial.value <= limit:
            trial = oracle.confirm(trial)
        if not trial.value <= limit:
            high = t
        else:
            gradient = oracle.gradient(trial)
            best = (trial, gradient)
            if gradient @ direction >= WOLFE * slope:
                return trial, gradient, True
            if t >= longest:
                return trial, gradient, bool((gradient - start) @ direction > 0.0)
            low = t
        if budget.spent:
            break
        t = 0.5 * (low + high) if np.isfinite(high) else min(2.0 * t, longest)
        if np.isfinite(high) and high - low <= 1e-12 * high + 1e-15:
            break
        if best is not None and np.isfinite(high) and high - low <= 0.1 * low:
            break
    return (None, None, False) if best is None else (*best, False)


def first_hessian(oracle: Oracle, point: Point, scaled: bool) -> Array:
    """Inverse Hessian to begin with: if `scaled` that of the oracle's metric, else the identity."""
    M = oracle.metric(point) if scaled else None
    if M is None or not np.all(np.isfinite(M)):
        return np.eye(point.theta.size)
    F = unit_steps(M)
    return np.asarray(F @ F.T)


def bfgs(
    oracle: Oracle,
    start: Point,
    budget: Budget,
    *,
    max_iterations: int = 300,
    tolerance: float = 1e-5,
    window: int = 15,
    target: float = -np.inf,
    scaled: bool = True,
    accepted: Callable[[Point], None] | None = None,
) -> Descent:
    r"""Minimise a maximum of smooth functions from a point of finite value.

    BFGS with a weak Wolfe line search converges to nonsmooth minimisers in practice:
    the inverse Hessian learns the directions in which the maximum has a kink.
    It begins with the oracle's metric or, if not `scaled`, with the parameters as they are. It ends below
    `target`, when the value fell by less than `tolerance` in `window` iterations, or when no descent is found along
    two steepest directions in turn.

    References
    ----------
    Lewis and Overton (2013), Mathematical Programming 141, 135-163.
    """
    point = start
    gradient = oracle.gradient(point)
    H = first_hessian(oracle, point, scaled)
    fresh = True
    values = [point.value]
    for iteration in range(max_iterations):
        if point.value < target:
            return Descent(point, "target reached", iteration)
        if budget.spent:
            return Descent(point, "time limit", iteration)
        direction = -H @ gradient
        slope = float(direction @ gradient)
        if not np.isfinite(slope) or slope >= -1e-14 * np.linalg.norm(direction) * np.linalg.norm(gradient):
            if fresh:
                return Descent(point, "zero gradient", iteration)
            H, fresh = first_hessian(oracle, point, scaled), True
            continue
        size = float(np.linalg.norm(direction))
        reach = max(1.0, float(np.linalg.norm(point.theta)))
        if fresh:
            # no curvature yet: a step of a tenth of theta
            direction, size = direction * (0.1 * reach / size), 0.1 * reach
        # a longer step would leave the region that the start stands for, often for infinity
        trial, new_gradient, curved = weak_wolfe(oracle, point, gradient, direction, budget, REACH * reach / size)
        if trial is None or new_gradient is None:
            if fresh:
                return Descent(point, "no descent", iteration)
            H, fresh = first_hessian(oracle, point, scaled), True
            continue
        step, change = trial.theta - point.theta, new_gradient - gradient
        product = float(step @ change)
        if curved and product > 1e-14 * np.linalg.norm(step) * np.linalg.norm(change):
            if fresh:
                # of the right size along this step
                H = H * (product / float(change @ H @ change))
                fresh = False
            left = step / product
            Hy = H @ change
            H = (
                H
                - np.outer(left, Hy)
                - np.outer(Hy, left)
                + (1.0 + float(change @ Hy) / product) * np.outer(step, left)
            )
            H = 0.5 * (H + H.T)
        point, gradient = trial, new_gradient
        values.append(point.value)
        if accepted is not None:
            accepted(point)
        if len(values) > window and values[-1 - window] - values[-1] < tolerance:
            return Descent(point, "slow progress", iteration + 1)
    return Descent(point, "iteration limit", max_iterations)
