"""Chebyshev matrices from samples: interpolation and least squares, each with its measured error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array, finite_array, points_in_box
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.polynomial import ChebyshevMatrix, from_nodes, nodes


@dataclass(frozen=True, eq=False)
class MatrixFit:
    """A fitted matrix and what the fit is worth.

    Attributes
    ----------
    matrix : ChebyshevMatrix
        The fit.
    error : (rows, cols)
        Largest absolute deviation of every entry at the test positions.
    scale : float
        Largest absolute value of any entry at the test positions.
    n_test : int
        Number of test positions; for interpolation none of them is a node.
    """

    matrix: ChebyshevMatrix
    error: Array
    scale: float
    n_test: int

    @property
    def relative_error(self) -> float:
        """Largest deviation of any entry relative to the largest entry."""
        return float(np.max(self.error, initial=0.0) / self.scale) if self.scale > 0.0 else 0.0


def degrees(degree: int | Sequence[int], n_p: int) -> tuple[int, ...]:
    """One degree for every axis."""
    given = np.full(n_p, degree) if np.ndim(degree) == 0 else np.asarray(degree)
    if given.shape != (n_p,) or not np.issubdtype(given.dtype, np.integer) or np.any(given < 0):
        raise DimensionError(f"degree is {degree!r}, wanted one or {n_p} whole numbers of at least 0.")
    return tuple(int(d) for d in given)


def spread_points(box: ArrayLike, n: int, seed: int = 0) -> Array:
    """`n` positions spread evenly over the box (scrambled Sobol), for measuring a fit's error."""
    from scipy.stats import qmc

    bounds = box_array(box)
    unit = qmc.Sobol(len(bounds), seed=seed).random_base2(int(np.ceil(np.log2(max(n, 2)))))[:n]
    return np.asarray(bounds[:, 0] + unit * (bounds[:, 1] - bounds[:, 0]))


def interpolate(
    function: Callable[[Array], Array],
    *,
    box: ArrayLike,
    degree: int | Sequence[int],
    n_test: int = 64,
) -> MatrixFit:
    """Interpolate a matrix function of p on the tensor grid of Chebyshev points.

    Parameters
    ----------
    function : (N, n_p) -> (N, rows, cols)
    box : (n_p, 2)
    degree : one whole number, or one for every axis
    n_test : number of further positions at which the error is measured

    Returns
    -------
    MatrixFit
        With the error at positions that were not used.

    Examples
    --------
    >>> fit = interpolate(lambda p: np.exp(p)[:, :, None], box=[[-1.0, 1.0]], degree=10)
    >>> bool(fit.relative_error < 1e-9)
    True
    """
    bounds = box_array(box)
    size = [d + 1 for d in degrees(degree, len(bounds))]
    grid = nodes(size, bounds)
    values = finite_array("function(points)", function(grid), (len(grid), None, None))
    matrix = ChebyshevMatrix(from_nodes(values.reshape(*size, *values.shape[1:]), len(bounds)), bounds)
    where = spread_points(bounds, n_test)
    return _measured(matrix, where, finite_array("function(points)", function(where), (len(where), *matrix.shape)))


def least_squares(points: ArrayLike, values: ArrayLike, *, box: ArrayLike, degree: int | Sequence[int]) -> MatrixFit:
    """Fit samples at scattered positions by least squares.

    Parameters
    ----------
    points : (N, n_p)
    values : (N, rows, cols)
    box : (n_p, 2)
    degree : one whole number, or one for every axis

    Raises
    ------
    AssumptionError
        If the positions do not determine the polynomial.
    """
    bounds = box_array(box)
    where = points_in_box(points, bounds, name="points")
    samples = finite_array("values", values, (len(where), None, None))
    size = [d + 1 for d in degrees(degree, len(bounds))]
    basis = ChebyshevMatrix(np.zeros((*size, 0, 0)), bounds)._basis(where)
    solution, _, rank, _ = np.linalg.lstsq(basis, samples.reshape(len(where), -1), rcond=None)
    if rank < basis.shape[1]:
        raise AssumptionError(
            f"{len(where)} positions determine {rank} of the {basis.shape[1]} coefficients of degree {degree}. "
            "Give more positions, spread over the box, or lower the degree."
        )
    matrix = ChebyshevMatrix(solution.reshape(*size, *samples.shape[1:]), bounds)
    return _measured(matrix, where, samples)


def _measured(matrix: ChebyshevMatrix, where: Array, truth: Array) -> MatrixFit:
    error = np.max(np.abs(matrix.sample(where) - truth), axis=0, initial=0.0)
    return MatrixFit(matrix, error, float(np.max(np.abs(truth), initial=0.0)), len(where))
