"""Part of the study of the plant: frequency responses of the decoupled plant over P, for the figures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.plant.mmpa import MMPA
from lpvhinf.plant.modal import Residual
from lpvhinf.progress import Progress
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator
from studies.positions import grid

CHANNELS = ("z", "rx", "ry")  # of the decoupled plant; the last channel is z at the point of control
INDEX = [2, 3, 4]
FIRST_HZ, LAST_HZ = 10.0, 1500.0


def responses(settings: Settings, progress: Progress) -> Found:
    """Magnitudes of z, rx, ry and of z at the point of control, conventional and extended, at a grid over P."""
    plant = actuator(settings)
    points = grid(plant.box, settings.frf_grid)
    omega = frequencies(plant.modal.omega[plant.modal.n_rb :])
    found = {}
    progress.stage("frequency responses over P", 2 * len(points))
    for name, kind in (("conventional", "rigid-body"), ("extended", "extended")):
        decoupled = decouple(plant, n_flex=settings.n_flex, input_decoupling=kind)
        found[name] = np.abs(channel_responses(plant, decoupled, points, omega))
        progress.update(len(points))
    values = {"n_points": len(points), "n_flex": settings.n_flex}
    return Found(values=values, arrays={"points": points, "omega": omega, "modes": plant.modal.omega, **found})


def frequencies(flexible: Array) -> Array:
    """Logarithmic, and denser around every eigenfrequency [rad/s]."""
    around = flexible[:, None] * (1.0 + 0.04 * np.linspace(-1.0, 1.0, 31) ** 3)
    every = np.concatenate([2 * np.pi * np.geomspace(FIRST_HZ, LAST_HZ, 300), around.ravel()])
    return np.unique(every[(every >= 2 * np.pi * FIRST_HZ) & (every <= 2 * np.pi * LAST_HZ)])


def channel_responses(plant: MMPA, decoupled: DecoupledPlant, points: Array, omega: Array) -> NDArray[np.complex128]:
    """Responses (N, 4, n_omega) of CHANNELS, then of z at the point of control to the z input, compliance included."""
    gains = decoupled.sample(points)
    C, D = performance(plant, decoupled, points)
    outputs = np.concatenate([gains.C[:, INDEX], C[:, None]], axis=1)
    inputs = gains.B[:, :, [*INDEX, INDEX[0]]].swapaxes(1, 2)
    through = np.concatenate([gains.D[:, INDEX, INDEX], D[:, None]], axis=1)
    s = 1j * omega[:, None]
    dynamics = 1.0 / (s**2 + 2 * decoupled.zeta * decoupled.omega * s + decoupled.omega**2)
    return np.asarray((outputs * inputs) @ dynamics.T + through[:, :, None])


def performance(plant: MMPA, decoupled: DecoupledPlant, points: Array) -> tuple[Array, Array]:
    """Height of the point of control per unit of every mode, (N, n_modes), and its compliance to the z input, (N,)."""
    modal = plant.modal
    C = plant.performance_gains(points)[:, 2].copy()
    C[:, : modal.n_rb] = C[:, : modal.n_rb] @ np.linalg.inv(modal.rigid_body_scaling)
    assert isinstance(modal.residual, Residual)  # it comes from a mechanical model, compliance kept
    rows = plant.point_of_control(points)[:, 2] @ modal.residual.matrix
    currents = decoupled.matrices(points)[1][:, :, INDEX[0]]
    forces = np.einsum("nqu,nu->nq", plant.mechanical.input_map_at(points), currents)
    return C, np.sum(rows * forces, axis=1)
