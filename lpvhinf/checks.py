"""Checks of arguments, with messages that name argument, value, expectation and remedy."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lpvhinf.errors import DimensionError, DomainError

Array = NDArray[np.float64]


def read_only(array: Any, dtype: Any = float) -> Any:
    """A read-only copy, so that frozen dataclasses are frozen to the last number."""
    out = np.array(array, dtype=dtype)
    out.setflags(write=False)
    return out


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...] | None = None) -> Array:
    """`value` as a float array of the wanted shape (None: any length) without NaN or infinity.

    Raises
    ------
    DimensionError
        If the shape is another one.
    DomainError
        If an entry is NaN, infinite or not a real number.
    """
    try:
        given = np.asarray(value)
        if given.dtype.kind in "cSU":  # NumPy would drop the imaginary part, and read "1" as 1
            raise TypeError(f"entries of type {given.dtype}")
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise DomainError(f"{name} is not an array of real numbers: {error}. Pass real floats.") from error
    if shape is not None:
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
            raise DimensionError(f"{name} has shape {array.shape}, wanted {wanted}. Reshape it, or check its sizes.")
    if not np.all(np.isfinite(array)):
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise DomainError(f"{name}{list(where)} is {array[where]}, wanted a finite number. Clean the data first.")
    return array


def positive(name: str, value: float, unit: str = "") -> float:
    """`value` if it is a finite number above zero, else a `DomainError`."""
    number = isinstance(value, int | float | np.integer | np.floating)
    if not number or not np.isfinite(value) or value <= 0.0:
        raise DomainError(f"{name} is {value!r}, wanted a finite number above 0{' ' + unit if unit else ''}.")
    return float(value)


def box_array(box: ArrayLike) -> Array:
    """The box P as a read-only (n_p, 2) array of lower and upper bounds.

    Raises
    ------
    DimensionError
        If `box` is not (n_p, 2).
    DomainError
        If a lower bound is not below its upper bound.
    """
    array = finite_array("box", box, (None, 2))
    if array.shape[0] < 1 or np.any(array[:, 0] >= array[:, 1]):
        raise DomainError(f"box is {array.tolist()}, wanted rows (lower, upper) with lower < upper.")
    bounds: Array = read_only(array)
    return bounds


def points_in_box(points: ArrayLike, box: Array, *, name: str = "p") -> Array:
    """Positions as (N, n_p), each inside the box (to round-off, then clipped onto it).

    Raises
    ------
    DimensionError
        If the last axis is not n_p long.
    DomainError
        If a position is outside the box.
    """
    array = finite_array(name, points)
    n_p = box.shape[0]
    if array.ndim == 0 and n_p == 1:
        array = array.reshape(1)
    if array.ndim == 1 and array.shape[0] == n_p:
        array = array[None, :]
    if array.ndim != 2 or array.shape[1] != n_p:
        raise DimensionError(f"{name} has shape {array.shape}, wanted ({n_p},) or (N, {n_p}), one row a position.")
    slack = 1e-12 * (box[:, 1] - box[:, 0])
    outside = np.any((array < box[:, 0] - slack) | (array > box[:, 1] + slack), axis=1)
    if np.any(outside):
        raise DomainError(
            f"{name} = {array[np.argmax(outside)].tolist()} is outside the box {box.tolist()}. "
            "Keep to the box, or build the model over a larger one."
        )
    return np.clip(array, box[:, 0], box[:, 1])


def known_options(what: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise a `DomainError` that lists the known names if an unknown one was given."""
    names = sorted(known)
    for name in given:
        if name not in names:
            raise DomainError(f"{what} has no option {name!r}. Known: {', '.join(names)}.")


def whole_number(name: str, value: object, least: int) -> int:
    """`value` if it is a whole number of at least `least`, else a `DomainError`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise DomainError(f"{name} is {value!r}, wanted a whole number of at least {least}.")
    return int(value)
