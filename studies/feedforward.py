"""Rigid-body feedforward: which flexible modes it excites over P, and the error that it leaves, by decoupling.

Parts, each of which ends as a folder of figures and arrays:

* excitation: the largest modal force per acceleration of every axis, by search, for the extended and the rigid-body
  decoupling, for fully actuated plants, and with a commutation that is misaligned;
* steps-1, steps-3, ...: errors of a short smooth step of every axis, one number of preserved modes each;
* maps: arrays of the figure.

The report and the figure are made from these folders alone.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import lpvhinf
from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa import MMPA, Effects, benchmark
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS
from lpvhinf.progress import Progress
from lpvhinf.simulation import (
    FourthOrderStep,
    RigidBodyFeedforward,
    StepError,
    mode_excitation,
    step_error,
    worst_excitation,
)
from lpvhinf.storage import make_folder, write_json
from studies.feedforward_report import write_report
from studies.plant_results import Found, finished, save
from studies.positions import grid
from studies.record import run_record
from studies.settings import fingerprint

__all__ = ["NAME", "Settings", "parts_of", "run", "run_part", "write_report"]

NAME = "feedforward"
DECOUPLINGS = ("rigid-body", "extended")  # without, with
DEGREE = 0  # of a polynomial plant, which nothing here uses


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    magnetics: str
    n_plant_modes: int
    n_flex: int
    n_flexes: tuple[int, ...]
    mode_weights: tuple[float, ...]
    misalignment: tuple[float, ...]
    distances: tuple[float, ...]
    snap_times: tuple[float, ...]
    settle: float
    n_search: int
    grid: int
    map_grid: int
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        if self.magnetics not in KINDS:
            raise DomainError(f"magnetics is {self.magnetics!r}, wanted one of {', '.join(KINDS)}.")
        for name, least in (("n_plant_modes", 1), ("n_flex", 1), ("n_search", 1), ("grid", 2), ("map_grid", 2)):
            whole_number(name, getattr(self, name), least)
        for name, least in (("seed", 0), ("jobs", 1)):
            whole_number(name, getattr(self, name), least)
        finite_array("n_flexes", self.n_flexes, (None,))
        for n in (self.n_flex, *self.n_flexes):
            if whole_number("n_flexes", n, 1) > self.n_plant_modes:
                raise DomainError(f"n_flexes has {n}, wanted at most n_plant_modes = {self.n_plant_modes}.")
        finite_array("misalignment", self.misalignment, (2,))
        finite_array("distances", self.distances, (6,))
        for name in ("mode_weights", "distances", "snap_times"):
            if np.min(finite_array(name, getattr(self, name), (None,)), initial=np.inf) <= 0.0:
                raise DomainError(f"{name} is {getattr(self, name)}, wanted values above 0.")
        if not self.n_flexes or not self.snap_times:
            raise DomainError("n_flexes or snap_times is empty, wanted at least one value of each.")
        positive("settle", self.settle, "s")


def parts_of(settings: Settings) -> list[str]:
    """Names of the parts."""
    return ["excitation", *(f"steps-{n}" for n in settings.n_flexes), "maps"]


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`; parts that are there already, from the same settings, are kept."""
    began = time.time()
    make_folder(out)
    keys = {name: key_of(settings, name) for name in parts_of(settings)}
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "parts.json", keys)  # what belongs to these settings; other folders are leftovers
    if settings.magnetics == "exact" and not all(finished(out / "parts" / name, key) for name, key in keys.items()):
        # the tables are built once, over all processes, before the parts want them
        benchmark(magnetics=settings.magnetics, jobs=settings.jobs, progress=progress)
    run_jobs(run_part, [(name, (settings, name, out)) for name in keys], jobs=settings.jobs, progress=progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began))
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


def key_of(settings: Settings, name: str) -> str:
    """A key of everything that a stored part depends on."""
    relevant = {key: value for key, value in dataclasses.asdict(settings).items() if key not in ("jobs", "n_flexes")}
    return fingerprint(relevant, name, lpvhinf.__version__)


def run_part(settings: Settings, name: str, out: Path, progress: Progress) -> None:
    """Compute and store one part, unless it is there already."""
    folder, key = out / "parts" / name, key_of(settings, name)
    make_folder(folder)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    kind, _, n_flex = name.partition("steps-")
    work: dict[str, Callable[[Settings, Progress], Found]] = {"excitation": excitation, "maps": maps}
    save(folder, key, work[kind](settings, progress) if kind else steps(settings, int(n_flex), progress))


@lru_cache(maxsize=1)
def _machine(magnetics: str, n_modes: int) -> MMPA:
    return benchmark(n_flex=n_modes, magnetics=magnetics)


def machine(settings: Settings) -> MMPA:
    """The benchmark; in one process the same object every time, as its tables are large."""
    return _machine(settings.magnetics, settings.n_plant_modes)


def variants(settings: Settings) -> dict[str, DecoupledPlant]:
    """Decoupled plants of the part "excitation", by name."""
    true, n_flex = machine(settings), settings.n_flex
    effects = Effects(commutation_misalignment=(settings.misalignment[0], settings.misalignment[1]))
    misaligned = benchmark(n_flex=settings.n_plant_modes, magnetics=settings.magnetics, effects=effects)
    found = {kind: decouple(true, n_flex=n_flex, input_decoupling=kind, degree=DEGREE) for kind in DECOUPLINGS}
    found |= {
        f"full-{rho:g}": decouple(true, n_flex=n_flex, actuation="full", mode_weight=rho, degree=DEGREE)
        for rho in settings.mode_weights
    }
    found |= {
        f"misaligned-{kind}": decouple(misaligned, n_flex=n_flex, input_decoupling=kind, degree=DEGREE)
        for kind in DECOUPLINGS
    }
    return found


def excitation(settings: Settings, progress: Progress) -> Found:
    """The worst excitation of the preserved modes by every axis, and what the feedforward does not cancel."""
    plants = variants(settings)
    points = grid(machine(settings).box, settings.grid)
    values, arrays = dict[str, Any](), dict[str, Any]()
    progress.stage("worst excitation over P", len(plants))
    for name, plant in plants.items():
        worst = worst_excitation(plant, n_search=settings.n_search, seed=settings.seed)
        over = mode_excitation(plant, points)
        values[name] = {
            "gain": worst.gain,
            "relative": worst.relative,
            "position_mm": 1e3 * worst.position,
            "discarded": np.max(np.abs(over.relative[:, settings.n_flex :]), axis=0).max(axis=0, initial=0.0),
            "not_cancelled": float(np.max(RigidBodyFeedforward(plant=plant).residual(points))),
        }
        arrays |= {f"{name}_{key}": getattr(worst, key) for key in ("gain", "relative", "position")}
        progress.update()
    hertz = machine(settings).modal.omega[6 : 6 + settings.n_flex] / (2 * np.pi)
    return Found(values={"plants": values, "mode_hertz": hertz, "n_points": len(points)}, arrays=arrays)


def steps(settings: Settings, n_flex: int, progress: Progress) -> Found:
    """Errors of a step of every axis at the sensors' outputs and at the point of control, for every snap time."""
    plant = machine(settings)
    points = grid(plant.box, settings.grid)
    progress.stage("steps", 2 * len(DECOUPLINGS) * len(settings.snap_times))
    arrays: dict[str, Any] = {"points": points, "snap_times": np.array(settings.snap_times)}
    rows = []
    for kind in DECOUPLINGS:
        decoupled = decouple(plant, n_flex=n_flex, input_decoupling=kind, degree=DEGREE)
        for place, outputs in (("sensors", None), ("point of control", plant.performance_gains)):
            peaks = []
            for snap_time in settings.snap_times:
                step = FourthOrderStep(distance=1.0, snap_time=snap_time)
                error = step_error(decoupled, step, points, settle=settings.settle, outputs=outputs)
                peaks.append(_scaled(error, np.array(settings.distances)))
                rows.append({"decoupling": kind, "place": place, "snap_time": snap_time, **_row(peaks[-1])})
                progress.update()
            for key in ("during", "after"):
                arrays[f"{kind}_{place.replace(' ', '_')}_{key}"] = np.array(
                    [np.max(one[key], axis=0) for one in peaks]
                )
    return Found(values={"n_flex": n_flex, "rows": rows, "n_points": len(points)}, arrays=arrays)


def _scaled(error: StepError, distances: Array) -> dict[str, Array]:
    """Errors (N, 6, 6) for steps of the wanted distances."""
    names = ("during", "after", "preserved_during", "preserved_after")
    return {name: getattr(error, name) * distances for name in names}


def _row(peaks: dict[str, Array]) -> dict[str, Any]:
    """Worst over positions of the error along the axis that moves, and of the height."""
    own = np.arange(6)
    out: dict[str, Any] = {name: np.max(value, axis=0)[own, own] for name, value in peaks.items()}
    out |= {f"{name}_z": np.max(peaks[name], axis=0)[2] for name in ("during", "after")}
    return out


def maps(settings: Settings, progress: Progress) -> Found:
    """Relative forces on the preserved modes over P, with both decouplings."""
    plant = machine(settings)
    points = grid(plant.box, settings.map_grid)
    progress.stage("maps over P", len(points))
    arrays: dict[str, Any] = {
        "axis": np.linspace(plant.box[0, 0], plant.box[0, 1], settings.map_grid),
        "points": points,
    }
    for kind in DECOUPLINGS:
        decoupled = decouple(plant, n_flex=settings.n_flex, input_decoupling=kind, degree=DEGREE)
        arrays[kind] = mode_excitation(decoupled, points).relative[:, : settings.n_flex]
    arrays["mode_hertz"] = plant.modal.omega[6 : 6 + settings.n_flex] / (2 * np.pi)
    largest = {kind: float(np.max(np.abs(arrays[kind]))) for kind in DECOUPLINGS}
    return Found(values={"n_points": len(points), "largest": largest}, arrays=arrays)
