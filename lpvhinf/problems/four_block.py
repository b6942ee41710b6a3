"""The conventional 4-block problem: K_RB alone."""

from __future__ import annotations

from lpvhinf.problems.loop import Loop
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant


def four_block(loop: Loop) -> LPVGeneralizedPlant:
    r"""The generalized plant of the 4-block problem (van de Wal et al., 2002).

    .. math:: M = \begin{bmatrix} W_{z1} S W_{w1} & W_{z1} S \tilde G_{y,u_1} W_{w2} \\
              W_{z2} K_{RB} S W_{w1} & W_{z2} K_{RB} S \tilde G_{y,u_1} W_{w2} \end{bmatrix}, \quad
              S = [I + \tilde G_{y,u_1} K_{RB}]^{-1}

    The flexible-mode inputs of the plant are left alone, and so is the observer of `loop`, if it has one.
    Measurements are (e, x_I) with the integrator of W_z1 absorbed: :math:`\dot x_I = 2\pi f_I e`.
    """
    conventional = Loop(plant=loop.plant, filters=loop.filters, n_rb=loop.n_rb)
    system = conventional.wire(controller=None, weighted=True, flexible_input=False)
    return LPVGeneralizedPlant(system, n_u=loop.n_rb, n_y=2 * loop.n_rb)
