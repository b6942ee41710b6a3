"""The folder of one co-design: a checkpoint while it is made, then its arrays, measures and figures."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, largest_real_part, measure
from lpvhinf.codesign.report import figures
from lpvhinf.errors import StorageError
from lpvhinf.progress import Progress
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import read_arrays, read_json, write_arrays, write_json
from studies.codesign_settings import CodesignSettings
from studies.positions import grid
from studies.results import belongs

DESIGN = "lpvhinf.Design"
CHECKPOINT = "lpvhinf.Checkpoint"
MEASURES = "lpvhinf.Measures"
RESPONSES = "lpvhinf.Responses"
SAVE_EVERY = 5.0  # seconds between two checkpoints of one design


def finished(folder: Path, key: str) -> bool:
    """Whether a folder holds a finished design of this key, every file readable."""
    try:
        summary = read_json(folder / "summary.json")
        for name, kind in (("design", DESIGN), ("measures", MEASURES), ("responses", RESPONSES)):
            read_arrays(folder / f"{name}.npz", kind)
        for name in ("plant", "controller", "closed_loop", "performance_loop"):
            LPVStateSpace.load(folder / f"{name}.npz")
    except StorageError:
        return False
    return belongs(summary, key)


class Saver:
    """Writes the best parameters so far, not more often than every few seconds."""

    def __init__(self, folder: Path, key: str) -> None:
        self.path, self.key = folder / "checkpoint.npz", key
        self._last = time.monotonic()

    def __call__(self, theta: Array, gamma: float) -> None:
        """Take note of better parameters."""
        if time.monotonic() - self._last >= SAVE_EVERY:
            write_arrays(self.path, CHECKPOINT, {"theta": theta, "gamma": gamma, "key": np.array(self.key)})
            self._last = time.monotonic()


def warm_start(folder: Path, key: str, progress: Progress) -> Array | None:
    """Parameters that an interrupted run of the same design left behind."""
    path = folder / "checkpoint.npz"
    if not path.is_file():
        return None
    try:
        data = read_arrays(path, CHECKPOINT)
    except StorageError as error:
        progress.log(f"checkpoint not usable, starting anew: {error}")
        return None
    if str(data["key"]) != key:
        return None
    progress.log(f"going on from a checkpoint at gamma {float(data['gamma']):.4f}")
    return np.asarray(data["theta"])


def stored(out: Path, design: str, name: str) -> Array:
    """An array of a finished design of the same results folder: its "parameters" or "positions"."""
    return np.asarray(read_arrays(out / "designs" / design / "design.npz", DESIGN)[name])


def frequencies(design: Design) -> Array:
    """Frequencies of the figures [rad/s]: logarithmic, and denser around every eigenfrequency."""
    omega = design.assembly.plant.omega
    flexible = omega[omega > 0.0]
    around = flexible[:, None] * (1.0 + 0.03 * np.linspace(-1.0, 1.0, 25) ** 3)
    return np.unique(np.concatenate([2 * np.pi * np.geomspace(1.0, 2000.0, 400), around.ravel()]))


def write_measures(
    folder: Path,
    design: Design,
    settings: CodesignSettings,
    progress: Progress,
    **more: Array,
) -> dict[str, Any]:
    """Measure a design on the grids of the settings, write the arrays with `more`, return the figures to quote."""
    plant = design.assembly.plant
    points = grid(plant.box, settings.measure_grid)
    progress.stage("measures", len(points))
    measures = measure(design, points, progress=progress)
    dense = grid(plant.box, settings.stability_grid)
    progress.stage("poles on the dense grid", len(dense))
    poles = largest_real_part(design, dense, progress=progress)
    arrays = {field.name: getattr(measures, field.name) for field in dataclasses.fields(measures)}
    write_arrays(folder / "measures.npz", MEASURES, {**arrays, "dense": dense, "poles": poles, **more})
    fit = {name: value.relative_error for name, value in plant.fit.items()}
    values = figures(design, measures)
    values |= {"largest_real_part": float(np.max(poles)), "n_dense": len(dense), "fit_error": fit}
    values["worst_pole_position"] = dense[int(np.argmax(poles))]
    return values


def response_points(design: Design, settings: CodesignSettings) -> Array:
    """Positions of the figures: a grid and the worst position."""
    return np.vstack([grid(design.assembly.plant.box, settings.response_grid), design.worst_position[None]])


def write_finished(folder: Path, design: Design, summary: dict[str, Any]) -> None:
    """Write the design's own files, and last its summary, which says that the design is finished."""
    design.save(folder)
    write_json(folder / "summary.json", summary)
    (folder / "checkpoint.npz").unlink(missing_ok=True)
