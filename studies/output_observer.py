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
from typing import Any

import numpy as np

import lpvhinf
from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.codesign import Design, Specification, codesign, largest_real_part, measure
from lpvhinf.codesign.measures import block_responses, bounds
from lpvhinf.codesign.report import figures
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import make_folder, read_arrays, read_json, write_arrays, write_json
from studies.output_observer_report import write_report
from studies.positions import grid
from studies.record import run_record
from studies.results import belongs
from studies.settings import fingerprint

NAME = "output_observer"
DESIGN = "lpvhinf.Design"
CHECKPOINT = "lpvhinf.Checkpoint"
MEASURES = "lpvhinf.Measures"
RESPONSES = "lpvhinf.Responses"
SAVE_EVERY = 5.0  # seconds between two checkpoints of one design


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    f_bw: float
    n_flex: int
    n_plant_modes: int
    epsilon: float
    epsilons: tuple[float, ...]
    degree: int
    n_positions: int
    exchange_rounds: int
    n_search: int
    starts: int
    max_iterations: int
    stability_grid: int
    measure_grid: int
    response_grid: int
    with_Ty: bool = True
    magnetics: str = "exact"
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        for name in ("f_bw", "epsilon"):
            positive(name, getattr(self, name))
        if np.any(finite_array("epsilons", self.epsilons, (None,)) <= 0.0):
            raise DomainError(f"epsilons is {self.epsilons}, wanted values above 0.")
        for name in ("degree", "exchange_rounds", "seed"):
            whole_number(name, getattr(self, name), 0)
        for name in ("n_flex", "n_plant_modes", "n_positions", "n_search", "starts", "max_iterations", "jobs"):
            whole_number(name, getattr(self, name), 1)
        for name in ("stability_grid", "measure_grid", "response_grid"):
            whole_number(name, getattr(self, name), 1)
        if not isinstance(self.with_Ty, bool):
            raise DomainError(f"with_Ty is {self.with_Ty!r}, wanted true or false.")
        if self.magnetics not in KINDS:
            raise DomainError(f"magnetics is {self.magnetics!r}, wanted one of {', '.join(KINDS)}.")


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
    checkpoint = folder / "checkpoint.npz"
    design = codesign(
        plant,
        job.architecture,
        specification,
        positions=_conventional_positions(settings, job, out),
        n_positions=settings.n_positions,
        warm_start=_warm_start(folder, key, progress),
        rigid_start=_conventional_gains(job, out),
        starts=settings.starts,
        exchange_rounds=settings.exchange_rounds if job.exchange else 0,
        n_search=settings.n_search,
        max_iterations=settings.max_iterations,
        seed=settings.seed,
        progress=progress,
        checkpoint=_Saver(checkpoint, key),
    )
    points = grid(plant.box, settings.measure_grid)
    progress.stage("measures", len(points))
    measures = measure(design, points, progress=progress)
    dense = grid(plant.box, settings.stability_grid)
    progress.stage("poles on the dense grid", len(dense))
    poles = largest_real_part(design, dense, progress=progress)
    write_arrays(
        folder / "measures.npz",
        MEASURES,
        {**{f.name: getattr(measures, f.name) for f in dataclasses.fields(measures)}, "dense": dense, "poles": poles},
    )
    omega = frequencies(design)
    at = np.vstack([grid(plant.box, settings.response_grid), design.worst_position[None]])
    responses = block_responses(design, at, omega)
    write_arrays(
        folder / "responses.npz",
        RESPONSES,
        {"omega": omega, "points": at, "sigma": responses.sigma, "bounds": bounds(design, omega)},
    )
    progress.stage("saving")
    design.save(folder)
    fit = {name: value.relative_error for name, value in plant.fit.items()}
    values: dict[str, Any] = {"fingerprint": key, **dataclasses.asdict(job), **figures(design, measures)}
    values |= {"largest_real_part": float(np.max(poles)), "n_dense": len(dense), "fit_error": fit}
    values["worst_pole_position"] = dense[int(np.argmax(poles))]
    write_json(folder / "summary.json", values)  # last: it says that the design is finished
    checkpoint.unlink(missing_ok=True)


def frequencies(design: Design) -> Array:
    """Frequencies of the figure [rad/s]: logarithmic, and denser around every eigenfrequency."""
    omega = design.assembly.plant.omega
    flexible = omega[omega > 0.0]
    around = flexible[:, None] * (1.0 + 0.03 * np.linspace(-1.0, 1.0, 25) ** 3)
    return np.unique(np.concatenate([2 * np.pi * np.geomspace(1.0, 2000.0, 400), around.ravel()]))


class _Saver:
    """Writes the best parameters so far, not more often than every few seconds."""

    def __init__(self, path: Path, key: str) -> None:
        self.path, self.key = path, key
        self._last = time.monotonic()

    def __call__(self, theta: Array, gamma: float) -> None:
        if time.monotonic() - self._last >= SAVE_EVERY:
            write_arrays(self.path, CHECKPOINT, {"theta": theta, "gamma": gamma, "key": np.array(self.key)})
            self._last = time.monotonic()


def _warm_start(folder: Path, key: str, progress: Progress) -> Array | None:
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


def _conventional_gains(job: Job, out: Path) -> Array | None:
    """Parameters of K_RB that an observer design starts from."""
    if job.architecture == "rigid-body":
        return None
    return np.asarray(read_arrays(out / "designs" / "conventional" / "design.npz", DESIGN)["parameters"])


def _conventional_positions(settings: Settings, job: Job, out: Path) -> Array | None:
    """Observer designs take over the positions that the conventional design found to matter."""
    if job.architecture == "rigid-body":
        return None
    return np.asarray(read_arrays(out / "designs" / "conventional" / "design.npz", DESIGN)["positions"])
