"""Starts of an observer design: Riccati gains and damping gains, screened by their exact norms."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.positions import norms_at

DAMPING = (0.1, 0.3, 1.0)
SPREAD = 6  # positions at which a start is judged


def observer_starts(assembly: Assembly, points: Array, rigid: Array, n: int) -> list[Array]:
    """The `n` best starts for given parameters of K_RB, judged at some of the positions.

    Unstable ones rank last but still count: the solver stabilises them first.
    """
    few = points[np.linspace(0, len(points) - 1, min(SPREAD, len(points))).astype(int)]
    tries = [assembly.start(points, rigid=rigid, xi=xi, noise_ratio=ratio)
             for ratio in (10.0, 1.0, 0.1, 0.01) for xi in DAMPING]  # fmt: skip
    scores = [float(np.max(norms_at(assembly, theta, few))) for theta in tries]
    return [tries[i] for i in np.argsort(scores, kind="stable")[: max(1, n)]]
