"""A set-point in any number of axes whose position is a polynomial of fourth order, piece by piece."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.notebook import table
from lpvhinf.simulation.limits import NAMES, MotionLimits

SLACK = 1e-9  # relative: closer than this, a limit is kept
ROUND_OFF = 1e-14  # relative to the largest value so far: below this, a velocity, acceleration or jerk is zero
BOX_SLACK = 1e-12  # of the width of the box, as elsewhere
FACTORIALS = np.array([factorial(k) for k in range(5)], dtype=float)


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class Trajectory:
    r"""Positions r(t) of n axes from rest to rest, with piecewise constant snap :math:`r^{(4)}`.

    On piece i, :math:`r(t) = \sum_{k=0}^{4} s_{ik} (t - t_i)^k / k!`. Before the first knot and after the last one the
    axes rest.

    Parameters
    ----------
    knots : (m + 1,) [s]
        Begin and end of the pieces.
    states : (m, 5, n)
        Position [m, rad], velocity, acceleration and jerk at the begin of each piece, and the snap on it.
    end : (n,)
        Final position.

    Raises
    ------
    DimensionError
        If the shapes disagree.
    DomainError
        If a number is not finite or the knots do not increase.

    Examples
    --------
    >>> from lpvhinf.simulation import MotionLimits, point_to_point
    >>> move = point_to_point([0.0, 0.0], [0.01, 0.02], MotionLimits(velocity=0.5, acceleration=10.0, snap=1e6))
    >>> move.position([0.0, 0.5 * move.duration, move.duration])
    array([[0.   , 0.   ],
           [0.005, 0.01 ],
           [0.01 , 0.02 ]])
    """

    knots: Array
    states: Array
    end: Array

    def __init__(self, *, knots: ArrayLike, states: ArrayLike, end: ArrayLike) -> None:
        times, rows = finite_array("knots", knots, (None,)), finite_array("states", states, (None, 5, None))
        if len(rows) < 1 or len(times) != len(rows) + 1:
            raise DimensionError(
                f"there are {len(times)} knots and {len(rows)} pieces, wanted one knot more than pieces."
            )
        if np.any(np.diff(times) < 0.0):
            raise DomainError("knots do not increase. Sort them.")
        object.__setattr__(self, "knots", read_only(times))
        object.__setattr__(self, "states", read_only(rows))
        object.__setattr__(self, "end", read_only(finite_array("end", end, (rows.shape[2],))))

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(self.states.shape[2])

    @property
    def start(self) -> Array:
        """Initial position (n,)."""
        first: Array = self.states[0, 0]
        return first

    @property
    def duration(self) -> float:
        """From the first to the last knot [s]."""
        return float(self.knots[-1] - self.knots[0])

    def times(self, period: float) -> Array:
        """Sampling times from the first knot to the first one at or after the last [s]."""
        count = int(np.ceil(self.duration / period * (1.0 - 1e-12)))
        return np.asarray(self.knots[0] + period * np.arange(count + 1))

    def evaluate(self, times: ArrayLike) -> Array:
        """Position, velocity, acceleration, jerk and snap at times (N,) as (5, N, n)."""
        t = np.atleast_1d(finite_array("times", times))
        if t.ndim != 1:
            raise DimensionError(f"times has shape {t.shape}, wanted (N,).")
        return np.stack([self._derivative(t, order) for order in range(5)])

    def position(self, times: ArrayLike) -> Array:
        """Positions (N, n) at times (N,), or (n,) at one time [m, rad]."""
        return self.derivative(times, 0)

    def velocity(self, times: ArrayLike) -> Array:
        """Velocities (N, n) at times (N,), or (n,) at one time."""
        return self.derivative(times, 1)

    def acceleration(self, times: ArrayLike) -> Array:
        """Accelerations (N, n) at times (N,), or (n,) at one time."""
        return self.derivative(times, 2)

    def jerk(self, times: ArrayLike) -> Array:
        """Jerks (N, n) at times (N,), or (n,) at one time."""
        return self.derivative(times, 3)

    def snap(self, times: ArrayLike) -> Array:
        """Snaps (N, n) at times (N,), or (n,) at one time; at a knot, that of the piece after it."""
        return self.derivative(times, 4)

    def derivative(self, times: ArrayLike, order: int) -> Array:
        """The derivative of order 0 to 4, (..., n) at times (...)."""
        if order not in range(5):
            raise DomainError(f"order is {order!r}, wanted 0 to 4.")
        t = finite_array("times", times)
        return self._derivative(t.ravel(), order).reshape(*t.shape, self.n_axes)

    def _derivative(self, t: Array, order: int) -> Array:
        piece = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.states) - 1)
        tau = (t - self.knots[piece])[:, None]
        value = self.states[piece, 4]
        for k in range(3, order - 1, -1):  # Horner's scheme
            value = self.states[piece, k] + tau / (k + 1 - order) * value
        before, after = (self.start, self.end) if order == 0 else (np.zeros(self.n_axes), np.zeros(self.n_axes))
        value = np.where((t < self.knots[0])[:, None], before, value)
        return np.asarray(np.where((t >= self.knots[-1])[:, None], after, value))

    @cached_property
    def peaks(self) -> Array:
        """Largest velocity, acceleration, jerk and snap of every axis, (4, n), exact to round-off."""
        out = np.zeros((4, self.n_axes))
        for axis in range(self.n_axes):
            out[3, axis] = np.max(np.abs(self.states[:, 4, axis]))
            for order in (1, 2, 3):
                turning = self._turning_times(axis, order)
                out[order - 1, axis] = np.max(np.abs(self._derivative(turning, order)[:, axis]))
        out.setflags(write=False)
        return out

    def check(self, *, limits: MotionLimits | None = None, box: ArrayLike | None = None, first: int = 0) -> None:
        """Raise an error with the first time at which a limit is exceeded or the position leaves the box P.

        Parameters
        ----------
        limits : MotionLimits, optional
        box : (n_p, 2), optional
            P, for the axes `first` to `first` + n_p - 1.
        first : int

        Raises
        ------
        DomainError
            With time, axis, value and limit.
        DimensionError
            If limits or box do not fit the axes.
        """
        if box is not None:
            bounds = box_array(box)
            if not 0 <= first <= self.n_axes - len(bounds):
                raise DimensionError(f"box has {len(bounds)} axes from {first} on, the set-point {self.n_axes} in all.")
            slack = BOX_SLACK * (bounds[:, 1] - bounds[:, 0])
            found = [
                (self._first_above(first + i, 0, high, slack[i], low=low), first + i, low, high)
                for i, (low, high) in enumerate(bounds)
            ]
            time, axis, low, high = min(found, key=lambda row: row[0])
            if np.isfinite(time):
                raise DomainError(
                    f"the set-point leaves P at t = {time:.6g} s: axis {axis} passes "
                    f"{_passed(self._derivative(np.array([time]), 0)[0, axis], low, high):.6g}, wanted within "
                    f"[{low:.6g}, {high:.6g}]. Move its ends, shorten its run-up, or take a larger P."
                )
        if limits is not None:
            allowed = limits.array(self.n_axes)
            steps = [
                (
                    self._first_above(axis, order, allowed[order - 1, axis], SLACK * allowed[order - 1, axis]),
                    order,
                    axis,
                )
                for order in range(1, 5)
                for axis in range(self.n_axes)
                if self.peaks[order - 1, axis] > (1.0 + SLACK) * allowed[order - 1, axis]
            ]
            if steps:
                time, order, axis = min(steps)
                raise DomainError(
                    f"the set-point exceeds a limit at t = {time:.6g} s: {NAMES[order - 1]} of axis {axis} passes "
                    f"{allowed[order - 1, axis]:.6g} and reaches {self.peaks[order - 1, axis]:.6g}. Plan it with these "
                    "limits, or slow it down."
                )

    def _turning_times(self, axis: int, order: int) -> Array:
        """Times between which the derivative of this order is monotone: knots, and its turning points in pieces."""
        rows, lengths = self.states[:, :, axis], np.diff(self.knots)
        inside = []
        for row, knot, length in zip(rows, self.knots, lengths):
            slopes = row[order + 1 :] / FACTORIALS[: 4 - order]
            while len(slopes) and slopes[-1] == 0.0:
                slopes = slopes[:-1]
            if len(slopes) > 1:
                roots = np.roots(slopes[::-1])
                real = roots.real[np.abs(roots.imag) <= 1e-9 * np.abs(roots)]
                inside += [knot + tau for tau in real if 0.0 < tau < length]
        return np.sort(np.concatenate([self.knots, inside]))

    def _first_above(self, axis: int, order: int, high: float, slack: float, low: float | None = None) -> float:
        """First time with a value outside [low, high] by more than `slack`; infinity if there is none."""
        bottom = -high if low is None else low

        def excess(t: Array) -> Array:
            value = self._derivative(t, order)[:, axis]
            return np.maximum(value - high, bottom - value) - slack

        if order == 4:  # constant on pieces
            beyond = np.abs(self.states[:, 4, axis]) > high + slack
            return float(self.knots[np.argmax(beyond)]) if np.any(beyond) else np.inf
        turning = self._turning_times(axis, order)
        beyond = excess(turning) > 0.0
        if not np.any(beyond):
            return np.inf
        at = int(np.argmax(beyond))
        if at == 0:
            return float(turning[0])
        left, right = float(turning[at - 1]), float(turning[at])
        for _ in range(100):  # monotone in between
            middle = 0.5 * (left + right)
            if not left < middle < right:
                break
            left, right = (left, middle) if excess(np.array([middle]))[0] > 0.0 else (middle, right)
        return right

    def __repr__(self) -> str:
        return f"Trajectory({self.n_axes} axes, {len(self.states)} pieces, {self.duration:.6g} s)"

    def _repr_html_(self) -> str:
        head = ["axis", "from", "to", *(f"largest {name}" for name in NAMES)]
        rows = [
            [str(i), *(f"{value:.6g}" for value in (self.start[i], self.end[i], *self.peaks[:, i]))]
            for i in range(self.n_axes)
        ]
        return table(f"Trajectory of {self.duration:.6g} s", [head, *rows])


def from_snap(start: ArrayLike, durations: Array, snap: Array, *, velocity: ArrayLike = 0.0) -> tuple[Array, Array]:
    """Knots (m + 1,) from 0, and states (m, 5, n), of pieces with given durations (m,) and snap (m, n).

    `start` and `velocity` (n,) hold at the first knot, where acceleration and jerk are zero.
    """
    position = np.atleast_1d(np.asarray(start, dtype=float))
    state = np.zeros((4, len(position)))
    state[0], state[1] = position, velocity
    states, largest = np.zeros((len(durations), 5, len(position))), np.abs(state)
    for i, (time, value) in enumerate(zip(durations, snap, strict=True)):
        states[i, :4], states[i, 4] = state, value
        powers = time ** np.arange(5) / FACTORIALS
        state = np.stack([powers[: 5 - k] @ states[i, k:] for k in range(4)])
        # a jerk of round-off grows with t^2 over a long piece of constant velocity; there it is zero
        largest = np.maximum(largest, np.abs(state))
        state[1:][np.abs(state[1:]) <= ROUND_OFF * largest[1:]] = 0.0
    return np.concatenate([[0.0], np.cumsum(durations)]), states


def stay_inside(times: ArrayLike, positions: ArrayLike, box: ArrayLike) -> None:
    """Raise an error with the first time at which sampled positions (N, n_p) at `times` (N,) are outside the box P.

    Raises
    ------
    DomainError
        If one is outside.
    DimensionError
        If the shapes disagree.
    """
    bounds = box_array(box)
    t = finite_array("times", times, (None,))
    p = finite_array("positions", positions, (len(t), len(bounds)))
    slack = BOX_SLACK * (bounds[:, 1] - bounds[:, 0])
    outside = np.any((p < bounds[:, 0] - slack) | (p > bounds[:, 1] + slack), axis=1)
    if np.any(outside):
        at = int(np.argmax(outside))
        raise DomainError(
            f"the position leaves P at t = {t[at]:.6g} s: it is {p[at].tolist()}, wanted within {bounds.tolist()}. "
            "Move the set-point, or take a larger P."
        )


def _passed(value: float, low: float, high: float) -> float:
    """The bound that was passed."""
    return low if abs(value - low) < abs(value - high) else high
