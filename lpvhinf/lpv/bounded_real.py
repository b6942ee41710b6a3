r"""The bounded-real inequality at a given Lyapunov matrix: what level it proves, recomputed without any solver.

.. math::

    \begin{bmatrix} A^\top X + X A + \dot X & X B & C^\top \\ B^\top X & -\gamma I & D^\top \\ C & D & -\gamma I
    \end{bmatrix} \prec 0, \quad X \succ 0

With :math:`Q = -(A^\top X + X A + \dot X) \succ 0` it holds exactly for gamma above

.. math:: \lambda_{\max}\left( \begin{bmatrix} 0 & D^\top \\ D & 0 \end{bmatrix}
    + \begin{bmatrix} B^\top X \\ C \end{bmatrix} Q^{-1} \begin{bmatrix} X B & C^\top \end{bmatrix} \right).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from lpvhinf.checks import Array

FloatArray = NDArray[np.floating[Any]]

#: Share added to a level for the round-off of its computation.
ROUND_OFF = 1e-9


def proven_level(A: Array, B: Array, C: Array, D: Array, X: Array, X_dot: Array) -> float:
    """The smallest gamma at which the inequality holds with X; infinity if X or Q is not positive definite.

    The inequality is first brought to coordinates in which X = I, as X may be badly scaled.
    """
    n, n_w, n_z = A.shape[0], B.shape[1], C.shape[0]
    corner = np.block([[np.zeros((n_w, n_w)), D.T], [D, np.zeros((n_z, n_z))]])
    if n == 0:
        return _largest(corner)
    try:
        L = np.linalg.cholesky(0.5 * (X + X.T))
    except np.linalg.LinAlgError:
        return np.inf
    a, b, c = _in_unit_coordinates(A, B, C, L)
    half = scipy.linalg.solve_triangular(L, X_dot, lower=True)
    slope = scipy.linalg.solve_triangular(L, half.T, lower=True)
    Q = -(a + a.T + 0.5 * (slope + slope.T))
    values, vectors = np.linalg.eigh(Q)
    # below round-off of its computation an eigenvalue proves nothing
    if values[0] <= 8.0 * np.finfo(float).eps * n * (float(np.linalg.norm(a, 2)) + float(np.linalg.norm(slope, 2))):
        return np.inf
    G = (np.vstack([b.T, c]) @ vectors) / np.sqrt(values)
    return _largest(corner + G @ G.T) * (1.0 + ROUND_OFF)


def smallest_margin(A: Array, B: Array, C: Array, D: Array, X: Array, X_dot: Array, gamma: float) -> float:
    """Smallest eigenvalue of the negative of the inequality, in coordinates with X = I and scaled to a unit diagonal.

    Positive where the inequality holds; -infinity if X is not positive definite or gamma is not finite.
    """
    n_w, n_z = B.shape[1], C.shape[0]
    if not np.isfinite(gamma):
        return -np.inf
    try:
        L = np.linalg.cholesky(0.5 * (X + X.T))
    except np.linalg.LinAlgError:
        return -np.inf
    a, b, c = _in_unit_coordinates(A, B, C, L)
    half = scipy.linalg.solve_triangular(L, X_dot, lower=True)
    slope = scipy.linalg.solve_triangular(L, half.T, lower=True)
    Q = -(a + a.T + 0.5 * (slope + slope.T))
    Z = np.block([[Q, -b, -c.T], [-b.T, gamma * np.eye(n_w), -D.T], [-c, -D, gamma * np.eye(n_z)]])
    size = np.sqrt(np.abs(np.diag(Z)))
    size[size == 0.0] = 1.0
    return float(np.linalg.eigvalsh(Z / size[:, None] / size)[0])


def _in_unit_coordinates(A: Array, B: Array, C: Array, L: FloatArray) -> tuple[Array, Array, Array]:
    """L' A L^-T, L' B, C L^-T for X = L L'."""
    a = scipy.linalg.solve_triangular(L, (L.T @ A).T, lower=True).T
    c = scipy.linalg.solve_triangular(L, C.T, lower=True).T
    return np.asarray(a), np.asarray(L.T @ B), np.asarray(c)


def _largest(matrix: Array) -> float:
    return float(np.linalg.eigvalsh(matrix)[-1]) if matrix.size else 0.0


def frozen_norm(A: Array, B: Array, C: Array, D: Array) -> float:
    """H-infinity norm by level sets of the Hamiltonian matrix; infinity if A is not Hurwitz.

    References
    ----------
    Bruinsma and Steinbuch (1990), Systems & Control Letters 14, 287-293.
    """
    n = A.shape[0]
    floor = float(np.linalg.norm(D, 2)) if D.size else 0.0
    if n == 0 or not (B.size and C.size):
        return floor
    A, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    B, C = B / scale[:, None], C * scale
    poles = np.linalg.eigvals(A)
    if np.max(poles.real) >= 0.0:
        return np.inf
    moduli = np.abs(poles)
    level = max(gains(A, B, C, D, np.concatenate([[0.0], moduli, np.abs(poles.imag)])).max(), floor)
    for _ in range(40):
        trial = level * (1.0 + 1e-9) + 1e-300
        R = trial * np.eye(D.shape[1]) - D.T @ D / trial
        RD, RB = np.linalg.solve(R, D.T) / trial, np.linalg.solve(R, B.T)
        F = A + B @ RD @ C
        H = np.block([[F, B @ RB], [-C.T @ (C + D @ RD @ C) / trial, -F.T]])
        found = np.linalg.eigvals(H)
        near = np.abs(found.real) <= 1e-5 * np.abs(found) + 1e-11 * np.max(np.abs(found))
        edges = np.concatenate([[0.0], np.unique(np.abs(found[near].imag))])
        if edges.size == 1:
            break
        better = float(gains(A, B, C, D, np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])])).max())
        if better <= trial:
            break
        level = better
    return float(level)


def gains(A: Array, B: Array, C: Array, D: Array, omega: Array) -> Array:
    """Largest singular values of the response at frequencies (N,)."""
    shifted = 1j * omega[:, None, None] * np.eye(len(A)) - A
    response = C @ np.linalg.solve(shifted, np.broadcast_to(B.astype(complex), (len(omega), *B.shape))) + D
    return np.asarray(np.linalg.norm(response, 2, axis=(1, 2)))
