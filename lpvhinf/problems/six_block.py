"""The paper's 6-block problem: K_RB, L and xi of the output-based observer designed together."""

from __future__ import annotations

from lpvhinf.errors import AssumptionError
from lpvhinf.problems.loop import Loop
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant


def six_block(loop: Loop) -> LPVGeneralizedPlant:
    r"""The generalized plant of the 6-block problem (eq. 14-16), z = -M w.

    .. math:: M = \begin{bmatrix}
              W_{z1} S W_{w1} & W_{z1} S G_{\Delta,y,u_1} W_{w2} & W_{z1} S G_{\Delta,y,u_2} W_{w3} \\
              W_{z2} K S W_{w1} & W_{z2} K S G_{\Delta,y,u_1} W_{w2} & W_{z2} K S G_{\Delta,y,u_2} W_{w3}
              \end{bmatrix}, \quad S = [I + G_{\Delta,y,u_1} K_{RB}]^{-1}

    The position-dependent part of the observer belongs to :math:`G_\Delta`; what is left open for tuning
    is diag(K_RB, L, -xi) from (e, x_I, nu, band-passed velocities) to (u_RB, injection, u_FM).

    Raises
    ------
    AssumptionError
        If `loop` has no observer.
    """
    if loop.observer is None:
        raise AssumptionError("the loop has no observer, wanted one for the 6-block problem. Use four_block instead.")
    system = loop.wire(controller=None, weighted=True, flexible_input=True)
    n_o, n_flex, n_rb = loop.observer.model.n_x, loop.observer.n_flex, loop.n_rb
    return LPVGeneralizedPlant(system, n_u=n_rb + n_o + n_flex, n_y=2 * n_rb + loop.plant.n_y + n_flex)
