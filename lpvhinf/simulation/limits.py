"""What the axes of a machine may do: largest velocity, acceleration, jerk and snap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, read_only
from lpvhinf.errors import DimensionError, DomainError

NAMES = ("velocity", "acceleration", "jerk", "snap")


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class MotionLimits:
    """Symmetric limits of the derivatives of every axis: one number for all axes, or (n_axes,).

    Parameters
    ----------
    velocity : [m/s, rad/s]
    acceleration : [m/s^2, rad/s^2]
    jerk : [m/s^3, rad/s^3]
    snap : [m/s^4, rad/s^4]
        Always finite; the others are infinite where left out.

    Raises
    ------
    DimensionError
        If two limits are for different numbers of axes.
    DomainError
        If a limit is NaN or not above zero, or the snap is infinite.

    Examples
    --------
    >>> limits = MotionLimits(velocity=[0.5, 0.5, 0.01], acceleration=10.0, snap=1e6)
    >>> limits.n_axes, limits.jerk.tolist()
    (3, [inf, inf, inf])
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    snap: Array

    def __init__(
        self,
        *,
        snap: ArrayLike,
        jerk: ArrayLike = np.inf,
        acceleration: ArrayLike = np.inf,
        velocity: ArrayLike = np.inf,
    ) -> None:
        given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk, "snap": snap}
        arrays = {name: _limit(name, value) for name, value in given.items()}
        n_axes = max(len(value) for value in arrays.values())
        for name, value in arrays.items():
            if len(value) not in (1, n_axes):
                raise DimensionError(
                    f"{name} has {len(value)} entries, another limit {n_axes}. Give one for each axis."
                )
            object.__setattr__(self, name, read_only(np.broadcast_to(value, (n_axes,))))

    @property
    def n_axes(self) -> int:
        """Number of axes; 1 serves any number."""
        return len(self.snap)

    def array(self, n_axes: int) -> Array:
        """Limits of velocity, acceleration, jerk and snap as (4, n_axes).

        Raises
        ------
        DimensionError
            If the limits are for another number of axes.
        """
        if self.n_axes not in (1, n_axes):
            raise DimensionError(
                f"limits are for {self.n_axes} axes, the set-point has {n_axes}. Give one for each axis."
            )
        return np.stack([np.broadcast_to(getattr(self, name), (n_axes,)) for name in NAMES])

    def along(self, displacement: Array) -> Array:
        """Limits (4,) of a path parameter from 0 to 1 on a straight line by `displacement` (n_axes,), not zero.

        The axis that is first at a limit decides.
        """
        moving = displacement != 0.0
        return np.asarray(np.min(self.array(len(displacement))[:, moving] / np.abs(displacement[moving]), axis=1))


def _limit(name: str, value: ArrayLike) -> Array:
    try:
        array = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError) as error:
        raise DomainError(f"{name} is {value!r}, wanted a positive number, or one for each axis.") from error
    if array.ndim != 1 or not len(array):
        raise DimensionError(f"{name} has shape {array.shape}, wanted one number or (n_axes,).")
    if not np.all(array > 0.0):  # NaN too
        raise DomainError(f"{name} is {array.tolist()}, wanted numbers above 0.")
    if name == "snap" and not np.all(np.isfinite(array)):
        raise DomainError(f"snap is {array.tolist()}, wanted finite numbers: the set-points here are of fourth order.")
    return array
