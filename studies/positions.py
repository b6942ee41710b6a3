"""Positions at which the studies look at a plant."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array


def grid(box: Array, n: int) -> Array:
    """A grid of n positions per axis, the first axis slowest, (n^n_p, n_p)."""
    axes = [np.linspace(low, high, n) for low, high in box]
    return np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=-1)
