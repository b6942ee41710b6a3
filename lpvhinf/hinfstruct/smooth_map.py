"""Any smooth function (theta, p) -> (A, B, C, D) as a structure, with derivatives by differences."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from lpvhinf.checks import Array, whole_number
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.hinfstruct.structures import Realization

#: A complex step has no cancellation, so it may be this small.
TINY = 1e-30

Function = Callable[[Any, Any], tuple[Any, Any, Any, Any]]


class SmoothMap:
    """A user's function as a structure, for those who have no derivatives.

    One pullback costs 2 n_parameters calls of the function by central differences (error about 1e-10, relative), or
    n_parameters calls by complex steps (exact to rounding). Complex steps need a function that is analytic and lets
    complex numbers through: no `abs`, `max`, `float`, transposes instead of conjugate transposes, and matrices that
    are built from theta by `np.array` or with ``dtype=theta.dtype``. `check_structure` compares either way with
    differences. With jobs > 1 the function must be picklable: define it in a module.

    Parameters
    ----------
    function : callable
        (theta, p) -> (A, B, C, D); p is None where no positions are given.
    n_parameters : int
    n_u, n_y, n_x : int
        Sizes of the controller.
    derivative : "central" or "complex"
    initial : callable, optional
        Random generator -> theta. Left out: standard normal parameters.
    names : sequence of str, optional

    Raises
    ------
    DomainError
        If `derivative` is another one, or a size is too small.

    Examples
    --------
    >>> def lag(theta, p):
    ...     k, w = theta[0], np.exp(theta[1])
    ...     return np.array([[-w]]), np.array([[w]]), np.array([[k]]), np.zeros((1, 1))
    >>> from lpvhinf.hinfstruct import check_structure
    >>> K = SmoothMap(lag, 2, n_u=1, n_y=1, n_x=1, derivative="complex")
    >>> check_structure(K) < 1e-6
    True
    """

    def __init__(
        self,
        function: Function,
        n_parameters: int,
        *,
        n_u: int,
        n_y: int,
        n_x: int = 0,
        derivative: str = "central",
        initial: Callable[[np.random.Generator], Array] | None = None,
        names: tuple[str, ...] | None = None,
    ) -> None:
        if derivative not in ("central", "complex"):
            raise DomainError(f"derivative is {derivative!r}, wanted 'central' or 'complex'.")
        self.function, self.derivative = function, derivative
        self.n_parameters = whole_number("n_parameters", n_parameters, 1)
        self.n_u, self.n_y = whole_number("n_u", n_u, 1), whole_number("n_y", n_y, 1)
        self.n_x = whole_number("n_x", n_x, 0)
        self.names = tuple(f"theta[{k}]" for k in range(n_parameters)) if names is None else tuple(names)
        if len(self.names) != n_parameters:
            raise DomainError(f"names has {len(self.names)} entries, wanted {n_parameters}, one a parameter.")
        self._initial = initial

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """The function's matrices as real arrays."""
        A, B, C, D = (np.asarray(matrix, dtype=float) for matrix in self.function(np.asarray(theta, dtype=float), p))
        return A, B, C, D

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """Inner products of the gradients with the differences of the matrices."""
        G = (GA, GB, GC, GD)
        out = np.empty(self.n_parameters)
        for k in range(self.n_parameters):
            if self.derivative == "complex":
                change = [matrix.imag / TINY for matrix in self._complex(theta, p, k)]
            else:
                step = np.zeros(self.n_parameters)
                step[k] = 6e-6 * max(1.0, abs(theta[k]))
                above, below = self.realize(theta + step, p), self.realize(theta - step, p)
                change = [(a - b) / (2.0 * step[k]) for a, b in zip(above, below, strict=True)]
            out[k] = sum(float(np.sum(g * c)) for g, c in zip(G, change, strict=True))
        return out

    def _complex(self, theta: Array, p: Array | None, k: int) -> list[np.ndarray]:
        moved = np.asarray(theta, dtype=complex)
        moved[k] += 1j * TINY
        try:
            with warnings.catch_warnings():
                # a dropped imaginary part would be a derivative of zero
                warnings.simplefilter("error", np.exceptions.ComplexWarning)
                return [np.asarray(matrix, dtype=complex) for matrix in self.function(moved, p)]
        except (TypeError, ValueError, np.exceptions.ComplexWarning) as error:
            raise AssumptionError(
                f"the function does not accept complex parameters: {error}. Use derivative='central', or build the "
                "matrices with dtype=theta.dtype."
            ) from error

    def initial(self, rng: np.random.Generator) -> Array:
        """The given start, or standard normal parameters."""
        if self._initial is not None:
            return np.asarray(self._initial(rng), dtype=float)
        return np.asarray(rng.standard_normal(self.n_parameters))
