r"""The wrench of a coil on one cuboid magnet, as a table over their relative offset.

A piece dl of the conductor that carries the current i feels :math:`i\, dl \times B`; the magnet takes the reaction.
The legs of a rectangular filament lie along x and y, so every component of the wrench is an integral of one function
g along the legs in y and of another, h, along the legs in x:

==========================  ============================  ======================
component                   g (legs along y)              h (legs along x)
==========================  ============================  ======================
:math:`F_x`                 :math:`-B_z`                  0
:math:`F_y`                 0                             :math:`B_z`
:math:`F_z`                 :math:`B_x`                   :math:`-B_y`
:math:`T_x = yF_z - zF_y`   :math:`y B_x`                 :math:`-y B_y - z B_z`
:math:`T_y = zF_x - xF_z`   :math:`-z B_z - x B_x`        :math:`x B_y`
:math:`T_z = xF_y - yF_x`   :math:`y B_z`                 :math:`x B_z`
==========================  ============================  ======================

with x, y from the magnet's centre and z from the neutral plane of the mover, whose point above the magnet's centre is
the pivot. With half sides (a, b), current counter-clockwise, a filament at the offset d contributes

.. math:: W(d) = \int_{d_y-b}^{d_y+b} \big[g(x, y)\big]_{x=d_x-a}^{x=d_x+a} dy
   - \int_{d_x-a}^{d_x+a} \big[h(x, y)\big]_{y=d_y-b}^{y=d_y+b} dx

The field is taken on a fine grid and interpolated by quintic splines, of which these integrals are exact: on a grid of
offsets the whole table is a few products of banded matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.magnets import TURN

DEGREE = 5
FIELD_SPACING = 1e-3  # m; the nearest conductor is about 2 mm from the magnets: errors near 1e-6 of the largest force


@dataclass(frozen=True, kw_only=True)
class MagnetKind:
    """Magnets of one size and direction of magnetisation.

    Attributes
    ----------
    size : (3,)
        Side lengths along the axes of the array [m].
    direction : (3,)
        Unit polarization along the axes of the array.
    height : float
        z of its centre from the neutral plane [m].
    """

    size: tuple[float, float, float]
    direction: tuple[float, float, float]
    height: float

    def field(self, places: Array) -> Array:
        """The exact field (..., 3) [T] per tesla of polarization, at `places` (..., 3) [m] from the pivot."""
        import magpylib
        from scipy.spatial.transform import Rotation

        magnet = magpylib.magnet.Cuboid(
            polarization=self.direction,
            dimension=self.size,
            position=(0.0, 0.0, self.height),
            orientation=Rotation.from_euler("z", TURN, degrees=True),
        )
        return np.asarray(magnet.getB(places))


class Winding(NamedTuple):
    """The filaments of a coil: what `CoilLayer` says of one coil, free of where the coils lie."""

    half_x: Array
    half_y: Array
    share: Array
    z: Array
    turns: Array

    @classmethod
    def of(cls, layer: CoilLayer) -> Winding:
        """The winding of the coils of a layer."""
        return cls(layer.half_x, layer.half_y, layer.share, layer.z, layer.turns)


class _Axis:
    """Quintic splines on a uniform grid along one axis, and their differences and integrals over the filaments."""

    def __init__(self, offsets: Array, halves: Array) -> None:
        import scipy.sparse
        from scipy.interpolate import BSpline, make_interp_spline

        n = int(np.ceil((np.max(np.abs(offsets)) + np.max(halves)) / FIELD_SPACING)) + 1
        self.grid = np.arange(-n, n + 1) * FIELD_SPACING
        t = make_interp_spline(self.grid, np.zeros(len(self.grid)), k=DEGREE).t
        longer, widths = np.concatenate([t[:1], t, t[-1:]]), (t[DEGREE + 1 :] - t[: len(self.grid)]) / (DEGREE + 1)
        self.difference, self.integral = [], []
        for half in halves:
            ends = offsets + half, offsets - half
            upper, lower = (BSpline.design_matrix(x, t, DEGREE) for x in ends)
            self.difference.append(upper - lower)
            # the primitive of a spline has the coefficients sum_(j <= i) c_j width_j one degree higher
            upper, lower = (BSpline.design_matrix(x, longer, DEGREE + 1) for x in ends)
            tail = np.cumsum((upper - lower).toarray()[:, :0:-1], axis=1)[:, ::-1] * widths
            tail[np.abs(tail) < 1e-12 * np.max(np.abs(tail))] = 0.0
            self.integral.append(scipy.sparse.csr_matrix(tail))


def _coefficients(values: Array, x: _Axis, y: _Axis) -> Array:
    from scipy.interpolate import make_interp_spline

    along_x = make_interp_spline(x.grid, values, k=DEGREE, axis=0).c
    return np.asarray(make_interp_spline(y.grid, np.ascontiguousarray(along_x.T), k=DEGREE, axis=0).c.T)


def single_magnet_wrench(kind: MagnetKind, winding: Winding, x: Array, y: Array) -> Array:
    """Wrench of a coil on a magnet of this kind, at all offsets.

    Parameters
    ----------
    kind : MagnetKind
        The magnet, with a polarization of one tesla.
    winding : Winding
        The coil.
    x, y : (n_x,), (n_y,)
        Offsets of the coil's centre from the magnet's centre [m].

    Returns
    -------
    (n_x, n_y, 6)
        F_x, F_y, F_z [N/(A T)] and T_x, T_y, T_z [N m/(A T)] about the pivot.
    """
    x_axis, y_axis = _Axis(x, winding.half_x), _Axis(y, winding.half_y)
    X, Y = np.meshgrid(x_axis.grid, y_axis.grid, indexing="ij")
    B, arm = np.zeros((3, *X.shape)), np.zeros(X.shape)  # sums over the heights of n B and of n z B_z
    for z, turns in zip(winding.z, winding.turns, strict=True):
        at = np.moveaxis(kind.field(np.stack([X, Y, np.full_like(X, z)], axis=-1)), -1, 0)
        B += turns * at
        arm += turns * z * at[2]
    B_x, B_y, B_z = B
    along_y = {0: -B_z, 2: B_x, 3: Y * B_x, 4: -arm - X * B_x, 5: Y * B_z}
    along_x = {1: B_z, 2: -B_y, 3: -Y * B_y - arm, 4: X * B_y, 5: X * B_z}
    out = np.zeros((len(x), len(y), 6))
    for component, g in along_y.items():
        c = _coefficients(g, x_axis, y_axis)
        for share, D, J in zip(winding.share, x_axis.difference, y_axis.integral, strict=True):
            out[:, :, component] += share * (J @ (D @ c).T).T
    for component, h in along_x.items():
        c = _coefficients(h, x_axis, y_axis)
        for share, J, D in zip(winding.share, x_axis.integral, y_axis.difference, strict=True):
            out[:, :, component] -= share * (D @ (J @ c).T).T
    return out
