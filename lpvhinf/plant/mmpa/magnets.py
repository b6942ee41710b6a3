"""The magnet array: layout, polarization and mass of the cuboids, and the mirror bars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.plant.mmpa.parameters import MMPAParameters

TURN = -45.0  # degrees about z, of the array against the mover frame


@dataclass(frozen=True, kw_only=True, eq=False)
class MagnetArray:
    """Cuboid magnets of the quasi-Halbach array.

    Attributes
    ----------
    centres : (n, 2)
        Centres in the mover frame [m]; the array is turned by -45 degrees about z against it.
    sizes : (n, 3)
        Side lengths along the axes of the array [m].
    polarization : (n, 3)
        Polarization along the axes of the array [T].
    masses : (n,)
        [kg]
    """

    centres: Array
    sizes: Array
    polarization: Array
    masses: Array


def magnet_array(parameters: MMPAParameters) -> MagnetArray:
    """The cuboids whose centres lie within ``magnet_limit`` of the plate's centre along x and y.

    Vertically magnetised squares of width tau_m alternate like a chess board of pitch tau; horizontally magnetised
    ones between them close the flux, so that the field is strong below and weak above.

    Examples
    --------
    >>> array = magnet_array(MMPAParameters())
    >>> len(array.masses), round(float(array.masses.sum()), 2)
    (140, 5.51)
    """
    tau, height, br = parameters.magnet_pitch, parameters.magnet_height, parameters.remanence
    wide = parameters.magnet_fill * tau
    narrow = tau - wide
    index = np.arange(-parameters.magnet_count_half, parameters.magnet_count_half + 1)
    i, j = (m.ravel() for m in np.meshgrid(index, index, indexing="ij"))
    sign = np.where((i + j) % 2 == 0, 1.0, -1.0) * br
    zero, one = np.zeros_like(sign), np.ones_like(sign)
    kinds = [
        (np.stack([(i + 0.5) * tau, (j + 0.5) * tau], 1), (wide, wide), np.stack([zero, zero, sign], 1)),
        (np.stack([(i + 1.0) * tau, (j + 0.5) * tau], 1), (narrow, wide), np.stack([sign, zero, zero], 1)),
        (np.stack([(i + 0.5) * tau, (j + 1.0) * tau], 1), (wide, narrow), np.stack([zero, sign, zero], 1)),
    ]
    turn = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    centres = np.concatenate([places @ turn.T for places, _, _ in kinds])
    sizes = np.concatenate([one[:, None] * np.array([*size, height]) for _, size, _ in kinds])
    polarization = np.concatenate([p for _, _, p in kinds])
    kept = np.max(np.abs(centres), axis=1) < parameters.magnet_limit
    return MagnetArray(
        centres=read_only(centres[kept]),
        sizes=read_only(sizes[kept]),
        polarization=read_only(polarization[kept]),
        masses=read_only(parameters.magnet_density * np.prod(sizes[kept], axis=1)),
    )


def mirror_bars(parameters: MMPAParameters) -> tuple[Array, Array]:
    """Points (n, 2) [m] and masses (n,) [kg] that stand for the two mirror bars."""
    h, n = parameters.side / 2, parameters.bar_points
    along = np.linspace(-h + parameters.bar_clearance, h - parameters.bar_clearance, n)
    across = np.full(n, h - parameters.bar_inset)
    points = np.vstack([np.stack([across, along], 1), np.stack([along, across], 1)])
    return points, np.full(2 * n, parameters.bar_mass / n)
