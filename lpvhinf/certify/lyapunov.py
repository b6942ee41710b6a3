r"""Candidate Lyapunov matrices on a cell: the normal form of A(p), followed through the cell.

At the cell's centre the modal form block-diagonalises A. The polynomial X(delta) in P = S' X(delta) S follows the
block-diagonalising transform to degree e: its terms cancel the off-diagonal part of the Lyapunov inequality, order by
order. A candidate needs no trust: it is rounded, and then proved or not.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from lpvhinf.certify.enclosure import multi_indices
from lpvhinf.certify.inequality import LocalLyapunov
from lpvhinf.checks import Array

CLIP = 0.3  # largest entry of a term of X: a denominator close to zero would make a term useless
ILL = 1e9  # condition of the modal form above which it is not used


def modal(A: Array) -> tuple[Array, Array, Array] | None:
    """Real T with T^-1 A T in real modal form, the unitary W from that form to eigenvectors, and the eigenvalues."""
    values, vectors = np.linalg.eig(A)
    order = [i for i in np.lexsort((values.imag, values.real, np.abs(values))) if values[i].imag >= 0.0]
    n = len(A)
    T, W, lam = np.zeros((n, n)), np.zeros((n, n), dtype=complex), np.zeros(n, dtype=complex)
    k = 0
    for i in order:
        v = vectors[:, i] / np.linalg.norm(vectors[:, i])
        if values[i].imag == 0.0:
            T[:, k], W[k, k], lam[k] = v.real, 1.0, values[i]
            k += 1
        else:
            if k + 2 > n:
                return None
            T[:, k], T[:, k + 1] = np.sqrt(2.0) * v.real, np.sqrt(2.0) * v.imag
            W[k : k + 2, k : k + 2] = np.array([[1.0, 1.0], [1j, -1j]]) / np.sqrt(2.0)
            lam[k], lam[k + 1] = values[i], np.conj(values[i])
            k += 2
    return (T, W, lam) if k == n else None


def _balance(S: Array, coupling: Array, lam: Array) -> Array:
    """Osborne's scaling of the modes, so that their couplings through p are balanced; in single precision."""
    H = coupling.copy()
    np.fill_diagonal(H, 0.0)
    g = np.ones(len(H))
    for _ in range(8):
        q = ((H.sum(axis=1) + 1e-12) / (H.sum(axis=0) + 1e-12)) ** 0.25
        H = H / q[:, None] * q
        g = g * q
    i = 0
    while i < len(g):
        if lam[i].imag != 0.0:
            g[i] = g[i + 1] = np.sqrt(g[i] * g[i + 1])
            i += 2
        else:
            i += 1
    return np.array((S / g[:, None]).astype(np.float32), dtype=np.float64)


def normal_form(terms: Array, n_p: int, degree: int, e: int) -> LocalLyapunov | None:
    """A candidate from the local coefficients of A; None where A(centre) is not Hurwitz or has no modal form.

    Parameters
    ----------
    terms : (n_terms, n, n)
        Coefficients of delta^a, total degree up to `degree`.
    e : degree of X
    """
    A0 = terms[0]
    n = len(A0)
    found = modal(A0)
    if found is None or np.max(found[2].real) >= 0.0:
        return None
    T, W, lam = found
    if np.linalg.cond(T) > ILL:
        return weighted(terms, n_p, degree, e)
    S: Array = np.asarray(np.linalg.inv(T), dtype=float)
    D: Array = 1.0 / np.sqrt(-2.0 * lam.real)
    coupling = np.abs(S @ terms[1:] @ T).sum(axis=0)
    S = _balance(S, np.asarray(D[:, None] * coupling * D, dtype=float), lam)
    H = S @ terms @ np.linalg.inv(S)
    indices = {a: i for i, a in enumerate(multi_indices(n_p, degree))}
    wanted = multi_indices(n_p, e)
    X = np.zeros((len(wanted), n, n))
    X[0] = np.eye(n)
    denominator = np.conj(lam)[:, None] + lam[None, :]
    for k, b in enumerate(wanted[1:], start=1):
        coupled = _earlier(H, X, indices, wanted, b, k)
        C = W.conj().T @ coupled @ W
        Y = -C / denominator
        np.fill_diagonal(Y, 0.0)
        size = np.abs(Y)
        Y *= np.minimum(1.0, CLIP / np.maximum(size, 1e-300))
        x = (W @ Y @ W.conj().T).real
        X[k] = _rounded(0.5 * (x + x.T))
    return LocalLyapunov(S=S, degree=e, terms=X)


def weighted(terms: Array, n_p: int, degree: int, e: int) -> LocalLyapunov | None:
    """A candidate from Lyapunov equations: A'P + PA + Q = 0 to order e, with Q = I in balanced coordinates."""
    n = len(terms[0])
    _, (scale, _) = scipy.linalg.matrix_balance(terms[0], permute=False, separate=True)
    A = terms / scale[:, None] * scale
    try:
        P = scipy.linalg.solve_continuous_lyapunov(A[0].T, -np.eye(n))
        S = (np.linalg.cholesky(0.5 * (P + P.T)).T / scale).astype(np.float32).astype(float)
        T = np.linalg.inv(S)
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(T)):
        return None
    H = S @ terms @ T
    indices = {a: i for i, a in enumerate(multi_indices(n_p, degree))}
    wanted = multi_indices(n_p, e)
    X = np.zeros((len(wanted), n, n))
    X[0] = np.eye(n)
    for k, b in enumerate(wanted[1:], start=1):
        x = scipy.linalg.solve_continuous_lyapunov(H[0].T, -_earlier(H, X, indices, wanted, b, k))
        x *= min(1.0, CLIP / max(float(np.max(np.abs(x))), 1e-300))
        X[k] = _rounded(0.5 * (x + x.T))
    return LocalLyapunov(S=S, degree=e, terms=X)


def _earlier(
    H: Array,
    X: Array,
    indices: dict[tuple[int, ...], int],
    wanted: tuple[tuple[int, ...], ...],
    b: tuple[int, ...],
    count: int,
) -> Array:
    """The part of order b of H'X + XH that the terms before X_b make."""
    total = np.zeros_like(H[0])
    for k, c in enumerate(wanted[:count]):
        a = tuple(x - y for x, y in zip(b, c))
        if min(a) >= 0 and any(a) and a in indices:
            total += H[indices[a]].T @ X[k]
    return np.asarray(total + total.T)


def _rounded(x: Array) -> Array:
    """To half precision, with entries too small to matter set to zero: the file stays small."""
    out: Array = np.where(np.abs(x) < 1e-6, 0.0, x).astype(np.float16).astype(np.float64)
    return out
