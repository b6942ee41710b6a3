"""Ready-made controller structures: static gains, fixed order, blocks, scaling."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct.structures import ControllerStructure, Realization


def _size(name: str, value: int, least: int) -> int:
    if not isinstance(value, (int, np.integer)) or value < least:
        raise DomainError(f"{name} is {value!r}, wanted an integer of at least {least}.")
    return int(value)


def _static(D: Array) -> Realization:
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
        self.n_u, self.n_y, self.n_x = _size("n_u", n_u, 1), _size("n_y", n_y, 1), 0
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
        return _static(D)

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
        self.n_u = self.n_y = self.n_parameters = _size("n", n, 1)
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
            return _static(np.diag(theta))
        return _static(np.diag(np.exp(theta)) * self.sign[:, None])

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The diagonal of `GD`, times the gains where they are exponentials."""
        diagonal = np.diagonal(GD).copy()
        return diagonal if self.sign is None else diagonal * self._gains(theta)

    def initial(self, rng: np.random.Generator) -> Array:
        """Gains of random size around one."""
        theta = 10.0 ** rng.uniform(-1.0, 1.0) * rng.standard_normal(self.n_u)
        return theta if self.sign is None else rng.normal(0.0, 1.5, self.n_u)


class FixedOrder:
    """A controller of `order` states with free matrices A, B, C, D.

    Parameters
    ----------
    order, n_u, n_y : int
    form : "full" or "tridiagonal"
        Entries of A that are free. A tridiagonal A still reaches almost every
        transfer function, with fewer parameters.
    strictly_proper : bool
        True: D = 0.

    Raises
    ------
    DomainError
        If `form` is unknown or a size is too small.

    Examples
    --------
    >>> FixedOrder(2, 1, 1).n_parameters, FixedOrder(4, 1, 1, form="tridiagonal").n_parameters
    (9, 19)
    """

    def __init__(self, order: int, n_u: int, n_y: int, *, form: str = "full", strictly_proper: bool = False) -> None:
        self.n_x, self.n_u, self.n_y = _size("order", order, 0), _size("n_u", n_u, 1), _size("n_y", n_y, 1)
        if form not in ("full", "tridiagonal"):
            raise DomainError(f"form is {form!r}, wanted 'full' or 'tridiagonal'.")
        i, j = np.indices((order, order))
        free_A = np.ones((order, order), dtype=bool) if form == "full" else np.abs(i - j) <= 1
        free_D = np.full((n_u, n_y), not strictly_proper)
        self._masks = (free_A, np.ones((order, n_y), dtype=bool), np.ones((n_u, order), dtype=bool), free_D)
        counts = [int(np.sum(mask)) for mask in self._masks]
        self._cuts = np.cumsum(counts)[:-1]
        self.n_parameters = sum(counts)
        self.names = tuple(
            f"{name}[{i},{j}]" for name, mask in zip("ABCD", self._masks, strict=True) for i, j in np.argwhere(mask)
        )

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D) with the parameters placed row by row, A first."""
        out = []
        for mask, part in zip(self._masks, np.split(np.asarray(theta, dtype=float), self._cuts), strict=True):
            matrix = np.zeros(mask.shape)
            matrix[mask] = part
            out.append(matrix)
        return out[0], out[1], out[2], out[3]

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The free entries of the four gradients."""
        return np.concatenate([G[mask] for G, mask in zip((GA, GB, GC, GD), self._masks, strict=True)])

    def initial(self, rng: np.random.Generator) -> Array:
        """Normal matrices of random size, with A shifted to be stable."""
        size = 10.0 ** rng.uniform(-1.0, 1.0)
        out = [np.where(mask, rng.standard_normal(mask.shape), 0.0) for mask in self._masks]
        if self.n_x:
            out[0] = size * (out[0] - (np.max(np.linalg.eigvals(out[0]).real) + 1.0) * np.eye(self.n_x))
        out[3] *= size
        return np.concatenate([matrix[mask] for matrix, mask in zip(out, self._masks, strict=True)])


class BlockDiagonal:
    """Structures side by side: block i sees its own measurements and drives its own inputs.

    Parameters
    ----------
    *blocks : ControllerStructure
        theta is the blocks' parameters one after another; so are u, y and the states.

    Raises
    ------
    DimensionError
        If no block is given.

    Examples
    --------
    >>> BlockDiagonal(StaticGain(1, 1), FixedOrder(1, 1, 1)).n_parameters
    5
    """

    def __init__(self, *blocks: ControllerStructure) -> None:
        if not blocks:
            raise DimensionError("blocks is empty, wanted at least one structure.")
        self.blocks = blocks
        self.n_u, self.n_y = sum(b.n_u for b in blocks), sum(b.n_y for b in blocks)
        self.n_x, self.n_parameters = sum(b.n_x for b in blocks), sum(b.n_parameters for b in blocks)
        self._cuts = np.cumsum([b.n_parameters for b in blocks])[:-1]
        self.names = tuple(
            f"block {i}: {name}"
            for i, b in enumerate(blocks)
            for name in getattr(b, "names", [f"theta[{k}]" for k in range(b.n_parameters)])
        )

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """Block-diagonal (A, B, C, D)."""
        parts = [b.realize(t, p) for b, t in zip(self.blocks, np.split(theta, self._cuts), strict=True)]
        A, B, C, D = (block_diag(*[part[k] for part in parts]) for k in range(4))
        return A, B, C, D

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The blocks' pullbacks of their diagonal parts."""
        out, x, u, y = [], 0, 0, 0
        for b, t in zip(self.blocks, np.split(theta, self._cuts), strict=True):
            ix, iu, iy = slice(x, x + b.n_x), slice(u, u + b.n_u), slice(y, y + b.n_y)
            out.append(b.pullback(t, GA[ix, ix], GB[ix, iy], GC[iu, ix], GD[iu, iy], p))
            x, u, y = x + b.n_x, u + b.n_u, y + b.n_y
        return np.concatenate(out)

    def initial(self, rng: np.random.Generator) -> Array:
        """The blocks' starts."""
        return np.concatenate([b.initial(rng) for b in self.blocks])


class Scaled:
    """A structure between fixed gains: K_scaled = diag(row_scale) K diag(column_scale).

    Parameters
    ----------
    structure : ControllerStructure
    row_scale, column_scale : (n_u,), (n_y,) or a number
        For instance the inverse plant gain at the crossover, so that theta is of size one.

    Raises
    ------
    DomainError
        If a scale is zero, NaN or infinite, or does not fit.

    Examples
    --------
    >>> float(Scaled(StaticGain(1, 1), 10.0, 2.0).realize(np.array([1.0]))[3][0, 0])
    20.0
    """

    def __init__(
        self, structure: ControllerStructure, row_scale: ArrayLike = 1.0, column_scale: ArrayLike = 1.0
    ) -> None:
        self.structure = structure
        self.n_u, self.n_y = structure.n_u, structure.n_y
        self.n_x, self.n_parameters = structure.n_x, structure.n_parameters
        self.names = tuple(getattr(structure, "names", [f"theta[{k}]" for k in range(self.n_parameters)]))
        scales = []
        for name, value, n in (("row_scale", row_scale, self.n_u), ("column_scale", column_scale, self.n_y)):
            scale = finite_array(name, value)
            if scale.shape not in ((), (n,)) or np.any(scale == 0.0):
                raise DomainError(f"{name} is {scale.tolist()}, wanted a number or {n} of them, none zero.")
            scales.append(np.broadcast_to(scale, (n,)))
        self.row_scale, self.column_scale = (read_only(scale) for scale in scales)

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B c, r C, r D c)."""
        A, B, C, D = self.structure.realize(theta, p)
        r, c = self.row_scale[:, None], self.column_scale
        return A, B * c, r * C, r * D * c

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The inner pullback of the scaled gradients."""
        r, c = self.row_scale[:, None], self.column_scale
        return self.structure.pullback(theta, GA, GB * c, r * GC, r * GD * c, p)

    def initial(self, rng: np.random.Generator) -> Array:
        """The inner start."""
        return self.structure.initial(rng)
