"""Fully actuated plants: what coupled channels cost, and what the Q of the band-pass in K_FM does about it.

A plant with six virtual forces for six axes and a controlled mode shares them by weighted least squares; the
over-actuated one is the reference. Designs for every plant, all with the same filters:

* conventional: K_RB alone;
* start: K_RB, L and xi co-designed with the first Q of the settings, from the gains of the conventional design;
* Q-...: the same for every Q, each from the parameters of the start and at its positions.

The start is also looked at with other Q and its gains held. Each design ends as a folder of arrays; the report and the
figure are made from these folders alone.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import lpvhinf
from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.codesign import Design, Specification, codesign, measure
from lpvhinf.codesign.report import figures
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa import MMPA, benchmark
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS
from lpvhinf.progress import Progress
from lpvhinf.storage import make_folder, read_arrays, read_json, write_arrays, write_json
from studies.full_actuation_coupling import LoopCoupling, damping, loop_coupling, with_Q
from studies.full_actuation_report import write_report
from studies.positions import grid
from studies.record import run_record
from studies.results import belongs
from studies.settings import fingerprint

__all__ = ["NAME", "Job", "Settings", "jobs_of", "run", "run_design", "write_report"]

NAME = "full_actuation"
DESIGN = "lpvhinf.Design"
ARRAYS = "lpvhinf.FullActuation"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    f_bw: float
    epsilon: float
    n_plant_modes: int
    degree: int
    mode_weights: tuple[float, ...]
    Qs: tuple[float, ...]
    held_Qs: tuple[float, ...]
    n_positions: int
    exchange_rounds: int
    n_search: int
    max_iterations: int
    tolerance: float
    measure_grid: int
    coupling_grid: int
    magnetics: str = "exact"
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        for name in ("f_bw", "epsilon", "tolerance"):
            positive(name, getattr(self, name))
        for name in ("mode_weights", "Qs", "held_Qs"):
            value = getattr(self, name)
            if len(finite_array(name, value, (None,))) == 0 or np.min(value) <= 0.0:
                raise DomainError(f"{name} is {value}, wanted at least one value above 0.")
            if len(set(value)) != len(value):
                raise DomainError(f"{name} is {value}, wanted different values.")
        for name in ("degree", "exchange_rounds", "seed"):
            whole_number(name, getattr(self, name), 0)
        for name in ("n_plant_modes", "n_positions", "n_search", "max_iterations", "measure_grid", "coupling_grid"):
            whole_number(name, getattr(self, name), 1)
        whole_number("jobs", self.jobs, 1)
        if self.magnetics not in KINDS:
            raise DomainError(f"magnetics is {self.magnetics!r}, wanted one of {', '.join(KINDS)}.")


@dataclass(frozen=True, kw_only=True)
class Job:
    """One design: its plant (None: over-actuated), and its Q (None: no observer)."""

    name: str
    mode_weight: float | None
    Q: float | None
    start: str | None = None  # the design whose parameters and positions it begins with

    @property
    def plant(self) -> str:
        """Name of the plant."""
        return plant_name(self.mode_weight)


def plant_name(mode_weight: float | None) -> str:
    """Name of a plant in the folders."""
    return "over" if mode_weight is None else f"full-{mode_weight:g}"


def jobs_of(settings: Settings) -> list[list[Job]]:
    """Three stages, each of which begins with what the one before found."""
    stages: list[list[Job]] = [[], [], []]
    for weight in (None, *settings.mode_weights):
        name = plant_name(weight)
        stages[0].append(Job(name=f"{name}-conventional", mode_weight=weight, Q=None))
        first = settings.Qs[0]
        stages[1].append(Job(name=f"{name}-start", mode_weight=weight, Q=first, start=f"{name}-conventional"))
        stages[2] += [
            Job(name=f"{name}-Q-{Q:g}", mode_weight=weight, Q=Q, start=f"{name}-start") for Q in sorted(settings.Qs)
        ]
    return stages


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`; designs that are there already, from the same settings, are kept."""
    began = time.time()
    make_folder(out)
    stages = jobs_of(settings)
    keys = {job.name: key_of(settings, job) for stage in stages for job in stage}
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "designs.json", keys)  # what belongs to these settings; other folders are leftovers
    for stage in stages:
        tasks = [(job.name, (settings, job, out)) for job in stage]
        run_jobs(run_design, tasks, jobs=settings.jobs, progress=progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began))
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


def key_of(settings: Settings, job: Job) -> str:
    """A key of everything that a stored design depends on."""
    ours = dataclasses.asdict(settings)
    relevant = {k: v for k, v in ours.items() if k not in ("jobs", "mode_weights", "Qs")}
    # designs of one plant begin with the first Q
    return fingerprint(relevant, settings.Qs[0], job, lpvhinf.__version__)


def finished(folder: Path, key: str) -> bool:
    """Whether a folder holds a finished design of this key, every file readable."""
    try:
        summary = read_json(folder / "summary.json")
        read_arrays(folder / "design.npz", DESIGN)
        read_arrays(folder / "coupling.npz", ARRAYS)
    except StorageError:
        return False
    return belongs(summary, key)


@lru_cache(maxsize=1)
def _machine(magnetics: str, n_modes: int) -> MMPA:
    return benchmark(n_flex=n_modes, magnetics=magnetics)


def decoupled_plant(settings: Settings, job: Job) -> DecoupledPlant:
    """The plant of one design."""
    machine = _machine(settings.magnetics, settings.n_plant_modes)
    if job.mode_weight is None:
        return decouple(machine, n_flex=1, degree=settings.degree)
    return decouple(machine, n_flex=1, actuation="full", mode_weight=job.mode_weight, degree=settings.degree)


def run_design(settings: Settings, job: Job, out: Path, progress: Progress) -> None:
    """Design, measure and store one job, unless it is there already."""
    folder = out / "designs" / job.name
    make_folder(folder)
    key = key_of(settings, job)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    began = time.process_time()
    plant = decoupled_plant(settings, job)
    design = _design(settings, job, plant, out, progress)
    seconds = time.process_time() - began
    points = grid(plant.box, settings.measure_grid)
    progress.stage("measures", len(points))
    measures = measure(design, points, progress=progress)
    some = grid(plant.box, settings.coupling_grid)
    progress.stage("coupling of the loops")
    values: dict[str, Any] = {"fingerprint": key, **dataclasses.asdict(job), **figures(design, measures)}
    values |= {"plant": job.plant, "cpu_s": seconds, "damping_median": np.median(measures.damping, axis=0)}
    values["channels"] = dataclasses.asdict(plant.coupling(points))
    arrays: dict[str, Any] = {"points": some, "measure_points": points, "damping": measures.damping}
    if job.Q is not None:
        coupling = loop_coupling(design, some)
        values |= told(coupling)
        names = ("omega", "plant_change", "reaction", "band")
        arrays |= {name: getattr(coupling, name) for name in names}
    if job.name.endswith("-start"):
        values["held"] = held(settings, design, some, points, progress)
    write_arrays(folder / "coupling.npz", ARRAYS, arrays)
    progress.stage("saving")
    design.save(folder)
    write_json(folder / "summary.json", values)  # last: it says that the design is finished


def _design(settings: Settings, job: Job, plant: DecoupledPlant, out: Path, progress: Progress) -> Design:
    """The co-design of one job."""
    begin: dict[str, Any] = {}
    if job.start is not None:
        stored = read_arrays(out / "designs" / job.start / "design.npz", DESIGN)
        kind = "rigid_start" if job.start.endswith("-conventional") else "warm_start"
        begin = {kind: stored["parameters"], "positions": stored["positions"]}
    return codesign(
        plant,
        "rigid-body" if job.Q is None else "output-observer",
        Specification(f_bw=settings.f_bw, epsilon=settings.epsilon, Q=1.0 if job.Q is None else job.Q),
        n_positions=settings.n_positions,
        starts=1,
        exchange_rounds=settings.exchange_rounds,
        n_search=settings.n_search,
        max_iterations=settings.max_iterations,
        tolerance=settings.tolerance,
        seed=settings.seed,
        progress=progress,
        **begin,
    )


def told(coupling: LoopCoupling) -> dict[str, float]:
    """The figures of a coupling of loops that the report quotes: the worst position, and the median one."""
    return {
        "plant_change": float(np.max(coupling.change_in_band)),
        "plant_change_median": float(np.median(coupling.change_in_band)),
        "plant_change_everywhere": float(np.max(coupling.plant_change)),
        "reaction": float(np.max(coupling.reaction_in_band)),
        "reaction_median": float(np.median(coupling.reaction_in_band)),
    }


def held(settings: Settings, design: Design, some: Array, points: Array, progress: Progress) -> list[dict[str, Any]]:
    """One row for each Q with all gains held: gamma, coupling and damping."""
    progress.stage("other Q with the same gains", len(settings.held_Qs))
    rows = []
    for Q in settings.held_Qs:
        one = with_Q(design, Q)
        zeta = damping(one, points)
        row = {"Q": Q, "gamma": one.gamma, **told(loop_coupling(one, some))}
        rows.append(row | {"damping_min": float(np.min(zeta)), "damping_median": float(np.median(zeta))})
        progress.update()
    return rows
