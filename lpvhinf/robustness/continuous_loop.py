"""Perturbed plants with a delay at their inputs, in continuous time."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.robustness.closed_loop import SystemStack
from lpvhinf.robustness.perturbed_plant import ModalStack
from lpvhinf.shaping import pade_delay


def continuous_plant(modes: ModalStack, *, n_u: int, n_rb: int, delay: float, delay_order: int) -> SystemStack:
    r"""From (u, w3) to y: u passes a Padé approximation of the delay, the modal forces w3 do not.

    The first 2 n_modes states are those of the plant, grouped per mode, followed by those of the delay.

    Parameters
    ----------
    modes : ModalStack
    n_u : int
        The controller drives the first n_u inputs.
    n_rb : int
        Inputs from n_rb on take w3 as well.
    delay : float [s]
    delay_order : int
    """
    N, n_modes = modes.omega.shape
    A, B, C = _modal_matrices(modes)
    direct, force = B[:, :, :n_u], B[:, :, n_rb:]
    D, D_w = modes.D[:, :, :n_u], modes.D[:, :, n_rb:]
    if delay == 0.0:
        return SystemStack(A=A, B=np.concatenate([direct, force], axis=2), C=C, D=np.concatenate([D, D_w], axis=2))
    a, b, c, d = pade_delay(delay, delay_order, n_u)
    n, n_d = 2 * n_modes, len(a)
    joined = np.zeros((N, n + n_d, n + n_d))
    joined[:, :n, :n], joined[:, n:, n:], joined[:, :n, n:] = A, a, direct @ c
    inputs = np.zeros((N, n + n_d, n_u + force.shape[2]))
    inputs[:, :n, :n_u], inputs[:, n:, :n_u], inputs[:, :n, n_u:] = direct @ d, b, force
    return SystemStack(
        A=joined,
        B=inputs,
        C=np.concatenate([C, D @ c], axis=2),
        D=np.concatenate([D @ d, D_w], axis=2),
    )


def _modal_matrices(modes: ModalStack) -> tuple[Array, Array, Array]:
    """A (N, 2 n, 2 n), B (N, 2 n, n_in) and C (N, n_out, 2 n) of the states (eta, eta' / rate), grouped per mode."""
    N, n = modes.omega.shape
    position, velocity = np.arange(0, 2 * n, 2), np.arange(1, 2 * n, 2)
    A = np.zeros((N, 2 * n, 2 * n))
    A[:, position, velocity] = modes.rate
    A[:, velocity, position] = -(modes.omega**2) / modes.rate
    A[:, velocity, velocity] = -2.0 * modes.zeta * modes.omega
    B = np.zeros((N, 2 * n, modes.B.shape[2]))
    B[:, velocity] = modes.B / modes.rate[:, None]
    C = np.zeros((N, modes.C.shape[1], 2 * n))
    C[:, :, position] = modes.C
    return A, B, C
