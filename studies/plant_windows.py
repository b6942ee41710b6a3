"""Part of the study of the plant: what the windows of the commutation cost and what they are good for."""

from __future__ import annotations

from typing import Any

import numpy as np

from lpvhinf.decoupling import decouple
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.progress import Progress
from studies.plant_currents import LOADS, active_coils, copper_loss, load_currents
from studies.plant_polynomial import KINDS, gain_errors, relative
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator, random_positions, windowed
from studies.positions import grid


def windows(settings: Settings, progress: Progress) -> Found:
    """Error of the polynomial model with one controlled mode, currents and loss, for each choice of windows."""
    box = actuator(settings).box  # its tables of the field serve all
    random, regular = random_positions(settings, box), grid(box, settings.grid)
    n = len(settings.windows)
    errors, scales = np.zeros((n, len(random), len(KINDS))), np.zeros((n, len(KINDS)))
    largest, loss = np.zeros((2, n, len(LOADS), len(regular)))
    active = np.zeros((n, len(regular)), dtype=int)
    progress.stage("windows of the commutation", n)
    for k, window in enumerate(settings.windows):
        plant = benchmark(windowed(window), n_flex=settings.n_plant_modes, magnetics=settings.magnetics)
        model = decouple(plant, n_flex=1, degree=settings.window_degree)
        errors[k], scales[k] = gain_errors(model.system, model.sample(random), random, model.n_rb)
        wrench = plant.wrench_matrix(regular)
        currents = load_currents(plant, regular, wrench, settings.acceleration)
        largest[k], loss[k] = np.max(np.abs(currents), axis=2), copper_loss(currents)
        active[k] = active_coils(plant, regular, wrench)
        progress.update()
    share = relative(errors, scales)
    rows: list[dict[str, Any]] = [
        {
            "window": settings.windows[k],
            "errors": share[k],
            "levitation_A": np.max(largest[k, 0]),
            "acceleration_A": np.max(largest[k, 1:]),
            "levitation_loss_W": np.mean(loss[k, 0]),
            "active_min": np.min(active[k]),
            "active_max": np.max(active[k]),
        }
        for k in range(n)
    ]
    values = {"rows": rows, "kinds": KINDS, "degree": settings.window_degree, "n_points": len(random)}
    arrays = {"random": random, "points": regular, "windows": np.array(settings.windows), "errors": errors,
              "scales": scales, "largest_current": largest, "copper_loss": loss, "active": active}  # fmt: skip
    return Found(values=values, arrays=arrays)
