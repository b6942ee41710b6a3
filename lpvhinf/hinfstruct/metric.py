"""The size of a change of the controller, measured by what it does to the loop."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.response import Response

#: Smallest eigenvalue of a metric, relative to the mean one.
FLOOR = 1e-9
#: A pole with less damping, or slower than this part of the plant's fastest pole, is at risk.
OFF_AXIS, SLOW = 0.02, 1e-3


def loop_metric(loop: ClosedLoop, response: Response, omega: Array, dK: Array, scale: float) -> Array:
    r"""Metric M with :math:`d^T M d = \sum_k \|\hat N(s_k) \hat\Delta\|_F^2 + \|\hat\Delta \hat N(s_k)\|_F^2`.

    A change :math:`\Delta = \sum_i d_i \Delta_i` of the controller turns the response into
    :math:`T + L \Delta (I - N \Delta)^{-1} Q`: where :math:`N \Delta` is small the change is nearly linear, and below
    one at every frequency the loop stays stable. Steps of equal size in M are therefore
    equally trustworthy, whatever the units of u, y and the states, and however large the gain is already. For
    that the channels of N are scaled to equal sizes (:math:`\hat N = R^{-1} N C^{-1}, \hat\Delta = C \Delta R`).
    The points s_k lie a little right of the axis: poles on the verge of instability are left to constraints of their
    own.

    Parameters
    ----------
    loop : ClosedLoop
    response : Response
        Of the same loop.
    omega : (N,)
        Finite frequencies, rad/s; those of the peaks.
    dK : (m, n_K + n_u, n_K + n_y)
        Directions of the augmented gain.
    scale : float
        Size of the fastest pole of the plant, rad/s.

    Returns
    -------
    (m, m), positive semidefinite
    """
    n = loop.A.shape[0]
    if n == 0 or response.right is None or response.left is None:
        sizes = np.linalg.norm(dK.reshape(dK.shape[0], -1), axis=1)
        return np.diag(np.maximum(sizes, 1e-12) ** 2)
    poles = response.poles[response.poles.imag >= 0.0]
    size = np.abs(poles)
    low, high = max(float(np.min(size)), 1e-9 * float(np.max(size))), float(np.max(size))
    grid = np.concatenate([[0.0], np.abs(poles.imag), size, np.geomspace(0.3 * low + 1e-12, 3.0 * high + 1e-12, 12)])
    grid = np.concatenate([grid, omega[np.isfinite(omega)]])
    points = OFF_AXIS * grid + SLOW * scale + 1j * grid
    left, right = response.left @ loop.Bi, loop.Ci @ response.right
    N = (right * (1.0 / (points[:, None] - response.poles))[:, None, :]) @ left + loop.D22i
    r, c = channel_sizes(np.sum(N.real**2 + N.imag**2, axis=0))
    N = N / (r[:, None] * c)
    dK = dK * (c[:, None] * r)
    rows, columns = N.reshape(-1, N.shape[2]), N.transpose(1, 0, 2).reshape(N.shape[1], -1)
    SL, SR = (rows.conj().T @ rows).real, (columns @ columns.conj().T).real
    flat = dK.reshape(dK.shape[0], -1)
    moved = np.matmul(SL, dK) + np.matmul(dK, SR)
    return np.asarray(flat @ moved.reshape(flat.shape).T)


def channel_sizes(P: Array, rounds: int = 20) -> tuple[Array, Array]:
    """Sizes r of the rows and c of the columns, so that the rows and columns of P / (r^2 c^2) have like sums.

    The alternating scaling of Sinkhorn and Knopp; channels that are zero keep the size of the others.
    """
    floor = max(float(np.max(P)), 1e-300) * 1e-14
    P = P + floor
    r2, c2 = np.ones(P.shape[0]), np.ones(P.shape[1])
    for _ in range(rounds):
        r2 = np.mean(P / c2, axis=1)
        c2 = np.mean(P / r2[:, None], axis=0)
    return np.sqrt(r2), np.sqrt(c2)


def unit_steps(M: Array) -> Array:
    """F with F^T M F = I: columns are steps of unit size in the metric, flat directions bounded."""
    mean = max(float(np.trace(M)) / M.shape[0], 1e-300)
    eigenvalues, vectors = scipy.linalg.eigh(0.5 * (M + M.T) / mean)
    return np.asarray(vectors / np.sqrt(np.maximum(eigenvalues, FLOOR) * mean))
