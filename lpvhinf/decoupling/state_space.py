"""The decoupled plant as a state space, with exact ones and zeros where the decoupling is exact."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.decoupling.partition import mode_dynamics
from lpvhinf.polynomial import ChebyshevMatrix, block
from lpvhinf.statespace.lpv import LPVStateSpace


def unit_inputs(flexible: ChebyshevMatrix, *, n_rb: int, n_flex: int, input_decoupling: str) -> ChebyshevMatrix:
    """B of all modes from that of the flexible ones; the decoupled modes have exact unit gains from their own inputs.

    Parameters
    ----------
    flexible : (n_modes - n_rb, n_rb + n_flex)
        Rows of preserved modes are replaced where they are known exactly.
    input_decoupling : "extended" or "rigid-body"
        With "rigid-body" the rigid inputs drive the preserved modes by what `flexible` says.
    """
    n_in, box = n_rb + n_flex, flexible.box
    keep = n_flex if input_decoupling == "extended" else 0
    B = block([[np.eye(n_rb + keep, n_in)], [flexible[keep:, :]]], box)
    if input_decoupling == "extended" or n_flex == 0:
        return B
    exact = B.coefficients.copy()
    own = slice(n_rb, n_in)
    exact[..., own, own] = 0.0
    exact[(0,) * len(box)][own, own] = np.eye(n_flex)
    return ChebyshevMatrix(exact, box)


def unit_outputs(flexible: ChebyshevMatrix, *, n_rb: int) -> ChebyshevMatrix:
    """C of all modes from that of the flexible ones: every rigid-body mode is one output and no other."""
    return block([[np.eye(flexible.shape[0], n_rb), flexible]], flexible.box)


def modal_state_space(
    omega: Array, zeta: Array, B: ChebyshevMatrix, C: ChebyshevMatrix, D: ChebyshevMatrix
) -> LPVStateSpace:
    """Independent modes, states grouped per mode, from the gains of all of them.

    Parameters
    ----------
    omega, zeta : (n_modes,)
        Eigenfrequencies [rad/s], zero for rigid-body modes, and damping ratios.
    B : (n_modes, n_in)
    C : (n_out, n_modes)
    D : (n_out, n_in)
    """
    n_modes = len(omega)
    velocities, positions = np.zeros((2 * n_modes, n_modes)), np.zeros((n_modes, 2 * n_modes))
    velocities[np.arange(1, 2 * n_modes, 2), np.arange(n_modes)] = 1.0
    positions[np.arange(n_modes), np.arange(0, 2 * n_modes, 2)] = 1.0
    return LPVStateSpace(ChebyshevMatrix(mode_dynamics(omega, zeta), D.box), velocities @ B, C @ positions, D)
