"""The point of control: the mover point that is at a fixed place of the frame, whose motion is what counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa.kinematics import displacement_rows, rigid_transform, rotation_rows
from lpvhinf.plant.mmpa.mover import Mover
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.plate import RitzPlate


@dataclass(frozen=True, kw_only=True, eq=False)
class PointOfControl:
    r"""Motion of the material point at the frame point r = (r_x, r_y), which is the mover point r - p.

    Its displacement and rotation are those of `lpvhinf.plant.mmpa.kinematics` at (X, Y) = r - p and the height Z. For
    rigid motion about the centre of gravity c they are t + rot x d and rot with d = (r - p, Z) - c; the rest is the
    flexible error at the point of control.

    Attributes
    ----------
    plate : RitzPlate
        The mover's plate.
    centre_of_gravity : (3,)
        In the mover frame [m].
    place : (3,)
        r_x and r_y in the frame, and the height Z from the neutral plane [m].
    """

    plate: RitzPlate
    centre_of_gravity: Array
    place: Array

    @classmethod
    def of(cls, parameters: MMPAParameters, mover: Mover) -> PointOfControl:
        """The point of control that `parameters` name, on a mover.

        Examples
        --------
        >>> from lpvhinf.plant.mmpa.mover import mover
        >>> p = MMPAParameters()
        >>> point = PointOfControl.of(p, mover(p))
        >>> point.rigid_transform(np.array([[0.01, 0.02]]))[0, 2].round(4).tolist()  # z from (x, y, z, rx, ry, rz)
        [0.0, 0.0, 1.0, -0.027, 0.017, 0.0]
        """
        place = np.array([*parameters.point_of_control[:2], parameters.point_height])
        return cls(plate=mover.plate, centre_of_gravity=mover.centre_of_gravity, place=place)

    def rows(self, points: Array) -> Array:
        """Rows (N, 6, 3 + n_ritz) that map q to x, y, z [m] and rx, ry, rz [rad] of the point, at p (N, 2) [m]."""
        places = self.place[:2] - points
        displacement = displacement_rows(self.plate, self.centre_of_gravity, places, self.place[2])
        return np.concatenate([displacement, rotation_rows(self.plate, places)], axis=1)

    __call__ = rows

    def rigid_transform(self, points: Array) -> Array:
        """Rigid coordinates (x, y, z, rx, ry, rz) about the centre of gravity to the point, (N, 6, 6), at p (N, 2)."""
        offsets = np.column_stack([self.place[:2] - points, np.full(len(points), self.place[2])])
        return rigid_transform(offsets - self.centre_of_gravity)
