"""Position-dependent matrices Phi(p): constants, callables, and their projections.

A map is any callable that takes positions (N, n_p) and returns (N, rows, cols).
A map of a large model may also offer ``left_project(V)`` (the map of V.T @ Phi(p)) or
``right_project(V)`` (the map of Phi(p) @ V), so that the large matrix is never formed;
a map without them is composed with V.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError

PositionMap = Callable[[Array], Any]

CHUNK_BYTES = 16_000_000  # a batch of positions that stays near the cache and far below any memory limit


@dataclass(frozen=True, eq=False)
class ConstantMap:
    """A map that does not depend on the position.

    Examples
    --------
    >>> ConstantMap(np.eye(2))(np.zeros((3, 1))).shape
    (3, 2, 2)
    """

    matrix: Array

    def __call__(self, points: Array) -> Array:
        """The same matrix at every position."""
        return np.broadcast_to(self.matrix, (len(points), *self.matrix.shape))

    def left_project(self, V: Array) -> ConstantMap:
        """The map of V.T @ Phi."""
        return ConstantMap(read_only(V.T @ self.matrix))

    def right_project(self, V: Array) -> ConstantMap:
        """The map of Phi @ V."""
        return ConstantMap(read_only(self.matrix @ V))


@dataclass(frozen=True, eq=False)
class LeftProjectedMap:
    """The map of V.T @ Phi(p), by composition."""

    inner: PositionMap
    V: Array

    def __call__(self, points: Array) -> Array:
        """V.T @ Phi at every position."""
        return np.asarray(np.matmul(self.V.T, self.inner(points)))


@dataclass(frozen=True, eq=False)
class RightProjectedMap:
    """The map of Phi(p) @ V, by composition."""

    inner: PositionMap
    V: Array

    def __call__(self, points: Array) -> Array:
        """Phi @ V at every position."""
        return np.asarray(np.matmul(self.inner(points), self.V))


def project_left(inner: PositionMap, V: Array) -> PositionMap:
    """The map of V.T @ Phi(p), by the map's own ``left_project`` where it offers one."""
    own = getattr(inner, "left_project", None)
    projected: PositionMap = own(V) if own is not None else LeftProjectedMap(inner, V)
    return projected


def project_right(inner: PositionMap, V: Array) -> PositionMap:
    """The map of Phi(p) @ V, by the map's own ``right_project`` where it offers one."""
    own = getattr(inner, "right_project", None)
    projected: PositionMap = own(V) if own is not None else RightProjectedMap(inner, V)
    return projected


def as_map(name: str, value: Any) -> PositionMap:
    """`value` as a map: a callable is kept, a constant 2-D array is wrapped.

    Raises
    ------
    DimensionError
        If an array is not 2-D.
    DomainError
        If an array has an entry that is not finite.
    """
    if callable(value):
        kept: PositionMap = value
        return kept
    return ConstantMap(read_only(finite_array(name, value, (None, None))))


def evaluate(name: str, inner: PositionMap, points: Array, rows: int | None, cols: int | None) -> Array:
    """Phi at all positions as (N, rows, cols), checked (None: any size).

    Raises
    ------
    DimensionError
        If the map returns another shape.
    DomainError
        If it returns NaN or infinity, or no real numbers.
    """
    try:
        values = np.asarray(inner(points), dtype=float)
    except (TypeError, ValueError) as error:
        if isinstance(error, DimensionError | DomainError):
            raise
        raise DomainError(
            f"{name} failed at {len(points)} position(s) of shape {points.shape}: {error}. "
            "A map takes positions (N, n_p) and returns real numbers (N, rows, cols)."
        ) from error
    n = len(points)
    wanted = f"({n}, {'any' if rows is None else rows}, {'any' if cols is None else cols})"
    fits = values.ndim == 3 and values.shape[0] == n
    fits = fits and (rows is None or values.shape[1] == rows) and (cols is None or values.shape[2] == cols)
    if not fits:
        raise DimensionError(
            f"{name} returned shape {values.shape} for {n} position(s), wanted {wanted}. "
            "A map takes positions (N, n_p) and returns one matrix for each."
        )
    if not np.all(np.isfinite(values)):
        bad = points[int(np.argmax(~np.all(np.isfinite(values), axis=(1, 2))))]
        raise DomainError(f"{name} is not finite at p = {bad.tolist()}, wanted finite numbers inside the box.")
    return values


def batches(n: int, numbers_per_position: int) -> Iterator[slice]:
    """Slices of 0..n that keep the temporary arrays of a batch near ``CHUNK_BYTES``."""
    size = max(1, CHUNK_BYTES // (8 * max(1, numbers_per_position)))
    for start in range(0, n, size):
        yield slice(start, min(start + size, n))
