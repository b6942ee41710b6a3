"""Starts of a design: rules of thumb for K_RB; for an observer Riccati and damping gains, screened by their norms."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.errors import AssumptionError
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.oracle import NormOracle
from lpvhinf.hinfstruct.problem import Budget

# From gentle to strong: a larger damping gain spills over into the discarded modes.
DAMPING = (0.05, 0.1, 0.2, 0.4, 0.8)
NOISE_RATIOS = (1.0, 10.0, 0.1, 0.01)
JUDGES = 6  # positions at which a start is judged
SAME = 0.05  # relative difference of norms that is no reason to take a stronger gain


def rigid_starts(assembly: Assembly, n: int) -> list[Array]:
    """`n` starts of K_RB: rules of thumb for the target bandwidth, and for lower ones."""
    structure, f_bw = assembly.rigid_body, assembly.scaling.f_bw
    tries = [structure.parameters(structure.rule_of_thumb(f_bw * 0.8**k)) for k in range(max(1, n))]
    return [assembly.layout.expanded(rigid) for rigid in tries]


def observer_starts(assembly: Assembly, points: Array, rigid: Array, n: int) -> list[Array]:
    """The `n` best starts for given parameters of K_RB, judged at some of the positions.

    Of starts that are equally good the gentlest comes first. Unstable ones rank last but still count: the
    solver stabilises them first. If all are unstable, the second start is the best one whose observer is stable at all
    positions.
    """
    few = points[np.linspace(0, len(points) - 1, min(JUDGES, len(points))).astype(int)]
    tries = [assembly.start(points, rigid=rigid, xi=xi, noise_ratio=ratio) for xi in DAMPING for ratio in NOISE_RATIOS]
    plants = assembly.generalized_plants(few)
    where = list(few) if assembly.layout.scheduled else [None] * len(few)
    oracle = NormOracle(ClosedLoops(plants, assembly.structure, where), Budget())

    def judged(candidates: list[Array]) -> Array:
        return np.log([oracle.gamma(oracle.evaluate(theta)) for theta in candidates])

    scores = judged(tries)
    if not np.any(np.isfinite(scores)):
        gentler = _stable_observers(assembly, points, rigid) if n > 1 else []
        return [tries[0], *(gentler[i] for i in np.argsort(judged(gentler))), *tries[1:]][: max(1, n)]
    rounded = np.where(np.isfinite(scores), np.round((scores - np.min(scores)) / SAME), np.inf)
    return [tries[i] for i in np.argsort(rounded, kind="stable")[: max(1, n)]]


def _stable_observers(assembly: Assembly, points: Array, rigid: Array) -> list[Array]:
    """Starts with the largest process noise whose observer is stable at all positions; none if there is none."""
    try:
        return [assembly.start(points, rigid=rigid, xi=xi) for xi in DAMPING]
    except AssumptionError:
        return []
