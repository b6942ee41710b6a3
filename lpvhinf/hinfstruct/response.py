"""Frequency responses at many frequencies from one factorisation of A."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from lpvhinf.checks import Array

Complex = NDArray[np.complex128]

#: Above this condition number (1-norm) of the eigenvectors the Schur form is used.
EIGENVECTOR_LIMIT = 1e8
#: Error of a computed eigenvalue, in units of the number of states times the largest pole: a hundred roundings.
ROUND_OFF = 100.0 * float(np.finfo(float).eps)


def spectral_abscissa(poles: Complex) -> float:
    """Largest real part of poles (n,), plus the round-off of an eigenvalue: a pole at zero must not pass for stable."""
    if poles.size == 0:
        return -np.inf
    return float(np.max(poles.real) + ROUND_OFF * poles.size * np.max(np.abs(poles)))


class Response:
    r"""T(j omega) = C (j omega I - A)^-1 B + D.

    The state is balanced, then A is diagonalised: a frequency costs one small
    product. Where the eigenvectors are nearly dependent (defective A) the complex
    Schur form takes over, with a back substitution vectorised over frequencies.

    Attributes
    ----------
    poles : (n,) complex
    abscissa : float
        Largest real part of the poles, round-off counted against stability; -inf without states.
    right, left : (n, n) complex or None
        Columns and rows are right and left eigenvectors of A, left = right^-1; None where nearly dependent.
    """

    def __init__(self, A: Array, B: Array, C: Array, D: Array) -> None:
        self.D = D.astype(complex)
        self._triangle: Complex | None = None
        n = A.shape[0]
        self.poles: Complex = np.zeros(0, dtype=complex)
        self.abscissa = -np.inf
        self.right: Complex | None = None
        self.left: Complex | None = None
        self._b: Complex = np.zeros((0, B.shape[1]), dtype=complex)
        self._c: Complex = np.zeros((C.shape[0], 0), dtype=complex)
        if n == 0:
            return
        balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True, overwrite_a=False)
        poles, V = np.linalg.eig(balanced)
        self.poles = poles.astype(complex)
        self.abscissa = spectral_abscissa(poles)
        Bb, Cb = B / scale[:, None], C * scale
        try:
            Vi = np.linalg.inv(V)
            condition = np.abs(V).sum(0).max() * np.abs(Vi).sum(0).max()
        except np.linalg.LinAlgError:
            condition = np.inf
        if condition < EIGENVECTOR_LIMIT:
            self._b, self._c = (Vi @ Bb).astype(complex), (Cb @ V).astype(complex)
            self.right, self.left = V * scale[:, None], Vi / scale
        else:
            self._triangle, Z = scipy.linalg.schur(balanced, output="complex")
            self.poles = np.diagonal(self._triangle).copy()
            self.abscissa = spectral_abscissa(self.poles)
            self._b, self._c = Z.conj().T @ Bb, Cb @ Z

    def _solve(self, s: Complex, X: Complex) -> Complex:
        """(s I - triangle)^-1 X, with X of shape (n, N, m) or (n, 1, m)."""
        T = self._triangle
        assert T is not None
        n = T.shape[0]
        out = np.empty((n, s.size, X.shape[2]), dtype=complex)
        for k in range(n - 1, -1, -1):
            right = X[k] + np.tensordot(T[k, k + 1 :], out[k + 1 :], axes=(0, 0))
            out[k] = right / (s - T[k, k])[:, None]
        return out

    def at(self, omega: Array) -> Complex:
        """T at the frequencies (N,), infinity allowed: (N, n_z, n_w)."""
        return self._evaluate(omega, 0)

    def derivative(self, omega: Array) -> Complex:
        """dT/d omega at finite frequencies (N,): (N, n_z, n_w)."""
        return self._evaluate(omega, 1)

    def _evaluate(self, omega: Array, order: int) -> Complex:
        if self.poles.size == 0:
            return np.broadcast_to(self.D if order == 0 else 0 * self.D, (omega.size, *self.D.shape)).copy()
        finite = np.isfinite(omega)
        s = 1j * np.where(finite, omega, 0.0)
        if self._triangle is None:
            F = 1.0 / (s[:, None] - self.poles)
            F[~finite] = 0.0
            if order == 1:
                F = -1j * F * F
            N, n_z = omega.size, self._c.shape[0]
            if n_z <= self._b.shape[1]:
                out = ((self._c * F[:, None, :]).reshape(N * n_z, -1) @ self._b).reshape(N, n_z, -1)
            else:
                # the smaller side is expanded over frequencies
                n_w = self._b.shape[1]
                out = ((self._b.T * F[:, None, :]).reshape(N * n_w, -1) @ self._c.T).reshape(N, n_w, -1)
                out = out.transpose(0, 2, 1)
        else:
            X = self._solve(s, self._b[:, None, :])
            if order == 1:
                X = -1j * self._solve(s, X)
            out = np.tensordot(self._c, X, axes=(1, 0)).transpose(1, 0, 2)
            out[~finite] = 0.0
        return out + self.D if order == 0 else out


def largest_sigma(T: Complex) -> Array:
    """Largest singular values of a stack (N, n_z, n_w) of matrices: (N,)."""
    if T.shape[0] == 0 or min(T.shape[1:]) == 0:
        return np.zeros(T.shape[0])
    if T.shape[1] > T.shape[2]:
        T = T.transpose(0, 2, 1)
    if T.shape[1] == 1:
        return np.asarray(np.sqrt(np.sum(T.real**2 + T.imag**2, axis=(1, 2))))
    # scaled, so that squares neither overflow nor vanish
    size = np.max(np.abs(T), axis=(1, 2))
    size = np.where(size > 0.0, size, 1.0)
    T = T / size[:, None, None]
    gram = T @ T.conj().transpose(0, 2, 1)
    if T.shape[1] == 2:
        a, d, b = gram[:, 0, 0].real, gram[:, 1, 1].real, np.abs(gram[:, 0, 1])
        return np.asarray(size * np.sqrt(0.5 * (a + d) + np.hypot(0.5 * (a - d), b)))
    return np.asarray(size * np.sqrt(np.linalg.eigvalsh(gram)[:, -1]))
