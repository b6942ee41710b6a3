r"""Basis functions of the Lyapunov matrices, sampled on a grid, and the vertices of the rate box."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import AssumptionError, DimensionError, DomainError

#: p (n_p,) to the values (n_b,) of the basis functions and their gradient (n_b, n_p).
Basis = Callable[[Array], tuple[ArrayLike, ArrayLike]]


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledBasis:
    r"""An orthonormalised basis :math:`\hat f = W^\top f` on a grid.

    Attributes
    ----------
    points : (N, n_p)
    values : (N, n_b)
        :math:`\hat f_i(p_k)`, with :math:`\sum_k \hat f_i(p_k) \hat f_j(p_k) = N \delta_{ij}`.
    gradients : (N, n_b, n_p)
    rates : tuple of (v, n_b), one a point
        :math:`\sum_j \dot p_j \partial \hat f_i / \partial p_j` at the different vertices of the rate box, over omega.
    vertices : tuple of (v, n_p), one a point
        The rates meant.
    W : (n_b, n_b)
        Back to the given functions: the matrices of f are :math:`Y_i = \sum_j W_{ij} \hat Y_j`.
    unit : (n_b,)
        Coefficients of the constant 1 in the orthonormalised basis.
    """

    points: Array
    values: Array
    gradients: Array
    rates: tuple[Array, ...]
    vertices: tuple[Array, ...]
    W: Array
    unit: Array

    @property
    def count(self) -> int:
        """Number of functions."""
        return int(self.values.shape[1])

    def matrices(self, Y: Array) -> Array:
        """The matrices (n_b, n, n) that belong to the functions as given."""
        return np.tensordot(self.W, Y, axes=(1, 0))


def constant_basis(points: Array) -> SampledBasis:
    """The single function 1."""
    N, n_p = points.shape
    return SampledBasis(
        points=read_only(points),
        values=read_only(np.ones((N, 1))),
        gradients=read_only(np.zeros((N, 1, n_p))),
        rates=(read_only(np.zeros((1, 1))),) * N,
        vertices=(read_only(np.zeros((1, n_p))),) * N,
        W=read_only(np.eye(1)),
        unit=read_only(np.ones(1)),
    )


def checked_points(points: ArrayLike, n: int) -> Array:
    """The grid as (N, n_p).

    Raises
    ------
    DimensionError
        If there is not one point for each plant.
    """
    array = finite_array("points", points)
    array = array[:, None] if array.ndim == 1 else array
    if array.ndim != 2 or array.shape[0] != n:
        raise DimensionError(f"points has shape {array.shape}, wanted ({n}, n_p): one row for each plant.")
    return array


def rate_box(rate: ArrayLike | None, n_p: int) -> Array:
    """The box of rates (n_p, 2); None stands for frozen scheduling, a number v for [-v, v] on every axis.

    Raises
    ------
    DimensionError
        If the shape is another one.
    DomainError
        If a lowest rate is above its highest one.
    """
    if rate is None:
        return np.zeros((n_p, 2))
    array = finite_array("rate", rate)
    if array.ndim == 0:
        array = np.tile([-float(array), float(array)], (n_p, 1))
    if array.shape != (n_p, 2):
        raise DimensionError(
            f"rate has shape {array.shape}, wanted ({n_p}, 2): lowest and highest dp/dt on every axis."
        )
    if np.any(array[:, 0] > array[:, 1]):
        raise DomainError(f"rate is {array.tolist()}, an empty box: wanted rows (lowest, highest) in this order.")
    return array


def sampled_basis(basis: Basis | None, points: Array, rate: Array, omega: float = 1.0) -> SampledBasis:
    r"""Evaluate basis functions and their rates on a grid, and orthonormalise them there.

    Parameters
    ----------
    basis : callable or None
        `basis(p) -> (values (n_b,), gradient (n_b, n_p))`; None is the constant 1.
    points : (N, n_p)
    rate : (n_p, 2)
        Box of dp/dt.
    omega : float
        Unit of frequency [rad/s]: the rates of the functions are divided by it.

    Raises
    ------
    DimensionError
        If values or gradients have another shape.
    AssumptionError
        If the constant 1 is no combination of the functions, they are dependent on this grid, or the grid does not move
        along an axis that has a rate.
    """
    if basis is None:
        return constant_basis(points)
    N, n_p = points.shape
    samples = [basis(np.array(p)) for p in points]
    n_b = np.asarray(samples[0][0]).size
    values = np.stack([finite_array("basis values", np.atleast_1d(np.asarray(f, float)), (n_b,)) for f, _ in samples])
    gradients = np.stack([_gradient(g, n_b, n_p) for _, g in samples])
    if np.linalg.norm(np.linalg.lstsq(values, np.ones(N), rcond=None)[0] @ values.T - 1.0) > 1e-8 * np.sqrt(N):
        raise AssumptionError(
            "basis has no constant term: 1 is no combination of its functions on the grid. Add the function 1."
        )
    Q, triangle = np.linalg.qr(values)
    diagonal = np.abs(np.diag(triangle)) if n_b <= N else np.zeros(1)
    if n_b > N or diagonal.min() <= 1e-9 * np.linalg.norm(values, axis=0).max():
        raise AssumptionError(
            f"the {n_b} basis functions are dependent on this grid of {N} points. Take fewer functions or more points."
        )
    W = np.linalg.inv(triangle) * np.sqrt(N)
    values, gradients = Q * np.sqrt(N), np.einsum("kip,ij->kjp", gradients, W)
    still = np.ptp(points, axis=0) == 0.0
    moving = np.any(rate != 0.0, axis=1) & np.any(gradients != 0.0, axis=(0, 1))
    if np.any(still & moving):
        axis = int(np.argmax(still & moving))
        raise AssumptionError(
            f"the grid does not span the box: all points have p[{axis}] = {points[0, axis]:g}, but the rate there is "
            f"{rate[axis].tolist()}. Spread the points, or set this rate to zero."
        )
    corners = np.array(list(itertools.product(*rate)))
    found = [_different(corners, corners @ g.T / omega) for g in gradients]
    return SampledBasis(
        points=read_only(points),
        values=read_only(values),
        gradients=read_only(gradients),
        rates=tuple(read_only(rates) for _, rates in found),
        vertices=tuple(read_only(vertices) for vertices, _ in found),
        W=read_only(W),
        unit=read_only(values.T @ np.ones(N) / N),
    )


def _gradient(gradient: ArrayLike, n_b: int, n_p: int) -> Array:
    array = np.asarray(gradient, dtype=float)
    if n_p == 1 and array.shape == (n_b,):
        array = array[:, None]
    return finite_array("basis gradient", array, (n_b, n_p))


def _different(corners: Array, rates: Array) -> tuple[Array, Array]:
    """Leave out vertices that give the same rates of the basis functions."""
    scale = max(float(np.abs(rates).max(initial=0.0)), 1e-300)
    _, first = np.unique(np.round(rates / scale, 12), axis=0, return_index=True)
    return corners[np.sort(first)], rates[np.sort(first)]
