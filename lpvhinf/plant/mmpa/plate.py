r"""A free plate with lumped masses, by the Ritz method with Legendre polynomials.

The displacement of the neutral plane is :math:`w(x, y) = \sum_{ij} c_{ij} P_i(2x/a) P_j(2y/a)`, so that mode shapes,
slopes and all derivatives are polynomials in closed form. Free edges are natural boundary conditions; the rigid
motions 1, x, y lie in the space exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.errors import DimensionError, DomainError


def legendre_table(t: Array, degree: int, derivative: int = 0) -> Array:
    """Legendre polynomials P_0..P_degree (or a derivative of them) at `t`, as (*t.shape, degree + 1)."""
    values = np.asarray(legendre.legvander(t, degree), dtype=np.float64)
    if derivative == 0:
        return values
    # the columns of D are the Legendre coefficients of the derivatives of P_0..P_degree
    D = np.zeros((degree + 1, degree + 1))
    below = legendre.legder(np.eye(degree + 1), derivative)
    D[: below.shape[0]] = below
    return np.asarray(values @ D, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class RitzPlate:
    r"""Mass and stiffness matrix of a free square Kirchhoff plate with lumped masses.

    .. math::

        K(v, w) &= D \int (1 - \nu)\, \nabla^2 v : \nabla^2 w + \nu\, \Delta v\, \Delta w \\
        M(v, w) &= \int \rho h\, v w + \rho_2 \nabla v \cdot \nabla w
                 + \sum_k m_k\, [\, v w + z_k^2\, \nabla v \cdot \nabla w\,](r_k)

    A mass at the height z above the neutral plane moves by :math:`-z \nabla w` sideways as the plate tilts, which is
    the second part of M.

    Parameters
    ----------
    side : float
        Side a [m]; the plate is [-a/2, a/2] squared.
    stiffness : float
        Bending stiffness D [N m].
    poisson : float
        Poisson's ratio [-].
    area_density : float
        Mass per area, rho h [kg/m2].
    degree : int
        Degree of the polynomials in x and in y.
    masses, places : (n,), (n, 2)
        Lumped masses [kg] and where they sit [m]; they add mass, no stiffness.
    heights : (n,), optional
        Heights of the lumped masses above the neutral plane [m]; zero if left out.
    rotary_density : float
        Second moment of the plate's own mass over its thickness, per area, rho_2 = rho h^3 / 12 [kg]; zero leaves the
        rotary inertia out, as Kirchhoff's theory does.

    Raises
    ------
    DomainError
        If a number is not positive or not finite, a mass is negative, or a place is off the plate.
    DimensionError
        If `places` is not (n, 2), or `heights` not (n,).

    Examples
    --------
    The lowest eigenfrequency of a free square plate, nu = 0.3, lambda = omega a^2 sqrt(rho h / D):

    >>> import scipy.linalg
    >>> plate = RitzPlate(side=1.0, stiffness=1.0, poisson=0.3, area_density=1.0, degree=14)
    >>> round(float(np.sqrt(scipy.linalg.eigh(plate.K, plate.M, eigvals_only=True)[3])), 4)
    13.4682
    """

    side: float
    stiffness: float
    poisson: float
    area_density: float
    degree: int
    masses: Array = field(default_factory=lambda: np.zeros(0))
    places: Array = field(default_factory=lambda: np.zeros((0, 2)))
    heights: Array | None = None
    rotary_density: float = 0.0
    M: Array = field(init=False, repr=False)
    K: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        positive("side", self.side, "m")
        positive("stiffness", self.stiffness, "N m")
        positive("area_density", self.area_density, "kg/m2")
        if not 0.0 <= self.poisson < 0.5:
            raise DomainError(f"poisson is {self.poisson}, wanted a value from 0 to below 0.5.")
        if int(self.degree) != self.degree or self.degree < 2:
            raise DomainError(f"degree is {self.degree}, wanted a whole number of at least 2.")
        masses = finite_array("masses", self.masses, (None,))
        places = finite_array("places", self.places)
        if places.shape != (len(masses), 2):
            raise DimensionError(f"places has shape {places.shape}, wanted ({len(masses)}, 2), one row for each mass.")
        if np.any(masses < 0.0):
            raise DomainError(f"masses has the entry {masses.min()} kg, wanted masses of at least 0.")
        if np.any(np.abs(places) > self.side / 2 * (1 + 1e-12)):
            raise DomainError(f"places reach {np.abs(places).max()} m, wanted at most side / 2 = {self.side / 2} m.")
        object.__setattr__(self, "masses", read_only(masses))
        heights = np.zeros(len(masses)) if self.heights is None else finite_array("heights", self.heights, masses.shape)
        if not 0.0 <= self.rotary_density < np.inf:
            raise DomainError(f"rotary_density is {self.rotary_density} kg, wanted a finite number of at least 0.")
        object.__setattr__(self, "places", read_only(places))
        object.__setattr__(self, "heights", read_only(heights))
        n, h = self.degree + 1, self.side / 2
        t, weights = legendre.leggauss(n + 1)  # exact for products of the polynomials
        tables = [legendre_table(t, self.degree, k) / h**k for k in range(3)]

        def integral(j: int, k: int) -> Array:
            return np.asarray(h * (tables[j].T * weights) @ tables[k])

        I00, I11, I22, I02 = integral(0, 0), integral(1, 1), integral(2, 2), integral(0, 2)
        K = np.kron(I22, I00) + np.kron(I00, I22)
        K += self.poisson * (np.kron(I02, I02.T) + np.kron(I02.T, I02))
        K += 2.0 * (1.0 - self.poisson) * np.kron(I11, I11)
        rows = self.rows(places)
        M = self.area_density * np.kron(I00, I00) + rows.T @ (masses[:, None] * rows)
        M += self.rotary_density * (np.kron(I11, I00) + np.kron(I00, I11))
        if np.any(heights):
            for direction in ((1, 0), (0, 1)):
                slopes = self.rows(places, direction)
                M += slopes.T @ ((masses * heights**2)[:, None] * slopes)
        K *= self.stiffness
        object.__setattr__(self, "M", read_only(0.5 * (M + M.T)))
        object.__setattr__(self, "K", read_only(0.5 * (K + K.T)))

    @property
    def n_ritz(self) -> int:
        """Number of Ritz coefficients, (degree + 1) squared; coefficient i (degree + 1) + j belongs to P_i P_j."""
        return (self.degree + 1) ** 2

    def rows(self, places: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Array:
        """Rows (..., n_ritz) that map Ritz coefficients to w, or to a derivative of it, at `places` (..., 2) [m].

        Raises
        ------
        DomainError
            If a place is off the plate by more than round-off: polynomials must not extrapolate.
        """
        at = finite_array("places", places)
        if at.ndim == 0 or at.shape[-1] != 2:
            raise DimensionError(f"places has shape {at.shape}, wanted (..., 2).")
        h = self.side / 2
        if np.any(np.abs(at) > h * (1 + 1e-9)):
            raise DomainError(f"places reach {np.abs(at).max():.6g} m, off the plate of half side {h:.6g} m.")
        x = legendre_table(at[..., 0] / h, self.degree, derivative[0]) / h ** derivative[0]
        y = legendre_table(at[..., 1] / h, self.degree, derivative[1]) / h ** derivative[1]
        return np.asarray((x[..., :, None] * y[..., None, :]).reshape(*at.shape[:-1], self.n_ritz))

    def function(self, constant: float, slope_x: float, slope_y: float) -> Array:
        """Ritz coefficients (n_ritz,) of the rigid motion constant + slope_x x + slope_y y."""
        n, h = self.degree + 1, self.side / 2
        c = np.zeros(self.n_ritz)
        c[0], c[n], c[1] = constant, slope_x * h, slope_y * h
        return c
