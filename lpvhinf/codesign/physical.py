"""The tuned gains of a design in physical units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.controllers import RigidBodyGains, RigidBodyStateSpace


@dataclass(frozen=True, kw_only=True, eq=False)
class PhysicalGains:
    """K_RB, L and xi at one position.

    Attributes
    ----------
    K_RB : RigidBodyGains or RigidBodyStateSpace
        Gains of PIDs and notches, or a state space per axis.
    L : (n_o, n_out), or None without observer
        From innovations [m, rad] to physical modal states.
    xi : (n_flex,), or None without observer
        [N/sqrt(kg) per m sqrt(kg)/s = 1/s]; positive damps.
    """

    K_RB: RigidBodyGains | RigidBodyStateSpace
    L: Array | None
    xi: Array | None


def physical_gains(assembly: Assembly, theta: Array, p: Array | None = None) -> PhysicalGains:
    """The gains at theta and, where they are scheduled, at p, by default the centre of P."""
    rigid, L, xi = assembly.split(theta, p)
    K_RB, observer, scaling = assembly.rigid_body.gains(rigid), assembly.observer, assembly.scaling
    if observer is None:
        return PhysicalGains(K_RB=K_RB, L=None, xi=None)
    n_rb, n_flex = assembly.plant.n_rb, assembly.plant.n_flex
    unit = scaling.state[assembly.observed] * observer.injection
    velocity = scaling.state[2 * n_rb + 1 : 2 * (n_rb + n_flex) : 2]
    return PhysicalGains(
        K_RB=K_RB,
        L=np.asarray(unit[:, None] * L * scaling.output),
        xi=np.asarray(xi * scaling.input[n_rb:] / velocity),
    )
