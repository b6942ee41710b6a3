"""Grids, rate boxes and ready-made basis functions of the scheduling position p, with their checks."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, whole_number
from lpvhinf.errors import AssumptionError, DimensionError, DomainError

BasisFunction = Callable[[Array], tuple[ArrayLike, ArrayLike]]

#: Largest relative deviation of a gradient from finite differences.
GRADIENT = 1e-4


def monomials(degree: int, *, box: ArrayLike) -> BasisFunction:
    r"""Products of powers of p scaled to [-1, 1] on the box, of total degree up to `degree`; the first one is 1.

    Parameters
    ----------
    degree : int
    box : (n_p, 2)

    Returns
    -------
    callable
        p (n_p,) -> values (n_b,), gradient (n_b, n_p).

    Raises
    ------
    DomainError
        If the degree is negative or the box is empty.

    Examples
    --------
    >>> values, gradient = monomials(2, box=[[0.0, 2.0]])(np.array([2.0]))
    >>> values.tolist(), gradient.ravel().tolist()
    ([1.0, 1.0, 1.0], [0.0, 1.0, 2.0])
    """
    most = whole_number("degree", degree, 0)
    bounds = finite_array("box", box, (None, 2))
    middle, half = bounds.mean(axis=1), 0.5 * (bounds[:, 1] - bounds[:, 0])
    if np.any(half <= 0.0):
        raise DomainError(f"box is {bounds.tolist()}, wanted rows (lower, upper) with lower < upper.")
    powers = sorted(
        (e for e in itertools.product(range(most + 1), repeat=len(bounds)) if sum(e) <= most),
        key=lambda e: (sum(e), tuple(-k for k in e)),
    )
    exponents = np.array(powers, dtype=int)

    def evaluate(p: Array) -> tuple[Array, Array]:
        x = (np.asarray(p, dtype=float).reshape(-1) - middle) / half
        values = np.prod(x**exponents, axis=1)
        gradient = np.zeros((len(exponents), len(x)))
        for axis in range(len(x)):
            lower = exponents.copy()
            lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
            gradient[:, axis] = exponents[:, axis] * np.prod(x**lower, axis=1) / half[axis]
        return values, gradient

    return evaluate


def check_basis(basis: BasisFunction | None, points: Array) -> None:
    """Check that a basis is a function whose gradients at the grid points are those of its values.

    Second-order differences are taken towards the middle of the grid: inside the domain of functions like a root.

    Raises
    ------
    DomainError
        If it is not callable, fails, or a value is not finite.
    DimensionError
        If values or gradients have wrong shapes.
    AssumptionError
        If a gradient is not that of the values.
    """
    if basis is None:
        return
    if not callable(basis):
        raise DomainError(
            f"basis is {type(basis).__name__}, wanted a function p -> (values (n_b,), gradient (n_b, n_p))."
        )
    pairs = [_evaluate(basis, p, None) for p in points]
    n_b = len(pairs[0][0])
    size = np.max(np.abs([np.resize(f, n_b) for f, _ in pairs]), axis=0) + 1e-300
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    width = points.max(axis=0) - points.min(axis=0)
    for p, (f, slope) in zip(points, pairs, strict=True):
        if len(f) != n_b:
            raise DimensionError(f"basis({p.tolist()}) has {len(f)} functions, wanted {n_b} as at the first point.")
        for axis in np.flatnonzero(width > 0.0):
            step = np.zeros(len(p))
            step[axis] = (1.0 if p[axis] <= middle[axis] else -1.0) * 1e-5 * width[axis]
            one, two = (_evaluate(basis, p + k * step, n_b)[0] for k in (1.0, 2.0))
            measured = (-3.0 * f + 4.0 * one - two) / (2.0 * step[axis])
            error = np.abs(measured - slope[:, axis]) * width[axis]
            allowed = GRADIENT * (np.abs(slope[:, axis]) * width[axis] + size)
            if np.any(error > allowed):
                i = int(np.argmax(error / allowed))
                raise AssumptionError(
                    f"the gradient of basis function {i} at p = {p.tolist()} along axis {axis} is "
                    f"{slope[i, axis]:.6g}, but its values change by {measured[i]:.6g}. Correct the gradient."
                )


def rate_bounds(rate: ArrayLike | None, n_p: int) -> Array | None:
    """The rate box (n_p, 2); None where the rate is not bounded. One pair serves a single axis.

    Raises
    ------
    DimensionError
        If `rate` is not (n_p, 2).
    DomainError
        If a lowest rate is above the highest (the box is empty), or not finite.
    """
    if rate is None:
        return None
    box = finite_array("rate", rate)
    if box.shape == (2,) and n_p == 1:
        box = box[None, :]
    if box.shape != (n_p, 2):
        raise DimensionError(
            f"rate has shape {box.shape}, wanted ({n_p}, 2): lowest and highest dp/dt of every axis. "
            "A speed v means [-v, v]."
        )
    if np.any(box[:, 0] > box[:, 1]):
        axis = int(np.argmax(box[:, 0] > box[:, 1]))
        raise DomainError(
            f"rate[{axis}] is {box[axis].tolist()}: the rate box is empty. Give (lowest, highest), lowest <= highest."
        )
    return box


def corners(box: Array) -> Array:
    """The different corners (V, n_p) of a box (n_p, 2)."""
    return np.unique(np.array(list(itertools.product(*box))), axis=0)


def grid_points(points: ArrayLike, n: int, *, name: str = "points") -> Array:
    """Grid points as (N, n_p), one for each of `n` systems, no two equal.

    Raises
    ------
    DimensionError
        If their number is not `n`.
    DomainError
        If two are equal, or one is not finite.
    """
    array = finite_array(name, points)
    if array.ndim == 1:
        array = array[:, None] if array.shape[0] == n else array[None, :]
    if array.ndim != 2 or array.shape[0] != n or array.shape[1] < 1:
        raise DimensionError(f"{name} has shape {array.shape}, wanted ({n}, n_p): one row for each of {n} systems.")
    repeated = n - len(np.unique(array, axis=0))
    if repeated:
        raise DomainError(f"{name} has {repeated} repeated rows. Give every position once.")
    return array


def spanned_box(points: Array, box: ArrayLike | None) -> Array:
    """The box that the grid spans, (n_p, 2), after a check against the box asked for.

    Raises
    ------
    AssumptionError
        If a side of `box` is not reached by any grid point.
    """
    spanned = np.stack([points.min(axis=0), points.max(axis=0)], axis=1)
    if box is None:
        return spanned
    wanted = finite_array("box", box, (points.shape[1], 2))
    slack = 1e-9 * np.maximum(np.abs(wanted[:, 1] - wanted[:, 0]), 1e-300)
    short = (spanned[:, 0] > wanted[:, 0] + slack) | (spanned[:, 1] < wanted[:, 1] - slack)
    if np.any(short):
        axis = int(np.argmax(short))
        raise AssumptionError(
            f"the grid does not span the box: points[:, {axis}] lie in {spanned[axis].tolist()}, the box is "
            f"{wanted[axis].tolist()}. Add grid points on its sides, or give the smaller box."
        )
    return np.asarray(wanted)


def _evaluate(basis: BasisFunction, p: Array, n_b: int | None) -> tuple[Array, Array]:
    try:
        values, gradient = basis(p)
    except (TypeError, ValueError, ArithmeticError) as error:
        raise DomainError(
            f"basis({p.tolist()}) failed: {error}. Wanted p (n_p,) -> (values (n_b,), gradient (n_b, n_p))."
        ) from error
    f = finite_array(f"values of basis({p.tolist()})", np.atleast_1d(np.asarray(values, dtype=float)), (n_b,))
    slope = np.asarray(gradient, dtype=float)
    if len(p) == 1 and slope.shape == (len(f),):
        slope = slope[:, None]
    return f, finite_array(f"gradient of basis({p.tolist()})", slope, (len(f), len(p)))
