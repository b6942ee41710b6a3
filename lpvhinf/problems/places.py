r"""Where disturbances enter the paper's two problems, and which shaping filter weighs which signal.

=============================  ==========================================  =====================================
signal                         "six-block" (eq. 14-18)                     "two-by-two" (Section IV)
=============================  ==========================================  =====================================
disturbance of y               w1, W_w1 = I                                none
force at u_1                   w2, W_w2 = I                                w1, :math:`W_{w1} = K_r\,\dots` (eq. 17)
force on the flexible modes    w3, :math:`W_{w3} = \epsilon\,\dots`        w2, :math:`W_{w2} = K_r \epsilon\,\dots`
e                              z1, :math:`W_{z1} = K_s\,\dots`             z1, :math:`W_{z1} = (K_s / K_r)\,\dots`
u_RB                           z2, :math:`W_{z2} = K_r\,\dots` (eq. 17)    z2, W_z2 = I
=============================  ==========================================  =====================================

The roll-off moves from u_RB to the force at u_1. The paper leaves open how large K_s and epsilon are in the second
problem; with the factors K_r above every block that both problems have is bounded alike between the cut-off
frequencies, :math:`K_s` for the process sensitivity, :math:`K_r` for the complementary one, :math:`K_s \epsilon` and
:math:`K_r \epsilon` for the modes. So K_s, K_r and epsilon mean the same in both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import DomainError
from lpvhinf.shaping import Filter, ShapingFilters

SIX_BLOCK, TWO_BY_TWO = "six-block", "two-by-two"
PROBLEMS = (SIX_BLOCK, TWO_BY_TWO)


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """The filters of one problem by the signal that they weigh; a filter without states is a gain.

    Attributes
    ----------
    disturbs_output : bool
        Whether the first disturbance is one of y, of weight I.
    error : float
        W_z1 is this times (s + 2 pi f_I)/s.
    u_RB, force, flexible : (A, B, C, D)
        Of u_RB, of the force at u_1, of the force on the flexible modes.
    """

    disturbs_output: bool
    error: float
    u_RB: Filter
    force: Filter
    flexible: Filter


def gain_filter(gain: float, n: int) -> Filter:
    """The same gain for n channels, as a filter without states."""
    return np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0)), gain * np.eye(n)


def checked_problem(problem: str) -> str:
    """The name of a problem as it is.

    Raises
    ------
    DomainError
        If there is no such problem.
    """
    if problem not in PROBLEMS:
        raise DomainError(f"problem is {problem!r}, wanted one of {', '.join(PROBLEMS)}.")
    return problem


def places(problem: str, filters: ShapingFilters) -> Places:
    """The filters of a problem.

    Raises
    ------
    DomainError
        If there is no such problem.
    """
    n_rb = len(filters.f_I)
    roll_off, modes, one = filters.realize_W_z2(), filters.realize_W_w3(), gain_filter(1.0, n_rb)
    if checked_problem(problem) == SIX_BLOCK:
        return Places(disturbs_output=True, error=filters.K_s, u_RB=roll_off, force=one, flexible=modes)
    A, B, C, D = modes
    return Places(
        disturbs_output=False,
        error=filters.K_s / filters.K_r,
        u_RB=one,
        force=roll_off,
        flexible=(A, B, filters.K_r * C, filters.K_r * D),
    )


def magnitudes(problem: str, filters: ShapingFilters, omega: Array) -> tuple[list[Array], list[Array]]:
    """Magnitudes of (W_z1, W_z2) and of the W_w of a problem, each (n_omega, channels)."""
    one = np.ones((len(omega), len(filters.f_I)))
    W_z1, roll_off, modes = (np.abs(W(omega)) for W in (filters.W_z1, filters.W_z2, filters.W_w3))
    if checked_problem(problem) == SIX_BLOCK:
        return [W_z1, roll_off], [one, one, modes]
    return [W_z1 / filters.K_r, one], [roll_off, filters.K_r * modes]
