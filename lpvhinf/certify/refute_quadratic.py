r"""Proof that no common Lyapunov matrix exists: positions p_k and :math:`Z_k = F_k F_k' \ge 0`, not all zero, with

.. math:: Y = \sum_k (A(p_k) Z_k + Z_k A(p_k)') + 2 \alpha \sum_k Z_k > 0.

P > 0 with :math:`A_k'P + PA_k + 2 \alpha P < 0` for all k would give
:math:`0 > \sum_k \mathrm{tr}(Z_k (A_k'P + PA_k + 2 \alpha P)) = \mathrm{tr}(P Y) > 0`.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lpvhinf.certify.cells import Point
from lpvhinf.certify.loop import LoopMatrix
from lpvhinf.certify.positive_definite import TINY, dominating_diagonal, gamma, positive_definite
from lpvhinf.certify.system import CanonicalSystem
from lpvhinf.checks import Array

SMALL = 1e-7  # eigenvalues of Z_k below this share of the largest are left out


@dataclass(frozen=True, eq=False, kw_only=True)
class Multipliers:
    """Positions and multipliers that exclude every common Lyapunov matrix.

    Attributes
    ----------
    positions : (N, n_p) rounded
    exact_positions : as rationals
    factors : N arrays (n, r_k), Z_k = F_k F_k'
    """

    positions: Array
    exact_positions: list[tuple[Fraction, ...]]
    factors: list[Array]


def excluded(
    system: CanonicalSystem, box: Array, points: list[Point], multipliers: Array, decay: float
) -> Multipliers | None:
    """The multipliers, if the inequality is proved for them at the points, round-off included."""
    loop = LoopMatrix(system, box, decay=decay)
    n = loop.n_x
    total, missed = np.zeros((n, n)), np.zeros((n, n))
    used: list[tuple[Point, Array]] = []
    largest = max(float(np.trace(Z)) for Z in multipliers)
    scale = np.sqrt(np.maximum(np.diag(multipliers.sum(axis=0)), 1e-300))
    for point, Z in zip(points, multipliers):
        values, vectors = np.linalg.eigh(Z / scale[:, None] / scale)
        keep = values > SMALL * max(float(values[-1]), 1e-300)
        if float(np.trace(Z)) <= 1e-12 * largest or not np.any(keep):
            continue
        F = scale[:, None] * vectors[:, keep] * np.sqrt(values[keep])
        used.append((point, F))
    for point, F in used:
        local = loop.local(point, 1)
        A = local.terms[0]
        half = (A @ F) @ F.T
        total += half + half.T
        size = np.abs(F) @ np.abs(F).T
        wrong = (local.remainder + gamma(2 * n + 8 + 2 * len(used)) * np.abs(A)) @ size
        missed += wrong + wrong.T
    missed = missed * (1.0 + 1e-10) + gamma(len(used) + 8) * np.abs(total) + n * TINY
    if not used:
        return None
    # any congruence serves; the diagonal one keeps the numbers of one size
    d = 2.0 ** -np.round(np.log2(np.sqrt(np.maximum(np.abs(np.diag(total)), 1e-300))))
    Y = 0.5 * (total + total.T) * d[:, None] * d
    Y[np.arange(n), np.arange(n)] -= dominating_diagonal(missed * d[:, None] * d)
    if not positive_definite(Y):
        return None
    return Multipliers(
        positions=np.array([point.rounded(box) for point, _ in used]),
        exact_positions=[point.position(box) for point, _ in used],
        factors=[F for _, F in used],
    )
