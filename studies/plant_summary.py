"""Part of the study of the plant: its own figures."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa import MMPA, weighted_pseudo_inverse
from lpvhinf.progress import Progress
from studies.plant_currents import CURRENT_LIMIT, LOADS, active_coils, copper_loss, load_currents
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator
from studies.positions import grid

LEVER = 0.1  # [m]: torques count as forces at this lever in the condition numbers
N_MODAL_ROWS = 5
N_COUNTED = 40  # coils that the root mean square of the description refers to
N_TIMED = 20
SIGN_PLACE = (0.15, 0.075)  # mode shapes are positive at this point of the mover [m], on the edge of the x-mirror
PLACES = np.array([[0.0, 0.0], [0.06, 0.06]])  # positions at which the dependence on p is told [m]


def summary(settings: Settings, progress: Progress) -> Found:
    """Mass, modes, force constants, currents, condition numbers and position dependence."""
    plant = actuator(settings)
    points = grid(plant.box, settings.grid)
    progress.stage("wrench matrices and currents over P", len(points))
    gains, weights = plant.modal.input_gains(points), plant.coil_weights(points)
    wrench = plant.wrench_matrix(points)
    rows = wrench / np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER])[:, None]
    modal = np.sqrt(plant.mass) * gains[:, 6 : 6 + N_MODAL_ROWS]
    active = np.sqrt(weights)[:, None, :]
    condition = {
        "condition_6": np.linalg.cond(rows * active),
        "condition_11": np.linalg.cond(np.concatenate([rows, modal], axis=1) * active),
    }
    currents = load_currents(plant, points, wrench, settings.acceleration)
    largest, loss = np.max(np.abs(currents), axis=2), copper_loss(currents)
    root_mean_square = np.sqrt(np.sum(currents[0] ** 2, axis=1) / N_COUNTED)
    taking_part = active_coils(plant, points, wrench)
    upper = plant.layers[0].n_coils
    values: dict[str, Any] = {
        "mass": plant.mass,
        "inertia": plant.inertia,
        "centre_of_gravity": plant.centre_of_gravity,
        "frequencies_Hz": plant.modal.omega[6:] / (2 * np.pi),
        "damping": plant.modal.zeta[6:],
        "k_z_upper": np.max(np.abs(wrench[:, 2, :upper])),
        "k_z_lower": np.max(np.abs(wrench[:, 2, upper:])),
        "levitation_rms_min": np.min(root_mean_square),
        "levitation_rms_max": np.max(root_mean_square),
        "active_min": np.min(taking_part),
        "active_max": np.max(taking_part),
        "loads": [_load(*entry) for entry in zip(LOADS, largest, loss, strict=True)],
        "current_limit": CURRENT_LIMIT,
        "position_ms": _milliseconds(plant, points),
        "n_points": len(points),
        "acceleration": settings.acceleration,
        **{
            f"{name}_{end}": f(value)
            for name, value in condition.items()
            for end, f in (("min", np.min), ("max", np.max))
        },
        **position_dependence(plant),
    }
    arrays = {"points": points, "largest_current": largest, "copper_loss": loss, "levitation_rms": root_mean_square,
              "active": taking_part, **condition}  # fmt: skip
    return Found(values=values, arrays=arrays)


def _load(name: str, largest: Array, loss: Array) -> dict[str, Any]:
    """One load case: largest current of any coil at a position, (N,) [A], and loss, (N,) [W]."""
    return {
        "name": name,
        "largest_A": np.max(largest),
        "mean_largest_A": np.mean(largest),
        "share_above": np.mean(largest > CURRENT_LIMIT),
        "loss_mean_W": np.mean(loss),
        "loss_max_W": np.max(loss),
    }


def _milliseconds(plant: MMPA, points: Array) -> float:
    """Mean processor time that all modal gains of one position take, one position asked for at a time."""
    some = points[:N_TIMED]
    began = time.process_time()
    for p in some:
        plant.modal.gains(p)
    return 1e3 * (time.process_time() - began) / len(some)


def mode_signs(plant: MMPA) -> Array:
    """Signs that make the flexible mode shapes positive at the point SIGN_PLACE of the mover, (n_flex,)."""
    assert plant.modal.V is not None  # it comes from a mechanical model
    shapes = plant.plate.rows(SIGN_PLACE) @ plant.modal.V[3:, plant.modal.n_rb :]
    return np.where(shapes < 0.0, -1.0, 1.0)


def position_dependence(plant: MMPA) -> dict[str, Any]:
    """Torsion amplitude at a sensor and at the point of control, umbrella force per newton: (0, 0) and (60, 60) mm."""
    root, n_rb, sign = np.sqrt(plant.mass), plant.modal.n_rb, mode_signs(plant)
    torsion, umbrella = n_rb, n_rb + 2
    inverse = weighted_pseudo_inverse(plant.wrench_matrix(PLACES), plant.coil_weights(PLACES), positions=PLACES)
    force = np.einsum("nu,nu->n", plant.modal.input_gains(PLACES)[:, umbrella], inverse[:, :, 2])
    return {
        "torsion_z1": sign[0] * root * plant.modal.output_gains(PLACES)[:, 0, torsion],
        "torsion_point_of_control": sign[0] * root * plant.performance_gains(PLACES)[:, 2, torsion],
        "umbrella_per_newton": sign[2] * root * force,
    }
