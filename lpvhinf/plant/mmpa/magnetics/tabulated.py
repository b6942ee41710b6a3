"""The wrench of all coils in the exact field, interpolated in tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.magnetics.single_magnet import DEGREE
from lpvhinf.plant.mmpa.magnetics.superposition import STENCIL, OffsetGrid


@dataclass(frozen=True, eq=False)
class LayerTable:
    """Coefficients (n_x, n_y, rows) of quintic B-splines on a grid of offsets."""

    grid: OffsetGrid
    coefficients: Array

    def values(self, offsets: Array) -> Array:
        """The wrenches (n, rows) at offsets (n, 2) [m]; zero beyond the grid."""
        import scipy.sparse
        from scipy.interpolate import BSpline  # here, as it takes long to import and the first harmonic needs none

        t = offsets / self.grid.step + np.array([self.grid.n_x, self.grid.n_y])
        shape = np.array(self.coefficients.shape[:2])
        inside = np.flatnonzero(np.all((t >= STENCIL) & (t <= shape - 1 - STENCIL), axis=1))
        if len(inside) == 0:
            return np.zeros((len(offsets), self.coefficients.shape[2]))
        along = []
        for axis in range(2):
            knots = np.arange(-STENCIL, shape[axis] + STENCIL, dtype=float)  # B-spline j is centred at node j
            basis = BSpline.design_matrix(t[inside, axis], knots, DEGREE)
            along.append((basis.indices.reshape(-1, DEGREE + 1), basis.data.reshape(-1, DEGREE + 1)))
        (i, w_x), (j, w_y) = along
        columns = (i[:, :, None] * shape[1] + j[:, None, :]).reshape(len(inside), -1)
        weights = (w_x[:, :, None] * w_y[:, None, :]).reshape(len(inside), -1)
        # rows of coils that are out of reach stay empty
        counts = np.zeros(len(offsets) + 1, dtype=np.int64)
        counts[inside + 1] = weights.shape[1]
        selection = scipy.sparse.csr_matrix(
            (weights.ravel(), columns.ravel(), np.cumsum(counts)), shape=(len(offsets), int(np.prod(shape)))
        )
        return np.asarray(selection @ self.coefficients.reshape(-1, self.coefficients.shape[2]))


@dataclass(frozen=True, kw_only=True, eq=False)
class TabulatedWrench:
    """`CoilWrench` of the exact field of all magnets; make it with `coil_wrench`.

    Attributes
    ----------
    layers : tuple of CoilLayer
        The stator, position errors of its coils included.
    tables : tuple of LayerTable
        One for each layer.
    """

    layers: tuple[CoilLayer, ...]
    tables: tuple[LayerTable, ...]

    @property
    def n_coils(self) -> int:
        """Number of coils in all layers."""
        return sum(layer.n_coils for layer in self.layers)

    def wrench(self, points: Array) -> Array:
        """Wrenches (N, 3 + n_ritz, n_coils) at `points` (N, 2) [m], rows as in `CoilWrench`."""
        points = np.asarray(points, dtype=float)
        parts = []
        for layer, table in zip(self.layers, self.tables, strict=True):
            offsets = layer.centres - points[:, None]
            values = table.values(offsets.reshape(-1, 2))
            parts.append(values.reshape(len(points), layer.n_coils, -1).transpose(0, 2, 1))
        return np.concatenate(parts, axis=2)
