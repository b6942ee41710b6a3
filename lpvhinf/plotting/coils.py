"""Coils seen from above, coloured by a value each has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import Colormap
from matplotlib.patches import Rectangle

from lpvhinf.checks import Array, finite_array
from lpvhinf.plotting.positions import MM
from lpvhinf.plotting.style import GREY


def rectangles(centres: Array, sizes: Array, angle: float = 0.0) -> list[Rectangle]:
    """Rectangles (n, 2), (n, 2) [m] as patches in mm, each turned by `angle` [rad] about its centre."""
    made = []
    for (x, y), (width, height) in zip(MM * centres, MM * sizes, strict=True):
        patch = Rectangle((x - width / 2, y - height / 2), width, height)
        if angle:
            patch.set_angle(float(np.degrees(angle)))
            patch.rotation_point = "center"
        made.append(patch)
    return made


def draw_coils(
    ax: Axes, centres: Array, sizes: Array, values: Array, limits: Sequence[float], cmap: Colormap
) -> PatchCollection:
    """Coils as rectangles, filled by their value.

    Parameters
    ----------
    ax : Axes
    centres, sizes : (n, 2)
        Centres and outer sizes along x and y [m]; drawn in mm.
    values : (n,)
        What the colour shows.
    limits : (low, high)
        Of the colour scale.
    cmap : Colormap

    Raises
    ------
    DimensionError
        If the sizes disagree.
    DomainError
        If a number is not finite.

    Examples
    --------
    >>> from lpvhinf.plotting.positions import AMOUNT
    >>> from lpvhinf.plotting.style import new_figure
    >>> centres, sizes = np.array([[0.0, 0.0], [0.04, 0.0]]), np.full((2, 2), 0.04)
    >>> drawn = draw_coils(new_figure().subplots(), centres, sizes, np.array([0.0, 1.0]), (0.0, 1.0), AMOUNT)
    >>> len(drawn.get_paths())
    2
    """
    where = finite_array("centres", centres, (None, 2))
    n = len(where)
    drawn = PatchCollection(
        rectangles(where, finite_array("sizes", sizes, (n, 2))), cmap=cmap, edgecolor=GREY, linewidth=0.3
    )
    drawn.set_array(finite_array("values", values, (n,)))
    drawn.set_clim(limits[0], limits[1])
    ax.add_collection(drawn)
    ax.set_aspect("equal")
    ax.grid(visible=False)
    return drawn
