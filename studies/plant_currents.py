"""Coil currents of the load cases, the loss in the copper, and which coils take part."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa import MMPA, Amplifier, weighted_pseudo_inverse

LOADS = ("levitation", "+x", "-x", "+y", "-y")
DIRECTIONS = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
RESISTANCE = Amplifier().resistance  # of a coil [ohm]; a choice of the benchmark, as is
CURRENT_LIMIT = Amplifier().current_limit  # [A]
WEIGHT, FORCE = 1e-6, 0.01  # below this weight, or share of the largest force, a coil does not take part


def load_currents(plant: MMPA, points: Array, wrench: Array, acceleration: float) -> Array:
    """Currents of the load cases, (5, N, n_coils) [A]: levitation alone, and with horizontal acceleration.

    Parameters
    ----------
    points : (N, 2) [m]
    wrench : (N, 6, n_coils)
        The wrench matrix there.
    acceleration : [m/s2]
    """
    inverse = weighted_pseudo_inverse(wrench, plant.coil_weights(points), positions=points)
    gravity = np.full((len(LOADS), 1), plant.parameters.gravity)
    forces = plant.mass * np.hstack([acceleration * DIRECTIONS, gravity])
    return np.asarray(np.einsum("nuk,lk->lnu", inverse[:, :, :3], forces))


def copper_loss(currents: Array) -> Array:
    """R times the sum of i^2 over the coils, the last axis [W]."""
    return np.asarray(RESISTANCE * np.sum(currents**2, axis=-1))


def active_coils(plant: MMPA, points: Array, wrench: Array) -> Array:
    """Coils that take part at each position, (N,): they have a weight, and force enough."""
    force = np.abs(wrench[:, :3]).sum(axis=1)
    active = (plant.coil_weights(points) > WEIGHT) & (force > FORCE * np.max(force))
    return np.asarray(np.count_nonzero(active, axis=1))
