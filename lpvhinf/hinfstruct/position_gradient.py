"""The derivative of a peak gain of the closed loop with respect to the position."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.loop import LoopFactory, augmented_gain
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Step of the differences of a scheduled controller, relative to the width of the box.
STEP = 1e-5


def gain_at(structure: ControllerStructure, theta: Array, p: Array) -> Array:
    """The augmented gain [[A_K, B_K], [C_K, D_K]] at a position."""
    return augmented_gain(*structure.realize(theta, p))


def gain_slopes(structure: ControllerStructure, theta: Array, p: Array, box: Array) -> Array:
    """Its derivatives to the position by differences inside the box, (n_p, ., .); zeros if not scheduled."""
    out = []
    for axis, (low, high) in enumerate(box):
        above, below = p.copy(), p.copy()
        above[axis] = min(p[axis] + STEP * (high - low), high)
        below[axis] = max(p[axis] - STEP * (high - low), low)
        change = gain_at(structure, theta, above) - gain_at(structure, theta, below)
        out.append(change / (above[axis] - below[axis]))
    return np.array(out)


def position_gradient(
    plant: GeneralizedPlant, slopes: Array, K: Array, K_slopes: Array, omega: float
) -> tuple[float, Array]:
    r"""The largest singular value of the loop at one frequency and its derivative to the position.

    With the whole matrix M(p) of the plant, closed by the augmented gain K(p), and the signals of the closed loop
    that the singular pair (u, v) excites,

    .. math:: \frac{\partial\bar\sigma}{\partial p_i} = \mathrm{Re}\left(
              \ell^* \frac{\partial M}{\partial p_i} r + \ell_K^* \frac{\partial K}{\partial p_i} r_K \right),

    r = (x, w, u) and l = (x, z, y) of the loop driven by v and of its adjoint driven by u. All derivatives come
    from one factorisation. Where the peak frequency moves with p this is the derivative of the norm as well.

    Parameters
    ----------
    plant : GeneralizedPlant
    slopes : (n_p, n_x + n_z + n_y, n_x + n_w + n_u)
    K, K_slopes : (n_K + n_u, n_K + n_y), (n_p, n_K + n_u, n_K + n_y)
    omega : float
        rad/s, may be infinity.

    Returns
    -------
    sigma : float
    gradient : (n_p,)
    """
    n_K = K.shape[0] - plant.n_u
    loop = LoopFactory(plant, n_K).close(K)
    if loop is None:
        return np.inf, np.zeros(len(slopes))
    n = loop.A.shape[0]
    if np.isfinite(omega) and n:
        factor = scipy.linalg.lu_factor(1j * omega * np.eye(n) - loop.A, overwrite_a=True, check_finite=False)
        RB = scipy.linalg.lu_solve(factor, loop.B.astype(complex), check_finite=False)
        u, sigma, v = _leading(loop.C @ RB + loop.D)
        x = RB @ v
        adjoint = scipy.linalg.lu_solve(factor, loop.C.T @ u.conj(), trans=1, check_finite=False)
    else:
        u, sigma, v = _leading(loop.D.astype(complex))
        x, adjoint = np.zeros(n, dtype=complex), np.zeros(n, dtype=complex)
    seen = loop.Ci @ x + loop.D21i @ v  # what the controller and its integrators see
    moved = adjoint @ loop.Bi + u.conj() @ loop.D12i  # what their outputs do to u^* T v
    right = np.concatenate([x[: plant.n_x], v, (K @ seen)[n_K:]])
    left = np.concatenate([adjoint[: plant.n_x], u.conj(), (moved @ K)[n_K:]])
    change = np.einsum("i,pij,j->p", left, slopes, right) + np.einsum("i,pij,j->p", moved, K_slopes, seen)
    return sigma, np.asarray(change.real)


def _leading(T: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    U, sigma, Vh = np.linalg.svd(T, full_matrices=False)
    return U[:, 0], float(sigma[0]), Vh[0].conj()
