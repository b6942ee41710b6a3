r"""Actuators and sensors at places that travel with the mover or stand on the frame.

The mover is displaced by p along the axes ``position_axes``; E p is that displacement in space. What stands on the
frame at r, in mover coordinates at p = 0, meets another point of the mover at every p:

.. math::

    \text{actuator: } r - E p, \qquad \text{sensor along } d: \; r - (I - d d^\top) E p

A sensor's beam runs along its direction and hits a mirror perpendicular to it, so the point seen moves along the mirror
only. For a vertical beam and travel in the plane this is r - p.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.plant.mode_data.mode_shapes import spatial

FIXED_TO = ("mover", "frame")
DIRECTIONS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Station(ABC):
    """What actuators and sensors have in common: a place, a direction, a gain.

    Raises
    ------
    DimensionError, DomainError
        If the place is not two or three numbers, the direction has no length, `fixed_to` is unknown, or the gain is
        zero or not finite.
    """

    place: Array
    fixed_to: str
    direction: Array | str = "z"
    gain: float = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        place = finite_array("place", self.place)
        if place.shape not in ((2,), (3,)):
            raise DimensionError(f"place has shape {place.shape}, wanted (2,) or (3,): x, y and perhaps z [m].")
        object.__setattr__(self, "place", read_only(place))
        if self.fixed_to not in FIXED_TO:
            raise DomainError(f"fixed_to is {self.fixed_to!r}, wanted 'mover' (travels with it) or 'frame'.")
        given: ArrayLike = self.direction
        if isinstance(self.direction, str):
            if self.direction not in DIRECTIONS:
                raise DomainError(f"direction is {self.direction!r}, wanted 'x', 'y', 'z' or three numbers.")
            given = DIRECTIONS[self.direction]
        direction = finite_array("direction", given, (3,))
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise DomainError("direction is (0, 0, 0), wanted a vector; it is normalised.")
        object.__setattr__(self, "direction", read_only(direction / length))
        if not np.isfinite(self.gain) or self.gain == 0.0:
            raise DomainError(f"gain is {self.gain!r}, wanted a finite number other than 0.")

    @abstractmethod
    def travel(self) -> Array:
        """The matrix (3, 3) by which the point that is met moves, in mover coordinates, as the mover moves."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Actuator(Station):
    """A force on the mover.

    Parameters
    ----------
    place : (3,) or (2,)
        Where it acts, in mover coordinates at p = 0 [m]; x and y alone lie in the plane of the nodes.
    fixed_to : "mover" or "frame"
        Whether the place travels with the mover, or stands on the frame and meets the mover at place - p.
    direction : (3,) or "x", "y", "z"
        Direction of the force, normalised; it does not turn.
    gain : float
        Force per unit of u [N per unit of u].
    name : str
        Label of the input.

    Examples
    --------
    >>> Actuator(place=[0.1, 0.0], fixed_to="mover", gain=25.0).direction.tolist()
    [0.0, 0.0, 1.0]
    """

    def travel(self) -> Array:
        """Zero on the mover, minus the identity on the frame."""
        return np.zeros((3, 3)) if self.fixed_to == "mover" else -np.eye(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensor(Station):
    """A reading of the mover's displacement along a direction.

    Parameters
    ----------
    place : (3,) or (2,)
        The point seen, in mover coordinates at p = 0 [m]; x and y alone lie in the plane of the nodes.
    fixed_to : "mover" or "frame"
        Whether the same point is seen at every p, or the beam stands on the frame and the point moves along the
        mirror, which is perpendicular to the beam.
    direction : (3,) or "x", "y", "z"
        Direction in which displacement counts, normalised.
    gain : float
        Reading per displacement [unit of y per m].
    name : str
        Label of the output.

    Examples
    --------
    A horizontal beam along x keeps its x on the mirror, and sees another y as the mover travels along y:

    >>> Sensor(place=[0.15, 0.08, 0.01], fixed_to="frame", direction="x").travel().diagonal().tolist()
    [0.0, -1.0, -1.0]
    """

    def travel(self) -> Array:
        """Zero on the mover, minus the projection on the mirror on the frame."""
        d = np.asarray(self.direction)
        return np.zeros((3, 3)) if self.fixed_to == "mover" else np.outer(d, d) - np.eye(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class StationArray:
    """Several stations: places (n, 3) at p = 0, their travel (n, 3, n_p), directions times gain (n, 3)."""

    places: Array
    travel: Array
    vectors: Array

    @classmethod
    def of(cls, stations: Sequence[Station], position_axes: Sequence[str], height: float) -> StationArray:
        """Stack stations; places without z lie at `height`."""
        E = np.stack([DIRECTIONS[name] for name in position_axes], axis=1)
        return cls(
            places=np.stack([spatial(s.place, height) for s in stations]),
            travel=np.stack([s.travel() @ E for s in stations]),
            vectors=np.stack([s.gain * np.asarray(s.direction) for s in stations]),
        )

    def at(self, points: Array) -> Array:
        """Mover points (N, n, 3) that the stations meet at positions (N, n_p)."""
        return np.asarray(self.places + np.einsum("kcp,np->nkc", self.travel, points))
