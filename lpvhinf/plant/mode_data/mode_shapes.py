r"""Mode shapes as polynomials in the place on the mover: tensor Legendre, with slopes in closed form.

A thin body that is known on one plane only moves by Kirchhoff's kinematics: a point at the height z above the plane
z = h has the displacement

.. math::

    u = u_0 - (z - h)\, \partial_x w, \qquad v = v_0 - (z - h)\, \partial_y w, \qquad w = w(x, y)

which is a polynomial in (x, y, z) again, of degree 1 in z. So there is one representation for plates and solids.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError

EDGE = 1e-9  # how far outside the outline a point may be, relative to the mover's size: round-off only
FIBRE = 0.5  # reach of Kirchhoff's fibres above and below a plane, relative to the shorter side


def spatial(places: ArrayLike, height: float, name: str = "places") -> Array:
    """Places (..., 2) or (..., 3) as (..., 3); two numbers are x and y in the plane z = `height`."""
    at = finite_array(name, places)
    if at.ndim == 0 or at.shape[-1] not in (2, 3):
        raise DimensionError(f"{name} has shape {at.shape}, wanted (..., 2) or (..., 3): x, y and perhaps z [m].")
    if at.shape[-1] == 3:
        return at
    return np.concatenate([at, np.full((*at.shape[:-1], 1), height)], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeShapes:
    """Displacement fields of n modes on the mover.

    Attributes
    ----------
    coefficients : (nx + 1, ny + 1, nz + 1, 3, n_modes)
        Of P_i P_j P_k in coordinates scaled to [-1, 1] over `bounds`; components x, y, z.
    bounds : (3, 2)
        Smallest and largest x, y, z [m].
    outline : (n, 2)
        Corners [m] of the convex area in (x, y) inside which the shapes are known, counter-clockwise.
    height : float
        The plane that points given by x and y alone lie in [m].
    """

    coefficients: Array
    bounds: Array
    outline: Array
    height: float

    def __post_init__(self) -> None:
        coefficients = finite_array("coefficients", self.coefficients, (None, None, None, 3, None))
        object.__setattr__(self, "coefficients", read_only(coefficients))
        object.__setattr__(self, "bounds", read_only(finite_array("bounds", self.bounds, (3, 2))))
        object.__setattr__(self, "outline", read_only(finite_array("outline", self.outline, (None, 2))))

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return int(self.coefficients.shape[-1])

    @property
    def degree(self) -> tuple[int, int, int]:
        """Degree in x, y and z."""
        nx, ny, nz = (n - 1 for n in self.coefficients.shape[:3])
        return nx, ny, nz

    def at(self, places: ArrayLike) -> Array:
        """Displacements (..., 3, n_modes) at `places` (..., 2) or (..., 3) [m].

        Raises
        ------
        DomainError
            If a place is outside: polynomials must not extrapolate.
        """
        at = spatial(places, self.height)
        outside = self.excess(at)
        if np.any(outside > EDGE):
            worst = np.unravel_index(int(np.argmax(outside)), outside.shape)
            raise DomainError(f"places has the point {at[worst].tolist()} m outside the mover's {self.describe()}.")
        rows = tensor_rows(at, self.bounds, self.degree)
        flat = self.coefficients.reshape(-1, 3 * self.n_modes)
        return np.asarray((rows @ flat).reshape(*at.shape[:-1], 3, self.n_modes))

    def excess(self, places: Array) -> Array:
        """How far `places` (..., 3) lie outside, relative to the mover's longest side; at most zero inside."""
        edges = np.roll(self.outline, -1, axis=0) - self.outline
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1)[:, None]
        beyond = np.max(places[..., :2] @ normals.T - np.sum(normals * self.outline, axis=1), axis=-1)
        z, (low, high) = places[..., 2], self.bounds[2]
        side = float(np.max(np.ptp(self.bounds[:2], axis=1)))
        return np.asarray(np.maximum(np.maximum(low - z, z - high), beyond) / side)

    def describe(self) -> str:
        """The mover's extent in words, for messages."""
        (x0, x1), (y0, y1), (z0, z1) = self.bounds.tolist()
        hull = "" if len(self.outline) == 4 else f" (within the hull of {len(self.outline)} outer points)"
        return f"x {x0:.6g} to {x1:.6g}, y {y0:.6g} to {y1:.6g}{hull}, z {z0:.6g} to {z1:.6g} m"

    def modes(self, chosen: slice) -> ModeShapes:
        """Some of the modes."""
        return ModeShapes(
            coefficients=self.coefficients[..., chosen], bounds=self.bounds, outline=self.outline, height=self.height
        )


def tensor_rows(places: Array, bounds: Array, degree: tuple[int, ...]) -> Array:
    """Values of the tensor basis, (..., (nx + 1)(ny + 1)(nz + 1)), at `places` (..., 3)."""
    t = (2.0 * places - bounds.sum(axis=1)) / np.ptp(bounds, axis=1)
    x, y, z = (legendre.legvander(t[..., k], n) for k, n in enumerate(degree))
    rows = x[..., :, None, None] * y[..., None, :, None] * z[..., None, None, :]
    return np.asarray(rows.reshape(*places.shape[:-1], -1), dtype=np.float64)


def rectangle(bounds: Array) -> Array:
    """Corners of the rectangle `bounds` (2 or 3, 2), counter-clockwise."""
    (x0, x1), (y0, y1) = bounds[:2]
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def plane_shapes(coefficients: Array, bounds: Array, outline: Array, height: float) -> ModeShapes:
    """Shapes known in the plane z = `height`, with Kirchhoff's kinematics above and below it.

    Parameters
    ----------
    coefficients : (nx + 1, ny + 1, 1 or 3, n_modes)
        Of P_i P_j: w alone, or u, v, w.
    bounds : (2, 2) [m]
    outline : (n, 2) [m]
    height : float [m]
    """
    reach = FIBRE * float(np.min(np.ptp(bounds, axis=1)))
    nx, ny, n_given, n_modes = coefficients.shape
    full = np.zeros((nx, ny, 2, 3, n_modes))
    full[:, :, 0, 3 - n_given :] = coefficients
    w = coefficients[:, :, -1]
    for axis in (0, 1):
        slope = legendre.legder(w, axis=axis) * 2.0 / np.ptp(bounds[axis])
        full[: slope.shape[0], : slope.shape[1], 1, axis] = -reach * slope  # z - h is reach times P_1
    solid = np.vstack([bounds, [height - reach, height + reach]])
    return ModeShapes(coefficients=full, bounds=solid, outline=outline, height=height)


def power_shapes(polynomials: Array, area: Array) -> ModeShapes:
    """Shapes from power series in x and y [m] over the rectangle `area` (2, 2), in the plane z = 0.

    Parameters
    ----------
    polynomials : (nx + 1, ny + 1, 1 or 3, n_modes)
        Of x^i y^j: w alone, or u, v, w.

    Examples
    --------
    Torsion w = 40 x y on a plate of 0.2 m; a point 0.01 m above the plane moves by -0.01 times the slope:

    >>> torsion = np.zeros((2, 2, 1, 1))
    >>> torsion[1, 1] = 40.0
    >>> shapes = power_shapes(torsion, np.array([[-0.1, 0.1], [-0.1, 0.1]]))
    >>> shapes.at([0.05, 0.1, 0.01])[:, 0].round(9).tolist()
    [-0.04, -0.02, 0.2]
    """
    coefficients = polynomials
    for axis in (0, 1):
        n = coefficients.shape[axis]
        shift = Polynomial([float(area[axis].mean()), 0.5 * float(np.ptp(area[axis]))])
        T = np.zeros((n, n))
        for i in range(n):
            T[: i + 1, i] = legendre.poly2leg((shift**i).coef)
        coefficients = np.moveaxis(np.tensordot(T, coefficients, axes=(1, axis)), 0, axis)
    return plane_shapes(coefficients, area, rectangle(area), 0.0)
