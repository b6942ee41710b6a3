"""Generalized plants given over a box of positions, with their derivatives to the position."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array, points_in_box, positive
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

Frozen = Callable[[Array], Sequence[GeneralizedPlant]]


@runtime_checkable
class PlantFamily(Protocol):
    """Plants of equal sizes over a box of positions.

    Attributes
    ----------
    box : (n_p, 2)
    plants_per_slope : int
        Plants that one call of `slopes` computes: what a gradient to the position costs.
    """

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2)."""

    @property
    def plants_per_slope(self) -> int:
        """Plants that one call of `slopes` computes."""

    def sample(self, points: Array) -> list[GeneralizedPlant]:
        """The plants at positions (N, n_p)."""

    def slopes(self, p: Array) -> tuple[GeneralizedPlant, Array]:
        """The plant at p (n_p,), and the derivatives of `whole_matrix` to p, (n_p, rows, columns)."""


def whole_matrix(plant: GeneralizedPlant) -> Array:
    """[[A, B1, B2], [C1, D11, D12], [C2, D21, D22]], (n_x + n_z + n_y, n_x + n_w + n_u)."""
    return np.block([[plant.A, plant.B1, plant.B2], [plant.C1, plant.D11, plant.D12], [plant.C2, plant.D21, plant.D22]])


class PolynomialFamily:
    """The plants of an `LPVGeneralizedPlant`; derivatives are those of its polynomials, exact to round-off.

    Examples
    --------
    >>> system = LPVStateSpace.from_coefficients([[[-1.0]], [[0.5]]], np.ones((1, 2)), np.ones((2, 1)),
    ...                                          np.zeros((2, 2)), box=[[-1.0, 1.0]], basis="power")
    >>> family = PolynomialFamily(LPVGeneralizedPlant(system, n_u=1, n_y=1))
    >>> plant, slopes = family.slopes(np.array([0.2]))
    >>> round(float(plant.A[0, 0]), 12), round(float(slopes[0, 0, 0]), 12)
    (-0.9, 0.5)
    """

    plants_per_slope = 1

    def __init__(self, plant: LPVGeneralizedPlant) -> None:
        self.plant = plant

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2)."""
        return self.plant.box

    @cached_property
    def _derivatives(self) -> list[LPVStateSpace]:
        return [self.plant.system.derivative(axis) for axis in range(len(self.box))]

    def sample(self, points: Array) -> list[GeneralizedPlant]:
        """The plants at positions (N, n_p)."""
        return self.plant.sample(points)

    def slopes(self, p: Array) -> tuple[GeneralizedPlant, Array]:
        """The plant at p, and the derivatives of its whole matrix."""
        out = []
        for derivative in self._derivatives:
            A, B, C, D = (m[0] for m in derivative.sample(p[None]))
            out.append(np.block([[A, B], [C, D]]))
        return self.plant.at(p), np.array(out)


class FrozenFamily:
    r"""Plants by a callable; derivatives are central differences of the matrices.

    A gradient costs 2 n_p further plants, asked for in one call together with the plant itself; the error is of
    order :math:`h^2` (h at an edge of the box, where the difference is one-sided).

    Parameters
    ----------
    frozen : (N, n_p) -> sequence of N GeneralizedPlant
    box : (n_p, 2)
    step : float
        h, relative to the width of the box.

    Raises
    ------
    DimensionError, DomainError
        If the box is not one, or the step is not above zero.

    Examples
    --------
    >>> def frozen(points):
    ...     return [GeneralizedPlant([[-1.0 - p[0] ** 2]], [[1.0]], [[1.0]], [[1.0]], [[1.0]],
    ...                              [[0.0]], [[0.0]], [[0.0]]) for p in points]
    >>> plant, slopes = FrozenFamily(frozen, [[0.0, 1.0]]).slopes(np.array([0.5]))
    >>> round(float(slopes[0, 0, 0]), 6)
    -1.0
    """

    def __init__(self, frozen: Frozen, box: ArrayLike, *, step: float = 1e-4) -> None:
        self.frozen, self.box, self.step = frozen, box_array(box), positive("step", step)
        self.plants_per_slope = 1 + 2 * len(self.box)

    def sample(self, points: Array) -> list[GeneralizedPlant]:
        """The plants at positions (N, n_p)."""
        where = points_in_box(points, self.box, name="points")
        plants = list(self.frozen(where))
        if len(plants) != len(where):
            raise DimensionError(f"frozen gave {len(plants)} plants for {len(where)} positions, wanted one for each.")
        return plants

    def slopes(self, p: Array) -> tuple[GeneralizedPlant, Array]:
        """The plant at p, and differences of its whole matrix."""
        steps = np.diag(self.step * (self.box[:, 1] - self.box[:, 0]))
        above, below = np.minimum(p + steps, self.box[:, 1]), np.maximum(p - steps, self.box[:, 0])
        plants = self.sample(np.vstack([p[None], above, below]))
        matrices = [whole_matrix(plant) for plant in plants]
        if len({m.shape for m in matrices}) > 1:
            raise DimensionError(f"frozen gave plants of different sizes near p = {p.tolist()}, wanted equal ones.")
        n = len(self.box)
        length = np.diagonal(above - below)
        return plants[0], np.array([(matrices[1 + i] - matrices[1 + n + i]) / length[i] for i in range(n)])


def as_family(plants: LPVGeneralizedPlant | PlantFamily) -> PlantFamily:
    """The family of an LPV plant; a family as it is.

    Raises
    ------
    DomainError
        If it is neither.
    """
    if isinstance(plants, LPVGeneralizedPlant):
        return PolynomialFamily(plants)
    if not isinstance(plants, PlantFamily):
        raise DomainError(
            f"plants is {type(plants).__name__}, wanted an LPVGeneralizedPlant or a family of plants over a box. "
            "Wrap a callable as FrozenFamily(frozen, box)."
        )
    return plants
