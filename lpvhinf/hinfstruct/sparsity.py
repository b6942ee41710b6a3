"""Static gains with zeros, equal entries and fixed entries."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lpvhinf.checks import Array, finite_array, read_only, whole_number
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct.gains import static
from lpvhinf.hinfstruct.structures import Realization

Mask = NDArray[np.bool_]


def block_mask(rows: Sequence[int], columns: Sequence[int], *, shape: str = "diagonal") -> Mask:
    """A mask for `StaticGain` from block sizes.

    Parameters
    ----------
    rows, columns : sequence of int
        Heights and widths of the blocks.
    shape : "diagonal", "lower" or "upper"
        Blocks that are free: on the diagonal, or also below or above it.

    Returns
    -------
    (sum of rows, sum of columns) of bool

    Raises
    ------
    DimensionError
        If there are not as many rows as columns of blocks.
    DomainError
        If a size is below one or the shape is unknown.

    Examples
    --------
    >>> block_mask([1, 2], [2, 1]).astype(int)
    array([[1, 1, 0],
           [0, 0, 1],
           [0, 0, 1]])
    """
    if len(rows) != len(columns) or not rows:
        raise DimensionError(f"rows has {len(rows)} blocks, columns {len(columns)}; wanted as many, at least one.")
    if shape not in ("diagonal", "lower", "upper"):
        raise DomainError(f"shape is {shape!r}, wanted 'diagonal', 'lower' or 'upper'.")
    i = np.repeat(np.arange(len(rows)), [whole_number("rows", size, 1) for size in rows])
    j = np.repeat(np.arange(len(columns)), [whole_number("columns", size, 1) for size in columns])
    below, above = i[:, None] >= j, i[:, None] <= j
    return np.asarray(below & above if shape == "diagonal" else below if shape == "lower" else above)


def band_mask(n_u: int, n_y: int, below: int = 1, above: int = 1) -> Mask:
    """A mask for `StaticGain` with free entries in a band around the diagonal: each input sees its neighbours only.

    Examples
    --------
    >>> band_mask(3, 3, below=0).astype(int)
    array([[1, 1, 0],
           [0, 1, 1],
           [0, 0, 1]])
    """
    i, j = np.indices((whole_number("n_u", n_u, 1), whole_number("n_y", n_y, 1)))
    return np.asarray((i - j <= whole_number("below", below, 0)) & (j - i <= whole_number("above", above, 0)))


class AffineGain:
    r"""A static gain that is affine in the parameters, :math:`D = D_0 + \sum_k \theta_k E_k`.

    Parameters
    ----------
    basis : (n_parameters, n_u, n_y)
        The matrices E_k, linearly independent.
    offset : (n_u, n_y), optional
        D_0, fixed entries. Zero if left out.

    Raises
    ------
    DimensionError
        If sizes disagree.
    AssumptionError
        If the matrices E_k are linearly dependent.

    Examples
    --------
    Two equal gains on the diagonal and a fixed coupling:

    >>> K = AffineGain([np.eye(2)], offset=[[0.0, 0.5], [0.0, 0.0]])
    >>> K.realize(np.array([3.0]))[3]
    array([[3. , 0.5],
           [0. , 3. ]])
    """

    def __init__(self, basis: ArrayLike, offset: ArrayLike | None = None) -> None:
        E = finite_array("basis", basis, (None, None, None))
        self.n_parameters, self.n_u, self.n_y = E.shape
        if min(E.shape) < 1:
            raise DimensionError(f"basis has shape {E.shape}, wanted (n_parameters, n_u, n_y), none of them zero.")
        self.n_x = 0
        self.names = tuple(f"theta[{k}]" for k in range(self.n_parameters))
        shape = (self.n_u, self.n_y)
        self.offset = read_only(np.zeros(shape) if offset is None else finite_array("offset", offset, shape))
        self.basis = read_only(E)
        if np.linalg.matrix_rank(E.reshape(self.n_parameters, -1)) < self.n_parameters:
            raise AssumptionError("basis holds linearly dependent matrices, wanted independent ones. Drop some.")

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D) without states."""
        return static(self.offset + np.tensordot(theta, self.basis, axes=1))

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The inner products of `GD` with the basis."""
        return np.asarray(np.tensordot(self.basis, GD, axes=2))

    def initial(self, rng: np.random.Generator) -> Array:
        """Normal parameters; a random power of ten between 0.1 and 10 as their size."""
        return np.asarray(10.0 ** rng.uniform(-1.0, 1.0) * rng.standard_normal(self.n_parameters))


def pattern_gain(pattern: ArrayLike) -> AffineGain:
    """A static gain from a table of parameter numbers: 0 is a zero, k is parameter k, -k its negative.

    Parameters
    ----------
    pattern : (n_u, n_y) of int
        Numbers 1, 2, ... without gaps; a number may stand in several places.

    Raises
    ------
    DomainError
        If entries are not whole numbers, or one between 1 and the largest is missing.

    Examples
    --------
    A symmetric gain of three parameters:

    >>> pattern_gain([[1, 2], [2, 3]]).realize(np.array([5.0, 6.0, 7.0]))[3]
    array([[5., 6.],
           [6., 7.]])
    """
    table = finite_array("pattern", pattern, (None, None))
    count = int(np.max(np.abs(table), initial=0.0))
    if np.any(table != np.round(table)) or set(np.abs(table[table != 0.0])) != set(range(1, count + 1)) or count == 0:
        raise DomainError(
            f"pattern is {table.tolist()}, wanted whole numbers that use each of 1, 2, ... up to the largest. "
            "Number the parameters without gaps."
        )
    return AffineGain([np.sign(table) * (np.abs(table) == k) for k in range(1, count + 1)])
