"""A point-to-point step whose position is a polynomial of fourth order, piece by piece."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.errors import DomainError


@dataclass(frozen=True, kw_only=True)
class FourthOrderStep:
    r"""A step from 0 to `distance` with piecewise constant snap, the fourth derivative of the position.

    The acceleration is a smooth pulse and its negative mirror image; each flank of a pulse is a trapezoid of jerk,
    whose flanks last `snap_time`. Acceleration is piecewise quadratic in t and its derivative continuous: the
    fourth-order setpoint of [lambrechts2005trajectory].

    Parameters
    ----------
    distance : [m, rad]
    snap_time : [s]
        Of each of the eight pieces with snap; above 0.
    jerk_time, acceleration_time, velocity_time : [s]
        Of each of the four pieces of constant jerk, of the two of constant acceleration, and of constant velocity.

    Raises
    ------
    DomainError
        If a time is below zero or not finite, `snap_time` or `distance` not above zero.

    Examples
    --------
    >>> step = FourthOrderStep(distance=1e-3, snap_time=5e-3)
    >>> step.duration, round(step.peak_acceleration, 6), step.position([0.0, 0.02, 0.04]).round(9).tolist()
    (0.04, 5.0, [0.0, 0.0005, 0.001])
    """

    distance: float
    snap_time: float
    jerk_time: float = 0.0
    acceleration_time: float = 0.0
    velocity_time: float = 0.0

    def __post_init__(self) -> None:
        positive("distance", self.distance)
        positive("snap_time", self.snap_time, "s")
        for name in ("jerk_time", "acceleration_time", "velocity_time"):
            if finite_array(name, getattr(self, name), ()) < 0.0:
                raise DomainError(f"{name} is {getattr(self, name)}, wanted 0 or more seconds.")

    @cached_property
    def _pieces(self) -> tuple[Array, Array]:
        """Knots (n + 1,), and the derivatives 0 to 4 of the position at the begin of each piece (n, 5)."""
        flank = [(1.0, self.snap_time), (0.0, self.jerk_time), (-1.0, self.snap_time)]
        fall = [(-sign, time) for sign, time in flank]
        faster = [*flank, (0.0, self.acceleration_time), *fall]
        slower = [(-sign, time) for sign, time in faster]
        plan = [(sign, time) for sign, time in [*faster, (0.0, self.velocity_time), *slower] if time > 0.0]
        knots = np.concatenate([[0.0], np.cumsum([time for _, time in plan])])
        rows, state = [], np.zeros(4)
        for sign, time in plan:
            row = np.append(state, sign)
            rows.append(row)
            state = np.array([_taylor(row[k:], time) for k in range(4)])
        return read_only(knots), read_only(np.array(rows) * (self.distance / state[0]))

    @property
    def knots(self) -> Array:
        """Begin and end of the pieces [s]."""
        return self._pieces[0]

    @property
    def duration(self) -> float:
        """Time of the step [s]."""
        return float(self.knots[-1])

    @property
    def accelerations(self) -> Array:
        """Acceleration, jerk and snap at the begin of each piece, (n, 3) [m/s^2, m/s^3, m/s^4]."""
        return self._pieces[1][:, 2:]

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration [m/s^2, rad/s^2]; reached at a knot, as the jerk changes its sign only there."""
        return float(np.max(np.abs(self.accelerations[:, 0])))

    def position(self, times: ArrayLike) -> Array:
        """Position at times (n_t,) [s]: 0 before, `distance` after the step."""
        return self._derivative(times, 0)

    def velocity(self, times: ArrayLike) -> Array:
        """Velocity at times (n_t,)."""
        return self._derivative(times, 1)

    def acceleration(self, times: ArrayLike) -> Array:
        """Acceleration at times (n_t,)."""
        return self._derivative(times, 2)

    def _derivative(self, times: ArrayLike, order: int) -> Array:
        t = finite_array("times", times)
        knots, rows = self._pieces
        piece = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(rows) - 1)
        tau = t - knots[piece]
        value = sum(rows[piece, order + k] * tau**k / factorial(k) for k in range(5 - order))
        inside = np.where(t <= 0.0, 0.0, value)
        return np.asarray(np.where(t >= knots[-1], self.distance if order == 0 else 0.0, inside))


def _taylor(derivatives: Array, time: float) -> float:
    """The polynomial with these derivatives at 0, at `time`."""
    return float(sum(d * time**k / factorial(k) for k, d in enumerate(derivatives)))
