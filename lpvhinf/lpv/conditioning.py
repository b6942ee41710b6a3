r"""Coordinates in which the synthesis inequalities are well scaled: time, states, controls and measurements.

With :math:`x = T \hat x`, :math:`t = \hat t / \omega`, :math:`u = E_u \hat u`, :math:`\hat y = E_y y` the plant reads

.. math:: \hat A = T^{-1} A T/\omega, \quad \hat B_1 = T^{-1} B_1/\sqrt\omega, \quad
    \hat B_2 = T^{-1} B_2 E_u/\sqrt\omega, \quad \hat C_1 = C_1 T/\sqrt\omega, \quad \hat C_2 = E_y C_2 T/\sqrt\omega

and D11 stays, so gamma stays. Original matrices are :math:`R = T \hat R T^\top` and
:math:`S = T^{-\top} \hat S T^{-1}`; rates are divided by :math:`\omega`. T is diagonal, of powers of two, and common
to all points; E_u and E_y make the columns of D12 and the rows of D21 orthonormal, point by point, which changes
neither R nor S.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Sweeps of the balancing; it converges in a handful.
SWEEPS = 30
#: Singular values of D12 and D21 below this share of the largest count as zero.
RANK = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledPlants:
    """Plants in scaled coordinates, and the way back.

    Attributes
    ----------
    plants : tuple of GeneralizedPlant
        Scaled; D12'D12 = I and D21 D21' = I.
    omega : float
        Unit of frequency [rad/s].
    T : (n_x,)
        Diagonal of T: x = T x_hat.
    E_u : (N, n_u, n_u)
        u = E_u u_hat.
    E_y : (N, n_y, n_y)
        y_hat = E_y y.
    """

    plants: tuple[GeneralizedPlant, ...]
    omega: float
    T: Array
    E_u: Array
    E_y: Array

    def original_R(self, R: Array) -> Array:
        """R in the plant's own coordinates, (..., n_x, n_x)."""
        return np.asarray(self.T[:, None] * R * self.T)

    def original_S(self, S: Array) -> Array:
        """S in the plant's own coordinates, (..., n_x, n_x)."""
        return np.asarray(S / self.T[:, None] / self.T)

    def scaled_R(self, R: Array) -> Array:
        """R in scaled coordinates, (..., n_x, n_x)."""
        return np.asarray(R / self.T[:, None] / self.T)

    def scaled_S(self, S: Array) -> Array:
        """S in scaled coordinates, (..., n_x, n_x)."""
        return np.asarray(self.T[:, None] * S * self.T)


def scaled_plants(plants: Sequence[GeneralizedPlant]) -> ScaledPlants:
    """Scale time, states, controls and measurements of plants at several points.

    Raises
    ------
    DimensionError
        If no plant is given, or their sizes differ.
    AssumptionError
        If D22 is not zero, or D12 (D21) has not full column (row) rank; the message names the plant.
    """
    if not plants:
        raise DimensionError("plants is empty, wanted one plant for each point.")
    sizes = {(P.n_x, P.n_w, P.n_u, P.n_z, P.n_y) for P in plants}
    if len(sizes) > 1:
        raise DimensionError(f"plants have different sizes (n_x, n_w, n_u, n_z, n_y) {sorted(sizes)}, wanted one.")
    E_u = np.stack([_normaliser(P.D12, "D12", "column", i) for i, P in enumerate(plants)])
    E_y = np.stack([_normaliser(P.D21.T, "D21", "row", i).T for i, P in enumerate(plants)])
    for i, P in enumerate(plants):
        if np.any(P.D22 != 0.0):
            raise AssumptionError(
                f"D22 of plant {i} is not zero (largest entry {np.abs(P.D22).max():.3g}), wanted zero. Design for "
                "D22 = 0 and close the loop D22 around the controller afterwards, or add a fast filter at u or y."
            )
    A = np.stack([P.A for P in plants])
    B = np.stack([np.hstack([P.B1, P.B2 @ E]) for P, E in zip(plants, E_u)])
    C = np.stack([np.vstack([P.C1, E @ P.C2]) for P, E in zip(plants, E_y)])
    omega = time_unit(A)
    A, B, C = A / omega, B / np.sqrt(omega), C / np.sqrt(omega)
    T = balancing(A, B, C)
    A, B, C = A * T / T[:, None], B / T[:, None], C * T
    n_w, n_z = plants[0].n_w, plants[0].n_z
    scaled = tuple(
        GeneralizedPlant(a, b[:, :n_w], b[:, n_w:], c[:n_z], c[n_z:], P.D11, P.D12 @ eu, ey @ P.D21)
        for a, b, c, P, eu, ey in zip(A, B, C, plants, E_u, E_y)
    )
    return ScaledPlants(plants=scaled, omega=omega, T=read_only(T), E_u=read_only(E_u), E_y=read_only(E_y))


def time_unit(A: Array) -> float:
    """Geometric mean of the moduli of the eigenvalues of A (N, n, n) [rad/s], a power of two; integrators left out."""
    moduli = np.abs(np.linalg.eigvals(A)).ravel()
    moduli = moduli[moduli > 1e-8 * max(float(moduli.max(initial=0.0)), 1e-300)]
    return float(2.0 ** np.round(np.mean(np.log2(moduli)))) if moduli.size else 1.0


def balancing(A: Array, B: Array, C: Array) -> Array:
    """Diagonal T, of powers of two, that makes rows and columns of [A B; C 0] equally large over all points."""
    n = A.shape[1]
    a = np.sum(A**2, axis=0) * (1.0 - np.eye(n))
    b, c = np.sum(B**2, axis=(0, 2)), np.sum(C**2, axis=(0, 1))
    log_T = np.zeros(n)
    for _ in range(SWEEPS):
        change = 0.0
        for i in range(n):
            t = 4.0**log_T  # squares of T
            row = (a[i] @ t + b[i]) / t[i]
            column = (a[:, i] @ (1.0 / t) + c[i]) * t[i]
            if row > 0.0 and column > 0.0:
                step = float(np.round(0.25 * np.log2(row / column)))
                log_T[i] += step
                change = max(change, abs(step))
        if change == 0.0:
            break
    return np.asarray(2.0**log_T)


def _normaliser(D: Array, name: str, what: str, plant: int) -> Array:
    """E such that D E has orthonormal columns: the triangular factor is inverted, so E varies as smoothly as D."""
    sizes = np.linalg.svd(D, compute_uv=False)
    if D.shape[0] < D.shape[1] or sizes[-1] <= RANK * sizes[0] or sizes[0] == 0.0:
        raise AssumptionError(
            f"{name} of plant {plant} has singular values {np.array2string(sizes, precision=3)}, wanted full {what} "
            f"rank {D.shape[1]}. Give every {'control a weight in z' if name == 'D12' else 'measurement noise in w'}, "
            "however small, for example 1e-3 of its typical size."
        )
    return np.asarray(np.linalg.inv(np.linalg.cholesky(D.T @ D)).T)
