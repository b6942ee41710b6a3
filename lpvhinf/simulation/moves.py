"""Point-to-point moves, rests and their sequences."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.simulation.limits import MotionLimits
from lpvhinf.simulation.trajectory import Trajectory, from_snap
from lpvhinf.simulation.widths import displacement, pulses, whole_samples


def point_to_point(
    start: ArrayLike,
    end: ArrayLike,
    limits: MotionLimits,
    *,
    period: float | None = None,
    box: ArrayLike | None = None,
) -> Trajectory:
    r"""The fastest fourth-order move from rest to rest on a straight line, all axes together.

    Every axis follows :math:`r_i(t) = r_{i,0} + d_i \sigma(t)` with one path parameter :math:`\sigma` from 0 to 1,
    whose limits are the smallest :math:`\text{limit}_i / |d_i|`: at least one limit of one axis is reached exactly, and
    none is exceeded. Each limit of velocity, acceleration and jerk may be out of reach of the move.

    Fastest among profiles whose jerk vanishes where the velocity is largest, as is usual. A profile free of that is at
    most (64/3)^(1/4)/2 = 1.07457 times faster where snap alone limits; where a velocity is reached its optimum switches
    the snap without end, and nobody builds it.

    Parameters
    ----------
    start, end : (n,) [m, rad]
    limits : MotionLimits
    period : float, optional
        Sampling period [s]: all knots are then whole samples, and limits are kept but no longer reached exactly.
    box : (n_p, 2), optional
        P, for the first n_p axes.

    Raises
    ------
    DimensionError
        If the numbers of axes disagree.
    DomainError
        If start and end are equal, or the move leaves P.

    Examples
    --------
    >>> limits = MotionLimits(velocity=0.5, acceleration=10.0, jerk=1000.0, snap=2e5)
    >>> move = point_to_point([0.0], [0.1], limits)
    >>> move.duration, move.peaks[:, 0].round(6).tolist()
    (0.265, [0.5, 10.0, 1000.0, 200000.0])
    """
    first = np.atleast_1d(finite_array("start", start))
    last = np.atleast_1d(finite_array("end", end))
    if first.ndim != 1 or first.shape != last.shape:
        raise DimensionError(f"start has shape {first.shape} and end {last.shape}, wanted (n,) both.")
    distance = last - first
    if not np.any(distance):
        raise DomainError(f"start and end are both {first.tolist()}. Use hold(position, duration) for a rest.")
    allowed = limits.along(distance)
    durations, snap = pulses(*_planned(allowed, period))
    scale = 1.0 if period is None else period
    knots, states = from_snap(first, scale * durations, snap[:, None] * distance / scale**4)
    move = Trajectory(knots=knots, states=states, end=last)
    if box is not None:
        move.check(box=box)
    return move


def _planned(allowed: Array, period: float | None) -> tuple[Array, float]:
    widths = displacement(1.0, allowed)
    if period is not None:
        widths = whole_samples(widths, 1.0, allowed, positive("period", period, "s"))
    return widths, 1.0


def hold(position: ArrayLike, duration: float) -> Trajectory:
    """Rest at a position (n,) for `duration` seconds."""
    at = np.atleast_1d(finite_array("position", position))
    knots, states = from_snap(at, np.array([positive("duration", duration, "s")]), np.zeros((1, len(at))))
    return Trajectory(knots=knots, states=states, end=at)


def chain(parts: Sequence[Trajectory]) -> Trajectory:
    """One set-point after another; each begins where the one before it ends.

    Raises
    ------
    DimensionError
        If the numbers of axes disagree.
    DomainError
        If there is a jump, or nothing to chain.

    Examples
    --------
    >>> limits = MotionLimits(acceleration=10.0, snap=1e6)
    >>> there, back = point_to_point(0.0, 0.1, limits), point_to_point(0.1, 0.0, limits)
    >>> round(chain([there, hold(0.1, 0.5), back]).duration - there.duration - back.duration, 9)
    0.5
    """
    if not parts:
        raise DomainError("parts is empty, wanted at least one trajectory.")
    for i, (before, after) in enumerate(pairwise(parts)):
        if before.n_axes != after.n_axes:
            raise DimensionError(f"parts[{i}] has {before.n_axes} axes, parts[{i + 1}] {after.n_axes}.")
        gap = np.max(np.abs(after.start - before.end))
        if gap > 1e-12 * max(1.0, float(np.max(np.abs(before.end)))):
            raise DomainError(
                f"parts[{i + 1}] begins at {after.start.tolist()}, parts[{i}] ends at {before.end.tolist()}."
            )
    shifts = np.cumsum([parts[0].knots[0], *(part.duration for part in parts)])
    knots = [part.knots[:-1] - part.knots[0] + shift for part, shift in zip(parts, shifts)]
    return Trajectory(
        knots=np.concatenate([*knots, shifts[-1:]]),
        states=np.concatenate([part.states for part in parts]),
        end=parts[-1].end,
    )
