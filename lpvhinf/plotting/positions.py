"""Maps over a square in the plane: over the box P of positions, or over the mover."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, LinearSegmentedColormap

from lpvhinf.checks import Array, finite_array, positive
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.plotting.style import BLACK, BLUE, GREY, SKY, VERMILION

# Blue to vermilion through white, which is zero: told apart with any common colour vision, and by the line of zeros in
# grey print.
SIGNED: Colormap = LinearSegmentedColormap.from_list("signed", [BLUE, "#FFFFFF", VERMILION])
AMOUNT: Colormap = LinearSegmentedColormap.from_list("amount", ["#FFFFFF", SKY, BLUE, "#00304D"])
MM = 1e3


def signed_map(ax: Axes, axis: Array, values: Array, limit: float) -> QuadMesh:
    """A map of values of both signs: white is zero, a black line shows where the sign changes, grey ones the quarters.

    Parameters
    ----------
    ax : Axes
    axis : (n,)
        Coordinates along x and along y [m]; drawn in mm.
    values : (n, n)
        The first index is that along x.
    limit : float
        Largest magnitude of the colour scale; equal limits make maps comparable.

    Raises
    ------
    DimensionError
        If `values` is not (n, n).
    DomainError
        If `limit` is not above zero, or a number is not finite.

    Examples
    --------
    >>> from lpvhinf.plotting.style import new_figure, style
    >>> axis = np.linspace(-0.06, 0.06, 5)
    >>> with style():
    ...     drawn = signed_map(new_figure().subplots(), axis, np.outer(axis, axis), 0.004)
    >>> drawn.get_clim()
    (-0.004, 0.004)
    """
    largest = positive("limit", limit)
    x, z = _square(axis, values)
    drawn = _shaded(ax, x, z, -largest, largest, SIGNED)
    _lines(ax, x, z, largest * np.array([-0.75, -0.5, -0.25, 0.25, 0.5, 0.75]), GREY, 0.3)
    _lines(ax, x, z, [0.0], BLACK, 0.8)
    return drawn


def amount_map(
    ax: Axes, axis: Array, values: Array, low: float, high: float, *, lines: Sequence[float] = ()
) -> QuadMesh:
    """A map of values of one sign, dark where they are large.

    Parameters
    ----------
    ax, axis, values
        As of `signed_map`.
    low, high : float
        Ends of the colour scale.
    lines : sequence of float
        Values at which a line is drawn.

    Raises
    ------
    DimensionError
        If `values` is not (n, n).
    DomainError
        If `low` is not below `high`, or a number is not finite.
    """
    if not low < high:
        raise DomainError(f"low is {low}, wanted a value below high = {high}.")
    x, z = _square(axis, values)
    drawn = _shaded(ax, x, z, low, high, AMOUNT)
    _lines(ax, x, z, lines, VERMILION, 0.9)
    return drawn


def _square(axis: Array, values: Array) -> tuple[Array, Array]:
    """The axis in mm, and the checked values."""
    x = MM * finite_array("axis", axis, (None,))
    z = finite_array("values", values)
    if z.shape != (len(x), len(x)):
        raise DimensionError(
            f"values has shape {z.shape}, wanted ({len(x)}, {len(x)}), one for each pair of coordinates."
        )
    return x, z


def _shaded(ax: Axes, x: Array, z: Array, low: float, high: float, cmap: Colormap) -> QuadMesh:
    """Colours without steps; as pixels, since a PDF of many small triangles shows their seams."""
    drawn = ax.pcolormesh(x, x, z.T, shading="gouraud", cmap=cmap, vmin=low, vmax=high, rasterized=True)
    ax.set_aspect("equal")
    ax.grid(visible=False)
    return drawn


def _lines(ax: Axes, x: Array, z: Array, levels: Sequence[float] | Array, color: str, width: float) -> None:
    """Contour lines of the levels that the values reach; matplotlib warns of others."""
    reached = [level for level in levels if np.min(z) < level < np.max(z)]
    if reached:
        ax.contour(x, x, z.T, reached, colors=color, linewidths=width, linestyles="solid")
