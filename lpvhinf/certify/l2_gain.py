r"""The Lyapunov polynomial of a claim about the L2 gain, from Riccati equations.

With :math:`M = \begin{bmatrix} \gamma I & -D' \\ -D & \gamma I \end{bmatrix}^{-1}` the bounded-real inequality is

.. math:: A'P + PA + \begin{bmatrix} P B & C' \end{bmatrix} M \begin{bmatrix} B' P \\ C \end{bmatrix} < 0,

and P(p) solves it with :math:`-\varepsilon W(p)` on the right: all the slack lies along the weight W.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from lpvhinf.certify.global_lyapunov import GlobalLyapunov, constant_lyapunov
from lpvhinf.certify.rate import choose_weight, fitted, spread
from lpvhinf.certify.weights import BlendedWeight
from lpvhinf.checks import Array
from lpvhinf.statespace import LPVStateSpace

SLACK = 0.5  # share of the largest possible epsilon that is used
STEPS = 10  # bisections for the largest epsilon


@dataclass(frozen=True, eq=False, kw_only=True)
class Riccati:
    """A'X + XA + XGX + Q = 0 at one position."""

    A: Array
    G: Array
    Q: Array

    def residual(self, X: Array) -> Array:
        """The left-hand side."""
        return np.asarray(self.A.T @ X + X @ self.A + X @ self.G @ X + self.Q)


def riccati(A: Array, B: Array, C: Array, D: Array, gamma: float, extra: Array) -> Riccati | None:
    """The Riccati equation of the bound gamma with `extra` added to Q; None where gamma is not above D's norm."""
    n_u, n_y = B.shape[1], C.shape[0]
    M = np.block([[gamma * np.eye(n_u), -D.T], [-D, gamma * np.eye(n_y)]])
    if np.linalg.eigvalsh(M)[0] <= 0.0:
        return None
    M = np.linalg.inv(M)
    M11, M12, M22 = M[:n_u, :n_u], M[:n_u, n_u:], M[n_u:, n_u:]
    Q = C.T @ M22 @ C + extra
    return Riccati(A=A + B @ M12 @ C, G=B @ M11 @ B.T, Q=0.5 * (Q + Q.T))


def stabilizing(equation: Riccati) -> Array | None:
    """The stabilising solution, from the Hamiltonian matrix's stable subspace; None where there is none."""
    n = len(equation.A)
    H = np.block([[equation.A, equation.G], [-equation.Q, -equation.A.T]])
    try:
        _, Z, count = scipy.linalg.schur(H, sort="lhp")
        if count != n:
            return None
        X = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T)
    except np.linalg.LinAlgError:
        return None
    X = 0.5 * (X + X.T)
    return X if _solves(equation, X) else None


def _solves(equation: Riccati, X: Array) -> bool:
    size = np.linalg.norm(X @ equation.A) + np.linalg.norm(equation.Q) + np.linalg.norm(X @ equation.G @ X)
    closed = equation.A + equation.G @ X
    return bool(
        np.linalg.norm(equation.residual(X)) <= 1e-6 * size
        and np.linalg.eigvalsh(X)[0] > 0.0
        and np.max(np.linalg.eigvals(closed).real) < 0.0
    )


class BoundedReal:
    """Riccati solutions P(p) of a bound gamma, and the matrix of the inequality at sampled positions."""

    def __init__(self, system: LPVStateSpace, gamma: float, weight: BlendedWeight) -> None:
        self.system, self.gamma, self.weight = system, gamma, weight
        self.epsilon = 0.0

    def _equation(self, matrices: Sequence[Array], p: Array, epsilon: float) -> Riccati | None:
        A, B, C, D = matrices
        return riccati(A, B, C, D, self.gamma, epsilon * self.weight.at(p))

    def choose_epsilon(self, points: Array) -> bool:
        """Set epsilon to `SLACK` times the largest value that all `points` allow; False where none does."""
        samples = self.system.sample(points)
        allowed = np.inf
        for k, p in enumerate(points):
            matrices = [M[k] for M in samples]

            def solvable(epsilon: float, at: Array = p, given: Sequence[Array] = matrices) -> bool:
                equation = self._equation(given, at, epsilon)
                return equation is not None and stabilizing(equation) is not None

            if np.isfinite(allowed) and solvable(allowed):
                continue
            low, high = _bracket(solvable, allowed)
            if low == 0.0:
                return False
            for _ in range(STEPS):
                middle = np.sqrt(low * high)
                low, high = (middle, high) if solvable(middle) else (low, middle)
            allowed = low
        self.epsilon = SLACK * allowed
        return True

    def values(self, points: Array) -> Array | None:
        """P at positions (N, n_p)."""
        samples = self.system.sample(points)
        out = np.empty((len(points), self.system.n_x, self.system.n_x))
        for k, p in enumerate(points):
            equation = self._equation([M[k] for M in samples], p, self.epsilon)
            X = None if equation is None else stabilizing(equation)
            if X is None:
                return None
            out[k] = X
        return out

    def inequality(self, points: Array, P: Array) -> Array:
        """N at positions, (N, m, m)."""
        A, B, C, D = self.system.sample(points)
        At, Bt, Ct, Dt = (np.swapaxes(M, 1, 2) for M in (A, B, C, D))
        unit = np.eye(B.shape[2]), np.eye(C.shape[1])
        blocks = [
            [At @ P + P @ A, P @ B, Ct],
            [Bt @ P, np.broadcast_to(-self.gamma * unit[0], (len(P), *unit[0].shape)), Dt],
            [C, D, np.broadcast_to(-self.gamma * unit[1], (len(P), *unit[1].shape))],
        ]
        return np.asarray(-np.block(blocks))


def _bracket(solvable: object, start: float) -> tuple[float, float]:
    """Epsilon that works and one that does not, at most a factor of 100 apart; (0, 0) where nothing works."""
    assert callable(solvable)
    high = start if np.isfinite(start) else 1e12
    while high > 1e-24:
        low = high / 100.0
        if solvable(low):
            return low, high
        high = low
    return 0.0, 0.0


def gain_candidate(
    system: LPVStateSpace, box: Array, gamma: float, reach: Array, *, constant: bool = False
) -> GlobalLyapunov | None:
    """P(p) for the bound gamma; None where the Riccati equations have no solution at some position looked at."""
    speeds = np.where(reach > 0.0, reach, 1e-3 * (box[:, 1] - box[:, 0]))
    chosen = choose_weight(system, box, 0.0, speeds)
    if chosen is None:
        return None
    real = BoundedReal(system, gamma, chosen[0])
    if not real.choose_epsilon(np.concatenate([spread(box, 3, 1.0), spread(box, 2, 0.5)])):
        return None
    if constant:
        P = real.values(spread(box, 3, 0.97))
        return None if P is None else constant_lyapunov(P.mean(axis=0), len(box))
    return fitted(box, real.values, real.inequality, first=45)
