r"""The linear map of an LMI problem, its adjoint, and the order of its unknowns.

A point is a vector y: for every unknown matrix the scaled lower triangle (svec, off-diagonal entries times
:math:`\sqrt 2`, so that inner products are kept), and gamma last. With :math:`F` the linear part,

.. math:: Z = F_0 + F y, \qquad \langle F^* T, y \rangle = \sum_k \langle T_k, (F y)_k \rangle .
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.lmi import LMIProblem, term_value


class LMIOperator:
    """F, its adjoint and the layout of y.

    Parameters
    ----------
    problem : LMIProblem

    Attributes
    ----------
    n_variables : int
    offsets : dict of unknown name -> tuple of int
        Where each matrix of the family begins in y.
    """

    def __init__(self, problem: LMIProblem) -> None:
        self.problem = problem
        self.n_variables = problem.n_variables
        self.offsets: dict[str, tuple[int, ...]] = {}
        self.triangles = {u.name: Triangle(u.size) for u in problem.unknowns}
        start = 0
        for u in problem.unknowns:
            length = self.triangles[u.name].length
            self.offsets[u.name] = tuple(start + i * length for i in range(u.count))
            start += u.count * length

    def matrices(self, y: Array) -> dict[str, Array]:
        """The unknown matrices (count, n, n) of a vector."""
        out = {}
        for u in self.problem.unknowns:
            triangle, start = self.triangles[u.name], self.offsets[u.name][0]
            out[u.name] = triangle.full(y[start : start + u.count * triangle.length].reshape(u.count, -1))
        return out

    def vector(self, matrices: dict[str, Array], gamma: float) -> Array:
        """The vector of unknown matrices and gamma."""
        parts = [self.triangles[u.name].packed(matrices[u.name]).ravel() for u in self.problem.unknowns]
        return np.concatenate([*parts, [gamma]])

    def value(self, y: Array) -> list[Array]:
        """F0 + F y, one (m, s, s) a block."""
        return self.problem.evaluate(self.matrices(y), float(y[-1]))

    def linear(self, y: Array) -> list[Array]:
        """F y."""
        matrices, out = self.matrices(y), []
        for block in self.problem.blocks:
            Z = y[-1] * block.Fg if block.Fg is not None else np.zeros_like(block.F0)
            for term in block.terms:
                Z = Z + term_value(term, matrices[term.unknown])
            out.append(Z)
        return out

    def adjoint_matrices(self, T: Sequence[Array]) -> tuple[dict[str, Array], float]:
        """F* T as gradient matrices (count, n, n) for every unknown, and its gamma part."""
        gradients = {u.name: np.zeros((u.count, u.size, u.size)) for u in self.problem.unknowns}
        gamma = 0.0
        for block, t in zip(self.problem.blocks, T):
            for term in block.terms:
                assert term.value is not None and term.inner is not None
                G, count = gradients[term.unknown], term.value.shape[1]
                TV = t @ term.V
                VTV = term.V.swapaxes(1, 2) @ TV
                G += (term.inner.T @ VTV.reshape(len(VTV), -1)).reshape(count, *G.shape[1:])
                if term.U is not None:
                    UTV = term.U.swapaxes(1, 2) @ TV
                    UTV = UTV + UTV.swapaxes(1, 2)
                    G += (term.value.T @ UTV.reshape(len(UTV), -1)).reshape(count, *G.shape[1:])
            if block.Fg is not None:
                gamma += float(np.vdot(block.Fg, t))
        return gradients, gamma

    def adjoint(self, T: Sequence[Array]) -> Array:
        """F* T as a vector; T symmetric."""
        return self.vector(*self.adjoint_matrices(T))


class Triangle:
    """The scaled lower triangle of symmetric (n, n) matrices, rows first: entry (b, a), a <= b, at b (b + 1)/2 + a."""

    def __init__(self, n: int) -> None:
        self.n, self.length = n, n * (n + 1) // 2
        self.rows, self.columns = np.tril_indices(n)
        self.weights = np.where(self.rows == self.columns, 1.0, np.sqrt(2.0))
        low, high = np.minimum.outer(np.arange(n), np.arange(n)), np.maximum.outer(np.arange(n), np.arange(n))
        self.places = high * (high + 1) // 2 + low  #: where the pair {a, b} is, (n, n)

    def packed(self, G: Array) -> Array:
        """(..., n, n) symmetric to (..., n (n + 1)/2)."""
        return np.asarray(G[..., self.rows, self.columns] * self.weights)

    def full(self, x: Array) -> Array:
        """(..., n (n + 1)/2) to (..., n, n)."""
        Y = np.empty((*x.shape[:-1], self.n, self.n))
        scaled = x / self.weights
        Y[..., self.rows, self.columns] = scaled
        Y[..., self.columns, self.rows] = scaled
        return Y
