"""What a page shows of the machine: coils, mover, beams and mode shapes, where the design says which machine it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from lpvhinf.plant.mmpa import benchmark
from lpvhinf.stored_design import StoredDesign
from lpvhinf.viewer.packing import packed

N_SHAPE = 31  # points of a shape along each side of the mover


def machine_view(design: StoredDesign) -> dict[str, Any] | None:
    """Geometry and mode shapes of the benchmark that a design was made for; None where that is not known.

    Shapes do not depend on the magnets' field, so that the quick one serves.
    """
    known = design.machine
    if known is None or len(design.box) != 2:
        return None
    found = benchmark(n_flex=known["plant_modes"], magnetics="first-harmonic")
    p, modal = found.parameters, found.modal
    assert modal.V is not None  # it comes from a mechanical model
    axis = p.side / 2.0 * np.linspace(-1.0, 1.0, N_SHAPE)
    places = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    shapes = np.moveaxis(found.plate.rows(places) @ modal.V[3:, modal.n_rb :], 2, 0)
    largest = np.max(np.abs(shapes), axis=(1, 2), keepdims=True)
    beams = found.mechanical.output_map
    sizes = ((p.coil_short, p.coil_long), (p.coil_long, p.coil_short))
    coils = [
        [float(x), float(y), *size, layer]
        for layer, (stage, size) in enumerate(zip(found.layers, sizes, strict=True))
        for x, y in stage.centres
    ]
    hertz = modal.omega[modal.n_rb :] / (2.0 * np.pi)
    return {
        "side": p.side,
        "coils": coils,
        "z_beams": np.asarray(beams.z_beams).tolist(),  # type: ignore[attr-defined]
        "x_beams": np.asarray(beams.x_beams).tolist(),  # type: ignore[attr-defined]
        "y_beams": np.asarray(beams.y_beams).tolist(),  # type: ignore[attr-defined]
        "n_shape": N_SHAPE,
        "controlled": known["n_flex"],
        "hertz": [round(float(f), 2) for f in hertz],
        "shapes": packed(np.round(127.0 * shapes / largest), "int8"),
    }
