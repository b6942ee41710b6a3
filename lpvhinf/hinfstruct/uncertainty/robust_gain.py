r"""The largest gain of a loop over all dynamic uncertainty of size one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.norm import exact_norm
from lpvhinf.hinfstruct.peaks import frequency_grid
from lpvhinf.hinfstruct.response import Complex, Response

#: Golden section over the logarithm of the scaling.
STEPS = 60
#: Its range above the smallest feasible scaling, natural logarithm.
RANGE = (-18.0, 25.0)
#: Local maxima over frequency that are refined.
REFINED = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class RobustGain:
    r"""The largest gain from w to z over :math:`\|\Delta\|_\infty \le 1`.

    Attributes
    ----------
    gain : float
        Infinite where the loop is not robustly stable. The bound at each frequency is exact (one full block of
        uncertainty); its supremum is taken over a grid on the poles and refined at the peaks.
    omega : float
        rad/s, where it is attained.
    scaling : float
        d at that frequency, see `robust_gain`.
    nominal : float
        Exact norm from w to z for Delta = 0.
    stability : float
        Exact norm from d to q: the loop is stable for all :math:`\|\Delta\|_\infty` below its reciprocal.
    """

    gain: float
    omega: float
    scaling: float
    nominal: float
    stability: float

    @property
    def robustly_stable(self) -> bool:
        """Whether the loop is stable for every Delta of size one."""
        return self.stability < 1.0


def robust_gain(A: Array, B: Array, C: Array, D: Array, *, n_d: int, n_q: int) -> RobustGain:
    r"""The robust gain of a closed loop whose first inputs d and outputs q belong to :math:`\Delta`.

    With :math:`M = [[M_{11}, M_{12}], [M_{21}, M_{22}]]` from (d, w) to (q, z) the gain at one frequency is

    .. math:: \min_{d > 0} \Big\{ \gamma : \bar\sigma\Big(
              \begin{bmatrix} d I & \\ & I \end{bmatrix} M
              \begin{bmatrix} d^{-1} I & \\ & \gamma^{-1} I \end{bmatrix}\Big) \le 1 \Big\},

    the scaled small gain, which is tight for one full block of uncertainty and the performance block. Its square
    is convex in :math:`d^2`.

    Parameters
    ----------
    A, B, C, D : closed loop, stable
    n_d, n_q : int
        Inputs and outputs that belong to Delta.

    References
    ----------
    Packard and Doyle (1993), Automatica 29, 71-109; Zhou, Doyle and Glover, Robust and Optimal Control (1996),
    chapter 11.

    Examples
    --------
    For q = 0.5 (d + w), z = d + w: z = w / (1 - 0.5 Delta), at most 2.

    >>> none = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0))
    >>> found = robust_gain(*none, np.array([[0.5, 0.5], [1.0, 1.0]]), n_d=1, n_q=1)
    >>> round(found.gain, 6), found.nominal, found.stability
    (2.0, 1.0, 0.5)
    """
    T = Response(A, B, C, D)
    nominal = exact_norm(A, B[:, n_d:], C[n_q:], D[n_q:, n_d:]).norm
    around = exact_norm(A, B[:, :n_d], C[:n_q], D[:n_q, :n_d])
    if not around.norm < 1.0:
        return RobustGain(gain=np.inf, omega=around.omega, scaling=np.nan, nominal=nominal, stability=around.norm)
    peaks = np.array([w for w in (around.omega,) if np.isfinite(w)])
    omega = frequency_grid(T.poles, peaks)
    gains, scalings = gains_at(T.at(omega), n_d, n_q)
    best = int(np.argmax(gains))
    top, where, scaling = float(gains[best]), float(omega[best]), float(scalings[best])
    inner = np.arange(1, len(omega) - 2)
    local = inner[(gains[inner] >= gains[inner - 1]) & (gains[inner] >= gains[inner + 1])]
    for k in local[np.argsort(-gains[local])][:REFINED]:
        low, high = np.log(max(omega[k - 1], 1e-3 * omega[k])), np.log(omega[k + 1])
        run = scipy.optimize.minimize_scalar(
            lambda x: -float(gains_at(T.at(np.exp([x])), n_d, n_q)[0][0]),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-6 * (high - low)},
        )
        if -run.fun > top:
            value, d = gains_at(T.at(np.exp([run.x])), n_d, n_q)
            top, where, scaling = float(value[0]), float(np.exp(run.x)), float(d[0])
    return RobustGain(gain=top, omega=where, scaling=scaling, nominal=nominal, stability=around.norm)


def gains_at(M: Complex, n_d: int, n_q: int) -> tuple[Array, Array]:
    """Robust gains of a stack (N, ., .) of matrices, and their scalings d: (N,), (N,); infinite where not stable."""
    N = len(M)
    M11, M21 = M[:, :n_q, :n_d], M[:, n_q:, :n_d]
    gap = np.eye(n_d) - M11.conj().transpose(0, 2, 1) @ M11
    stable = np.linalg.eigvalsh(gap)[:, 0] > 0.0
    gains, scalings = np.full(N, np.inf), np.full(N, np.nan)
    if not np.any(stable):
        return gains, scalings
    M, M21, gap = M[stable], M21[stable], gap[stable]
    # smallest feasible d^2: the largest root x of det(x gap - M21^* M21)
    L = np.linalg.cholesky(gap)
    half = np.linalg.solve(L, M21.conj().transpose(0, 2, 1))
    least = np.linalg.eigvalsh(half @ half.conj().transpose(0, 2, 1))[:, -1]
    least = np.maximum(least, 1e-16 * np.maximum(np.max(np.abs(M), axis=(1, 2)) ** 2, 1e-300))
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    low, high = np.full(len(M), RANGE[0]), np.full(len(M), RANGE[1])

    def square(t: Array) -> Array:
        return _scaled_square(M, least * (1.0 + np.exp(t)), n_d, n_q)

    a, b = high - golden * (high - low), low + golden * (high - low)
    f_a, f_b = square(a), square(b)
    for _ in range(STEPS):
        left = f_a <= f_b
        low, high = np.where(left, low, a), np.where(left, b, high)
        new = np.where(left, high - golden * (high - low), low + golden * (high - low))
        f_new = square(new)
        a, b = np.where(left, new, b), np.where(left, a, new)
        f_a, f_b = np.where(left, f_new, f_b), np.where(left, f_a, f_new)
    t = np.where(f_a <= f_b, a, b)
    gains[stable], scalings[stable] = np.sqrt(np.minimum(f_a, f_b)), np.sqrt(least * (1.0 + np.exp(t)))
    return gains, scalings


def _scaled_square(M: Complex, x: Array, n_d: int, n_q: int) -> Array:
    r"""Smallest :math:`\gamma^2` for :math:`d^2 = x`; with columns a, b it is the norm of b^* (I - a a^*)^-1 b."""
    root = np.sqrt(x)[:, None, None]
    a = np.concatenate([M[:, :n_q, :n_d], M[:, n_q:, :n_d] / root], axis=1)
    b = np.concatenate([M[:, :n_q, n_d:] * root, M[:, n_q:, n_d:]], axis=1)
    # (I - a a^*)^-1 = I + a (I - a^* a)^-1 a^*
    gap = np.eye(n_d) - a.conj().transpose(0, 2, 1) @ a
    feasible = np.linalg.eigvalsh(gap)[:, 0] > 0.0
    gap[~feasible] = np.eye(n_d)
    c = a.conj().transpose(0, 2, 1) @ b
    form = b.conj().transpose(0, 2, 1) @ b + c.conj().transpose(0, 2, 1) @ np.linalg.solve(gap, c)
    return np.where(feasible, np.linalg.eigvalsh(form)[:, -1], np.inf)
