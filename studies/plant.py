"""The planar actuator that the other studies use: its figures, validation, polynomial model, effects and coupling.

Parts, each of which ends as a folder of figures and arrays:

* summary: mass, modes, forces, coil currents and position dependence, beside the benchmark's description;
* validation: published plate frequencies, frequency responses of two kinds, energy balance, the two fields;
* polynomial-0, polynomial-1, ...: the error of the LPV polynomial model against its degree, by controlled modes;
* windows: the same error, coil currents and copper loss against the windows of the commutation;
* effects: how far deviations of the machine from its known model disturb the decoupling;
* full-actuation: coupling of the channels when there are only six virtual forces;
* geometry, maps, responses: arrays of the figures.

The report and the figures are made from these folders alone.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path

import lpvhinf
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.progress import Progress
from lpvhinf.storage import make_folder, write_json
from studies.plant_effects import effects
from studies.plant_full_actuation import full_actuation
from studies.plant_geometry import geometry
from studies.plant_maps import maps
from studies.plant_polynomial import polynomial
from studies.plant_report import write_report
from studies.plant_responses import responses
from studies.plant_results import Found, finished, save
from studies.plant_settings import Settings
from studies.plant_summary import summary
from studies.plant_validation import validation
from studies.plant_windows import windows
from studies.record import run_record
from studies.settings import fingerprint

__all__ = ["NAME", "Settings", "parts_of", "run", "run_part", "write_report"]

NAME = "plant"
WORK: dict[str, Callable[[Settings, Progress], Found]] = {
    "summary": summary,
    "validation": validation,
    "windows": windows,
    "effects": effects,
    "full-actuation": full_actuation,
    "geometry": geometry,
    "maps": maps,
    "responses": responses,
}


def parts_of(settings: Settings) -> list[str]:
    """Names of the parts, the longest first, so that processes end at about the same time."""
    longest = ["effects", "windows", *(f"polynomial-{n}" for n in sorted(settings.n_flexes, reverse=True))]
    return longest + [name for name in WORK if name not in longest]


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
    relevant = {key: value for key, value in dataclasses.asdict(settings).items() if key != "jobs"}
    return fingerprint(relevant, name, lpvhinf.__version__)


def run_part(settings: Settings, name: str, out: Path, progress: Progress) -> None:
    """Compute and store one part, unless it is there already."""
    folder, key = out / "parts" / name, key_of(settings, name)
    make_folder(folder)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    kind, _, n_flex = name.partition("polynomial-")
    found = WORK[kind](settings, progress) if kind else polynomial(settings, int(n_flex), progress)
    save(folder, key, found)
