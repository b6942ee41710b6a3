"""The error-based modal observer: the 2x2-block co-design, and what its damping costs beside the output-based one.

Designs, all with the same filters, fixed before tuning:

* inactive: K_RB alone, tuned on the left column of the 2x2 problem;
* error-epsilon-..., output-epsilon-...: K_RB, L and xi for the same problem, for both observers and several epsilon;
* conventional-...Hz-n, output-..., error-...: more controlled modes and another bandwidth, each for its own problem of
  the paper (4-block, 6-block, 2x2-block), measured on the columns that all have;
* ...-seed-k: the main three designs from other design positions and other starts.

Each design ends as a folder of arrays; the report and the figures are made from these folders alone.
"""

from __future__ import annotations

import dataclasses
import time
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, Specification, codesign, complexity
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.measures import block_responses
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.problems import TWO_BY_TWO, magnitudes
from lpvhinf.progress import Progress
from lpvhinf.storage import make_folder, write_arrays, write_json
from studies.codesign_folder import (
    RESPONSES,
    Saver,
    finished,
    frequencies,
    response_points,
    stored,
    warm_start,
    write_finished,
    write_measures,
)
from studies.column_search import columns_over_P, coupling
from studies.error_observer_jobs import Job as Job
from studies.error_observer_jobs import Settings as Settings
from studies.error_observer_jobs import jobs_of, key_of
from studies.error_observer_report import write_report as write_report
from studies.positions import grid
from studies.record import run_record

NAME = "error_observer"
OTHER_STARTS = (0.7, 1.1)  # of other seeds: rules of thumb for so many times the bandwidth


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`; designs that are there already, from the same settings, are kept."""
    began = time.time()
    make_folder(out)
    alone, observers = jobs_of(settings)
    keys = {job.name: key_of(settings, job) for job in [*alone, *observers]}
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "designs.json", keys)  # what belongs to these settings; other folders are leftovers
    for stage in (alone, observers):
        tasks = [(job.name, (settings, job, out)) for job in stage]
        run_jobs(run_design, tasks, jobs=settings.jobs, progress=progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began))
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


@lru_cache(maxsize=3)
def decoupled_plant(n_plant_modes: int, magnetics: str, n_flex: int, degree: int) -> DecoupledPlant:
    """The plant of several designs, made once in every process."""
    return decouple(benchmark(n_flex=n_plant_modes, magnetics=magnetics), n_flex=n_flex, degree=degree)


def run_design(settings: Settings, job: Job, out: Path, progress: Progress) -> None:
    """Design, measure and store one job, unless it is there already."""
    folder = out / "designs" / job.name
    make_folder(folder)
    key = key_of(settings, job)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    began = time.process_time()
    progress.stage("plant")
    plant = decoupled_plant(settings.n_plant_modes, settings.magnetics, job.n_flex, settings.degree)
    specification = Specification(f_bw=job.f_bw, epsilon=job.epsilon)
    before = time.process_time()
    design = codesign(
        plant,
        job.architecture,
        specification,
        problem=job.problem,
        positions=None if job.start is None else stored(out, job.start, "positions"),
        n_positions=settings.n_positions,
        warm_start=warm_start(folder, key, progress),
        rigid_start=_rigid_start(settings, job, plant, specification, out),
        starts=settings.starts,
        exchange_rounds=settings.exchange_rounds,
        n_search=settings.n_search,
        max_iterations=settings.max_iterations,
        seed=job.seed,
        progress=progress,
        checkpoint=Saver(folder, key),
    )
    after = time.process_time()
    arrays, values = _columns(design, settings, job, progress)
    values |= write_measures(folder, design, settings, progress, **arrays)
    cost = complexity(design)
    values |= {"multiplications": cost.multiplications, "scheduling": cost.scheduling}
    values["gamma_over_P"] = _gamma_over_P(design, values["columns"])
    _write_responses(folder, design, settings)
    progress.stage("saving")
    # design alone, and with plant and measures
    values |= {"cpu_seconds_design": after - before, "cpu_seconds": time.process_time() - began}
    write_finished(folder, design, {"fingerprint": key, **dataclasses.asdict(job), **values})


def _rigid_start(
    settings: Settings, job: Job, plant: DecoupledPlant, specification: Specification, out: Path
) -> Array | None:
    """Parameters of K_RB to start from: of another design, or for another seed of another rule of thumb."""
    if job.start is not None:
        return stored(out, job.start, "parameters")
    if job.seed == settings.seed:
        return None
    factor = float(np.random.default_rng(job.seed).uniform(*OTHER_STARTS))
    structure = Assembly(plant=plant, specification=specification, architecture=job.architecture).rigid_body
    return structure.parameters(structure.rule_of_thumb(factor * specification.bandwidths(plant.n_rb)))


def _columns(
    design: Design, settings: Settings, job: Job, progress: Progress
) -> tuple[dict[str, Array], dict[str, Any]]:
    """Column norms at the positions of the measures, and their largest values over P."""
    points = grid(design.assembly.plant.box, settings.measure_grid)
    arrays: dict[str, Array] = {}
    values: dict[str, Any] = {"columns": {}}
    for problem in job.measured:
        there, values["columns"][problem] = columns_over_P(
            design, points, problem=problem, n_search=settings.n_search, seed=settings.seed, progress=progress
        )
        for name in ("rigid", "flexible", "whole"):
            arrays[f"{name}_{problem}"] = getattr(there, name)
        if problem == TWO_BY_TWO and design.assembly.observer is not None:
            values["coupling"] = coupling(design, design_and_worst(design), problem=problem)
    return arrays, values


def design_and_worst(design: Design) -> Array:
    """The design positions and the worst position."""
    return np.vstack([design.positions, design.worst_position[None]])


def _gamma_over_P(design: Design, columns: dict[str, Any]) -> float:
    """The largest norm that counts in the design's own problem, of the searches of the design and of the measures."""
    counted = "rigid" if design.assembly.observer is None else "whole"
    return max(design.gamma_worst, float(columns[design.problem][counted]))


def _write_responses(folder: Path, design: Design, settings: Settings) -> None:
    """The four blocks of the 2x2 problem without filters, and the bounds of the filters."""
    omega, at = frequencies(design), response_points(design, settings)
    sigma = block_responses(design, at, omega).sigma[:, :, 1:]
    W_z, W_w = magnitudes(TWO_BY_TWO, design.assembly.filters, omega)
    bounds = [[1.0 / (np.max(z, axis=1) * np.max(w, axis=1)) for w in W_w] for z in W_z]
    write_arrays(
        folder / "responses.npz", RESPONSES, {"omega": omega, "points": at, "sigma": sigma, "bounds": np.array(bounds)}
    )
