"""Claims at every frozen p: each cell has a Lyapunov matrix of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpvhinf.certify.cells import Cell
from lpvhinf.certify.inequality import LocalLyapunov, failed, verify
from lpvhinf.certify.loop import LoopMatrix
from lpvhinf.certify.lyapunov import normal_form, weighted
from lpvhinf.certify.search import Attempt
from lpvhinf.checks import Array


class FrozenStability:
    """A(p) + decay I is Hurwitz for every p of a cell.

    Parameters
    ----------
    degree : d, of A on a cell
    lyapunov_degree : e, of the Lyapunov matrix
    """

    suspicion = "a position looks unstable"

    def __init__(self, loop: LoopMatrix, degree: int, lyapunov_degree: int) -> None:
        self.loop, self.degree, self.lyapunov_degree = loop, degree, lyapunov_degree

    def test(self, cell: Cell) -> Attempt:
        """Try the normal form first, then the solution of a Lyapunov equation."""
        local = self.loop.local(cell, self.degree)
        n_p, d, e = len(cell.level), self.degree, self.lyapunov_degree
        still = np.zeros((1, n_p))
        best = failed(n_p)
        for candidate in (normal_form, weighted):
            lyapunov = candidate(local.terms, n_p, d, e)
            if lyapunov is None:
                continue
            verdict = verify(local, lyapunov, d, still)
            if verdict.proved:
                return Attempt(verdict=verdict, record=pack(lyapunov))
            if verdict.excess < best.excess:
                best = verdict
            if self.loop.size > 12 or best.excess > 1.5:  # the second candidate costs as much as a cut
                break
        suspect = bool(np.max(np.linalg.eigvals(local.terms[0]).real) >= 0.0) if not np.isfinite(best.excess) else False
        return Attempt(verdict=best, suspect=suspect)


def pack(lyapunov: LocalLyapunov) -> dict[str, NDArray[Any]]:
    """S in single and the terms of X in half precision: what they are, exactly."""
    n = len(lyapunov.S)
    rows, cols = np.tril_indices(n)
    X: Array = lyapunov.terms[1:, rows, cols]
    return {"S": lyapunov.S.astype(np.float32), "X": X.astype(np.float16)}
