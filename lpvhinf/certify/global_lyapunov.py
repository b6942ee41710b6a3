r"""Claims with one Lyapunov matrix over the whole box: P(p) = S' X(xi) S with a polynomial X.

A polynomial is continuous and differentiable everywhere, so that rates of p can be counted:
:math:`\dot P = \sum_i \dot p_i \, \partial P / \partial p_i`. Degree 0 gives quadratic stability.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpvhinf.certify.cells import Cell
from lpvhinf.certify.enclosure import ChebyshevEntries, multi_indices
from lpvhinf.certify.inequality import LocalLyapunov, verify
from lpvhinf.certify.loop import LoopMatrix
from lpvhinf.certify.search import Attempt
from lpvhinf.checks import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalLyapunov:
    """P(p) = S' X(xi) S over the claim's box, xi in [-1, 1]^n_p.

    Attributes
    ----------
    S : (n, n)
    X : (k_1, ..., k_np, n (n + 1) / 2)
        Chebyshev coefficients of the packed lower triangle, in the precision in which they are stored.
    """

    S: Array
    X: NDArray[Any]

    @property
    def is_constant(self) -> bool:
        """Whether P does not depend on p."""
        return all(k == 1 for k in self.X.shape[:-1])


def constant_lyapunov(P: Array, n_p: int) -> GlobalLyapunov:
    """One P for all p."""
    S = np.asarray(np.linalg.cholesky(P).T, dtype=float)
    return GlobalLyapunov(S=S, X=pack_symmetric(np.eye(len(S))).reshape((1,) * n_p + (-1,)))


class GlobalProver:
    """The claim with a given P(p) on one cell after another.

    Parameters
    ----------
    degree, lyapunov_degree : degrees of K and of X in the cell's coordinates
    rate : (n_p, 2) box of dp/dt, or None
    """

    suspicion = "the Lyapunov matrix that was found does not serve a position"

    def __init__(
        self, loop: LoopMatrix, lyapunov: GlobalLyapunov, degree: int, lyapunov_degree: int, rate: Array | None
    ) -> None:
        self.loop, self.lyapunov, self.degree = loop, lyapunov, degree
        self.lyapunov_degree = 0 if lyapunov.is_constant else lyapunov_degree
        self.entries = ChebyshevEntries(np.asarray(lyapunov.X, dtype=float))
        still = np.zeros((1, len(loop.box)))
        self.vertices = still if rate is None else np.array(list(product(*rate.tolist())))
        self.S = np.eye(loop.size)
        self.S[: loop.n_x, : loop.n_x] = lyapunov.S

    def local(self, cell: Cell) -> LocalLyapunov:
        """Q on a cell."""
        n, m = self.loop.n_x, self.loop.size
        constant = self.lyapunov.is_constant
        part = self.entries.local(
            cell.centre, cell.radius, self.lyapunov_degree, slopes=bool(np.any(self.vertices)) and not constant
        )
        rows, cols = np.tril_indices(n)
        terms = np.zeros((len(part.terms), m, m))
        terms[:, rows, cols] = part.terms
        terms[:, cols, rows] = part.terms
        outside = np.arange(n, m)
        terms[0, outside, outside] = 1.0
        bound, slopes = np.zeros((m, m)), np.zeros((len(part.slopes), m, m))
        bound[rows, cols] = bound[cols, rows] = part.remainder
        slopes[:, rows, cols] = slopes[:, cols, rows] = part.slopes
        return LocalLyapunov(S=self.S, degree=self.lyapunov_degree, terms=terms, remainder=bound, slopes=slopes)

    def rates(self, cell: Cell) -> Array:
        """Vertices of d delta / dt: dp_i/dt divided by the cell's half width in p."""
        widths = [
            float(r * (Fraction(high) - Fraction(low)) / 2)
            for r, (low, high) in zip(cell.radius, self.loop.box.tolist())
        ]
        return np.asarray(self.vertices / np.array(widths))

    def test(self, cell: Cell) -> Attempt:
        """Verify the inequality on a cell."""
        local = self.loop.local(cell, self.degree)
        lyapunov, rates = self.local(cell), self.rates(cell)
        verdict = verify(local, lyapunov, self.degree, rates)
        return Attempt(verdict=verdict, suspect=not verdict.proved and not self._holds_at_centre(cell))

    def _holds_at_centre(self, cell: Cell) -> bool:
        """Whether the inequality holds close to the centre of a cell, up to round-off; where not, no cut will help."""
        level = tuple(k + 12 for k in cell.level)
        near = Cell(level, tuple((2 * i + 1) * 2**11 for i in cell.index))
        K = self.loop.local(near, self.degree).terms[0]
        return _holds(K, self.local(near), self.rates(near))


def _holds(K: Array, lyapunov: LocalLyapunov, rates: Array) -> bool:
    """Whether the inequality holds at delta = 0, up to round-off."""
    S, X = lyapunov.S, lyapunov.terms
    N = S.T @ X[0] @ S @ K
    N = -(N + N.T)
    n_p = rates.shape[1]
    linear = (
        X[[multi_indices(n_p, 1).index(tuple(int(a == i) for a in range(n_p))) for i in range(n_p)]]
        if len(X) > 1
        else None
    )
    for v in rates:
        M = N if linear is None else N - S.T @ np.tensordot(v, linear, axes=1) @ S
        scale = np.diag(M)
        if np.any(scale <= 0.0):
            return False
        try:
            np.linalg.cholesky(M / np.sqrt(scale[:, None] * scale))
        except np.linalg.LinAlgError:
            return False
    return True


def pack_symmetric(matrices: Array) -> Array:
    """(..., n, n) to the packed lower triangles (..., n (n + 1) / 2)."""
    rows, cols = np.tril_indices(matrices.shape[-1])
    return np.asarray(matrices[..., rows, cols])
