"""Preserved and discarded flexible modes, and the static compliance that stands for the discarded ones."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array


def mode_dynamics(omega: Array, zeta: Array) -> Array:
    r"""The state matrix of independent modes, grouped per mode: state (eta_1, eta_1', eta_2, ...).

    Each block is :math:`\begin{bmatrix} 0 & 1 \\ -\omega_i^2 & -2\zeta_i\omega_i \end{bmatrix}`;
    a rigid-body mode has omega = 0.
    """
    n = len(omega)
    A = np.zeros((2 * n, 2 * n))
    position, velocity = np.arange(0, 2 * n, 2), np.arange(1, 2 * n, 2)
    A[position, velocity] = 1.0
    A[velocity, position] = -(omega**2)
    A[velocity, velocity] = -2.0 * zeta * omega
    return A


def compliance_correction(output_gains: Array, input_gains: Array, omega: Array) -> Array:
    r"""Static gain of discarded modes, the feed-through of eq. 9.

    .. math:: -C_d A_d^{-1} B_d = \sum_{i \in d} c_i b_i / \omega_i^2

    Parameters
    ----------
    output_gains : (N, n_y, n_d)
        Columns c_i of the discarded modes.
    input_gains : (N, n_d, n_u)
        Rows b_i.
    omega : (n_d,) [rad/s]
        All above zero: a rigid-body mode has no static gain.

    Returns
    -------
    (N, n_y, n_u)

    Examples
    --------
    >>> float(compliance_correction(np.ones((1, 1, 1)), np.ones((1, 1, 1)), np.array([2.0]))[0, 0, 0])
    0.25
    """
    return np.asarray((output_gains / omega**2) @ input_gains)
