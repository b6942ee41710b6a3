"""Laser interferometers on the metrology frame, which see other points of the mover as it travels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa.effects import Effects
from lpvhinf.plant.mmpa.kinematics import IN_PLANE, displacement_rows
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.plate import RitzPlate

SENSOR_NAMES = ("z1", "z2", "z3", "z4", "x1", "x2", "x3", "y1", "y2")


@dataclass(frozen=True, kw_only=True, eq=False)
class InterferometerMap:
    r"""Phi_s(p) of nine beams, for q = (x, y, rz, Ritz coefficients); x, y, rz describe the centre of gravity's place.

    - Four vertical beams at the frame points r_k = (+-80, +-80) mm read w at the mover point r_k - p.
    - Three horizontal beams along x at the frame ordinates y = 80, 0, -80 mm hit the mirror at the edge x = a/2 at the
      mover ordinate s = y - p_y and the height h above the neutral plane. They read
      :math:`x - (s - c_y)\, r_z - h\, \partial w / \partial x (a/2, s)`.
    - Two beams along y at the frame abscissae x = 80, -80 mm hit the mirror at y = a/2, s = x - p_x, and read
      :math:`y + (s - c_x)\, r_z - h\, \partial w / \partial y (s, a/2)`.

    That holds for mirrors square to their beams. In general a beam along the unit vector b meets a mirror of normal n
    at a mover point r. When the mover is displaced by u, the mirror's plane passes through r + u(r), and the place
    where the beam meets it shifts along the beam by

    .. math:: \frac{n \cdot u(r)}{n \cdot b}

    to first order in u; the mirror's own rotation is of second order there, as the beam keeps its place. With
    n = b + slopes, as below, the denominator is 1: a slope mixes in the displacement of the same point across the beam.

    At every position the four vertical beams see z, rx, ry (their four points form a square), two of the x-beams
    x and rz, and a y-beam y: all six rigid-body coordinates are observable, with three beams to spare.

    Attributes
    ----------
    plate : RitzPlate
        The mover's plate.
    centre_of_gravity : (3,)
        In the mover frame [m].
    z_beams, x_beams, y_beams : (4, 2), (3,), (2,)
        Frame coordinates of the beams [m].
    height : float
        Of the horizontal beams, from the neutral plane [m].
    top : float
        Height of the mirror of the vertical beams, the top face, from the neutral plane [m].
    normals : (3, 3)
        Normals of the mirrors of x-, y- and z-beams, one a row, with a unit entry along the beam.
    """

    plate: RitzPlate
    centre_of_gravity: Array
    z_beams: Array
    x_beams: Array
    y_beams: Array
    height: float
    top: float
    normals: Array

    @classmethod
    def from_parameters(
        cls,
        parameters: MMPAParameters,
        plate: RitzPlate,
        centre_of_gravity: Array,
        effects: Effects | None = None,
    ) -> InterferometerMap:
        """The nine beams of the benchmark, with the beam height and mirror slopes of `effects`.

        Raises
        ------
        DomainError
            If the horizontal beams miss their mirrors.
        """
        given = Effects() if effects is None else effects
        s, height = parameters.sensor_xy_half_span, parameters.sensor_height + given.beam_height_error
        if not -parameters.plate_thickness / 2 <= height <= parameters.beam_top:
            raise DomainError(
                f"beam_height_error is {given.beam_height_error} m: the horizontal beams run {height:.4g} m above the "
                f"neutral plane and miss the mirrors, which end at {-parameters.plate_thickness / 2:.4g} m and "
                f"{parameters.beam_top:.4g} m."
            )
        x, y, z = given.mirror_slope_x, given.mirror_slope_y, given.mirror_slope_z
        return cls(
            plate=plate,
            centre_of_gravity=centre_of_gravity,
            z_beams=parameters.z_beams,
            x_beams=np.array([s, 0.0, -s]),
            y_beams=np.array([s, -s]),
            height=height,
            top=parameters.plate_thickness / 2,
            normals=np.array([[1.0, *x], [y[0], 1.0, y[1]], [*z, 1.0]]),
        )

    def __call__(self, points: Array) -> Array:
        """Phi_s at `points` (N, 2), as (N, 9, 3 + n_ritz)."""
        h = self.plate.side / 2
        across_x, across_y = self.x_beams - points[:, 1:], self.y_beams - points[:, :1]
        groups = [
            (self.z_beams - points[:, None, :], self.top, self.normals[2]),
            (np.stack([np.full_like(across_x, h), across_x], axis=-1), self.height, self.normals[0]),
            (np.stack([across_y, np.full_like(across_y, h)], axis=-1), self.height, self.normals[1]),
        ]
        out = np.zeros((len(points), sum(places.shape[1] for places, _, _ in groups), IN_PLANE + self.plate.n_ritz))
        start = 0
        for places, height, normal in groups:
            beams = out[:, start : start + places.shape[1]]
            start += places.shape[1]
            rows = displacement_rows(self.plate, self.centre_of_gravity, places, height)
            for axis in np.flatnonzero(normal):
                beams += normal[axis] * rows[:, :, axis]
        return out
