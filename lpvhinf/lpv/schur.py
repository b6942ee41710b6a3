r"""The Schur complement of an LMI problem from its Kronecker structure.

The interior-point method needs, with multipliers X and inverse slacks W = Z^-1,

.. math:: H = F^* (X \otimes W) F, \qquad
    \langle E, H E' \rangle = \sum_k \operatorname{tr}\left( F_k(E)\, X_k\, F_k(E')\, W_k \right).

For :math:`F_k(E) = \tilde U E V^\top + V E \tilde U^\top`, with :math:`\tilde U_i = c_i U + \tfrac12 h_i V` for
the i-th matrix of a family, each pair of unknown matrices contributes four products
:math:`\operatorname{tr}(E P E' Q)` an inequality:

.. math:: (P, Q) \in \{ (V^\top X \tilde U', V'^\top W \tilde U),\; (V^\top X V', \tilde U'^\top W \tilde U),\;
    (\tilde U^\top X \tilde U', V'^\top W V),\; (\tilde U^\top X V', \tilde U'^\top W V) \}

so that :math:`\sum P \otimes Q` is one matrix product over all inequalities for each pair of unknown matrices, in
:math:`O(n^4)` for each inequality instead of the :math:`O(n^5)` of general code. The product is formed for a few rows
of P at a time and folded onto the symmetric unknowns at once, so that it is never stored.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.lmi import Term
from lpvhinf.lpv.operator import LMIOperator, Triangle

#: Doubles of the Kronecker product that are formed at a time: a share of a processor's cache.
SLAB = 400_000


def operator_form(operator: LMIOperator, X: Sequence[Array], W: Sequence[Array], y: Array) -> Array:
    """H y without H: F* of the symmetric part of X (F y) W."""
    return operator.adjoint([symmetric(x @ f @ w) for x, f, w in zip(X, operator.linear(y), W)])


def schur_complement(operator: LMIOperator, X: Sequence[Array], W: Sequence[Array], H: Array) -> None:
    """Write the lower triangle of H (N, N); what is above the diagonal is left undefined.

    Parameters
    ----------
    operator : LMIOperator
    X, W : list of (m, s, s)
        Multipliers and inverse slacks.
    H : (N, N)
        In C order.
    """
    problem = operator.problem
    products = [
        {
            (a.unknown, b.unknown): _Products(a, b, x, w)
            for a in block.terms
            for b in block.terms
            if operator.offsets[a.unknown][0] >= operator.offsets[b.unknown][0]
        }
        for block, x, w in zip(problem.blocks, X, W)
    ]
    for first in problem.unknowns:
        for second in problem.unknowns:
            if operator.offsets[first.name][0] < operator.offsets[second.name][0]:
                continue
            meeting = [p[first.name, second.name] for p in products if (first.name, second.name) in p]
            for i in range(first.count):
                for j in range(i + 1 if first.name == second.name else second.count):
                    row, column = operator.offsets[first.name][i], operator.offsets[second.name][j]
                    rows, columns = operator.triangles[first.name], operator.triangles[second.name]
                    target = H[row : row + rows.length, column : column + columns.length]
                    target[:] = 0.0
                    factors = [pair for product in meeting for pair in product.pairs(i, j)]
                    if factors:
                        _fold(factors, rows, columns, target)
    with_gamma = [
        symmetric(x @ block.Fg @ w) if block.Fg is not None else np.zeros_like(x)
        for block, x, w in zip(problem.blocks, X, W)
    ]
    H[-1] = operator.adjoint(with_gamma)


def symmetric(M: Array) -> Array:
    """Symmetric part of (..., n, n)."""
    return np.asarray(0.5 * (M + M.swapaxes(-1, -2)))


class _Products:
    """The products of one block for two of its terms, from which those of all pairs of basis functions follow."""

    def __init__(self, first: Term, second: Term, X: Array, W: Array) -> None:
        self.first, self.second = first, second
        V1, V2 = first.V, second.V
        XV, WV = X @ V2, W @ V1
        self.X_vv, self.W_vv = _t(V1) @ XV, _t(V2) @ WV
        self.simple = first.U is None and second.U is None
        if self.simple:
            return
        U1 = first.U if first.U is not None else np.zeros_like(V1)
        U2 = second.U if second.U is not None else np.zeros_like(V2)
        XU, WU = X @ U2, W @ U1
        self.X_vu, self.X_uv, self.X_uu = _t(V1) @ XU, _t(U1) @ XV, _t(U1) @ XU
        self.W_vu, self.W_uv, self.W_uu = _t(V2) @ WU, _t(U2) @ WV, _t(U2) @ WU

    def pairs(self, i: int, j: int) -> list[tuple[Array, Array]]:
        """(P, Q) of the i-th and j-th matrix of the two families, (m, n1, n2) and (m, n2, n1) each."""
        c1, h1 = _column(self.first.value, i), 0.5 * _column(self.first.inner, i)
        c2, h2 = _column(self.second.value, j), 0.5 * _column(self.second.inner, j)
        if self.simple:
            return [(4.0 * h1 * h2 * self.X_vv, self.W_vv)]
        X_vu, X_uv = c2 * self.X_vu + h2 * self.X_vv, c1 * self.X_uv + h1 * self.X_vv
        W_vu, W_uv = c1 * self.W_vu + h1 * self.W_vv, c2 * self.W_uv + h2 * self.W_vv
        X_uu = c1 * c2 * self.X_uu + c1 * h2 * self.X_uv + h1 * c2 * self.X_vu + h1 * h2 * self.X_vv
        W_uu = c1 * c2 * self.W_uu + c2 * h1 * self.W_uv + h2 * c1 * self.W_vu + h1 * h2 * self.W_vv
        return [(X_vu, W_vu), (self.X_vv, W_uu), (X_uu, self.W_vv), (X_uv, W_uv)]


def _fold(factors: list[tuple[Array, Array]], rows: Triangle, columns: Triangle, target: Array) -> None:
    r"""Add the form of :math:`\sum \operatorname{tr}(E P E' Q)` on scaled triangles E and E' to `target`.

    With T[b, c, d, a] the sum of P[b, c] Q[d, a], the entry of the pairs (a, b) and (c, d) is the mean of T over
    exchanging a with b and c with d, times the weights of the pairs.
    """
    n1, n2 = rows.n, columns.n
    P = np.ascontiguousarray(np.concatenate([p for p, _ in factors]).transpose(1, 2, 0))  # (b, c, inner)
    Q = np.concatenate([q for _, q in factors]).reshape(-1, n2 * n1)  # (inner, d a)
    lower, upper = columns.rows * n2 + columns.columns, columns.columns * n2 + columns.rows
    weights = 0.25 * np.sqrt(2.0) * columns.weights[:, None]
    step = max(1, SLAB // (n2 * n2 * n1))
    T = np.empty((min(step, n1) * n2, n2 * n1))
    folded, turned = np.empty((columns.length, n1)), np.empty((columns.length, n1))
    for start in range(0, n1, step):
        stop = min(start + step, n1)
        part = T[: (stop - start) * n2]
        np.matmul(P[start:stop].reshape(-1, P.shape[2]), Q, out=part)
        for b in range(start, stop):
            one = part[(b - start) * n2 : (b - start + 1) * n2].reshape(n2 * n2, n1)
            one.take(lower, axis=0, out=folded, mode="clip")
            one.take(upper, axis=0, out=turned, mode="clip")
            folded += turned
            folded *= weights
            folded[:, b] *= np.sqrt(2.0)  # a pair of equal indices occurs once, with weight 1
            target[rows.places[b]] += folded.T


def _column(coefficients: Array | None, i: int) -> Array:
    assert coefficients is not None
    return coefficients[:, i, None, None]


def _t(M: Array) -> Array:
    return M.swapaxes(-1, -2)
