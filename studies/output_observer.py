"""The paper's first result: 6-block co-design with the output-based modal observer, beside the conventional 4-block.

Designs, all with the same filters, fixed before tuning:

* conventional: K_RB alone, with the extended modal decoupling;
* conventional-rigid: K_RB alone, with the rigid-body decoupling of eq. 6;
* observer: K_RB, L and xi co-designed; and the same for other values of epsilon;
* observer-Ty: the same with T_y of eq. 6 as the observer's only measurement.

Each design ends as a folder of arrays; the report and the figures are made from these folders alone.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from pathlib import Path

import lpvhinf
from lpvhinf.checks import Array
from lpvhinf.codesign import Specification, codesign
from lpvhinf.codesign.measures import block_responses, bounds
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.progress import SILENT, Progress
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
from studies.codesign_settings import CodesignSettings
from studies.output_observer_report import write_report
from studies.record import run_record
from studies.settings import fingerprint

NAME = "output_observer"


@dataclass(frozen=True, kw_only=True)
class Settings(CodesignSettings):
    """Settings of the study; see the presets for their meaning."""

    with_Ty: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.with_Ty, bool):
            raise DomainError(f"with_Ty is {self.with_Ty!r}, wanted true or false.")


@dataclass(frozen=True, kw_only=True)
class Job:
    """One design of the study."""

    name: str
    architecture: str
    input_decoupling: str = "extended"
    sensing: str = "all"
    epsilon: float
    exchange: bool = True


def jobs_of(settings: Settings) -> tuple[list[Job], list[Job]]:
    """The conventional designs, and the observer designs that start from the first of them."""
    main = settings.epsilon
    conventional = [
        Job(name="conventional", architecture="rigid-body", epsilon=main),
        Job(name="conventional-rigid", architecture="rigid-body", input_decoupling="rigid-body", epsilon=main),
    ]
    observers = [Job(name="observer", architecture="output-observer", epsilon=main)]
    if settings.with_Ty:
        # one round is enough to show what it cannot do; early, because it takes longest
        literal = Job(
            name="observer-Ty", architecture="output-observer", sensing="rigid-body", epsilon=main, exchange=False
        )
        observers.append(literal)
    observers += [
        Job(name=f"observer-epsilon-{value:g}", architecture="output-observer", epsilon=value)
        for value in sorted(settings.epsilons, reverse=True)  # the most demanding first: they take longest
        if value != main
    ]
    return conventional, observers


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`; designs that are there already, from the same settings, are kept."""
    began = time.time()
    make_folder(out)
    conventional, observers = jobs_of(settings)
    keys = {job.name: key_of(settings, job) for job in [*conventional, *observers]}
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "designs.json", keys)  # what belongs to these settings; other folders are leftovers
    for stage in (conventional, observers):
        tasks = [(job.name, (settings, job, out)) for job in stage]
        run_jobs(run_design, tasks, jobs=settings.jobs, progress=progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began))
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


def key_of(settings: Settings, job: Job) -> str:
    """A key of everything that a stored design depends on."""
    ours = dataclasses.asdict(settings)
    relevant = {k: v for k, v in ours.items() if k not in ("jobs", "epsilons", "epsilon", "with_Ty")}
    return fingerprint(relevant, job, lpvhinf.__version__)


def decoupled_plant(settings: Settings, job: Job, progress: Progress = SILENT) -> DecoupledPlant:
    """The plant of one design."""
    return decouple(
        benchmark(n_flex=settings.n_plant_modes, magnetics=settings.magnetics, progress=progress),
        n_flex=settings.n_flex,
        input_decoupling=job.input_decoupling,
        sensing=job.sensing,
        degree=settings.degree,
    )


def run_design(settings: Settings, job: Job, out: Path, progress: Progress) -> None:
    """Design, measure and store one job, unless it is there already."""
    folder = out / "designs" / job.name
    make_folder(folder)
    key = key_of(settings, job)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    plant = decoupled_plant(settings, job, progress)
    specification = Specification(f_bw=settings.f_bw, epsilon=job.epsilon)
    design = codesign(
        plant,
        job.architecture,
        specification,
        positions=_conventional_positions(settings, job, out),
        n_positions=settings.n_positions,
        warm_start=warm_start(folder, key, progress),
        rigid_start=_conventional_gains(job, out),
        starts=settings.starts,
        exchange_rounds=settings.exchange_rounds if job.exchange else 0,
        n_search=settings.n_search,
        max_iterations=settings.max_iterations,
        seed=settings.seed,
        progress=progress,
        checkpoint=Saver(folder, key),
    )
    values = write_measures(folder, design, settings, progress)
    omega, at = frequencies(design), response_points(design, settings)
    responses = block_responses(design, at, omega)
    write_arrays(
        folder / "responses.npz",
        RESPONSES,
        {"omega": omega, "points": at, "sigma": responses.sigma, "bounds": bounds(design, omega)},
    )
    progress.stage("saving")
    write_finished(folder, design, {"fingerprint": key, **dataclasses.asdict(job), **values})


def _conventional_gains(job: Job, out: Path) -> Array | None:
    """Parameters of K_RB that an observer design starts from."""
    if job.architecture == "rigid-body":
        return None
    return stored(out, "conventional", "parameters")


def _conventional_positions(settings: Settings, job: Job, out: Path) -> Array | None:
    """Observer designs take over the positions that the conventional design found to matter."""
    if job.architecture == "rigid-body":
        return None
    return stored(out, "conventional", "positions")
