"""Noise and resolution of the position sensors, for simulations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import DomainError


@dataclass(frozen=True, kw_only=True)
class SensorErrors:
    """What a reading adds to the displacement along a beam: white noise, then rounding.

    Parameters
    ----------
    noise_rms : float
        Root mean square of the noise of one sample [m]; an interferometer has about 0.3 nm.
    quantisation : float
        Step of a reading [m], for instance 0.15 nm; zero is none.

    Raises
    ------
    DomainError
        If a value is negative or not finite.

    Examples
    --------
    >>> SensorErrors(quantisation=0.5e-9).read([1.6e-9]).tolist()
    [1.5e-09]
    """

    noise_rms: float = 0.0
    quantisation: float = 0.0

    def __post_init__(self) -> None:
        for name in ("noise_rms", "quantisation"):
            value = getattr(self, name)
            if isinstance(value, bool | str) or not 0.0 <= value < np.inf:
                raise DomainError(f"{name} is {value!r} m, wanted a finite number of at least 0.")

    def read(self, y: ArrayLike, rng: np.random.Generator | None = None) -> Array:
        """Readings (...) of the displacements `y` (...) [m]; without `rng` there is no noise.

        Raises
        ------
        DomainError
            If a displacement is not finite.
        """
        out = finite_array("y", y)
        if rng is not None and self.noise_rms:
            out = out + rng.normal(0.0, self.noise_rms, out.shape)
        if self.quantisation:
            out = self.quantisation * np.round(out / self.quantisation)
        return np.array(out)
