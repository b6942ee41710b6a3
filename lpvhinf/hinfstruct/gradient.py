"""Peak gains and their derivatives with respect to the augmented controller gain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.response import Complex


@dataclass(frozen=True, slots=True, eq=False)
class PeakGain:
    r"""Near-maximal singular values at one frequency, with their sensitivities.

    For a unit vector c over the r singular values the function
    :math:`\mathrm{Re}\,(Uc)^* T (Vc)` is at most the largest singular value, and equal to it at
    :math:`c = e_1`; its derivative with respect to :math:`\bar K` is
    :math:`\mathrm{Re}\,(\text{left}^T \bar c)(\text{right}\, c)^T`.

    Attributes
    ----------
    omega : float
    sigma : (r,) the near-maximal singular values, descending
    left : (r, n_K + n_u), U^* L
    right : (n_K + n_y, r), Q V
    """

    omega: float
    sigma: Array
    left: Complex
    right: Complex

    def value(self, c: Complex) -> float:
        """The gain in the direction c."""
        return float(np.sum(np.abs(c) ** 2 * self.sigma))

    def gradient(self, c: Complex) -> Array:
        """Derivative of the gain in the direction c, (n_K + n_u, n_K + n_y)."""
        return np.asarray(np.outer(c.conj() @ self.left, self.right @ c).real)


def peak_gain(loop: ClosedLoop, omega: float, cluster: float = 0.0, most: int = 4) -> PeakGain:
    """Gain and sensitivities at one frequency by a direct solve.

    Parameters
    ----------
    loop : ClosedLoop
    omega : float
        rad/s, may be infinity.
    cluster : float
        Singular values down to (1 - cluster) times the largest are kept, `most` of them at most.
    """
    if np.isfinite(omega) and loop.A.shape[0]:
        # LAPACK at once: the checks of a wrapper cost as much as the factors of a small loop
        lu, pivots, _ = lapack.zgetrf(1j * omega * np.eye(loop.A.shape[0]) - loop.A, overwrite_a=True)
        RB = lapack.zgetrs(lu, pivots, loop.B.astype(complex))[0]
        T = loop.C @ RB + loop.D
        U, sigma, V, r = _near_maximal(T, cluster, most)
        CR = lapack.zgetrs(lu, pivots, (loop.C.T @ U.conj()).astype(complex), trans=1)[0].T
        return PeakGain(omega, sigma[:r], CR @ loop.Bi + U.conj().T @ loop.D12i, loop.Ci @ (RB @ V) + loop.D21i @ V)
    U, sigma, V, r = _near_maximal(loop.D.astype(complex), cluster, most)
    return PeakGain(omega, sigma[:r], U.conj().T @ loop.D12i, loop.D21i @ V)


def _near_maximal(T: Complex, cluster: float, most: int) -> tuple[Complex, Array, Complex, int]:
    U, sigma, Vh = np.linalg.svd(T, full_matrices=False)
    r = int(min(np.sum(sigma >= (1.0 - cluster) * sigma[0]), most))
    return U[:, :r], sigma, Vh[:r].conj().T, r
