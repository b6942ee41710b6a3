r"""The wrench of all coils in a separable field, by one-dimensional integrals.

Each component of the field is a sum of products f(x) g(y), each Ritz function is one product, and each leg of a coil
lies along x or y. A leg therefore contributes a point value along one axis times an integral along the other. With
:math:`\Delta f` the difference of f between the two ends of a filament along an axis, and the functions of one
coordinate (w the edge window, P_i the Legendre polynomials, s and c the sine and cosine wave)

.. math::

    e_i = \beta_0\, w s P_i - \beta_1\, w c P_i', \quad h_i = w P_i', \quad
    j_i = \int w P_i, \quad k_i = \int w c P_i

the generalised force of a filament on P_i P_j is

.. math::

    \Delta e_i\, \Delta j_j - \Delta j_i\, \Delta e_j + \beta_1 (\Delta h_i\, \Delta k_j - \Delta k_i\, \Delta h_j)

where the sums :math:`\beta_0 = \sum n B_1(z)` and :math:`\beta_1 = \sum n z B_1(z)` run over the heights of
the bundle. On a grid of coils all of this is one small matrix product for each layer and position.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from lpvhinf.checks import Array, read_only
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.magnetics.first_harmonic import FirstHarmonicField
from lpvhinf.plant.mmpa.plate import legendre_table

TABLE_DEGREE = 63  # of the Legendre series that are integrated; their tails are at round-off


@dataclass(frozen=True, kw_only=True, eq=False)
class SeparableWrench:
    """`CoilWrench` of the first-harmonic field; exact up to the filament model and round-off.

    Parameters
    ----------
    field : FirstHarmonicField
        The field, in the mover frame.
    layers : tuple of CoilLayer
        The stator.
    degree : int
        Degree of the Ritz functions P_i(2x/a) P_j(2y/a) along each axis.

    Examples
    --------
    >>> from lpvhinf.plant.mmpa.coils import coil_layers
    >>> from lpvhinf.plant.mmpa.parameters import MMPAParameters
    >>> p = MMPAParameters()
    >>> coils = SeparableWrench(field=FirstHarmonicField.from_parameters(p), layers=coil_layers(p), degree=14)
    >>> coils.wrench(np.array([[0.0, 0.0]])).shape
    (1, 228, 160)
    """

    field: FirstHarmonicField
    layers: tuple[CoilLayer, ...]
    degree: int
    _breaks: Array = dataclasses.field(init=False, repr=False)
    _tables: Array = dataclasses.field(init=False, repr=False)

    def __post_init__(self) -> None:
        breaks, tables = self._primitives()
        object.__setattr__(self, "_breaks", breaks)
        object.__setattr__(self, "_tables", tables)

    @property
    def n_coils(self) -> int:
        """Number of coils in all layers."""
        return sum(layer.n_coils for layer in self.layers)

    def _primitives(self) -> tuple[Array, Array]:
        """Legendre series of the primitives of w P_i and w c P_i on the pieces where w is one polynomial."""
        h, inner, n = self.field.half_side, self.field.half_side - self.field.taper, self.degree + 1
        ends = [-h, -inner, inner, h] if inner > 0.0 else [-h, 0.0, h]
        t, weights = legendre.leggauss(TABLE_DEGREE + 1)
        project = (np.arange(TABLE_DEGREE + 1) + 0.5)[:, None] * legendre.legvander(t, TABLE_DEGREE).T * weights
        tables, offset = [], np.zeros(2 * n)
        for low, high in itertools.pairwise(ends):
            x = 0.5 * (low + high) + 0.5 * (high - low) * t
            w, P = self.field.edge(x), legendre_table(x / h, self.degree)
            wave = np.cos(self.field.wave_number * x)
            series = project @ np.hstack([w[:, None] * P, (w * wave)[:, None] * P])
            primitive = 0.5 * (high - low) * legendre.legint(series, lbnd=-1.0, axis=0)
            primitive[0] += offset
            tables.append(primitive)
            offset = primitive.sum(axis=0)  # P_m(1) = 1: the value at the end of the piece
        return np.asarray(read_only(ends)), np.asarray(read_only(tables))

    def _axis_functions(self, x: Array, beta0: float, beta1: float) -> tuple[Array, Array]:
        """[e, h, j, k] as (..., 4, degree + 1), and [w, w c] as (..., 2), at the coordinates x of one axis."""
        h, n = self.field.half_side, self.degree + 1
        x = np.clip(x, -h, h)  # beyond the edge w vanishes and its integrals stay
        flat = x.ravel()
        P, dP = legendre_table(flat / h, self.degree), legendre_table(flat / h, self.degree, 1) / h
        w, phase = self.field.edge(flat), self.field.wave_number * flat
        wc, ws = w * np.cos(phase), w * np.sin(phase)
        out = np.empty((len(flat), 4, n))
        out[:, 0] = (beta0 * ws)[:, None] * P - (beta1 * wc)[:, None] * dP
        out[:, 1] = w[:, None] * dP
        piece = np.clip(np.searchsorted(self._breaks, flat, side="right") - 1, 0, len(self._breaks) - 2)
        for i in range(len(self._breaks) - 1):
            mine = np.flatnonzero(piece == i)
            low, high = self._breaks[i], self._breaks[i + 1]
            local = (2.0 * flat[mine] - low - high) / (high - low)
            out[mine, 2:] = (legendre.legvander(local, self._tables.shape[1] - 1) @ self._tables[i]).reshape(-1, 2, n)
        return out.reshape(*x.shape, 4, n), np.stack([w, wc], axis=-1).reshape(*x.shape, 2)

    def _differences(self, p: Array, centres: Array, half: Array, beta: tuple[float, float]) -> tuple[Array, Array]:
        """Differences over the filaments, (N, centres, filaments, 4, n) and (N, centres, filaments, 2)."""
        # grids of positions repeat their coordinates: each one is computed once
        unique, inverse = np.unique(p, return_inverse=True)
        ends = np.stack([centres[:, None] - half, centres[:, None] + half], axis=-1)  # (centres, filaments, 2)
        many, few = self._axis_functions(ends - unique[:, None, None, None], *beta)
        many, few = many[:, :, :, 1] - many[:, :, :, 0], few[:, :, :, 1] - few[:, :, :, 0]
        return many[inverse], few[inverse]

    def wrench(self, points: Array) -> Array:
        """Wrenches (N, 3 + n_ritz, n_coils) at `points` (N, 2) [m], rows as in `CoilWrench`."""
        points = np.asarray(points, dtype=float)
        N, n = len(points), self.degree + 1
        out = np.empty((N, 3 + n * n, self.n_coils))
        start = 0
        for layer in self.layers:
            strength = layer.turns * self.field.strength(layer.z)
            beta = float(strength.sum()), float((strength * layer.z).sum())
            X, x_edge = self._differences(points[:, 0], layer.x, layer.half_x, beta)
            Y, y_edge = self._differences(points[:, 1], layer.y, layer.half_y, beta)
            part = slice(start, start + layer.n_coils)
            start += layer.n_coils
            columns, rows, b1 = len(layer.x), len(layer.y), beta[1]
            # left factor share (e, -j, b1 h, -b1 k) times right factor (j, e, k, h), summed over kinds and filaments
            X, x_edge = X * layer.share[:, None, None], x_edge * layer.share[:, None]
            left = X[:, :, :, [0, 2, 1, 3]] * np.array([1.0, -1.0, b1, -b1])[:, None]
            right = Y[:, :, :, [2, 0, 3, 1]]
            left = left.reshape(N, columns, -1, n).transpose(0, 1, 3, 2).reshape(N, columns * n, -1)
            right = right.reshape(N, rows, -1, n).transpose(0, 2, 1, 3).reshape(N, -1, rows * n)
            moments = (left @ right).reshape(N, columns, n, rows, n)
            out[:, 3:, part] = moments.transpose(0, 2, 4, 1, 3).reshape(N, n * n, layer.n_coils)
            out[:, :3, part] = self._in_plane(X[:, :, :, 2:, :2], x_edge, Y[:, :, :, 2:, :2], y_edge, beta[0])
        return out

    def _in_plane(self, J: Array, edge_x: Array, L: Array, edge_y: Array, beta0: float) -> Array:
        """Rows F_x, F_y and T_z, (N, 3, n_coils), from the integrals J (x) and L (y) of w and w c times P_0 and P_1."""
        h = self.field.half_side

        def total(fx: Array, fy: Array) -> Array:
            return np.asarray(np.einsum("ncf,nrf->ncr", fx, fy).reshape(len(fx), -1))

        w_x, c_x, w_y, c_y = edge_x[..., 0], edge_x[..., 1], edge_y[..., 0], edge_y[..., 1]
        force_x = total(c_x, L[..., 0, 0]) - total(w_x, L[..., 1, 0])
        force_y = total(J[..., 1, 0], w_y) - total(J[..., 0, 0], c_y)
        y_force_x = h * (total(c_x, L[..., 0, 1]) - total(w_x, L[..., 1, 1]))  # P_1 = y / h
        x_force_y = h * (total(J[..., 1, 1], w_y) - total(J[..., 0, 1], c_y))
        return beta0 * np.stack([force_x, force_y, x_force_y - y_force_x], axis=1)
