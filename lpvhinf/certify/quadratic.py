r"""One Lyapunov matrix for the whole box, or multipliers that exclude it.

With :math:`M_k(P) = -(A_k' P + P A_k)` at positions p_k and :math:`W_k = L_k L_k'` the modal weights there,

.. math:: F(P) = \frac{1}{\beta} \log \sum_k \mathrm{tr} \exp(-\beta L_k^{-1} M_k L_k^{-T}) - \tau \log\det P

falls without bound where one P serves all positions. Where none does, F has a minimum, at which the derivatives
:math:`Z_k \ge 0` of the first term satisfy :math:`\sum_k (A_k Z_k + Z_k A_k') = \tau P^{-1} > 0`: no P > 0 can have
all :math:`M_k > 0`, as :math:`\sum_k \mathrm{tr}(Z_k M_k) = -\mathrm{tr}(P \sum_k (A_k Z_k + Z_k A_k')) < 0`.
The variable is :math:`R = M_0(P)` at the centre of the box, in which the problem is well conditioned.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from lpvhinf.certify.cells import Point, grid_points
from lpvhinf.certify.weights import blended_weight, lyapunov_values
from lpvhinf.checks import Array
from lpvhinf.statespace import LPVStateSpace

STAGES = ((8.0, 60), (32.0, 120), (128.0, 240))  # beta and the most steps with it
TAU = 1e-3
GROWN = 300.0  # size of the scaled R at which it is clear that F falls without bound
ROUNDS = 4  # searches, each with the worst positions of the last one added
ADDED = 6
WANTED = 0.05  # smallest scaled eigenvalue at the positions that ends the search: the rest is for between them


@dataclass(frozen=True, eq=False, kw_only=True)
class CommonLyapunov:
    """What the search for one P gave.

    Attributes
    ----------
    P : (n, n)
    margin : smallest eigenvalue of the scaled M_k at the positions; above 0 where P serves them
    positions : p_k
    multipliers : (N, n, n) Z_k
    """

    P: Array
    margin: float
    positions: list[Point]
    multipliers: Array


def common_lyapunov(
    system: LPVStateSpace, box: Array, decay: float, *, deadline: float | None = None
) -> CommonLyapunov | None:
    """Search one P for a grid of positions, and then for those it does not serve between them.

    None where an A is not Hurwitz or has no modal form.
    """
    n_p = len(box)
    points = grid_points(n_p, {1: 8, 2: 4}.get(n_p, 2) if system.n_x <= 20 else {1: 8, 2: 2}.get(n_p, 1))
    finer = grid_points(n_p, {1: 128, 2: 16}.get(n_p, 4))
    start: Array | None = None
    found: CommonLyapunov | None = None
    for _ in range(ROUNDS):
        problem = _problem(system, box, decay, points)
        if problem is None:
            return found
        found = _search(problem, points, start, deadline)
        if found.margin <= 0.0 or (deadline is not None and time.monotonic() > deadline):
            break
        start = found.P
        A = system.A.sample(np.array([point.rounded(box) for point in finer])) + decay * np.eye(system.n_x)
        margins = problem.margins_at(A, found.P)
        worst = [k for k in np.argsort(margins)[:ADDED] if margins[k] < 0.5 * WANTED and finer[k] not in points]
        if not worst:
            break
        points = points + [finer[k] for k in worst]
    return found


def _problem(system: LPVStateSpace, box: Array, decay: float, points: list[Point]) -> _Problem | None:
    n_p, n = len(box), system.n_x
    where = np.concatenate([box.mean(axis=1)[None], [point.rounded(box) for point in points]])
    A = system.A.sample(where) + decay * np.eye(n)
    slopes = np.stack([system.A.derivative(axis).sample(where) for axis in range(n_p)], axis=1)
    weight = blended_weight(where, A, slopes, 0.5 * (box[:, 1] - box[:, 0]))
    if weight is None or np.max(np.linalg.eigvals(A).real) >= 0.0:
        return None
    W = np.array([weight.at(p) for p in where])
    P = lyapunov_values(A, W)
    return None if P is None else _Problem(A[1:], W[1:], A[0], P.mean(axis=0))


def _search(problem: _Problem, points: list[Point], start: Array | None, deadline: float | None) -> CommonLyapunov:
    P = problem.first if start is None else start
    R = -(problem.A0.T @ P + P @ problem.A0)
    for beta, steps in STAGES:
        problem.beta = beta
        R = _descend(problem, R, steps, deadline)
        if problem.margin(R) >= WANTED or (deadline is not None and time.monotonic() > deadline):
            break
    return CommonLyapunov(
        P=problem.P(R), margin=problem.margin(R), positions=points, multipliers=problem.multipliers(R)
    )


class _Problem:
    """F as a function of R, a symmetric matrix in the coordinates in which W_0 is close to I."""

    def __init__(self, A: Array, weights: Array, A0: Array, first: Array) -> None:
        self.A, self.A0, self.first, self.beta = A, A0, first, STAGES[0][0]
        self.inverse = np.linalg.inv(np.linalg.cholesky(weights))
        values, self.V = np.linalg.eig(A0)
        self.left = np.linalg.inv(self.V)
        self.denominator = -(np.conj(values)[:, None] + values[None, :])
        self.scale = np.linalg.cholesky(weights.mean(axis=0))

    def P(self, R: Array) -> Array:
        """The solution of A_0'P + PA_0 = -R."""
        inner = (self.V.conj().T @ R @ self.V) / self.denominator
        P = (self.left.conj().T @ inner @ self.left).real
        return np.asarray(0.5 * (P + P.T))

    def _adjoint(self, G: Array) -> Array:
        inner = (self.left @ G @ self.left.conj().T) / self.denominator.conj()
        R = (self.V @ inner @ self.V.conj().T).real
        return np.asarray(0.5 * (R + R.T))

    def _spectra(self, P: Array) -> tuple[Array, Array]:
        M = -(np.swapaxes(self.A, 1, 2) @ P + P @ self.A)
        M = self.inverse @ M @ np.swapaxes(self.inverse, 1, 2)
        values, vectors = np.linalg.eigh(0.5 * (M + np.swapaxes(M, 1, 2)))
        return values, vectors

    def margins_at(self, A: Array, P: Array) -> Array:
        """Smallest scaled eigenvalue at other positions."""
        inverse = np.linalg.inv(self.scale)
        M = -inverse @ (np.swapaxes(A, 1, 2) @ P + P @ A) @ inverse.T
        values = np.linalg.eigvalsh(0.5 * (M + np.swapaxes(M, 1, 2)))
        return np.asarray(values[:, 0] / max(float(np.mean(np.abs(values))), 1e-300))

    def margin(self, R: Array) -> float:
        """Smallest scaled eigenvalue, relative to the mean one."""
        values, _ = self._spectra(self.P(R))
        return float(values.min() / max(float(np.mean(np.abs(values))), 1e-300))

    def multipliers(self, R: Array) -> Array:
        """Z_k, of trace one in all."""
        values, vectors = self._spectra(self.P(R))
        share = np.exp(-self.beta * (values - values.min()))
        share /= share.sum()
        F = np.swapaxes(self.inverse, 1, 2) @ vectors
        return np.asarray((F * share[:, None, :]) @ np.swapaxes(F, 1, 2))

    def value(self, R: Array) -> tuple[float, Array]:
        """F and its gradient; infinite where P is not positive definite."""
        P = self.P(R)
        try:
            L = np.linalg.cholesky(P)
        except np.linalg.LinAlgError:
            return np.inf, np.zeros_like(R)
        values, _ = self._spectra(P)
        least = values.min()
        total = np.log(np.sum(np.exp(-self.beta * (values - least)))) / self.beta - least
        Z = self.multipliers(R)
        slope = (self.A @ Z + Z @ np.swapaxes(self.A, 1, 2)).sum(axis=0)
        inverse = np.linalg.inv(L)
        slope -= TAU * inverse.T @ inverse
        value = float(total - 2.0 * TAU * np.sum(np.log(np.diag(L))))
        return value, self._adjoint(slope)


def _descend(problem: _Problem, start: Array, steps: int, deadline: float | None) -> Array:
    """L-BFGS with backtracking, in the coordinates of `problem.scale`."""
    L, n = problem.scale, len(start)
    Li = np.linalg.inv(L)

    def value(x: Array) -> tuple[float, Array]:
        f, g = problem.value(L @ x.reshape(n, n) @ L.T)
        return f, (L.T @ g @ L).ravel()

    x = (Li @ start @ Li.T).ravel()
    x /= max(float(np.linalg.norm(x)) / np.sqrt(n), 1e-300)
    f, g = value(x)
    pairs: list[tuple[Array, Array]] = []
    for _ in range(steps):
        if not np.isfinite(f) or (deadline is not None and time.monotonic() > deadline):
            break
        if float(np.linalg.norm(x)) > GROWN * np.sqrt(n):
            break  # F has no minimum: P serves the positions, and only grows
        if np.linalg.norm(g) < 1e-7 or problem.margin(L @ x.reshape(n, n) @ L.T) >= WANTED:
            break
        direction = _two_loop(g, pairs)
        if direction @ g >= 0.0:
            direction, pairs = -g, []
        step, found = 1.0 if pairs else min(1.0, 1.0 / float(np.linalg.norm(g))), False
        for _ in range(25):
            trial = x + step * direction
            if float(np.linalg.norm(trial)) > 10.0 * GROWN * np.sqrt(n):
                step *= 0.4
                continue
            f_new, g_new = value(trial)
            if np.isfinite(f_new) and f_new <= f + 1e-4 * step * float(direction @ g):
                found = True
                break
            step *= 0.4
        if not found:
            break
        s, y = trial - x, g_new - g
        if s @ y > 1e-12 * float(np.linalg.norm(s) * np.linalg.norm(y)):
            pairs = (pairs + [(s, y)])[-20:]
        x, f, g = trial, f_new, g_new
    return np.asarray(L @ x.reshape(n, n) @ L.T)


def _two_loop(g: Array, pairs: list[tuple[Array, Array]]) -> Array:
    q = g.copy()
    shares = []
    for s, y in reversed(pairs):
        a = float(s @ q) / float(s @ y)
        shares.append(a)
        q -= a * y
    if pairs:
        s, y = pairs[-1]
        q *= float(s @ y) / float(y @ y)
    for (s, y), a in zip(pairs, reversed(shares)):
        q += (a - float(y @ q) / float(s @ y)) * s
    return -q
