r"""Proofs that symmetric matrices are positive definite, in plain double precision.

If Cholesky's algorithm runs to completion on :math:`fl(M - sI)` with s above its largest possible backward error,
M is positive definite (Rump, BIT 46, 2006).
"""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array

U = 2.0**-53
TINY = 2.0**-1074


def gamma(k: int) -> float:
    """K u / (1 - k u), rounded up."""
    return k * U / (1.0 - k * U) * (1.0 + 4.0 * U)


def dominating_diagonal(F: Array, rounds: int = 4) -> Array:
    """F with diag(f) - E >= 0 for every symmetric E, abs(E) <= F entry by entry: f = F w / w for any w > 0.

    w approaches the Perron vector of F, for which f is smallest; any w gives a valid f.
    """
    n = F.shape[-1]
    w = np.ones(n)
    for _ in range(rounds):
        w = F @ w
        w = np.maximum(w, 1e-4 * (np.max(w) + 1e-300))
        w = w / np.max(w)
    return np.asarray((F @ w) / w * (1.0 + 4.0 * (n + 8) * U) + n * TINY)


def needed_shift(M: Array, spare: float = 0.0) -> Array:
    """What has to be subtracted from the diagonals of M (..., n, n) so that Cholesky proves lambda_min > spare."""
    n = M.shape[-1]
    size = np.abs(np.diagonal(M, axis1=-2, axis2=-1))
    trace = np.sum(size, axis=-1)
    round_off = 4.0 * gamma(n + 2) * trace + 4.0 * U * (np.max(size, axis=-1) + spare)
    return np.asarray((round_off + 4.0 * n * (2.0 * n + trace) * TINY) * (1.0 + 64.0 * U) + spare)


def positive_definite(M: Array, spare: float = 0.0) -> bool:
    """Whether every M (..., n, n) is proved to have all eigenvalues above `spare` >= 0.

    The matrices must be exactly symmetric; only their lower triangles are read. False means "not proved".

    Examples
    --------
    >>> positive_definite(np.array([[2.0, 1.0], [1.0, 2.0]])), positive_definite(np.ones((2, 2)))
    (True, False)
    """
    if not np.all(np.isfinite(M)):
        return False
    shifted = np.array(M, dtype=float)
    i = np.arange(M.shape[-1])
    shifted[..., i, i] -= needed_shift(M, spare)[..., None]
    if not np.all(shifted[..., i, i] > 0.0):
        return False
    try:
        factor = np.linalg.cholesky(shifted)
    except np.linalg.LinAlgError:
        return False
    return bool(np.all(np.isfinite(factor)))
