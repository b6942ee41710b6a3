"""The generalized plant over the box P."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError
from lpvhinf.notebook import properties
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace


@dataclass(frozen=True, eq=False)
class LPVGeneralizedPlant:
    """An `LPVStateSpace` from [w; u] to [z; y], with the sizes of the control channel.

    Parameters
    ----------
    system : LPVStateSpace
    n_u, n_y : int
        Numbers of control inputs and of measurements: the last inputs and outputs.

    Raises
    ------
    DimensionError
        If the system has fewer channels.
    """

    system: LPVStateSpace
    n_u: int
    n_y: int

    def __post_init__(self) -> None:
        if not (0 <= self.n_u <= self.system.n_u and 0 <= self.n_y <= self.system.n_y):
            raise DimensionError(
                f"n_u = {self.n_u}, n_y = {self.n_y} do not fit a system with {self.system.n_u} inputs and "
                f"{self.system.n_y} outputs."
            )

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2)."""
        return self.system.box

    @property
    def n_w(self) -> int:
        """Number of disturbances."""
        return self.system.n_u - self.n_u

    @property
    def n_z(self) -> int:
        """Number of performance outputs."""
        return self.system.n_y - self.n_y

    def _repr_html_(self) -> str:
        sizes = f"w ({self.n_w}), u ({self.n_u}) to z ({self.n_z}), y ({self.n_y})"
        return properties("LPVGeneralizedPlant", [("channels", sizes)]) + self.system._repr_html_()

    def at(self, p: ArrayLike) -> GeneralizedPlant:
        """The frozen plant at one position."""
        return self.sample(np.reshape(np.asarray(p, dtype=float), (1, -1)))[0]

    def sample(self, points: ArrayLike) -> list[GeneralizedPlant]:
        """The frozen plants at positions (N, n_p)."""
        A, B, C, D = self.system.sample(points)
        w, z = self.n_w, self.n_z
        return [
            GeneralizedPlant(a, b[:, :w], b[:, w:], c[:z], c[z:], d[:z, :w], d[:z, w:], d[z:, :w], d[z:, w:])
            for a, b, c, d in zip(A, B, C, D, strict=True)
        ]
