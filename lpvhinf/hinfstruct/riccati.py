"""One side of full-order H-infinity synthesis: is a level refuted by its Riccati equation?"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from lpvhinf.checks import Array

#: Eigenvalues of the Hamiltonian matrix closer to the axis than this share of the largest count as on it.
ON_AXIS = 1e-11
#: Relative error of a frequency response.
ROUNDING = 1e-12
#: Singular values of D12 below this share of the largest count as zero.
RANK = 1e-11


@dataclass(frozen=True, kw_only=True, eq=False)
class SideSolution:
    r"""What the Riccati equation says at one level.

    Attributes
    ----------
    refuted : bool
        No controller can reach the level: shown, beyond the estimated error.
    reason : str
        How it was refuted, or why nothing can be said.
    X : (n, n)
        Positive semidefinite stabilising solution; zero where nothing can be said.
    error : float
        Estimate of the norm of the error of X.
    """

    refuted: bool
    reason: str
    X: Array
    error: float


class ControlSide:
    r"""Full-information synthesis: the best that a controller reaches that knows x and w.

    After rotation of z and scaling of u the plant reads

    .. math:: \dot x = A x + B_1 w + B_2 v, \quad z = (v,\; C x + D w),

    as the controller may cancel what enters z together with u. The level :math:`\gamma` is refuted if
    :math:`\bar\sigma(D) \ge \gamma`, if the gain from w to the part of z that u does not reach directly is above it at
    a frequency where the Hamiltonian matrix has an eigenvalue, or if the stabilising solution of

    .. math:: F^\top X + X F - X (B_2 B_2^\top - B_1 R^{-1} B_1^\top) X + C^\top (I - D D^\top/\gamma^2)^{-1} C = 0,
              \quad R = \gamma^2 I - D^\top D, \quad F = A + B_1 R^{-1} D^\top C

    is not positive semidefinite. Inputs that reach z not at all (D12 of less than full column rank, and no effect
    through the states either) take what they can reach out of the problem: X vanishes there. If an input without
    direct feed-through does act on z, nothing is claimed by this side.

    Parameters
    ----------
    A, B1, B2, C1, D11, D12 : matrices of the generalized plant
        For the other side (estimation) pass the transposed plant.
    remaining : callable
        Frequencies (N,) to the smallest gain over all u there, see `remaining_gain`.
    """

    def __init__(
        self,
        A: Array,
        B1: Array,
        B2: Array,
        C1: Array,
        D11: Array,
        D12: Array,
        remaining: Callable[[Array], Array],
    ) -> None:
        self._remaining = remaining
        self.n, n_w = A.shape[0], B1.shape[1]
        U, s, Vh = np.linalg.svd(D12)
        r = int(np.sum(s > RANK * s[0])) if s.size and s[0] > 0.0 else 0
        U1, U2, B_direct = U[:, :r], U[:, r:], B2 @ Vh[:r].T / s[:r]
        C_direct, D_direct = U1.T @ C1, U1.T @ D11
        F, B_w = A - B_direct @ C_direct, B1 - B_direct @ D_direct
        C, D = U2.T @ C1, U2.T @ D11
        self.usable, self.basis = True, np.eye(self.n)
        free = B2 @ Vh[r:].T
        if np.linalg.norm(free) > RANK * max(float(np.linalg.norm(B2)), 1e-300):
            reached = _reachable(F, free)
            self.basis = scipy.linalg.null_space(reached.T)
            self.usable = bool(np.linalg.norm(C @ reached) <= 1e-10 * max(float(np.linalg.norm(C)), 1e-300))
        Q = self.basis
        self.A, self.B1, self.B2 = Q.T @ F @ Q, Q.T @ B_w, Q.T @ B_direct
        self.C, self.D = C @ Q, D
        self.floor = float(np.linalg.norm(D, 2)) if D.size else 0.0
        self._identity = np.eye(n_w)
        #: pole of the estimation or regulator problem nearest to the axis, relative to the largest
        self.clearance = self._clearance()

    @property
    def regular(self) -> bool:
        """Full column rank of D12 and no zero on the imaginary axis: the Riccati test is exact."""
        return self.usable and self.basis.shape[1] == self.n and self.clearance > 1e-8

    def _clearance(self) -> float:
        if self.A.shape[0] == 0:
            return np.inf
        H = np.block([[self.A, -self.B2 @ self.B2.T], [-self.C.T @ self.C, -self.A.T]])
        poles = np.linalg.eigvals(_balanced(H)[0])
        return float(np.min(np.abs(poles.real)) / max(float(np.max(np.abs(poles))), 1e-300))

    def _nothing(self, reason: str) -> SideSolution:
        return SideSolution(refuted=False, reason=reason, X=np.zeros((self.n, self.n)), error=0.0)

    def _refuted(self, reason: str) -> SideSolution:
        return SideSolution(refuted=True, reason=reason, X=np.zeros((self.n, self.n)), error=0.0)

    def solve(self, gamma: float) -> SideSolution:
        """The solution at a level, or its refutation."""
        if not self.usable:
            return self._nothing("an input without direct feed-through acts on z")
        if self.floor >= gamma:
            return self._refuted("feed-through")
        n = self.A.shape[0]
        if n == 0:
            return self._nothing("no states")
        D = self.D / gamma
        R = self._identity - D.T @ D
        RB, RD = np.linalg.solve(R, self.B1.T) / gamma**2, np.linalg.solve(R, D.T) / gamma
        F = self.A + self.B1 @ RD @ self.C
        S = self.B2 @ self.B2.T - self.B1 @ RB
        W = np.eye(D.shape[0]) - D @ D.T
        Q = self.C.T @ np.linalg.solve(W, self.C) if D.shape[0] else np.zeros((n, n))
        H = np.block([[F, -S], [-Q, -F.T]])
        if not np.all(np.isfinite(H)):
            return self._nothing("overflow")
        balanced, d = _balanced(H)
        try:
            T, Z, stable = scipy.linalg.schur(balanced, sort="lhp")
        except np.linalg.LinAlgError as failure:
            return self._nothing(f"the Schur form failed: {failure}")
        poles = _schur_eigenvalues(T)
        near = np.abs(poles.real) <= ON_AXIS * np.max(np.abs(poles))
        if stable != n or np.any(near):
            return self._by_frequency(gamma, poles)
        try:
            X = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * np.outer(d, d)
            X, error = _refined(F, S, Q, 0.5 * (X + X.T))
        except np.linalg.LinAlgError:
            return self._nothing("the stable subspace has no graph")
        size = float(np.linalg.norm(X, 2))
        if not np.isfinite(error) or error > 1e-3 * size:
            return self._nothing("the Riccati equation is too ill conditioned")
        eigenvalues, vectors = np.linalg.eigh(X)
        if eigenvalues[0] < -(10.0 * error + 1e-9 * size):
            return self._refuted("Riccati solution not positive semidefinite")
        positive = (vectors * np.maximum(eigenvalues, 0.0)) @ vectors.T
        return SideSolution(
            refuted=False, reason="", X=self.basis @ positive @ self.basis.T, error=error + max(0.0, -eigenvalues[0])
        )

    def _by_frequency(self, gamma: float, poles: np.ndarray) -> SideSolution:
        """Eigenvalues on the axis refute the level if the gain there is above it."""
        close = np.abs(poles.real) <= 1e-4 * np.abs(poles) + 1e-9 * np.max(np.abs(poles))
        crossings = np.unique(np.abs(poles[close].imag))
        omega = np.concatenate([[0.0], crossings, 0.5 * (crossings[1:] + crossings[:-1])])
        gain = self._remaining(omega)
        if gain.size and np.max(gain) >= gamma * (1.0 + 1e-9):
            return self._refuted(f"gain {np.max(gain):.6g} at one frequency, whatever u does")
        return self._nothing("Hamiltonian eigenvalues on the axis")


def remaining_gain(matrices: tuple[Array, Array, Array, Array, Array, Array], s: NDArray[Any]) -> Array:
    r"""Smallest gain over all u at points of the plane, :math:`\min_Q \bar\sigma(P_{11}(s) + P_{12}(s) Q)`: (N,).

    Zero at (and near) poles of the plant.
    """
    A, B1, B2, C1, D11, D12 = matrices
    n, n_w = A.shape[0], B1.shape[1]
    poles = np.linalg.eigvals(A) if n else np.zeros(0, dtype=complex)
    out = np.zeros(s.size)
    for k, point in enumerate(s):
        if np.min(np.abs(point - poles), initial=np.inf) <= 1e-7 * max(abs(point), 1e-12):
            continue
        values = np.hstack([D11, D12]) + C1 @ np.linalg.solve(point * np.eye(n) - A, np.hstack([B1, B2]))
        U, sigma, _ = np.linalg.svd(values[:, n_w:])
        # every input that acts at all may be used, however weak it is: then little is known of what remains
        rank = sigma.size if np.any(values[:, n_w:]) else 0
        if rank < U.shape[0] and (rank == 0 or sigma[-1] > 0.0):
            direct = values[:, :n_w]
            gain = float(np.linalg.norm(U[:, rank:].conj().T @ direct, 2))
            weakest = float(sigma[0] / sigma[-1]) if rank else 1.0
            error = ROUNDING * float(np.linalg.norm(direct, 2)) * weakest
            out[k] = max(gain - error, 0.0) if error < 1e-3 * gain else 0.0
    return out


def coupling(control: SideSolution, estimation: SideSolution, gamma: float) -> bool:
    r"""True if :math:`\rho(X Y) > \gamma^2`, beyond the estimated errors."""
    X, Y = control.X, estimation.X
    if X.size == 0:
        return False
    eigenvalues, vectors = np.linalg.eigh(X)
    root = vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    product = root.T @ Y @ root
    radius = float(np.max(np.linalg.eigvalsh(0.5 * (product + product.T))))
    size = float(np.linalg.norm(X, 2)), float(np.linalg.norm(Y, 2))
    error = control.error * size[1] + estimation.error * size[0] + 1e-14 * size[0] * size[1]
    return radius - error > gamma**2


def reached(control: SideSolution, estimation: SideSolution, gamma: float) -> bool:
    """True if both equations are solved and the coupling is fine: some controller reaches the level."""
    solved = not (control.refuted or estimation.refuted or control.reason or estimation.reason)
    if not solved:
        return False
    return not coupling(replace(control, error=-control.error), replace(estimation, error=-estimation.error), gamma)


def _reachable(A: Array, B: Array) -> Array:
    """Orthonormal basis of the subspace that inputs B reach."""
    basis = scipy.linalg.orth(B, rcond=RANK)
    new = basis
    size = max(float(np.linalg.norm(A, 2)), 1e-300)
    while new.shape[1] and basis.shape[1] < A.shape[0]:
        step = A @ new
        for _ in range(2):
            step = step - basis @ (basis.T @ step)
        U, s, _ = np.linalg.svd(step, full_matrices=False)
        # nearly nothing is neglected: with a direction too many less is claimed, with one too few too much
        new = U[:, s > 1e-14 * size]
        basis = np.hstack([basis, new])[:, : A.shape[0]]
    return np.asarray(basis)


def _balanced(H: Array) -> tuple[Array, Array]:
    """H scaled by a diagonal symplectic matrix of powers of two, and d with X = diag(d) X_scaled diag(d)."""
    n = H.shape[0] // 2
    size = np.abs(H)
    np.fill_diagonal(size, 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # extreme scales do not fit an index that is not used here
        _, (scale, _) = scipy.linalg.matrix_balance(size, separate=True, permute=False)
    exponent = np.round(0.5 * (np.log2(scale[n:]) - np.log2(scale[:n])))
    d = np.exp2(np.clip(exponent, -100, 100))
    both = np.concatenate([d, 1.0 / d])
    return np.asarray(H * both[:, None] / both), d


def _schur_eigenvalues(T: Array) -> np.ndarray:
    """Eigenvalues of a real Schur form, without a second iteration."""
    n = T.shape[0]
    out = np.diagonal(T).astype(complex)
    for k in np.flatnonzero(np.diagonal(T, -1)) if n > 1 else []:
        out[k : k + 2] = np.linalg.eigvals(T[k : k + 2, k : k + 2])
    return np.asarray(out)


def _refined(F: Array, S: Array, Q: Array, X: Array) -> tuple[Array, float]:
    """Two Newton steps on the Riccati equation; the size of the last one estimates the error."""
    error = np.inf
    for _ in range(2):
        residual = F.T @ X + X @ F - X @ S @ X + Q
        closed = F - S @ X
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a nearly singular equation shows in the error
            step = scipy.linalg.solve_continuous_lyapunov(closed.T, -residual)
        if not np.all(np.isfinite(step)):
            raise np.linalg.LinAlgError("Newton step")
        error = float(np.linalg.norm(step, 2))
        X = X + 0.5 * (step + step.T)
    if np.max(np.linalg.eigvals(F - S @ X).real) >= 0.0:
        raise np.linalg.LinAlgError("not stabilising")
    return X, error
