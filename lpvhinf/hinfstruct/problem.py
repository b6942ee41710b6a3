"""What the minimisers ask of a function: a maximum of smooth ones, with cuts, gradients and curvature."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from lpvhinf.checks import Array


@dataclass(slots=True, eq=False)
class Point:
    """Parameters with the value of the function there; infinite outside its domain."""

    theta: Array
    value: float
    data: Any = None


class Family(Protocol):
    """A set of smooth functions below the maximum, too many to list."""

    def best(self, d: Array) -> Cut:
        """The one that is the largest, to first order, after the step d."""


@dataclass(slots=True, eq=False)
class Cut:
    """One smooth function: value and gradient at a point, and what it is.

    Below the maximum; where `hard`, one that a step must keep at or below zero. It may be one of a family.
    """

    value: float
    gradient: Array
    label: tuple[Any, ...]
    hard: bool = False
    family: Family | None = None


class Oracle(Protocol):
    """What the minimisers ask of a maximum of smooth functions."""

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        """The value; above `cutoff` any number above it will do."""

    def gradient(self, point: Point) -> Array:
        """Gradient of the function that is the maximum."""

    def confirm(self, point: Point) -> Point:
        """The point with its value checked by exact means."""

    def cuts(self, point: Point, missed: Sequence[Point] = (), earlier: Sequence[Cut] = ()) -> list[Cut]:
        """The functions near the maximum; those that decided at the points `missed` or were cuts before, too."""

    def hessians(self, point: Point, cuts: Sequence[Cut]) -> Array | None:
        """Hessian of every cut at a point, (n_cuts, n, n); None if not available."""

    def metric(self, point: Point) -> Array | None:
        """A positive semidefinite (n, n) matrix whose unit ball holds steps of equal trust; None if not available."""


@dataclass(slots=True)
class Budget:
    """Wall time and counts: of evaluations, and of exact norms and level tests, one a plant."""

    deadline: float = np.inf
    evaluations: int = 0
    exact: int = 0
    stop: Callable[[], bool] | None = None
    started: float = field(default_factory=time.monotonic)

    @property
    def spent(self) -> bool:
        """True if the time is over, or the caller wants an end."""
        return time.monotonic() >= self.deadline or (self.stop is not None and self.stop())
