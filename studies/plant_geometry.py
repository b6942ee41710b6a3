"""Part of the study of the plant: where everything is, and the shapes of the flexible modes, for the figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa import MMPA, magnet_array
from lpvhinf.progress import Progress
from studies.plant_results import Found
from studies.plant_settings import N_SHAPES, Settings, actuator
from studies.plant_summary import mode_signs


def geometry(settings: Settings, progress: Progress) -> Found:
    """Coils, magnets, mirrors, beams, windows' weights at one position; mode shapes on the mover."""
    progress.stage("geometry and mode shapes")
    plant = actuator(settings)
    arrays = {**coil_outlines(plant), **mover_parts(plant, settings), **mode_shapes(plant, settings.shape_grid)}
    position = np.array(settings.position)
    arrays |= {"position": position, "box": plant.box, "weights": plant.coil_weights(position[None])[0]}
    return Found(
        values={"n_coils": plant.parameters.n_coils, "n_magnets": len(arrays["magnet_centres"])}, arrays=arrays
    )


def coil_outlines(plant: MMPA) -> dict[str, Any]:
    """Centres (n, 2) and outer sizes (n, 2) of all coils [m], and the layer of each, 0 being the upper one."""
    p = plant.parameters
    sizes = ((p.coil_short, p.coil_long), (p.coil_long, p.coil_short))
    counts = [layer.n_coils for layer in plant.layers]
    return {
        "coil_centres": np.concatenate([layer.centres for layer in plant.layers]),
        "coil_sizes": np.repeat(sizes, counts, axis=0),
        "coil_layer": np.repeat(np.arange(len(counts)), counts),
    }


def mover_parts(plant: MMPA, settings: Settings) -> dict[str, Any]:
    """Magnets, mirror bars and centre of gravity in the mover frame, beams in the stator frame [m]."""
    p, magnets = plant.parameters, magnet_array(plant.parameters)
    s = p.sensor_xy_half_span
    return {
        "side": p.side,
        "magnet_centres": magnets.centres,
        "magnet_sizes": magnets.sizes[:, :2],
        "magnet_polarization": magnets.polarization,
        "bar_inset": p.bar_inset,
        "bar_length": p.side - 2 * p.bar_clearance,
        "centre_of_gravity": plant.centre_of_gravity[:2],
        "point_of_control": np.array(p.point_of_control[:2]),
        "z_beams": p.z_beams,
        "x_beams": np.array([s, 0.0, -s]),
        "y_beams": np.array([s, -s]),
    }


def mode_shapes(plant: MMPA, n: int) -> dict[str, Array]:
    """The first flexible mode shapes times sqrt(mass), (n_modes, n, n), x first, on an n x n grid of the mover."""
    assert plant.modal.V is not None  # it comes from a mechanical model
    axis = plant.parameters.side / 2 * np.linspace(-1.0, 1.0, n)
    places = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    first = plant.modal.n_rb
    shapes = plant.plate.rows(places) @ plant.modal.V[3:, first : first + N_SHAPES]
    shapes = np.moveaxis(shapes, 2, 0) * (np.sqrt(plant.mass) * mode_signs(plant)[:N_SHAPES])[:, None, None]
    hertz = plant.modal.omega[first : first + N_SHAPES] / (2 * np.pi)
    return {"shape_axis": axis, "shapes": shapes, "shape_hertz": hertz}
