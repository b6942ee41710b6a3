"""The first harmonic of the field below the magnet array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.windows import window


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
    def from_parameters(cls, parameters: MMPAParameters, remanence: float | None = None) -> FirstHarmonicField:
        r"""The field of an infinite array in the region below it.

        With the first Fourier coefficients :math:`a = s_m^2` of the vertical and :math:`b = s_m s_n` of the
        horizontal magnetisation, :math:`s_m = \tfrac4\pi \sin\tfrac{\pi \tau_m}{2\tau}` and
        :math:`s_n = \tfrac4\pi \sin\tfrac{\pi (\tau - \tau_m)}{2\tau}`, the amplitude at the distance d below is

        .. math:: B_1 = \tfrac14 B_r (1 - e^{-k h_m})\, (a + \sqrt2\, b)\, e^{-k d}

        with B_r the `remanence` [T], that of the parameters if left out.

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
        B_r = parameters.remanence if remanence is None else remanence
        at_face = 0.25 * B_r * (1.0 - np.exp(-k * parameters.magnet_height)) * halbach
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
