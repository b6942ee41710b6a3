"""Laser interferometers on the metrology frame, which see other points of the mover as it travels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.plate import RitzPlate

SENSOR_NAMES = ("z1", "z2", "z3", "z4", "x1", "x2", "x3", "y1", "y2")


@dataclass(frozen=True, kw_only=True, eq=False)
class InterferometerMap:
    r"""Phi_s(p) of nine beams, for q = (x, y, rz, Ritz coefficients); x, y, rz describe the centre of gravity.

    - Four vertical beams at the frame points r_k = (+-80, +-80) mm read w at the mover point r_k - p.
    - Three horizontal beams along x at the frame ordinates y = 80, 0, -80 mm hit the mirror at the edge x = a/2 at the
      mover ordinate s = y - p_y and the height h above the neutral plane. They read
      :math:`x - (s - c_y)\, r_z - h\, \partial w / \partial x (a/2, s)`.
    - Two beams along y at the frame abscissae x = 80, -80 mm hit the mirror at y = a/2, s = x - p_x, and read
      :math:`y + (s - c_x)\, r_z - h\, \partial w / \partial y (s, a/2)`.

    At every position the four vertical beams see z, rx, ry (their four points form a square), two of the x-beams
    x and rz, and a y-beam y: all six rigid-body coordinates are observable, with three beams to spare.
    """

    plate: RitzPlate
    centre_of_gravity: Array
    z_beams: Array
    x_beams: Array
    y_beams: Array
    height: float

    @classmethod
    def from_parameters(
        cls, parameters: MMPAParameters, plate: RitzPlate, centre_of_gravity: Array
    ) -> InterferometerMap:
        """The nine beams of the benchmark."""
        s = parameters.sensor_xy_half_span
        return cls(
            plate=plate,
            centre_of_gravity=centre_of_gravity,
            z_beams=parameters.z_beams,
            x_beams=np.array([s, 0.0, -s]),
            y_beams=np.array([s, -s]),
            height=parameters.sensor_height,
        )

    def __call__(self, points: Array) -> Array:
        """Phi_s at `points` (N, 2), as (N, 9, 3 + n_ritz)."""
        N, h = len(points), self.plate.side / 2
        c_x, c_y = self.centre_of_gravity
        n_z, n_x = len(self.z_beams), len(self.x_beams)
        out = np.zeros((N, n_z + n_x + len(self.y_beams), 3 + self.plate.n_ritz))
        out[:, :n_z, 3:] = self.plate.rows(self.z_beams - points[:, None, :])
        x_rows, y_rows = out[:, n_z : n_z + n_x], out[:, n_z + n_x :]
        s = self.x_beams - points[:, 1:]
        x_rows[:, :, 0], x_rows[:, :, 2] = 1.0, -(s - c_y)
        x_rows[:, :, 3:] = -self.height * self.plate.rows(np.stack([np.full_like(s, h), s], axis=-1), (1, 0))
        s = self.y_beams - points[:, :1]
        y_rows[:, :, 1], y_rows[:, :, 2] = 1.0, s - c_x
        y_rows[:, :, 3:] = -self.height * self.plate.rows(np.stack([s, np.full_like(s, h)], axis=-1), (0, 1))
        return out
