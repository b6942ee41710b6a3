"""Part of the study of the plant: modal gains and coil currents over P, for the figures."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa import MMPA, weighted_pseudo_inverse
from lpvhinf.progress import Progress
from studies.plant_currents import CURRENT_LIMIT, LOADS, load_currents
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator
from studies.plant_summary import mode_signs
from studies.positions import grid

LEVER = 0.1  # [m]: torques are those of one newton at this lever


def maps(settings: Settings, progress: Progress) -> Found:
    """Gains of the controlled modes and largest currents on a grid over P, and all currents at one position."""
    plant = actuator(settings)
    points = grid(plant.box, settings.map_grid)
    progress.stage("maps over P", len(points))
    wrench = plant.wrench_matrix(points)
    currents = load_currents(plant, points, wrench, settings.acceleration)
    position = np.array([settings.position])
    at = load_currents(plant, position, plant.wrench_matrix(position), settings.acceleration)
    arrays = {
        "axis": np.linspace(plant.box[0, 0], plant.box[0, 1], settings.map_grid),
        "points": points,
        "position": position[0],
        "largest_current": np.max(np.abs(currents), axis=2),
        "currents_at": at[:, 0],
        "loads": np.array(LOADS),
        **controlled_mode_gains(plant, points, wrench, settings.n_flex),
    }
    values = {
        "n_points": len(points),
        "acceleration": settings.acceleration,
        "current_limit": CURRENT_LIMIT,
    }
    return Found(values=values, arrays=arrays)


def controlled_mode_gains(plant: MMPA, points: Array, wrench: Array, n_flex: int) -> dict[str, Array]:
    """Forces on the controlled modes by the conventional decoupled inputs, and what the outputs see of the modes.

    All times sqrt(mass): the mover's rigid vertical motion would have the gain 1 everywhere.
    """
    n_rb, modes = plant.modal.n_rb, slice(plant.modal.n_rb, plant.modal.n_rb + n_flex)
    factor = np.sqrt(plant.mass) * mode_signs(plant)[:n_flex]
    inverse = weighted_pseudo_inverse(wrench, plant.coil_weights(points), positions=points)
    force = plant.modal.input_gains(points)[:, modes] @ inverse * np.repeat([1.0, LEVER], 3)
    return {
        "mode_hertz": plant.modal.omega[n_rb : n_rb + n_flex] / (2 * np.pi),
        "mode_force": factor[:, None] * force,  # (N, n_flex, 6), per newton
        "mode_at_z1": factor * plant.modal.output_gains(points)[:, 0, modes],
        "mode_at_point_of_control": factor * plant.performance_gains(points)[:, 2, modes],
    }
