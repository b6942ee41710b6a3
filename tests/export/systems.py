"""Controllers of every kind that the exporters meet, stable enough for thousands of samples."""

from __future__ import annotations

import numpy as np

from lpvhinf.statespace import LPVStateSpace

BOX = np.array([[-0.06, 0.06], [-0.05, 0.07]])
PERIOD = 1e-4
KINDS = ("gain", "six axes", "constant A", "scheduled", "fitted", "scheduled gain")


def observer_like(seed: int = 0, *, varying: bool = True) -> LPVStateSpace:
    """Lightly damped modes, with an innovation gain times an output matrix that moves with p."""
    rng = np.random.default_rng(seed)
    omega, n_y = 2.0 * np.pi * np.array([30.0, 140.0, 300.0, 700.0]), 3
    A = np.zeros((3, 4, 8, 8))
    for i, w in enumerate(omega):
        A[0, 0, 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[-0.3 * w, w], [-w, -0.3 * w]]
    C = rng.standard_normal((3, 4, n_y, 8)) * 0.5 ** np.add.outer(np.arange(3), np.arange(4))[:, :, None, None]
    if varying:
        A -= 3.0 * rng.standard_normal((8, n_y)) @ C
    B = rng.standard_normal((8, 2)) * 100.0
    D = np.zeros((2, 1, n_y, 2))
    D[:, 0] = 0.01 * rng.standard_normal((2, n_y, 2))
    return LPVStateSpace.from_coefficients(A, B, C, D, box=BOX)
