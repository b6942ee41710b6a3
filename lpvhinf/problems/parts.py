"""The parts of the loop that belong to the controller: the modal observer's model, and what is tuned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.controllers import velocity_selection
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.problems.wiring import Gain
from lpvhinf.statespace.lpv import LPVStateSpace

Realized = tuple[Gain, Gain, Gain, Gain]


@dataclass(frozen=True, kw_only=True, eq=False)
class ObserverBranch:
    """What the flexible-mode loop adds to the plant: the model of O, the band-pass, and units of injection.

    Attributes
    ----------
    model : LPVStateSpace
        A_o, B_o, C_o(p), D_o(p), scaled like the plant. Inputs are (u_RB, u_FM), or u_FM alone where the observer
        is fed by the error.
    omega : (n_flex,) [rad/s]
        Frequencies of the controlled modes.
    Q : float
        Of the band-pass.
    injection : (n_o,) [rad/s]
        The observer's correction is diag(injection) L nu, so that L is of size one.
    fed_by_error : bool
        Whether -e stands in for the measured rigid-body outputs: the error-based observer.
    """

    model: LPVStateSpace
    omega: Array
    Q: float
    injection: Array
    fed_by_error: bool = False

    @property
    def n_flex(self) -> int:
        """Number of controlled modes."""
        return len(self.omega)

    @property
    def Psi(self) -> Array:
        """The rows that pick the velocities of the controlled modes, the last ones of the observer, (n_flex, n_o)."""
        return velocity_selection(self.model.n_x // 2 - self.n_flex, self.n_flex)


@dataclass(frozen=True, kw_only=True, eq=False)
class TunedParts:
    """The tuned part diag(K_RB, L, xi) at given parameters, in scaled units; polynomials of p where scheduled.

    Attributes
    ----------
    K_RB : (A, B, C, D) from (e, x_I) to u_RB
    L : (n_o, n_out), or None without an observer
    xi : (n_flex,), or as a polynomial (n_flex, 1), or None; positive values damp
    """

    K_RB: Realized
    L: Gain | None = None
    xi: Gain | None = None

    @property
    def K_FM(self) -> Gain:
        """diag(xi), (n_flex, n_flex): what multiplies the band-passed velocities in -u_FM."""
        assert self.xi is not None
        if not isinstance(self.xi, ChebyshevMatrix):
            return np.diag(self.xi)
        return ChebyshevMatrix(self.xi.coefficients * np.eye(self.xi.shape[0]), self.xi.box)


def is_zero(gain: Gain) -> bool:
    """Whether a gain is zero at every position."""
    return not np.any(gain.coefficients if isinstance(gain, ChebyshevMatrix) else gain)
