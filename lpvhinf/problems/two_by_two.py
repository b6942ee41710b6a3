"""The paper's 2x2-block problem (Section IV): co-design of K_RB, L and xi for the error-based observer."""

from __future__ import annotations

from lpvhinf.problems.loop import Loop
from lpvhinf.problems.places import TWO_BY_TWO
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant


def two_by_two(loop: Loop) -> LPVGeneralizedPlant:
    r"""The generalized plant of the 2x2-block problem, z = -M w.

    .. math:: M = \begin{bmatrix}
              W_{z1} \tilde S G_{\Delta,y,u_1} W_{w1} & W_{z1} \tilde S G_{\Delta,y,u_2} W_{w2} \\
              W_{z2} K_{RB} \tilde S G_{\Delta,y,u_1} W_{w1} & W_{z2} K_{RB} \tilde S G_{\Delta,y,u_2} W_{w2}
              \end{bmatrix}, \quad
              \tilde S = [I + G_{\Delta,y,u_1} K_{RB} + G_{\Delta,y,u_2} \Sigma]^{-1}

    with :math:`u_{FM} = \Sigma e`. It takes every loop: with an error-based observer, whose redundant readings (if it
    has any) belong to :math:`G_\Delta`; with an output-based observer, which belongs to :math:`G_\Delta` as a whole
    (:math:`\Sigma = 0`); and without observer, where only the left column counts: K_RB alone cannot damp the modes,
    and would give up its bandwidth for the right one.

    What is left open for tuning is diag(K_RB, L, -xi) from (e, x_I, nu, band-passed velocities) to (u_RB, injection,
    u_FM), or K_RB from (e, x_I).
    """
    observer, n_rb = loop.observer, loop.n_rb
    system = loop.wire(controller=None, weighted=True, flexible_input=observer is not None, problem=TWO_BY_TWO)
    if observer is None:
        return LPVGeneralizedPlant(system, n_u=n_rb, n_y=2 * n_rb)
    n_o, n_flex = observer.model.n_x, observer.n_flex
    return LPVGeneralizedPlant(system, n_u=n_rb + n_o + n_flex, n_y=2 * n_rb + loop.plant.n_y + n_flex)
