r"""How a point of the mover moves: the neutral plane is rigid in its plane and deflects by w out of it.

The generalised coordinates are q = (x, y, rz, Ritz coefficients of w); x, y and rz are the displacement and rotation
of the neutral plane at the reference point (c_x, c_y), which is the place of the centre of gravity. As in Kirchhoff's
theory a normal of the neutral plane stays one, so the mover point (X, Y, Z), Z from the neutral plane, moves by

.. math::

    u_x = x - (Y - c_y)\, r_z - Z\, \partial_x w, \qquad
    u_y = y + (X - c_x)\, r_z - Z\, \partial_y w, \qquad
    u_z = w(X, Y)

and turns by :math:`(\partial_y w, -\partial_x w, r_z)`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.plant.mmpa.plate import RitzPlate
from lpvhinf.plant.rigid_motion import rigid_displacements

IN_PLANE = 3  # coordinates x, y, rz before the Ritz coefficients


def displacement_rows(plate: RitzPlate, reference: ArrayLike, places: ArrayLike, heights: ArrayLike = 0.0) -> Array:
    """Rows that map q to the displacement of mover points.

    Parameters
    ----------
    plate : RitzPlate
        The plate.
    reference : (2,) or longer
        The point (c_x, c_y) whose in-plane motion is (x, y, rz), in the mover frame [m].
    places : (..., 2)
        X, Y of the points in the mover frame [m].
    heights : (...) or float
        Z of the points, from the neutral plane [m].

    Returns
    -------
    (..., 3, 3 + n_ritz)
        Rows u_x, u_y, u_z.

    Raises
    ------
    DomainError
        If a place is off the plate.

    Examples
    --------
    A point 10 mm above the plate goes towards -x as the plate tilts up towards +x:

    >>> plate = RitzPlate(side=0.3, stiffness=1.0, poisson=0.3, area_density=1.0, degree=4)
    >>> tilt = np.concatenate([np.zeros(3), plate.function(0.0, 1e-3, 0.0)])
    >>> (displacement_rows(plate, [0.0, 0.0], [0.1, 0.0], 0.01) @ tilt * 1e6).round(6).tolist()
    [-10.0, 0.0, 100.0]
    """
    at = finite_array("places", places)
    c_x, c_y = (float(c) for c in np.asarray(reference, dtype=float)[:2])
    Z = np.broadcast_to(np.asarray(heights, dtype=float), at.shape[:-1])
    out = np.zeros((*at.shape[:-1], 3, IN_PLANE + plate.n_ritz))
    out[..., 0, 0] = out[..., 1, 1] = 1.0
    out[..., 0, 2], out[..., 1, 2] = -(at[..., 1] - c_y), at[..., 0] - c_x
    out[..., 2, IN_PLANE:] = plate.rows(at)
    if np.any(Z):
        for row, direction in ((0, (1, 0)), (1, (0, 1))):
            out[..., row, IN_PLANE:] = -Z[..., None] * plate.rows(at, direction)
    return out


def rotation_rows(plate: RitzPlate, places: ArrayLike) -> Array:
    """Rows (..., 3, 3 + n_ritz) that map q to the rotations rx, ry, rz of mover points at `places` (..., 2) [m].

    Raises
    ------
    DomainError
        If a place is off the plate.
    """
    at = finite_array("places", places)
    out = np.zeros((*at.shape[:-1], 3, IN_PLANE + plate.n_ritz))
    out[..., 0, IN_PLANE:] = plate.rows(at, (0, 1))
    out[..., 1, IN_PLANE:] = -plate.rows(at, (1, 0))
    out[..., 2, 2] = 1.0
    return out


def rigid_transform(offsets: ArrayLike) -> Array:
    r"""Rigid motion (x, y, z, rx, ry, rz) of a body's centre of gravity to that of a point `offsets` away from it.

    .. math:: u = t + r \times d

    Parameters
    ----------
    offsets : (..., 3)
        d, from the centre of gravity to the point [m].

    Returns
    -------
    (..., 6, 6)

    Examples
    --------
    >>> rigid_transform([0.0, 0.0, 0.02])[0].tolist()  # a point above the centre goes along x as the body turns about y
    [1.0, 0.0, 0.0, 0.0, 0.02, 0.0]
    """
    d = finite_array("offsets", offsets)
    out = np.zeros((*d.shape[:-1], 6, 6))
    out[..., :3, :] = rigid_displacements(d)
    out[..., 3:, 3:] = np.eye(3)
    return out
