"""Perturbed plants as plain numbers: modes, masses, misalignment and position of each."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box, read_only
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DimensionError, DomainError


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """N perturbed plants, each at a position.

    Attributes
    ----------
    zeta : (N, n_f)
        Damping ratios of all flexible modes of the true plant.
    omega : (N, n_f) [rad/s]
        Their eigenfrequencies.
    modal_mass : (N, n_f)
        Factors of their modal masses.
    mass : (N, n_rb)
        Factors of the masses and inertias of the rigid axes.
    misalignment : (N, n_p) [m]
        The actuators are commutated for position + misalignment.
    position : (N, n_p) [m]

    Raises
    ------
    DimensionError
        If sizes disagree.
    DomainError
        If a number is not finite, a frequency or mass factor not above 0, or a damping ratio not within [0, 1).
    """

    zeta: Array
    omega: Array
    modal_mass: Array
    mass: Array
    misalignment: Array
    position: Array

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(self.position))
        shapes = {"omega": np.shape(self.zeta), "modal_mass": np.shape(self.zeta)}
        shapes |= {"misalignment": np.shape(self.position)}
        for field in dataclasses.fields(self):
            values = finite_array(field.name, getattr(self, field.name), (n, None))
            if field.name in shapes and values.shape != shapes[field.name]:
                raise DimensionError(
                    f"{field.name} has shape {values.shape}, wanted {shapes[field.name]}: one row for each plant."
                )
            object.__setattr__(self, field.name, read_only(values))
        for name in ("omega", "modal_mass", "mass"):
            if np.any(getattr(self, name) <= 0.0):
                raise DomainError(f"{name} has the entry {np.min(getattr(self, name)):.6g}, wanted entries above 0.")
        if np.any((self.zeta < 0.0) | (self.zeta >= 1.0)):
            raise DomainError("zeta has entries outside [0, 1), wanted damping ratios of modes that oscillate.")

    @classmethod
    def nominal(cls, plant: DecoupledPlant, points: ArrayLike) -> Samples:
        """The plant as it is at positions (N, n_p); a `DomainError` outside the box."""
        where = points_in_box(points, plant.box)
        N, flexible = len(where), slice(plant.n_rb, None)
        return cls(
            zeta=np.tile(plant.zeta[flexible], (N, 1)),
            omega=np.tile(plant.omega[flexible], (N, 1)),
            modal_mass=np.ones((N, plant.n_modes - plant.n_rb)),
            mass=np.ones((N, plant.n_rb)),
            misalignment=np.zeros_like(where),
            position=where,
        )

    def __len__(self) -> int:
        return len(self.position)

    def take(self, which: Any) -> Samples:
        """Those that an index, a slice or an array of indices chooses; a single index gives one plant."""
        chosen: Any = np.array([which]) if isinstance(which, int | np.integer) else which
        return Samples(**{name: values[chosen] for name, values in self.arrays().items()})

    def arrays(self) -> dict[str, Array]:
        """All arrays by name."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
