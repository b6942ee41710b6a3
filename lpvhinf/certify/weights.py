r"""Lyapunov matrices over the whole box from Lyapunov equations with a smooth weight.

.. math:: A(p)' P(p) + P(p) A(p) + 2 \alpha P(p) = -W(p)

P(p) is as smooth as A(p) and W(p), and a polynomial through its values at Chebyshev points is soon good enough. Which
W leaves room for dP/dt decides about success: W is blended from the modal forms of A at positions spread over the
box, in which lightly damped modes count on their own and everything else is one block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array

LIGHT = 0.03  # relative damping below which a mode gets a direction of its own


def modal_weight(A: Array, slopes: Array, light: float = LIGHT, room: float = 0.5) -> Array | None:
    """W = -(A'P + PA) with P a balanced modal metric of A; None where A is not Hurwitz or has no such form.

    Parameters
    ----------
    A : (n, n)
    slopes : (n_p, n, n)
        Its derivatives, for the balance of the modes.
    light : relative damping below which an eigenvalue counts as a mode of its own
    room : share of the decay of the other block that its metric is asked to keep
    """
    n = len(A)
    values, V = np.linalg.eig(A)
    if np.max(values.real) >= 0.0:
        return None
    own = [i for i in range(n) if values[i].imag > 0.0 and -values[i].real < light * abs(values[i])]
    own.sort(key=lambda i: abs(values[i]))
    try:
        L = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return None
    k = 2 * len(own)
    right = np.zeros((n, k))
    left = np.zeros((k, n))
    for j, i in enumerate(own):
        right[:, 2 * j], right[:, 2 * j + 1] = np.sqrt(2.0) * V[:, i].real, np.sqrt(2.0) * V[:, i].imag
        left[2 * j], left[2 * j + 1] = L[i].real, L[i].imag
    rest = np.linalg.svd(left)[2][k:].T if k else np.eye(n)
    T = np.concatenate([right, rest], axis=1)
    decays = np.repeat([-2.0 * values[i].real for i in own], 2)
    if n > k:
        metric = _block_metric((np.linalg.inv(T) @ A @ T)[k:, k:], room)
        if metric is None:
            return None
        T[:, k:] = rest @ metric[0]
        decays = np.concatenate([decays, np.full(n - k, metric[1])])
    S = np.linalg.inv(T)
    scale = 1.0 / np.sqrt(decays)
    coupling = scale[:, None] * np.abs(S @ slopes @ T).sum(axis=0) * scale
    blocks = [slice(2 * j, 2 * j + 2) for j in range(len(own))] + ([slice(k, n)] if n > k else [])
    g = _balance(np.array([[np.linalg.norm(coupling[a, b]) for b in blocks] for a in blocks]))
    for block, factor in zip(blocks, g):
        S[block] /= factor
    H = S @ A @ np.linalg.inv(S)
    W = -S.T @ (H + H.T) @ S
    return np.asarray(0.5 * (W + W.T))


def _block_metric(A: Array, room: float) -> tuple[Array, float] | None:
    """Coordinates in which a Hurwitz block is dissipative, and how much of its decay they show."""
    n = len(A)
    decay = 2.0 * room * float(np.min(-np.linalg.eigvals(A).real))
    shifted = A + 0.5 * decay * np.eye(n)
    try:
        reach = np.diag(scipy.linalg.solve_continuous_lyapunov(A, -np.eye(n)))
        P = scipy.linalg.solve_continuous_lyapunov(shifted.T, -np.diag(1.0 / np.maximum(reach, 1e-12)))
        R = np.linalg.cholesky(0.5 * (P + P.T)).T
        return np.linalg.inv(R), decay
    except np.linalg.LinAlgError:
        return None


def _balance(coupling: Array) -> Array:
    """Osborne's factors for a matrix of couplings between blocks."""
    H = coupling.copy()
    np.fill_diagonal(H, 0.0)
    g = np.ones(len(H))
    for _ in range(12):
        q = ((H.sum(axis=1) + 1e-12) / (H.sum(axis=0) + 1e-12)) ** 0.25
        H = H / q[:, None] * q
        g *= q
    return g


@dataclass(frozen=True, eq=False, kw_only=True)
class BlendedWeight:
    r"""W(p) = sum_k w_k(p) W_k with weights w_k proportional to a Gaussian about the centre of patch k.

    The blend is analytic in p, so that the Lyapunov matrix is soon well fitted by a polynomial.

    Attributes
    ----------
    centres : (N, n_p) in p
    matrices : (N, n, n), each of determinant one
    width : (n_p,) standard deviation of the Gaussians [unit of p]
    """

    centres: Array
    matrices: Array
    width: Array

    def at(self, p: Array) -> Array:
        """W(p)."""
        return np.asarray(np.tensordot(self._shares(p)[0], self.matrices, axes=1))

    def slopes(self, p: Array) -> Array:
        """(n_p, n, n) derivatives of W."""
        return np.asarray(np.tensordot(self._shares(p)[1].T, self.matrices, axes=1))

    def _shares(self, p: Array) -> tuple[Array, Array]:
        z = (p - self.centres) / self.width
        exponent = -0.5 * np.sum(z**2, axis=1)
        w = np.exp(exponent - np.max(exponent))
        w /= w.sum()
        slope = -z / self.width
        return w, w[:, None] * (slope - w @ slope)


def blended_weight(
    centres: Array, matrices: Array, slopes: Array, width: Array, light: float = LIGHT, room: float = 0.5
) -> BlendedWeight | None:
    """The blend of the modal weights at several positions; None where none of them has one.

    Parameters
    ----------
    matrices : (N, n, n) A at the centres
    slopes : (N, n_p, n, n)
    """
    where, weights = [], []
    for centre, A, derivative in zip(centres, matrices, slopes):
        W = modal_weight(A, derivative, light, room)
        if W is None:
            continue
        sign, size = np.linalg.slogdet(W)
        if sign > 0.0 and np.linalg.eigvalsh(W)[0] > 0.0:
            where.append(centre)
            weights.append(W / np.exp(size / len(W)))
    if not where:
        return None
    return BlendedWeight(centres=np.array(where), matrices=np.array(weights), width=width)


def lyapunov_values(matrices: Array, weights: Array) -> Array | None:
    """P at every position, (N, n, n), from A and W (N, n, n), or None where an A is not Hurwitz."""
    out = np.empty_like(matrices)
    for k, (A, W) in enumerate(zip(matrices, weights)):
        try:
            P = scipy.linalg.solve_continuous_lyapunov(A.T, -W)
        except np.linalg.LinAlgError:
            return None
        out[k] = 0.5 * (P + P.T)
        if np.linalg.eigvalsh(out[k])[0] <= 0.0:
            return None
    return out
