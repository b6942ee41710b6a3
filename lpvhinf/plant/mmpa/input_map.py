"""The input map of the coils, from their wrenches."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa.coils import CoilWrench


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilInputMap:
    """Phi_a(p) of the coils for q = (x, y, rz, Ritz coefficients): the wrench, its torque moved to the CoG.

    Attributes
    ----------
    coils : CoilWrench
        The magnetics.
    centre_of_gravity : (3,)
        In the mover frame [m].
    shift : (2,)
        The map at p is that of the mover at p + shift [m], which may lie outside the box: what a misaligned
        commutation believes.
    """

    coils: CoilWrench
    centre_of_gravity: Array
    shift: Array = field(default_factory=lambda: np.zeros(2))

    def __call__(self, points: Array) -> Array:
        """Phi_a at `points` (N, 2), as (N, 3 + n_ritz, n_coils)."""
        wrench = np.array(self.coils.wrench(points + self.shift))  # a copy: the array is that of the magnetics
        c_x, c_y = self.centre_of_gravity[:2]
        wrench[:, 2] += c_y * wrench[:, 0] - c_x * wrench[:, 1]
        return wrench
