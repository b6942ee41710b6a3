"""The magnet array: layout and mass of the cuboids, and the first harmonic of their field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.windows import window


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


@dataclass(frozen=True, kw_only=True)
class FirstHarmonicField:
    r"""First harmonic of the field below the array, with a smooth edge.

    .. math::

        B = B_1(z)\, w(x) w(y)\, [\,\sin kx,\; -\sin ky,\; \cos ky - \cos kx\,], \qquad B_1(z) = B_0\, e^{k z}

    with :math:`k = \pi / \tau_n`. Without the window w the field is the gradient of a harmonic potential (its
    divergence and its curl vanish). The window is 1 up to ``taper`` from the edge and falls to 0 at the edge by a
    polynomial step; there the field is a model of the fringe, not a solution of Maxwell's equations.

    Parameters
    ----------
    wave_number : float
        k [1/m].
    amplitude : float
        B_0, amplitude of either wave at z = 0, extrapolated [T].
    half_side : float
        The field vanishes at \|x\| or \|y\| = half_side [m].
    taper : float
        Width of the edge [m].
    taper_order : int
        Continuous derivatives of the window.
    """

    wave_number: float
    amplitude: float
    half_side: float
    taper: float
    taper_order: int

    @classmethod
    def from_parameters(cls, parameters: MMPAParameters) -> FirstHarmonicField:
        r"""The field of an infinite array in the region below it.

        With the first Fourier coefficients :math:`a = s_m^2` of the vertical and :math:`b = s_m s_n` of the
        horizontal magnetisation, :math:`s_m = \tfrac4\pi \sin\tfrac{\pi \tau_m}{2\tau}` and
        :math:`s_n = \tfrac4\pi \sin\tfrac{\pi (\tau - \tau_m)}{2\tau}`, the amplitude at the distance d below is

        .. math:: B_1 = \tfrac14 B_r (1 - e^{-k h_m})\, (a + \sqrt2\, b)\, e^{-k d}

        Examples
        --------
        >>> field = FirstHarmonicField.from_parameters(MMPAParameters())
        >>> [round(float(field.strength(np.array(-0.014 - d))), 3) for d in (0.0045, 0.011)]
        [0.303, 0.153]
        """
        k = np.pi / parameters.pole_pitch
        wide = 4.0 / np.pi * np.sin(np.pi * parameters.magnet_fill / 2.0)
        narrow = 4.0 / np.pi * np.sin(np.pi * (1.0 - parameters.magnet_fill) / 2.0)
        halbach = wide**2 + np.sqrt(2.0) * wide * narrow
        at_face = 0.25 * parameters.remanence * (1.0 - np.exp(-k * parameters.magnet_height)) * halbach
        return cls(
            wave_number=float(k),
            amplitude=float(at_face * np.exp(-k * parameters.magnet_bottom)),
            half_side=parameters.side / 2,
            taper=parameters.field_taper,
            taper_order=parameters.field_taper_order,
        )

    def strength(self, z: Array) -> Array:
        """B_1(z) [T], z [m] from the neutral plane."""
        return np.asarray(self.amplitude * np.exp(self.wave_number * z))

    def edge(self, x: Array) -> Array:
        """The window w along one axis."""
        return window(x, self.half_side - self.taper, self.half_side, self.taper_order)

    def at(self, places: Array) -> Array:
        """The field at `places` (..., 3) [m] in the mover frame, as (..., 3) [T]."""
        x, y, z = np.moveaxis(np.asarray(places, dtype=float), -1, 0)
        k = self.wave_number
        waves = np.stack([np.sin(k * x), -np.sin(k * y), np.cos(k * y) - np.cos(k * x)], axis=-1)
        return np.asarray((self.strength(z) * self.edge(x) * self.edge(y))[..., None] * waves)
