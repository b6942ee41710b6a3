"""Smooth polynomial windows: the edge of the magnetic field and the weights of the coils."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lpvhinf.checks import Array, read_only


@lru_cache(maxsize=32)
def _step_coefficients(order: int) -> Array:
    """Power coefficients of the polynomial of degree 2 order + 1 behind `smoothstep`."""
    derivative = np.polynomial.Polynomial([0.0, 1.0, -1.0]) ** order  # t^n (1 - t)^n
    step = derivative.integ()
    return np.asarray(read_only((step / step(1.0)).coef))


def smoothstep(t: Array, order: int) -> Array:
    r"""A step from 0 (t <= 0) to 1 (t >= 1) with `order` continuous derivatives.

    .. math:: s(t) = \int_0^t \tau^n (1 - \tau)^n\, d\tau \Big/ \int_0^1 \tau^n (1 - \tau)^n\, d\tau

    Parameters
    ----------
    t : array
        Argument.
    order : int
        n; 2 is the usual quintic 6 t^5 - 15 t^4 + 10 t^3.

    Examples
    --------
    >>> smoothstep(np.array([-1.0, 0.5, 2.0]), 2).tolist()
    [0.0, 0.5, 1.0]
    """
    clipped = np.clip(t, 0.0, 1.0)
    low = np.minimum(clipped, 1.0 - clipped)  # symmetric evaluation keeps s(t) + s(1 - t) = 1 to round-off
    values = np.polynomial.polynomial.polyval(low, _step_coefficients(order))
    return np.where(clipped <= 0.5, values, 1.0 - values)


def window(distance: Array, inner: float, outer: float, order: int) -> Array:
    """1 within `inner`, 0 beyond `outer`, a smooth step of `order` continuous derivatives in between.

    Examples
    --------
    >>> window(np.array([0.0, 0.15, 0.2]), 0.1, 0.2, 2).tolist()
    [1.0, 0.5, 0.0]
    """
    return smoothstep((outer - np.abs(distance)) / (outer - inner), order)
