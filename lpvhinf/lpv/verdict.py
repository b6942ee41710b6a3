"""What may be said of a point and of multipliers: everything is recomputed from the problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.cone import inner
from lpvhinf.lpv.lmi import LMIProblem
from lpvhinf.lpv.operator import LMIOperator

#: Units of round-off by which a smallest eigenvalue must be above zero to count as such.
UNITS = 8.0
EPS = float(np.finfo(float).eps)


def rounding(problem: LMIProblem, unknowns: Mapping[str, Array], gamma: float) -> list[Array]:
    """Estimate of the error of each smallest eigenvalue, (m,) a block, from the size of what is added up."""
    out = []
    for block in problem.blocks:
        size = np.abs(block.F0).max(axis=(1, 2))
        if block.Fg is not None:
            size = size + abs(gamma) * np.abs(block.Fg).max(axis=(1, 2))
        for term in block.terms:
            assert term.value is not None and term.inner is not None
            norms = np.linalg.norm(unknowns[term.unknown], axis=(1, 2))
            V = np.linalg.norm(term.V, axis=2).max(axis=1)
            size = size + V**2 * (np.abs(term.inner) @ norms)
            if term.U is not None:
                size = size + 2.0 * V * np.linalg.norm(term.U, axis=2).max(axis=1) * (np.abs(term.value) @ norms)
        out.append(UNITS * EPS * size)
    return out


def holds(operator: LMIOperator, y: Array) -> bool:
    """All inequalities hold at y beyond round-off."""
    unknowns, gamma = operator.matrices(y), float(y[-1])
    return all(
        bool(np.all(np.linalg.eigvalsh(Z)[:, 0] > error))
        for Z, error in zip(operator.value(y), rounding(operator.problem, unknowns, gamma))
    )


def lower_bound(operator: LMIOperator, X: Sequence[Array]) -> float:
    r"""A lower bound on gamma from multipliers X >= 0; -infinity if they show none.

    From :math:`0 \le \sum \langle X, Z \rangle = \langle F_0, X \rangle + \gamma \langle F_g, X \rangle
    + \sum_i \langle G_i, Y_i \rangle`, where the residuals :math:`G_i` cost at most their nuclear norm times the bound
    on :math:`Y_i`.
    """
    constant, weight, _ = multiplier_sums(operator, X)
    return -constant / weight if weight > 0.0 else -np.inf


def multiplier_sums(operator: LMIOperator, X: Sequence[Array]) -> tuple[float, float, float]:
    """<F0, X> with residuals charged, <Fg, X>, and the largest nuclear norm of a residual."""
    gradients, weight = operator.adjoint_matrices(X)
    constant, largest = inner([block.F0 for block in operator.problem.blocks], X), 0.0
    for u in operator.problem.unknowns:
        nuclear = np.abs(np.linalg.eigvalsh(gradients[u.name])).sum(axis=1)
        if np.any(nuclear > 0.0):
            constant += float(nuclear.sum()) * u.bound
            largest = max(largest, float(nuclear.max()))
    return constant, weight, largest


def blended(operator: LMIOperator, inside: Array, outer: Array, steps: int = 12) -> Array:
    """The point nearest to `outer` on the line from `inside`, which holds, that is found to hold."""
    low, high = 0.0, 1.0
    for _ in range(steps):
        share = 0.5 * (low + high)
        if holds(operator, inside + share * (outer - inside)):
            low = share
        else:
            high = share
    return np.asarray(inside + low * (outer - inside))
