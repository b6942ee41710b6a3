"""K_FM: band-pass filters that turn estimated modal velocities into damping forces."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive


def band_pass(omega: ArrayLike, Q: float) -> tuple[Array, Array, Array, Array]:
    r"""The band-pass filters of K_FM (eq. 11), one per controlled mode, without their gains xi_i.

    .. math:: H_i(s) = \frac{(\omega_i/Q)\, s}{s^2 + (\omega_i/Q)\, s + \omega_i^2}

    Parameters
    ----------
    omega : (n_flex,) [rad/s]
    Q : float
        Narrows (large) or broadens (small) the band.

    Returns
    -------
    (A, B, C, D) with 2 n_flex states, n_flex inputs and outputs.

    Examples
    --------
    >>> A, B, C, D = band_pass([2.0], Q=1.0)
    >>> float(abs(C @ np.linalg.inv(2j * np.eye(2) - A) @ B + D)[0, 0])  # 1 at resonance
    1.0
    """
    w, q = finite_array("omega", omega, (None,)), positive("Q", Q)
    n = len(w)
    blocks = [np.array([[-x / q, -x], [x, 0.0]]) for x in w]
    A = scipy.linalg.block_diag(*blocks) if n else np.zeros((0, 0))
    B, C = np.zeros((2 * n, n)), np.zeros((n, 2 * n))
    B[2 * np.arange(n), np.arange(n)] = w / q
    C[np.arange(n), 2 * np.arange(n)] = 1.0
    return A, B, C, np.zeros((n, n))


def velocity_selection(n_rb: int, n_flex: int) -> Array:
    """Psi: the rows that pick the velocities of the flexible modes out of the observer's state.

    The state is grouped per mode, rigid-body modes first: (n_flex, 2 (n_rb + n_flex)).
    """
    psi = np.zeros((n_flex, 2 * (n_rb + n_flex)))
    psi[np.arange(n_flex), 2 * (n_rb + np.arange(n_flex)) + 1] = 1.0
    return psi
