"""Scanning set-points: lines at constant velocity to and fro, with a step between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.notebook import table
from lpvhinf.simulation.limits import MotionLimits
from lpvhinf.simulation.trajectory import FACTORIALS, Trajectory, from_snap
from lpvhinf.simulation.widths import displacement, pulses, stretched, velocity_change, whole_samples

Pieces = tuple[Array, Array]  # durations (m,), snap (m, n)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """A scanning set-point.

    Attributes
    ----------
    trajectory : Trajectory
        From rest to rest.
    windows : (lines, 2) [s]
        Begin and end of every line: the scan axis has constant velocity, the others rest.
    axis : int
        The scan axis.
    velocity : float
        Its speed in the windows [m/s].
    """

    trajectory: Trajectory
    windows: Array
    axis: int
    velocity: float

    def _repr_html_(self) -> str:
        rows = [[str(i), f"{low:.6g}", f"{high:.6g}"] for i, (low, high) in enumerate(self.windows)]
        title = f"Scan along axis {self.axis} at {self.velocity:.6g} m/s, {self.trajectory.duration:.6g} s"
        return table(title, [["line", "from s", "to s"], *rows])


def scan(
    start: ArrayLike,
    *,
    axis: int,
    length: float,
    velocity: float,
    limits: MotionLimits,
    lines: int = 1,
    step: ArrayLike | None = None,
    settle_time: float = 0.0,
    period: float | None = None,
    box: ArrayLike | None = None,
) -> Scan:
    """Scan `lines` lines to and fro at constant velocity; between them turn back and step to the next one.

    The scan axis is sped up from rest, keeps its velocity for `settle_time`, the line, and `settle_time` again, and
    turns back by one change of velocity from +v to -v, which is fourth-order and exactly at the limits. The step is
    made from the end of a line to the end of the turn; the shorter of both is stretched to the longer one, so that it
    is gentler.

    Parameters
    ----------
    start : (n,) [m, rad]
        Where the first line begins; the run-up lies before it.
    axis : int
        The scan axis.
    length : float
        Of a line [m]; negative to scan downwards first. In whole samples, a line is longer by less than one sample.
    velocity : float
        Scan speed [m/s], above 0.
    limits : MotionLimits
    lines : int
    step : (n,), optional
        From one line to the next, zero in the scan axis [m, rad]; none if left out.
    settle_time : float
        [s]
    period : float, optional
        Sampling period [s]: windows and knots are then whole samples.
    box : (n_p, 2), optional
        P, for the first n_p axes.

    Raises
    ------
    DimensionError
        If the numbers of axes disagree.
    DomainError
        If the speed exceeds its limit, the axis is unknown, `step` moves the scan axis, a time is negative, or the
        set-point leaves P.

    Examples
    --------
    >>> limits = MotionLimits(velocity=1.0, acceleration=10.0, jerk=2000.0, snap=1e6)
    >>> made = scan([0.0, 0.0], axis=1, length=0.03, velocity=0.3, limits=limits, lines=2, step=[0.02, 0.0])
    >>> made.windows.round(4).tolist()
    [[0.037, 0.137], [0.2337, 0.3337]]
    >>> made.trajectory.position(made.windows.ravel()).round(12).tolist()
    [[0.0, 0.0], [0.0, 0.03], [0.02, 0.03], [0.02, 0.0]]
    """
    origin = np.atleast_1d(finite_array("start", start))
    n = len(origin)
    origin = finite_array("start", origin, (n,))
    moved = np.zeros(n) if step is None else np.atleast_1d(finite_array("step", step))
    moved = finite_array("step", moved, (n,))
    if whole_number("axis", axis, 0) >= n:
        raise DomainError(f"axis is {axis}, wanted 0 to {n - 1}.")
    if moved[axis] != 0.0:
        raise DomainError(
            f"step moves the scan axis {axis} by {moved[axis]}, wanted 0 there: lines begin side by side."
        )
    allowed = limits.array(n)
    speed, unit = positive("velocity", velocity, "m/s"), 1.0 if period is None else positive("period", period, "s")
    if speed > allowed[0, axis]:
        raise DomainError(
            f"velocity is {speed}, which exceeds the limit {allowed[0, axis]} of axis {axis} in the first run-up. "
            "Scan slower."
        )
    if not np.isfinite(length) or length == 0.0:
        raise DomainError(f"length is {length}, wanted a finite number other than 0.")
    if not np.isfinite(settle_time) or settle_time < 0.0:
        raise DomainError(f"settle_time is {settle_time}, wanted 0 or more seconds.")
    line, settle = abs(length) / speed, settle_time
    if period is not None:  # from here on all times are numbers of samples
        line, settle = (float(np.ceil(t / period * (1.0 - 1e-12))) for t in (line, settle))

    def change(amount: float) -> Array:
        widths = velocity_change(amount, allowed[1:, axis])
        return widths if period is None else whole_samples(widths, amount, allowed[1:, axis], period)

    run_up, turn, move = change(speed), change(2.0 * speed), None
    if np.any(moved) and lines > 1:
        of_move = limits.along(moved)
        move = displacement(1.0, of_move)
        move = move if period is None else whole_samples(move, 1.0, of_move, period)
        turn = stretched(turn, max(float(np.sum(turn)), float(np.sum(move)) - settle))
        move = stretched(move, settle + float(np.sum(turn)))
    plan = _Plan(origin, axis, np.sign(length) * speed, unit)
    ahead = unit * (0.5 * float(np.sum(run_up)) + settle) * plan.velocity
    plan.ramp(run_up, origin[axis] - ahead, 0.0, plan.velocity)
    windows = []
    for i in range(whole_number("lines", lines, 1)):
        sign = 1.0 if i % 2 == 0 else -1.0
        begin = origin[axis] + (0.0 if sign > 0.0 else unit * line * plan.velocity)
        at = begin - sign * unit * settle * plan.velocity
        plan.cruise(settle, at, sign * plan.velocity)
        windows.append([plan.now, plan.now + unit * line])
        plan.cruise(line, begin, sign * plan.velocity)
        end = begin + sign * unit * line * plan.velocity
        step_at = plan.now
        plan.cruise(settle, end, sign * plan.velocity)
        away = end + sign * unit * settle * plan.velocity
        if i == lines - 1:
            plan.ramp(run_up, away, sign * plan.velocity, 0.0)
            last = away + 0.5 * sign * unit * float(np.sum(run_up)) * plan.velocity
        else:
            plan.ramp(turn, away, sign * plan.velocity, -sign * plan.velocity)
            if move is not None:
                plan.step(move, step_at, origin + i * moved, moved)
    trajectory = plan.trajectory(last, origin + (lines - 1) * moved)
    trajectory.check(limits=limits, box=box)
    return Scan(trajectory=trajectory, windows=read_only(windows), axis=axis, velocity=speed)


class _Plan:
    """The pieces of the scan axis, and of the steps of the other axes, as they are laid down."""

    def __init__(self, origin: Array, axis: int, velocity: float, unit: float) -> None:
        self.origin, self.axis, self.velocity, self.unit = origin, axis, velocity, unit
        self.knots: list[Array] = [np.zeros(1)]
        self.states: list[Array] = []
        self.steps: list[tuple[Array, Array, Array]] = []

    @property
    def now(self) -> float:
        return float(self.knots[-1][-1])

    def ramp(self, widths: Array, at: float, before: float, after: float) -> None:
        durations, snap = pulses(widths, 1.0)
        self._add(self.unit * durations, (after - before) / self.unit**3 * snap, at, before)

    def cruise(self, time: float, at: float, velocity: float) -> None:
        if time > 0.0:
            self._add(np.array([self.unit * time]), np.zeros(1), at, velocity)

    def _add(self, durations: Array, snap: Array, at: float, velocity: float) -> None:
        knots, states = from_snap(at, durations, snap[:, None], velocity=velocity)
        self.knots.append(self.now + knots[1:])
        self.states.append(states[:, :, 0])

    def step(self, widths: Array, begin: float, at: Array, moved: Array) -> None:
        durations, snap = pulses(widths, 1.0)
        knots, states = from_snap(at, self.unit * durations, snap[:, None] * moved / self.unit**4)
        self.steps.append((begin + knots, states, at + moved))

    def trajectory(self, last: float, rest: Array) -> Trajectory:
        """All axes on the union of their knots."""
        own = Trajectory(
            knots=np.concatenate(self.knots), states=np.concatenate(self.states)[:, :, None], end=np.array([last])
        )
        knots = _distinct(np.concatenate([own.knots, *(part[0] for part in self.steps)]))
        middle = 0.5 * (knots[:-1] + knots[1:])
        states = np.zeros((len(middle), 5, len(rest)))
        states[:, 0] = self.origin
        for times, pieces, end in self.steps:
            states[:, :, :] = _over(states, knots, middle, times, pieces)
            states[middle > times[-1], 0] = end
        states[:, :, self.axis : self.axis + 1] = _over(
            states[:, :, self.axis : self.axis + 1], knots, middle, own.knots, own.states
        )
        end = np.array(rest)
        end[self.axis] = last
        return Trajectory(knots=knots, states=states, end=end)


def _distinct(times: Array) -> Array:
    """Sorted times without those that differ from the one before by round-off only."""
    ordered = np.unique(times)
    apart = np.diff(ordered) > 1e-14 * max(1.0, float(ordered[-1]))
    return np.asarray(ordered[np.concatenate([[True], apart])])


def _over(states: Array, knots: Array, middle: Array, times: Array, pieces: Array) -> Array:
    """`states` on `knots`, replaced within `times` by those of `pieces` there."""
    inside = (middle > times[0]) & (middle < times[-1])
    piece = np.searchsorted(times, middle[inside]) - 1
    tau = (knots[:-1][inside] - times[piece])[:, None]
    out = np.array(states)
    value = pieces[piece]
    for k in range(5):
        out[inside, k] = sum(tau**i / FACTORIALS[i] * value[:, k + i] for i in range(5 - k))
    return out
