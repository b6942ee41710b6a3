"""Mode shapes of a plate, with nodal lines and what moving sensors see of it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.patches import Rectangle

from lpvhinf.checks import Array
from lpvhinf.plotting.positions import MM, signed_map
from lpvhinf.plotting.style import BLACK


def draw_mode_shape(ax: Axes, axis: Array, shape: Array, limit: float) -> QuadMesh:
    """One mode shape as a contour map with its nodal lines.

    Parameters
    ----------
    ax : Axes
    axis : (n,)
        Coordinates along x and y in the mover frame [m].
    shape : (n, n)
        Deflection; the first index is that along x.
    limit : float
        Largest magnitude of the colour scale.

    Raises
    ------
    DimensionError, DomainError
        As `lpvhinf.plotting.positions.signed_map`.
    """
    drawn = signed_map(ax, axis, shape, limit)
    edge = MM * float(np.max(np.abs(axis)))
    ax.set_xlim(-edge, edge)
    ax.set_ylim(-edge, edge)
    return drawn


def draw_swept_areas(ax: Axes, beams: Array, box: Array) -> list[Rectangle]:
    """Areas of the mover that beams at frame points (n, 2) [m] sweep while p runs through the box (2, 2) [m].

    The beam at r meets the mover at r - p.

    Examples
    --------
    >>> from lpvhinf.plotting.style import new_figure
    >>> (area,) = draw_swept_areas(new_figure().subplots(), np.array([[0.08, 0.0]]), np.array([[-0.06, 0.06]] * 2))
    >>> [round(float(x)) for x in (*area.get_xy(), area.get_width())]
    [20, -60, 120]
    """
    size = MM * (box[:, 1] - box[:, 0])
    made = []
    for beam in beams:
        x, y = MM * (beam - box[:, 1])
        area = Rectangle((x, y), size[0], size[1], fill=False, edgecolor=BLACK, linewidth=0.7, linestyle=(0, (3, 2)))
        ax.add_patch(area)
        made.append(area)
    return made
