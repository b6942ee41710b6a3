"""Part of the study of the plant: coupled channels when six virtual forces serve rigid-body axes and a mode."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from lpvhinf.decoupling import ChannelCoupling, decouple
from lpvhinf.progress import Progress
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator
from studies.positions import grid

FIELDS = ("rigid", "rigid_channel", "excitation", "modal_to_rigid", "own_gain_min", "own_gain_max")


def full_actuation(settings: Settings, progress: Progress) -> Found:
    """Coupling with one controlled mode for every mode weight, beside the over-actuated plant."""
    plant = actuator(settings)
    points = grid(plant.box, settings.grid)
    progress.stage("fully actuated plant", 1 + len(settings.mode_weights))
    found = [decouple(plant, n_flex=1).coupling(points)]
    for weight in settings.mode_weights:
        progress.update()
        found.append(decouple(plant, n_flex=1, actuation="full", mode_weight=weight).coupling(points))
    rows = [
        {"mode_weight": weight, **_row(one)} for weight, one in zip((None, *settings.mode_weights), found, strict=True)
    ]
    arrays = {name: np.array([np.atleast_1d(getattr(one, name)) for one in found]) for name in FIELDS}
    weights = np.array([np.nan, *settings.mode_weights])
    return Found(
        values={"rows": rows, "n_points": len(points)}, arrays={"points": points, "mode_weight": weights, **arrays}
    )


def _row(coupling: ChannelCoupling) -> dict[str, Any]:
    """One row of the table; the one controlled mode is the first."""
    values = dataclasses.asdict(coupling)
    return {
        "rigid": coupling.rigid,
        **{name: values[name][0] for name in ("excitation", "modal_to_rigid", "own_gain_min", "own_gain_max")},
        "rigid_at": coupling.rigid_at,
    }
