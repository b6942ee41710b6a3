r"""Matrices that are polynomial in the position p: tensor Chebyshev series over the box P.

This is the one representation of position dependence in the house. With
:math:`x_k \in [-1, 1]` the k-th coordinate of p scaled to the box,

.. math:: M(p) = \sum_{i_1 \dots i_{n_p}} M_{i_1 \dots i_{n_p}} T_{i_1}(x_1) \cdots T_{i_{n_p}}(x_{n_p}).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import ClassVar

import numpy as np
import scipy.fft
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from lpvhinf.checks import Array, box_array, finite_array, points_in_box, read_only
from lpvhinf.errors import DimensionError, DomainError

CHUNK = 2_000_000  # numbers of the largest temporary basis matrix: 16 MB


@dataclass(frozen=True, eq=False)
class ChebyshevMatrix:
    """A (rows, cols) matrix, polynomial in p over a box.

    Parameters
    ----------
    coefficients : (k_1, ..., k_np, rows, cols)
        Chebyshev coefficients; k_i - 1 is the degree along axis i.
    box : (n_p, 2)
        Lower and upper bound of every coordinate of p [m, for the planar actuator].

    Raises
    ------
    DimensionError
        If `coefficients` has not n_p + 2 axes.
    DomainError
        If a number is not finite, or the box is empty.

    Examples
    --------
    >>> M = ChebyshevMatrix(np.reshape([1.0, 2.0], (2, 1, 1)), [[-1.0, 1.0]])  # 1 + 2 p
    >>> float(M.at([0.5])[0, 0])
    2.0
    """

    coefficients: Array
    box: Array
    # NumPy leaves `array @ matrix` to __rmatmul__ below instead of taking the object for a scalar
    __array_ufunc__: ClassVar[None] = None

    def __init__(self, coefficients: ArrayLike, box: ArrayLike) -> None:
        bounds = box_array(box)
        values = finite_array("coefficients", coefficients)
        if values.ndim == 2:  # a constant
            values = values.reshape((1,) * len(bounds) + values.shape)
        if values.ndim != len(bounds) + 2 or 0 in values.shape[: len(bounds)]:
            raise DimensionError(
                f"coefficients has shape {values.shape}, wanted {len(bounds)} axes of degrees and then (rows, cols)."
            )
        object.__setattr__(self, "coefficients", read_only(values))
        object.__setattr__(self, "box", bounds)

    @classmethod
    def _of(cls, coefficients: Array, box: Array) -> ChebyshevMatrix:
        """From results of our own arithmetic, unchecked: loops are wired from thousands of small matrices."""
        out = object.__new__(cls)
        coefficients.setflags(write=False)
        object.__setattr__(out, "coefficients", coefficients)
        object.__setattr__(out, "box", box)
        return out

    @cached_property
    def _used(self) -> NDArray[np.intp]:
        """Entries that are not identically zero; only these are ever evaluated: state matrices are sparse."""
        return np.flatnonzero(np.any(self.coefficients != 0.0, axis=tuple(range(self.n_p))))

    @property
    def n_p(self) -> int:
        """Number of scheduling coordinates."""
        return len(self.box)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        rows, cols = self.coefficients.shape[-2:]
        return rows, cols

    @property
    def degree(self) -> tuple[int, ...]:
        """Degree along every axis of p."""
        return tuple(k - 1 for k in self.coefficients.shape[:-2])

    @property
    def is_constant(self) -> bool:
        """Whether the matrix does not depend on p."""
        return all(d == 0 for d in self.degree)

    def at(self, p: ArrayLike) -> Array:
        """The (rows, cols) matrix at one position p (n_p,); a `DomainError` outside the box."""
        return np.asarray(self.sample(np.reshape(np.asarray(p, dtype=float), (1, -1)))[0])

    def sample(self, points: ArrayLike) -> Array:
        """The matrices at positions (N, n_p) as (N, rows, cols); a `DomainError` outside the box."""
        where = points_in_box(points, self.box)
        rows, cols = self.shape
        if self.is_constant or rows * cols == 0:  # a view: one matrix serves every position
            constant = self.coefficients[(0,) * self.n_p]
            return np.broadcast_to(constant, (len(where), rows, cols))
        used = self._used
        flat = np.ascontiguousarray(self.coefficients.reshape(-1, rows * cols)[:, used])
        out = np.zeros((len(where), rows * cols))
        step = max(1, CHUNK // len(flat))
        for start in range(0, len(where), step):
            basis = self._basis(where[start : start + step])
            out[start : start + step, used] = basis @ flat
        return out.reshape(len(where), rows, cols)

    def _basis(self, points: Array) -> Array:
        """Values of all tensor basis functions, (N, k_1 ... k_np)."""
        x = scaled(points, self.box)
        factors = [np.asarray(chebyshev.chebvander(x[:, i], d), dtype=float) for i, d in enumerate(self.degree)]
        return reduce(lambda left, right: np.einsum("ni,nj->nij", left, right).reshape(len(points), -1), factors)

    def derivative(self, axis: int) -> ChebyshevMatrix:
        """The partial derivative dM/dp_axis, axis = 0 ... n_p - 1."""
        if not 0 <= axis < self.n_p:  # a negative one would count from the columns
            raise DomainError(f"axis is {axis}, wanted 0 to {self.n_p - 1}.")
        scale = 2.0 / (self.box[axis, 1] - self.box[axis, 0])
        return self._of(chebyshev.chebder(self.coefficients, scl=scale, axis=axis), self.box)

    def padded(self, degree: Sequence[int]) -> Array:
        """The coefficients with zeros added up to `degree`."""
        if tuple(degree) == self.degree:
            return self.coefficients
        grow = [(0, max(0, d - e)) for d, e in zip(degree, self.degree, strict=True)]
        return np.pad(self.coefficients, [*grow, (0, 0), (0, 0)])

    def trimmed(self, tolerance: float = 0.0) -> ChebyshevMatrix:
        """Without the trailing degrees whose coefficients are all at most `tolerance` in size."""
        c = self.coefficients
        for axis in range(self.n_p):
            sizes = np.max(np.abs(np.moveaxis(c, axis, 0)).reshape(c.shape[axis], -1), axis=1, initial=0.0)
            keep = np.flatnonzero(sizes > tolerance)
            c = np.take(c, range(int(keep[-1]) + 1 if len(keep) else 1), axis=axis)
        return self._of(np.array(c), self.box)

    # algebra: exact up to round-off, so that a closed loop has the plant's own degree in p

    def _like(self, other: ChebyshevMatrix | ArrayLike) -> ChebyshevMatrix:
        if not isinstance(other, ChebyshevMatrix):
            return ChebyshevMatrix(np.atleast_2d(np.asarray(other, dtype=float)), self.box)
        if other.box is self.box:
            return other
        if other.box.shape != self.box.shape or not np.array_equal(other.box, self.box):
            raise DimensionError(f"the boxes {self.box.tolist()} and {other.box.tolist()} differ. Use one box.")
        return other

    def __add__(self, other: ChebyshevMatrix | ArrayLike) -> ChebyshevMatrix:
        right = self._like(other)
        if right.shape != self.shape:
            raise DimensionError(f"cannot add {self.shape} and {right.shape} matrices.")
        degree = [max(a, b) for a, b in zip(self.degree, right.degree, strict=True)]
        return self._of(self.padded(degree) + right.padded(degree), self.box)

    def __neg__(self) -> ChebyshevMatrix:
        return self._of(-self.coefficients, self.box)

    def __sub__(self, other: ChebyshevMatrix | ArrayLike) -> ChebyshevMatrix:
        return self + -self._like(other)

    def __matmul__(self, other: ChebyshevMatrix | ArrayLike) -> ChebyshevMatrix:
        right = self._like(other)
        if self.shape[1] != right.shape[0]:
            raise DimensionError(f"cannot multiply {self.shape} and {right.shape} matrices.")
        if self.is_constant or right.is_constant:
            return self._of(self.coefficients @ right.coefficients, self.box)
        size = [a + b + 1 for a, b in zip(self.degree, right.degree, strict=True)]
        return self._of(from_nodes(_on_nodes(self, size) @ _on_nodes(right, size), self.n_p), self.box)

    def __radd__(self, other: ArrayLike) -> ChebyshevMatrix:
        return self + other

    def __rsub__(self, other: ArrayLike) -> ChebyshevMatrix:
        return -self + other

    def __rmatmul__(self, other: ArrayLike) -> ChebyshevMatrix:
        return self._like(other) @ self

    @property
    def T(self) -> ChebyshevMatrix:
        """The transpose."""
        return self._of(np.swapaxes(self.coefficients, -1, -2), self.box)

    def __getitem__(self, key: tuple[slice | Sequence[int], slice | Sequence[int]]) -> ChebyshevMatrix:
        rows, cols = key
        return self._of(self.coefficients[..., rows, :][..., cols], self.box)

    def __repr__(self) -> str:
        return f"ChebyshevMatrix({self.shape[0]}x{self.shape[1]}, degree {self.degree}, box {self.box.tolist()})"


def block(rows: Sequence[Sequence[ChebyshevMatrix | ArrayLike]], box: ArrayLike) -> ChebyshevMatrix:
    """A block matrix of `ChebyshevMatrix` and constant blocks over one box, like `numpy.block`."""
    empty = ChebyshevMatrix(np.zeros((0, 0)), box)
    cells = [[empty._like(cell) for cell in row] for row in rows]
    degree = [max(cell.degree[i] for row in cells for cell in row) for i in range(empty.n_p)]
    joined = [np.concatenate([cell.padded(degree) for cell in row], axis=-1) for row in cells]
    return empty._of(np.concatenate(joined, axis=-2), empty.box)


def scaled(points: Array, box: Array) -> Array:
    """Positions scaled so that the box becomes [-1, 1] on every axis."""
    return np.asarray((2.0 * points - box[:, 0] - box[:, 1]) / (box[:, 1] - box[:, 0]))


def nodes(size: Sequence[int], box: ArrayLike) -> Array:
    """The tensor grid of Chebyshev points of the first kind, `size[i]` on axis i, as (prod(size), n_p)."""
    bounds = box_array(box)
    axes = [
        0.5 * (low + high) + 0.5 * (high - low) * np.cos(np.pi * (np.arange(n) + 0.5) / n)
        for n, (low, high) in zip(size, bounds, strict=True)
    ]
    return np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=-1)


def from_nodes(values: Array, n_p: int) -> Array:
    """Chebyshev coefficients (k_1, ..., rows, cols) of the interpolant of values on the grid of `nodes`."""
    coefficients = np.asarray(values, dtype=float)
    for axis in range(n_p):
        n = coefficients.shape[axis]
        coefficients = scipy.fft.dct(coefficients, type=2, axis=axis) / n
        coefficients[(slice(None),) * axis + (0,)] /= 2.0
    return coefficients


def _on_nodes(matrix: ChebyshevMatrix, size: Sequence[int]) -> Array:
    """Values on the tensor grid of `nodes(size)`, as (size_1, ..., rows, cols)."""
    values = matrix.coefficients
    for axis, n in enumerate(size):
        basis = chebyshev.chebvander(np.cos(np.pi * (np.arange(n) + 0.5) / n), values.shape[axis] - 1)
        values = np.moveaxis(np.tensordot(basis, values, axes=(1, axis)), 0, axis)
    return values


def power_to_chebyshev(coefficients: ArrayLike, box: ArrayLike) -> Array:
    """Coefficients of powers of p (in p itself) as Chebyshev coefficients over the box.

    Both have shape (k_1, ..., k_np, rows, cols).
    """
    bounds = box_array(box)
    values = finite_array("coefficients", coefficients)
    if values.ndim != len(bounds) + 2:
        raise DimensionError(
            f"coefficients has shape {values.shape}, wanted {len(bounds)} axes of powers and then (rows, cols)."
        )
    for axis, (low, high) in enumerate(bounds):
        n = values.shape[axis]
        x = np.cos(np.pi * (np.arange(n) + 0.5) / n)
        powers = np.vander(0.5 * (low + high) + 0.5 * (high - low) * x, n, increasing=True)
        values = np.moveaxis(np.tensordot(powers, values, axes=(1, axis)), 0, axis)
    return from_nodes(values, len(bounds))
