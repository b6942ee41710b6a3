"""Sizes of mode shapes as they are given, at nodes or as power series."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import DimensionError, DomainError


def nodal_shapes(points: ArrayLike, shapes: ArrayLike, n_modes: int) -> tuple[Array, Array]:
    """Nodes (n, 2 or 3) and shapes (n, n_modes) or (n, 3, n_modes).

    Raises
    ------
    DimensionError
        If a shape is another one.
    DomainError
        If an entry is not finite.
    """
    at = finite_array("points", points)
    if at.ndim != 2 or at.shape[1] not in (2, 3) or len(at) == 0:
        raise DimensionError(f"points has shape {at.shape}, wanted (n_nodes, 2) or (n_nodes, 3): x, y, z [m].")
    n = len(at)
    values = finite_array("shapes", shapes)
    if values.shape not in ((n, n_modes), (n, 3, n_modes)):
        turned = "Transpose it: one row a node, one column a mode."
        counted = "Give a row for every point and a column for every frequency, rigid-body modes included."
        raise DimensionError(
            f"shapes has shape {values.shape}, wanted ({n}, {n_modes}) for w or ({n}, 3, {n_modes}) for u, v, w: "
            f"{n} points, {n_modes} frequencies. {turned if values.shape == (n_modes, n) else counted}"
        )
    return at, values


def power_series(polynomials: ArrayLike, area: ArrayLike, n_modes: int) -> tuple[Array, Array]:
    """Coefficients (nx + 1, ny + 1, n_modes) or (nx + 1, ny + 1, 3, n_modes) and area (2, 2).

    Raises
    ------
    DimensionError
        If a shape is another one.
    DomainError
        If an entry is not finite or the area is empty.
    """
    sides = finite_array("area", area, (2, 2))
    if np.any(sides[:, 0] >= sides[:, 1]):
        raise DomainError(f"area is {sides.tolist()}, wanted rows (lowest, highest) of x and y [m].")
    given = finite_array("polynomials", polynomials)
    fits = given.ndim in (3, 4) and given.shape[-1] == n_modes and (given.ndim == 3 or given.shape[2] == 3)
    if not fits or 0 in given.shape:
        raise DimensionError(
            f"polynomials has shape {given.shape}, wanted (nx + 1, ny + 1, {n_modes}) for w or "
            f"(nx + 1, ny + 1, 3, {n_modes}) for u, v, w: {n_modes} frequencies. The last axis counts the modes."
        )
    return sides, given


def non_negative(name: str, value: ArrayLike, n: int, unit: str, *, zero: bool) -> Array:
    """`value` as (n,) with entries above zero, or at least zero.

    Raises
    ------
    DimensionError
        If there are not n entries.
    DomainError
        If an entry is below its bound.
    """
    array = finite_array(name, value, (n,))
    if np.any(array < 0.0) or (not zero and np.any(array == 0.0)):
        wanted = "of at least 0" if zero else "above 0"
        raise DomainError(f"{name} has the entry {array.min():.6g}, wanted entries {wanted} {unit}.")
    return array
