"""Frequencies at which the parts of K_RB start that do nothing at first: notches and extra states."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError


def start_frequencies(name: str, given: ArrayLike | None, n: int, f_I: Array) -> Array:
    """The frequencies as (n_rb, n) [Hz]; without given ones 8, 16, ... f_I, which is above the usual bandwidth 4 f_I.

    Parameters
    ----------
    name : str
        Of the argument, for messages.
    given : (n,) or (n_rb, n), optional [Hz]
        The same for every axis, or one row an axis.
    n : int
    f_I : (n_rb,) [Hz]

    Raises
    ------
    DimensionError
        If there are not n of them, or not one row an axis.
    DomainError
        If one is not finite and above zero.

    Examples
    --------
    >>> start_frequencies("f_notches", None, 2, np.array([10.0])).tolist()
    [[80.0, 160.0]]
    """
    shape = (len(f_I), n)
    if given is None:
        return np.asarray(read_only(8.0 * f_I[:, None] * np.arange(1, n + 1)))
    values = finite_array(name, given)
    if values.shape not in ((n,), shape):
        raise DimensionError(f"{name} has shape {values.shape}, wanted ({n},) or {shape}, one frequency each.")
    if np.any(values <= 0.0):
        raise DomainError(f"{name} is {values.tolist()}, wanted entries above 0 Hz.")
    return np.asarray(read_only(np.broadcast_to(values, shape)))
