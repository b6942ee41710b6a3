r"""The one inequality of all claims, verified on a cell (docs/certificate_format.md, sections 4, 7 and 8).

.. math:: N = -\Big(K' Q + Q K + \sum_i v_i \frac{\partial Q}{\partial p_i}\Big) > 0, \qquad Q = S' X S

for all delta in the cell and all vertices v, as a polynomial in the cell's coordinates, in Bernstein form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from lpvhinf.certify.enclosure import multi_indices
from lpvhinf.certify.loop import LocalLoop
from lpvhinf.certify.positive_definite import TINY, dominating_diagonal, gamma, positive_definite
from lpvhinf.certify.restriction import bernstein
from lpvhinf.checks import Array

SPARE = 1e-6  # smallest eigenvalue the engine asks for, where the checker asks for 0; the matrices are close to I
LADDER = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 1e-3, 1e-4, 1e-5)  # margins that are tried for the report


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalLyapunov:
    """Q = S' X S on a cell.

    Attributes
    ----------
    S : (m, m)
    degree : e
    terms : (n_terms, m, m)
        X_b in the order of `multi_indices`, exact.
    remainder : (m, m) or None
        Bound of X minus its terms; None for nothing.
    slopes : (n_p, m, m) or None
        Bounds of the derivatives of that difference to delta_i.
    """

    S: Array
    degree: int
    terms: Array
    remainder: Array | None = None
    slopes: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class CellVerdict:
    """What a test of one cell gave.

    Attributes
    ----------
    proved : whether both inequalities hold on the whole cell
    margin : a proved lower bound of the smallest eigenvalue of T'NT, T'N(0)T being close to I; 0 if not proved
    excess : how far the cell is from a proof, for the choice of the next cut; at most 1 is close
    difficulty : (n_p,) share of every axis in the variation over the cell
    """

    proved: bool
    margin: float
    excess: float
    difficulty: Array


def failed(n_p: int, excess: float = np.inf) -> CellVerdict:
    """A verdict without a proof, and without a hint where to cut."""
    return CellVerdict(proved=False, margin=0.0, excess=excess, difficulty=np.ones(n_p))


def congruence(K0: Array, X0: Array, S: Array, ratios: Array, slope0: Array) -> Array | None:
    """A T with T' N(0) T close to I, or None where N(0) is not positive definite; it needs no trust."""
    try:
        T = np.linalg.inv(S)
        H = S @ K0 @ T
        N = -(H.T @ X0 + X0 @ H) - np.einsum("i,ijk->jk", ratios, slope0)
        scale = np.diag(N).copy()
        if not np.all(scale > 0.0):
            return None
        scale = 1.0 / np.sqrt(scale)
        L = np.linalg.cholesky((N + N.T) * (0.5 * scale[:, None] * scale))
        T = (T * scale) @ np.linalg.inv(L).T
    except np.linalg.LinAlgError:
        return None
    return T if np.all(np.isfinite(T)) else None


@lru_cache(maxsize=256)
def _pairs(n_p: int, d: int, e: int) -> tuple[Array, tuple[tuple[int, ...], ...]]:
    """For every product of delta^a (first) and delta^b: the number of the monomial delta^(a+b)."""
    monomials = multi_indices(n_p, d + e)
    number = {c: i for i, c in enumerate(monomials)}
    table = [[number[tuple(x + y for x, y in zip(a, b))] for a in multi_indices(n_p, d)] for b in multi_indices(n_p, e)]
    return np.array(table), monomials


@lru_cache(maxsize=64)
def _net(n_p: int, d: int) -> Array:
    """(number of control matrices, number of monomials up to total degree d) weights."""
    table = bernstein(d)
    return np.array(
        [
            [np.prod([table[k, i] for k, i in zip(c, where)]) for c in multi_indices(n_p, d)]
            for where in product(range(d + 1), repeat=n_p)
        ]
    )


def verify(loop: LocalLoop, lyapunov: LocalLyapunov, degree: int, rates: Array, *, grade: bool = True) -> CellVerdict:
    """Prove the inequality on a cell, or say how far that is.

    Parameters
    ----------
    degree : d, of `loop` and of the Bernstein form
    rates : (n_v, n_p)
        Vertices of d delta / dt in the cell; one row of zeros for no rates.
    grade : search for a margin to report
    """
    S, m, e = lyapunov.S, len(lyapunov.S), lyapunov.degree
    n_p = rates.shape[1]
    X = lyapunov.terms
    indices = multi_indices(n_p, e)
    first = [indices.index(tuple(int(a == i) for a in range(n_p))) for i in range(n_p)] if e else []
    slope0 = X[first] if e else np.zeros((n_p, m, m))
    T = congruence(loop.terms[0], X[0], S, np.zeros(n_p), slope0)
    if T is None:
        return failed(n_p)
    G = S @ T
    H = (S @ loop.terms) @ T
    XG = X @ G
    aS, aT, aG = np.abs(S), np.abs(T), np.abs(G)
    sum_H, sum_X = np.abs(H).sum(axis=0), np.abs(X).sum(axis=0)
    # what the computed polynomials miss
    error_G = gamma(m + 2) * (aS @ aT) + m * TINY
    missed_H = (aS @ (loop.remainder + gamma(2 * m + 4) * np.abs(loop.terms).sum(axis=0))) @ aT + m * TINY
    X_error = np.zeros((m, m)) if lyapunov.remainder is None else lyapunov.remainder
    full_X, full_G = sum_X + X_error, aG + error_G
    half = missed_H.T @ (full_X @ full_G)
    half += sum_H.T @ (X_error @ full_G + sum_X @ error_G)
    n_a, n_b = len(H), len(X)
    half += gamma(2 * m + n_a + n_b + 12) * ((sum_H + missed_H).T @ (full_X @ full_G))
    F = (half + half.T) * (1.0 + 1e-10) + m * m * TINY
    # the polynomial itself
    table, monomials = _pairs(n_p, degree, e)
    flat_H = np.swapaxes(H, 1, 2).reshape(n_a * m, m)
    N = np.zeros((len(monomials), m, m))
    for b in range(n_b):
        N[table[b]] -= (flat_H @ XG[b]).reshape(n_a, m, m)
    N += np.swapaxes(N, 1, 2).copy()
    positive = X[0] if lyapunov.remainder is None else X[0] - np.diag(dominating_diagonal(2.0 * lyapunov.remainder))
    if not _positive_at_centre(positive, G, error_G):
        return failed(n_p)
    sizes = np.abs(N)
    low = [i for i, c in enumerate(monomials) if sum(c) <= degree]
    high = [i for i, c in enumerate(monomials) if sum(c) > degree]
    F += sizes[high].sum(axis=0) * (1.0 + 1e-10)
    F += gamma(len(monomials) + 3 * n_p + 12) * sizes[low].sum(axis=0) * (1.0 + 1e-10)
    rows = sizes.sum(axis=2).max(axis=1)
    difficulty = np.array([sum(c[axis] * size for c, size in zip(monomials, rows)) for axis in range(n_p)])
    weights = _net(n_p, degree)
    control = np.tensordot(weights, N[low], axes=1)
    proved, excess = True, 0.0
    nets = []
    for v in rates:
        moving, F_v = control, F
        if np.any(v != 0.0) and e:
            drift, bound = _drift(lyapunov, v, indices, G, aG, full_G, error_G)
            moving = control - np.tensordot(weights[:, : len(drift)], drift, axes=1)
            F_v = F + bound
        f = dominating_diagonal(F_v)
        excess = max(excess, float(np.max(f)))
        if excess > 2.0:  # T'N(0)T is close to I
            return CellVerdict(proved=False, margin=0.0, excess=excess, difficulty=difficulty)
        i = np.arange(m)
        moving = 0.5 * (moving + np.swapaxes(moving, 1, 2))
        moving[:, i, i] -= f
        nets.append(moving)
        # the diagonal's subtraction rounds: covered by the shift of the test
        proved = positive_definite(moving, SPARE)
        if not proved:
            return CellVerdict(proved=False, margin=0.0, excess=max(excess, 1.0), difficulty=difficulty)
    margin = SPARE
    if grade:
        margin = next((s for s in LADDER if all(positive_definite(net, s) for net in nets)), SPARE)
    return CellVerdict(proved=True, margin=margin, excess=excess, difficulty=difficulty)


def _positive_at_centre(X0: Array, G: Array, error_G: Array) -> bool:
    """Whether G' X0 G > 0 for every G within error_G: then P > 0 at the centre of the cell."""
    m = len(G)
    inner = G.T @ (X0 @ G)
    inner = 0.5 * (inner + inner.T)
    size, full_G = np.abs(X0), np.abs(G) + error_G
    half = gamma(2 * m + 12) * (full_G.T @ (size @ full_G)) + error_G.T @ (size @ full_G)
    i = np.arange(m)
    inner[i, i] -= dominating_diagonal((half + half.T) * (1.0 + 1e-10) + m * m * TINY)
    return positive_definite(inner)


def _drift(
    lyapunov: LocalLyapunov,
    v: Array,
    indices: tuple[tuple[int, ...], ...],
    G: Array,
    aG: Array,
    full_G: Array,
    error_G: Array,
) -> tuple[Array, Array]:
    """G' (dX/dt) G as coefficients up to degree e - 1, and a bound of what they miss."""
    m, e, n_p = len(G), lyapunov.degree, len(v)
    number = {b: i for i, b in enumerate(indices)}
    lower = multi_indices(n_p, e - 1)
    D = np.zeros((len(lower), m, m))
    for k, c in enumerate(lower):
        for axis in range(n_p):
            up = tuple(x + (a == axis) for a, x in enumerate(c))
            D[k] += v[axis] * (c[axis] + 1) * lyapunov.terms[number[up]]
    size = np.zeros((m, m))
    for b, term in zip(indices, np.abs(lyapunov.terms)):
        size += sum(abs(v[axis]) * b[axis] for axis in range(n_p)) * term
    drift = G.T @ (D @ G)
    bound = gamma(2 * m + 4 * len(indices) + 20) * (full_G.T @ (size @ full_G))
    mixed = error_G.T @ (size @ full_G)
    bound = bound + mixed + mixed.T
    if lyapunov.slopes is not None:
        bound = bound + full_G.T @ (np.tensordot(np.abs(v), lyapunov.slopes, axes=1) @ full_G)
    return drift, (bound + bound.T) * (0.5 + 1e-10) + m * m * TINY
