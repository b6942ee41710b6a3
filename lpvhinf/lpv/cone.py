"""Stacks of positive definite matrices: factors, inverses and the step to the boundary of the cone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.schur import symmetric


def inverse_factors(M: Sequence[Array]) -> list[Array] | None:
    """L^-1 with M = L L' for each stack (m, s, s); None if a matrix is not positive definite."""
    try:
        factors = [np.linalg.cholesky(m) for m in M]
        inverses = [np.linalg.inv(L) for L in factors]
    except np.linalg.LinAlgError:
        return None
    return inverses if all(np.all(np.isfinite(L)) for L in inverses) else None


def inverses(factors: Sequence[Array]) -> list[Array]:
    """M^-1 from the inverse factors."""
    return [L.swapaxes(1, 2) @ L for L in factors]


def longest_step(factors: Sequence[Array], directions: Sequence[Array]) -> float:
    """Largest t with M + t D >= 0 for every matrix, from the inverse factors of M; infinity if there is none."""
    least = min(
        float(np.linalg.eigvalsh(symmetric(L @ D @ L.swapaxes(1, 2)))[:, 0].min(initial=0.0))
        for L, D in zip(factors, directions)
    )
    return -1.0 / least if least < 0.0 else np.inf


def inner(A: Sequence[Array], B: Sequence[Array]) -> float:
    """Sum of the inner products."""
    return sum(float(np.vdot(a, b)) for a, b in zip(A, B))


def moved(M: Sequence[Array], t: float, D: Sequence[Array]) -> list[Array]:
    """M + t D, symmetric to the last digit."""
    return [symmetric(m + t * d) for m, d in zip(M, D)]
