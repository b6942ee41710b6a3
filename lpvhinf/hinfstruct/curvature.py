"""Second derivatives of peak gains, the peak's frequency moving along."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.response import Complex


def log_gain_hessian(loop: ClosedLoop, omega: float, c: Complex, dK: Array, offset: float = 0.0) -> tuple[Array, Array]:
    r"""Hessian of log(peak gain + offset) for a controller gain that moves along given matrices.

    In the direction c of a cluster of r singular values the gain is the eigenvalue
    :math:`\lambda` of the Hermitian dilation :math:`H = [[0, T], [T^*, 0]]`, and

    .. math:: \lambda'' = z^* (\lambda I - H)^{\dagger} z + 2\, \mathrm{Re}\, u^* L \Delta N \Delta Q v, \quad
              z = (L \Delta Q v,\; Q^* \Delta^T L^* u)

    with the cluster itself left out of the pseudo-inverse: its coupling is described by
    the cuts. Where :math:`\omega` is a proper maximum of a single singular value the curvature
    :math:`-\sigma_{\theta\omega} \sigma_{\omega\omega}^{-1} \sigma_{\omega\theta}` of the moving peak is added.

    Parameters
    ----------
    loop : ClosedLoop
    omega : float
        rad/s, may be infinity.
    c : (r,) complex
        Unit vector over the r largest singular values.
    dK : (m, n_K + n_u, n_K + n_y)
        Directions of the augmented gain.
    offset : float

    Returns
    -------
    hessian : (m, m), of log(sigma + offset) for K + sum_k d_k dK_k
    weight : (n_K + n_u, n_K + n_y), gradient in K, for the second derivative of K itself
    """
    n = loop.A.shape[0]
    moving = bool(np.isfinite(omega) and omega > 0.0 and n)
    if np.isfinite(omega) and n:
        factor = scipy.linalg.lu_factor(1j * omega * np.eye(n) - loop.A, overwrite_a=True, check_finite=False)
        X = scipy.linalg.lu_solve(factor, np.hstack([loop.B, loop.Bi]).astype(complex), check_finite=False)
        X1, Xi = X[:, : loop.B.shape[1]], X[:, loop.B.shape[1] :]
        T, L = loop.C @ X1 + loop.D, loop.C @ Xi + loop.D12i
        Q, N = loop.Ci @ X1 + loop.D21i, loop.Ci @ Xi + loop.D22i
    else:
        T, L, Q, N = (M.astype(complex) for M in (loop.D, loop.D12i, loop.D21i, loop.D22i))
    n_z = T.shape[0]
    U, sigma, Vh = np.linalg.svd(T)
    r = c.size
    u, v = U[:, :r] @ c, Vh[:r].conj().T @ c
    value = float(np.sum(np.abs(c) ** 2 * sigma[:r]))
    left, right = u.conj() @ L, Q @ v
    # eigenvectors of the dilation outside the cluster: (u, v) with sigma, (u, -v) with -sigma, null vectors with 0
    k = sigma.size
    bases, gaps = [], []
    for sign in (1.0, -1.0):
        first = r if sign > 0.0 else 0
        bases.append(np.vstack([U[:, first:k], sign * Vh[first:k].conj().T]) / np.sqrt(2.0))
        gaps.append(value - sign * sigma[first:k])
    bases.append(np.vstack([U[:, k:], np.zeros((T.shape[1], U.shape[1] - k))]))
    bases.append(np.vstack([np.zeros((n_z, Vh.shape[0] - k)), Vh[k:].conj().T]))
    gaps.append(np.full(U.shape[1] - k + Vh.shape[0] - k, value))
    basis, gap = np.hstack(bases), np.concatenate(gaps)
    gap = np.where(np.abs(gap) > 1e-3 * value, gap, 1e-3 * value)

    # real products: numpy would turn all of dK into complex numbers
    dKq = (dK @ np.column_stack([right.real, right.imag])) @ np.array([1.0, 1j])
    dKl = np.array([1.0, 1j]) @ (np.vstack([left.real, left.imag]) @ dK)
    Z = np.hstack([dKq @ L.T, (dKl @ Q).conj()]) @ basis.conj()
    hessian = ((Z.conj() / gap) @ Z.T).real
    mixed = dKl @ (N @ dKq.T)
    hessian = hessian + (mixed + mixed.T).real
    gradient = (dKq @ left).real
    if moving and r == 1:
        W = scipy.linalg.lu_solve(factor, np.column_stack([X1 @ v, X1]), check_finite=False)
        X2v, X2 = W[:, 0], W[:, 1:]
        y = scipy.linalg.lu_solve(factor, (loop.C.T @ u.conj()).astype(complex), trans=1, check_finite=False)
        y2 = scipy.linalg.lu_solve(factor, y, trans=1, check_finite=False)
        dT = -1j * (loop.C @ X2)
        z = np.concatenate([dT @ v, dT.conj().T @ u]) @ basis.conj()
        # T'' = -2 C R^3 B, L' = -j C R^2 Bi, Q' = -j Ci R^2 B
        bend = float(np.sum(np.abs(z) ** 2 / gap)) - 2.0 * float((y @ X2v).real)
        coupling = ((Z.conj() / gap) @ z).real
        coupling = coupling + (-1j * (dKq @ (y2 @ loop.Bi)) - 1j * (dKl @ (loop.Ci @ X2v))).real
        slope = float((u.conj() @ dT @ v).real)
        if bend < 0.0 and abs(slope) < 1e-3 * np.sqrt(-bend * value):
            hessian = hessian - np.outer(coupling, coupling) / bend
    size = value + offset
    gradient = gradient / size
    return hessian / size - np.outer(gradient, gradient), np.outer(left, right).real / size
