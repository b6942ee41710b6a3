"""Everything about a closed loop that is recomputed after a synthesis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.errors import DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.lpv.bounded_real import frozen_norm, proven_level, smallest_margin
from lpvhinf.lpv.controller import ScheduledController
from lpvhinf.lpv.plant_family import PlantFamily
from lpvhinf.lpv.result import LoopLyapunov

#: Positions between the grid points at which the closed loop is looked at.
BETWEEN = 32


@dataclass(frozen=True, kw_only=True, eq=False)
class Verified:
    """See the attributes of the same names of `LPVSynthesisResult`."""

    gamma_achieved: float
    lmi_margin: float
    frozen_norms: Array
    points_between: Array
    frozen_norms_between: Array
    controller_poles: Array

    @property
    def fastest_pole(self) -> float:
        """Largest modulus of a controller pole at the grid points [rad/s]."""
        return float(np.max(np.abs(self.controller_poles), initial=0.0))


def verified(
    family: PlantFamily, controller: ScheduledController, lyapunov: LoopLyapunov, rates: Array, between: Array
) -> Verified:
    """Levels, margins, norms and poles of the closed loop with a controller.

    Parameters
    ----------
    family : PlantFamily
    controller : ScheduledController
    lyapunov : callable
        p, p_dot -> P, dP/dt of the closed loop.
    rates : (V, n_p)
        Corners of the rate box.
    between : (M, n_p)
        Further positions, for frozen norms.
    """
    cases, norms, poles = [], [], []
    for p, plant in zip(family.points, family.plants, strict=True):
        at_rest = controller.matrices(p)
        for rate in rates:
            loop = plant.close(*(controller.matrices(p, rate) if controller.needs_rate else at_rest))
            P, P_dot = lyapunov(p, rate)
            cases.append((loop, P, P_dot))
        norms.append(frozen_norm(*plant.close(*at_rest)))
        poles.append(np.linalg.eigvals(at_rest[0]).astype(complex))
    gamma = max(proven_level(*loop, P, P_dot) for loop, P, P_dot in cases)
    margin = min(smallest_margin(*loop, P, P_dot, 1.001 * gamma) for loop, P, P_dot in cases)
    return Verified(
        gamma_achieved=gamma,
        lmi_margin=margin if np.isfinite(gamma) else -np.inf,
        frozen_norms=read_only(norms),
        points_between=read_only(between),
        frozen_norms_between=read_only([frozen_norm(*family.at(p).close(*controller.matrices(p))) for p in between]),
        controller_poles=read_only(poles, dtype=complex),
    )


def positions_between(family: PlantFamily, box: Array) -> Array:
    """Positions spread over the box at which the family has a plant, (M, n_p); none for a single point."""
    moving = box[:, 0] < box[:, 1]
    if not np.any(moving):
        return np.zeros((0, len(box)))
    found = np.tile(box[:, 0], (BETWEEN, 1))
    found[:, moving] = spread_points(box[moving], BETWEEN)
    inside = []
    for p in found:
        try:
            family.at(p)
        except DomainError:  # outside the hull of scattered grid points
            continue
        inside.append(p)
    return np.array(inside).reshape(-1, len(box))
