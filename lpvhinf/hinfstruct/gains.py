"""Static gains: free, with a pattern of zeros, one a channel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only, whole_number
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct.structures import Realization


def static(D: Array) -> Realization:
    """(A, B, C, D) without states."""
    return np.zeros((0, 0)), np.zeros((0, D.shape[1])), np.zeros((D.shape[0], 0)), D


class StaticGain:
    """Static output feedback u = D y with free entries where `mask` is true, row by row.

    Parameters
    ----------
    n_u, n_y : int
    mask : (n_u, n_y) of bool, optional
        Entries that are free; the others are zero. All free if left out.

    Raises
    ------
    DimensionError
        If `mask` has another shape.
    DomainError
        If a size is below one.

    Examples
    --------
    >>> StaticGain(1, 2).realize(np.array([3.0, 4.0]))[3]
    array([[3., 4.]])
    """

    def __init__(self, n_u: int, n_y: int, mask: ArrayLike | None = None) -> None:
        self.n_u, self.n_y, self.n_x = whole_number("n_u", n_u, 1), whole_number("n_y", n_y, 1), 0
        free = np.ones((n_u, n_y), dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
        if free.shape != (n_u, n_y):
            raise DimensionError(f"mask has shape {free.shape}, wanted {(n_u, n_y)}.")
        self.mask = read_only(free, bool)
        self.n_parameters = int(np.sum(free))
        self.names = tuple(f"D[{i},{j}]" for i, j in np.argwhere(free))

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D) with the parameters placed into D."""
        D = np.zeros((self.n_u, self.n_y))
        D[self.mask] = theta
        return static(D)

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The free entries of `GD`."""
        return np.asarray(GD[self.mask])

    def initial(self, rng: np.random.Generator) -> Array:
        """Normal entries; a random power of ten between 0.1 and 10 as their size."""
        return np.asarray(10.0 ** rng.uniform(-1.0, 1.0) * rng.standard_normal(self.n_parameters))


class DiagonalGain:
    r"""One gain a channel, :math:`u_i = k_i y_i`; of a fixed sign as :math:`k_i = \pm e^{\theta_i}`.

    Parameters
    ----------
    n : int
    sign : +1, -1 or (n,) of these, optional
        Fixes the signs of the gains, whose logarithms are then the parameters. Left out: free gains.

    Raises
    ------
    DomainError
        If a sign is neither +1 nor -1, or n is below one.

    Examples
    --------
    >>> DiagonalGain(2, sign=-1).realize(np.zeros(2))[3]
    array([[-1., -0.],
           [-0., -1.]])
    """

    def __init__(self, n: int, sign: float | Sequence[float] | None = None) -> None:
        self.n_u = self.n_y = self.n_parameters = whole_number("n", n, 1)
        self.n_x = 0
        self.names = tuple(f"k[{i}]" if sign is None else f"log |k[{i}]|" for i in range(n))
        self.sign: Array | None = None
        if sign is not None:
            signs = np.broadcast_to(finite_array("sign", sign), (n,))
            if not np.all(np.abs(signs) == 1.0):
                raise DomainError(f"sign is {sign!r}, wanted +1 or -1, or one of them a channel.")
            self.sign = read_only(signs)

    def _gains(self, theta: Array) -> Array:
        return theta if self.sign is None else self.sign * np.exp(theta)

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D) with a diagonal D."""
        if self.sign is None:
            return static(np.diag(theta))
        return static(np.diag(np.exp(theta)) * self.sign[:, None])

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The diagonal of `GD`, times the gains where they are exponentials."""
        diagonal = np.diagonal(GD).copy()
        return diagonal if self.sign is None else diagonal * self._gains(theta)

    def initial(self, rng: np.random.Generator) -> Array:
        """Gains of random size around one."""
        theta = 10.0 ** rng.uniform(-1.0, 1.0) * rng.standard_normal(self.n_u)
        return theta if self.sign is None else rng.normal(0.0, 1.5, self.n_u)
