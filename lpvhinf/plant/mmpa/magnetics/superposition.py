r"""The wrench of a coil on the whole mover, as a table: the tables of single magnets, shifted and added.

A magnet is rigid and glued to the plate at its centre c: it follows the deflection there and turns with the slope.
With its force F and its torque T about the point of the neutral plane above c, the generalised force on a function
:math:`\phi` of the deflection is

.. math:: Q_\phi = \sum_m F_z\, \phi(c) + T_x\, \partial_y \phi(c) - T_y\, \partial_x \phi(c)

which equals the derivative of the linked flux, as there is no iron. The arm z of the horizontal forces is in T.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.magnetics.single_magnet import DEGREE, MagnetKind
from lpvhinf.plant.mmpa.magnets import MagnetArray
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.plate import legendre_table

PER_HALF_PITCH = 6  # magnets lie on a lattice of half the pole pitch: this many table steps from one to the next
REACH = 7.0  # pole pitches outside the mover beyond which a coil is left out: its force is below 2e-4 of the largest
SLACK = 2e-3  # m, for coils off their places and positions just outside P
STENCIL = DEGREE // 2 + 1  # nodes that a quintic spline needs on either side
PAD = 12  # nodes beyond: the influence of the border on the spline fades by 0.43 a node


@dataclass(frozen=True, kw_only=True)
class OffsetGrid:
    """Offsets of a coil's centre from the centre of the mover, or of a magnet: multiples of a step, on both axes."""

    step: float
    n_x: int
    n_y: int

    @property
    def x(self) -> Array:
        """Offsets along x, (2 n_x + 1,) [m]."""
        return np.asarray(np.arange(-self.n_x, self.n_x + 1) * self.step)

    @property
    def y(self) -> Array:
        """Offsets along y, (2 n_y + 1,) [m]."""
        return np.asarray(np.arange(-self.n_y, self.n_y + 1) * self.step)

    def wider(self, nodes: int) -> OffsetGrid:
        """The same grid with more nodes on every side."""
        return OffsetGrid(step=self.step, n_x=self.n_x + nodes, n_y=self.n_y + nodes)


def mover_grid(parameters: MMPAParameters, layer: CoilLayer) -> OffsetGrid:
    """Offsets at which a coil of this layer acts on the mover: all that the stator has, up to a distance."""
    p = parameters
    step = 0.5 * p.pole_pitch / PER_HALF_PITCH
    nodes = []
    for centres, half in ((layer.x, layer.half_x), (layer.y, layer.half_y)):
        there = float(np.max(np.abs(centres))) + p.travel + SLACK
        worth = p.side / 2 + float(np.max(half)) + REACH * p.pole_pitch
        nodes.append(int(np.ceil(min(there, worth) / step)) + STENCIL)
    return OffsetGrid(step=step, n_x=nodes[0], n_y=nodes[1])


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A magnet array in terms of the kinds of its magnets.

    Attributes
    ----------
    kinds : tuple of MagnetKind
        The different magnets.
    of : (n,)
        Index of the kind of every magnet.
    strength : (n,)
        Polarization of every magnet along the direction of its kind [T].
    shift : (n, 2)
        Centres of the magnets in steps of the table.
    centres : (n, 2)
        Centres [m].
    """

    kinds: tuple[MagnetKind, ...]
    of: Array
    strength: Array
    shift: Array
    centres: Array

    @property
    def reach(self) -> int:
        """Largest shift, in steps."""
        return int(np.max(np.abs(self.shift)))


def arrange(magnets: MagnetArray, parameters: MMPAParameters) -> Arrangement:
    """The kinds, strengths and shifts of a magnet array.

    Raises
    ------
    AssumptionError
        If a magnet is off the lattice of half the pole pitch.
    """
    step = 0.5 * parameters.pole_pitch / PER_HALF_PITCH
    shift = np.round(magnets.centres / step)
    off = float(np.max(np.abs(magnets.centres - shift * step)))
    if off > 1e-9:
        raise AssumptionError(
            f"a magnet lies {off:.3g} m off the lattice of half the pole pitch ({parameters.pole_pitch / 2:.4g} m). "
            "The tables shift one magnet's wrench in whole steps: keep the magnets on the lattice."
        )
    height = parameters.magnet_bottom + parameters.magnet_height / 2
    kinds: list[MagnetKind] = []
    of, strength = [], []
    for size, polarization in zip(magnets.sizes, magnets.polarization, strict=True):
        largest = polarization[np.argmax(np.abs(polarization))]
        amount = float(np.copysign(np.linalg.norm(polarization), largest))
        kind = MagnetKind(
            size=_rounded(size),
            direction=_rounded(polarization / amount if amount else np.array([0.0, 0.0, 1.0])),
            height=height,
        )
        if kind not in kinds:
            kinds.append(kind)
        of.append(kinds.index(kind))
        strength.append(amount)
    return Arrangement(tuple(kinds), np.array(of), np.array(strength), shift.astype(int), magnets.centres)


def _rounded(values: Array) -> tuple[float, float, float]:
    """Round-off of the layout does not make another kind; zeros have no sign."""
    a, b, c = (float(np.round(v, 12)) + 0.0 for v in values)
    return a, b, c


def superpose(single: list[Array], arrangement: Arrangement, grid: OffsetGrid, side: float, degree: int) -> Array:
    """Spline coefficients of the wrench table of one layer on the whole mover.

    Parameters
    ----------
    single : list of (n_x', n_y', 6)
        For each kind, the table of one magnet of one tesla on ``grid.wider(arrangement.reach + PAD)``.
    arrangement : Arrangement
        The magnets.
    grid : OffsetGrid
        Offsets of the coil from the centre of the mover.
    side : float
        Side of the plate [m].
    degree : int
        Degree of the Ritz functions P_i(2x/a) P_j(2y/a).

    Returns
    -------
    (2 n_x + 1, 2 n_y + 1, 3 + (degree + 1)^2)
        Coefficients of quintic B-splines; rows as in `CoilWrench`.
    """
    # the splines' coefficients are linear in the values and shift with them: filtering the few single tables suffices
    filtered = [_spline_coefficients(table) for table in single]
    h, n = side / 2, degree + 1
    x, y = arrangement.centres[:, 0], arrangement.centres[:, 1]
    P_x, P_y = legendre_table(x / h, degree), legendre_table(y / h, degree)
    dP_x, dP_y = legendre_table(x / h, degree, 1) / h, legendre_table(y / h, degree, 1) / h
    s = arrangement.strength[:, None, None]
    follow = [s * P_x[:, :, None] * P_y[:, None, :], s * P_x[:, :, None] * dP_y[:, None, :]]
    follow.append(-s * dP_x[:, :, None] * P_y[:, None, :])
    deflection = np.stack(follow, axis=1).reshape(-1, n * n)  # rows (magnet; F_z, T_x, T_y)
    in_plane = np.zeros((len(x), 3, 3))  # (magnet; F_x, F_y, T_z; rows)
    in_plane[:, 0, 0] = in_plane[:, 1, 1] = in_plane[:, 2, 2] = 1.0
    in_plane[:, 0, 2], in_plane[:, 1, 2] = -y, x
    planar = (s * in_plane).reshape(-1, 3)
    margin = arrangement.reach + PAD
    columns, rows = 2 * grid.n_x + 1, 2 * grid.n_y + 1
    out = np.empty((columns, rows, 3 + n * n))
    strip = np.empty((rows, len(x), 6))
    for i in range(columns):
        for m, (k, (a, b)) in enumerate(zip(arrangement.of, arrangement.shift, strict=True)):
            strip[:, m] = filtered[k][margin + i - a, margin - b : margin - b + rows]
        out[i, :, 3:] = strip[:, :, 2:5].reshape(rows, -1) @ deflection
        out[i, :, :3] = strip[:, :, [0, 1, 5]].reshape(rows, -1) @ planar
    out.setflags(write=False)  # a copy would double the memory
    return out


def _spline_coefficients(table: Array) -> Array:
    import scipy.ndimage

    once = scipy.ndimage.spline_filter1d(table, order=DEGREE, axis=0, mode="mirror")
    return np.asarray(scipy.ndimage.spline_filter1d(once, order=DEGREE, axis=1, mode="mirror"))
