r"""Rigid-body motion of a body's points, about its centre of gravity."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array

AXES = ("x", "y", "z", "rx", "ry", "rz")


def rigid_displacements(offsets: Array) -> Array:
    r"""Displacements of points for unit rigid-body motions.

    .. math:: u(d) = t + \theta \times d

    Parameters
    ----------
    offsets : (..., 3)
        d, from the centre of gravity to the points [m].

    Returns
    -------
    (..., 3, 6)
        Columns x, y, z [m per m], rx, ry, rz [m per rad].

    Examples
    --------
    >>> rigid_displacements(np.array([0.0, 0.2, 0.0]))[2].tolist()
    [0.0, 0.0, 1.0, 0.2, 0.0, 0.0]
    """
    x, y, z = np.moveaxis(offsets, -1, 0)
    out = np.zeros((*offsets.shape, 6))
    out[..., [0, 1, 2], [0, 1, 2]] = 1.0
    out[..., 1, 3], out[..., 2, 3] = -z, y
    out[..., 0, 4], out[..., 2, 4] = z, -x
    out[..., 0, 5], out[..., 1, 5] = -y, x
    return out
