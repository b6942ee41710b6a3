"""Positive physical quantities as smooth functions of unbounded parameters, through logarithms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, logit

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import DomainError


@dataclass(frozen=True)
class LogRange:
    r"""A positive quantity v(x) for any real x, strictly inside its bounds.

    ====================== ==========================================================================
    bounds                 v
    ====================== ==========================================================================
    none                   :math:`e^x`
    low > 0                :math:`v_{low}(1 + e^x)`
    high                   :math:`v_{high}\, s(x)`
    low > 0 and high       :math:`v_{low} (v_{high}/v_{low})^{s(x)}`, the logarithm moves between both
    ====================== ==========================================================================

    with the logistic function :math:`s(x) = 1/(1 + e^{-x})`.

    Parameters
    ----------
    low, high : float
        0 <= low < high; zero and infinity mean no bound.

    Raises
    ------
    DomainError
        If the bounds are not such numbers.

    Examples
    --------
    >>> float(LogRange(1.0, 100.0).value(0.0))  # the geometric mean of the bounds
    10.0
    >>> float(LogRange().inverse(1.0))
    0.0
    """

    low: float = 0.0
    high: float = np.inf

    def __post_init__(self) -> None:
        if not (0.0 <= self.low < self.high) or np.isnan(self.high):
            raise DomainError(f"range is ({self.low!r}, {self.high!r}), wanted 0 <= low < high.")

    @property
    def _span(self) -> float:
        return float(np.log(self.high / self.low))

    def value(self, x: ArrayLike) -> Array:
        """The quantity v at the parameter x."""
        x = np.asarray(x, dtype=float)
        if np.isinf(self.high):
            return np.asarray(np.exp(x) if self.low == 0.0 else self.low * (1.0 + np.exp(x)))
        return np.asarray(self.high * expit(x) if self.low == 0.0 else self.low * np.exp(self._span * expit(x)))

    def slope(self, x: ArrayLike) -> Array:
        """The slope dv/dx at the parameter x."""
        x = np.asarray(x, dtype=float)
        if np.isinf(self.high):
            return np.asarray(np.exp(x) * (1.0 if self.low == 0.0 else self.low))
        change = expit(x) * expit(-x)
        return np.asarray(self.high * change if self.low == 0.0 else self.value(x) * self._span * change)

    def inverse(self, v: ArrayLike, name: str = "value") -> Array:
        """The parameter x of a value v.

        Raises
        ------
        DomainError
            If v is not strictly inside the range.
        """
        v = finite_array(name, v)
        if np.any(v <= self.low) or np.any(v >= self.high):
            raise DomainError(
                f"{name} is {v.tolist()}, wanted numbers strictly between {self.low:g} and {self.high:g}. "
                "Widen the range, or choose a value inside it."
            )
        if np.isinf(self.high):
            return np.asarray(np.log(v) if self.low == 0.0 else np.log(v / self.low - 1.0))
        return np.asarray(logit(v / self.high if self.low == 0.0 else np.log(v / self.low) / self._span))


def as_range(name: str, bounds: tuple[float, float] | LogRange | None) -> LogRange:
    """A `LogRange` from (low, high), None meaning no bounds."""
    if bounds is None:
        return LogRange()
    if isinstance(bounds, LogRange):
        return bounds
    try:
        low, high = (float(bound) for bound in bounds)
    except (TypeError, ValueError) as error:
        raise DomainError(f"{name} is {bounds!r}, wanted (low, high) or None.") from error
    try:
        return LogRange(low, high)
    except DomainError as error:
        raise DomainError(f"{name} is {bounds!r}, wanted (low, high) with 0 <= low < high.") from error
