"""The stator: two layers of long coils, as filaments, and the protocol of their wrench on the mover."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.polynomial import legendre

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.plant.mmpa.parameters import MMPAParameters


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilLayer:
    """A layer of equal rectangular coils on a regular grid; coil (i, j) is number i * len(y) + j of the layer.

    The current of every coil is counted counter-clockwise, seen from above. The bundle of turns is a uniform current
    density; rectangular filaments at Gauss points over its width and height stand for it, and filament (f, h)
    carries ``share[f] * turns[h]`` times the coil current.

    Attributes
    ----------
    x, y : (n_columns,), (n_rows,)
        Centres of the coils in the stator frame [m].
    half_x, half_y : (n_filaments,)
        Half sides of the filaments of a bundle, at one height [m].
    share : (n_filaments,)
        Share of the current in each of them; sums to 1.
    z : (n_heights,)
        Heights of the filaments from the neutral plane of the mover [m].
    turns : (n_heights,)
        Turns that each height stands for.
    errors : (n_coils, 2)
        How far each coil lies off its place in the grid [m]; none by default.
    """

    x: Array
    y: Array
    half_x: Array
    half_y: Array
    share: Array
    z: Array
    turns: Array
    errors: Array = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        if len(self.errors) == 0:
            object.__setattr__(self, "errors", read_only(np.zeros((self.n_coils, 2))))
        object.__setattr__(self, "errors", read_only(finite_array("errors", self.errors, (self.n_coils, 2))))

    @property
    def n_coils(self) -> int:
        """Number of coils of the layer."""
        return len(self.x) * len(self.y)

    @property
    def centres(self) -> Array:
        """Centres (n_coils, 2) [m], position errors included."""
        return self.errors + np.stack([np.repeat(self.x, len(self.y)), np.tile(self.y, len(self.x))], axis=1)


def coil_layers(parameters: MMPAParameters) -> tuple[CoilLayer, CoilLayer]:
    """Upper layer, long along y (16 x 5), and lower layer, long along x (5 x 16).

    Examples
    --------
    >>> upper, lower = coil_layers(MMPAParameters())
    >>> upper.n_coils, lower.n_coils, [round(float(layer.z.mean()) * 1e3, 3) for layer in (upper, lower)]
    (80, 80, [-18.5, -25.0])
    """
    p = parameters
    t, share = legendre.leggauss(p.filaments_width)
    inset, share = 0.5 * (t + 1.0) * p.bundle_width, read_only(0.5 * share)
    t, turns = legendre.leggauss(p.filaments_height)
    height, turns = 0.5 * t * p.bundle_height, read_only(0.5 * p.turns * turns)
    short = (np.arange(p.coils_short) - (p.coils_short - 1) / 2) * p.pitch_short
    long = (np.arange(p.coils_long) - (p.coils_long - 1) / 2) * p.pitch_long
    half_short, half_long = p.coil_short / 2 - inset, p.coil_long / 2 - inset
    upper = CoilLayer(
        x=read_only(short),
        y=read_only(long),
        half_x=read_only(half_short),
        half_y=read_only(half_long),
        share=share,
        z=read_only(p.layer_heights[0] + height),
        turns=turns,
    )
    lower = CoilLayer(
        x=read_only(long),
        y=read_only(short),
        half_x=read_only(half_long),
        half_y=read_only(half_short),
        share=share,
        z=read_only(p.layer_heights[1] + height),
        turns=turns,
    )
    return upper, lower


class CoilWrench(Protocol):
    r"""What the benchmark needs to know of the magnetics: the generalised force of every coil per ampere.

    The Lorentz force on a piece dl of the conductor is dl x B; the mover takes the reaction F = -(dl x B). With
    P_i P_j the Ritz functions of the plate, the rows of the wrench are

    .. math::

        \sum F_x, \quad \sum F_y, \quad \sum (x F_y - y F_x), \quad
        \sum \left[ F_z\, P_i P_j - z\, (F_x\, P_i' P_j + F_y\, P_i P_j') \right]

    about the mover frame's origin, x and y in the mover frame and z the height from the neutral plane: a horizontal
    force below the neutral plane bends the plate through its lever arm. A more exact field comes as another class
    with this method.
    """

    @property
    def n_coils(self) -> int:
        """Number of coils."""
        ...

    def wrench(self, points: Array) -> Array:
        """Wrenches (N, 3 + n_ritz, n_coils) at the mover positions `points` (N, 2) [m]; [N/A] and [N m/A]."""
        ...
