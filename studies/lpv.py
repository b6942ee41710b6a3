"""Scheduled controllers of full order on the actuator's out-of-plane axes, against co-designs of constant gains.

All designs have the same weighted problem (see `studies.lpv_plants`): gridded ones for several grids and rates, one
with constant R and S, a polytopic one, state feedback as a bound, and the structured co-designs. What is judged is the
polynomial fit of the controller: on the design plant, and in truth, on the plant with all its modes. Each design ends
as a folder; the report and the figures are made from these folders alone.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lpvhinf
from lpvhinf.checks import finite_array, positive, whole_number
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS
from lpvhinf.progress import Progress
from lpvhinf.storage import make_folder, read_arrays, read_json, write_arrays, write_json
from studies.lpv_designs import STRUCTURED, Effort, Job, judged, make
from studies.lpv_plants import Problem, build
from studies.lpv_report import write_report
from studies.record import run_record
from studies.results import belongs
from studies.settings import fingerprint

__all__ = ["NAME", "Settings", "jobs_of", "run", "run_design", "write_report"]

NAME = "lpv"
ARRAYS = "lpvhinf.LPVStudy"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    f_bw: float
    epsilon: float
    n_flex: int
    n_plant_modes: int
    degree: int
    leak: float
    u_FM_weight: float
    noise: float
    uncertainty: float
    f_uncertainty: float
    grids: tuple[int, ...]
    degrees: tuple[int, ...]
    speeds: tuple[float, ...]
    max_iterations: int
    gap: float
    backoff: float
    time_limit: float
    fit_degree: int
    f_lag: float
    n_truth: int
    n_frequencies: int
    magnetics: str = "exact"
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        names = ("f_bw", "epsilon", "leak", "u_FM_weight", "noise", "uncertainty", "f_uncertainty", "gap", "time_limit")
        for name in (*names, "f_lag"):
            positive(name, getattr(self, name))
        if positive("backoff", self.backoff) < 1.0:
            raise DomainError(f"backoff is {self.backoff}, wanted at least 1.")
        for name, lowest in (("grids", 2), ("degrees", 1)):
            if not getattr(self, name):
                raise DomainError(f"{name} is empty, wanted at least one value.")
            for value in getattr(self, name):
                whole_number(name, value, lowest)
        if not len(self.speeds) or np.min(finite_array("speeds", self.speeds, (None,))) < 0.0:
            raise DomainError(f"speeds is {self.speeds}, wanted at least one value, none below 0.")
        for name in ("n_flex", "n_plant_modes", "degree", "max_iterations", "fit_degree", "n_truth", "n_frequencies"):
            whole_number(name, getattr(self, name), 1)
        whole_number("seed", self.seed, 0)
        whole_number("jobs", self.jobs, 1)
        if self.magnetics not in KINDS:
            raise DomainError(f"magnetics is {self.magnetics!r}, wanted one of {', '.join(KINDS)}.")


def jobs_of(settings: Settings) -> list[Job]:
    """All designs, the quick ones first."""
    first = min(settings.grids)
    highest = max(settings.speeds)
    out = [Job(name=f"pointwise-{n * n}", kind="pointwise", n_grid=n) for n in settings.grids]
    out += [Job(name=f"constant-{n * n}", kind="gridded", n_grid=n) for n in settings.grids]
    out += [
        Job(name=f"gridded-{n * n}-{degree}-{speed:g}", kind="gridded", n_grid=n, degree=degree, speed=speed)
        for n in settings.grids
        for degree in settings.degrees
        for speed in settings.speeds
        if (degree + 1) * (degree + 2) // 2 < n * n  # else R(p) is hardly bounded between the points
    ]
    out += [Job(name="state-feedback", kind="state-feedback", n_grid=first, degree=1, speed=highest)]
    out += [Job(name="polytopic", kind="polytopic", n_grid=2)]
    out += [Job(name=kind, kind=kind, n_grid=first) for kind in STRUCTURED]
    return out


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`; designs that are there already, from the same settings, are kept."""
    began = time.time()
    make_folder(out)
    jobs = jobs_of(settings)
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "designs.json", {job.name: key_of(settings, job) for job in jobs})
    run_jobs(run_design, [(job.name, (settings, job, out)) for job in jobs], jobs=settings.jobs, progress=progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began))
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


def key_of(settings: Settings, job: Job) -> str:
    """A key of everything that a stored design depends on."""
    ours = dataclasses.asdict(settings)
    relevant = {k: v for k, v in ours.items() if k not in ("jobs", "grids", "degrees", "speeds")}
    return fingerprint(relevant, job, lpvhinf.__version__)


def problem_of(settings: Settings) -> Problem:
    """The problem that all designs have."""
    names = ("f_bw", "epsilon", "n_flex", "n_plant_modes", "degree", "magnetics", "leak", "u_FM_weight", "noise")
    return build(**{name: getattr(settings, name) for name in (*names, "uncertainty", "f_uncertainty")})


def finished(folder: Path, key: str) -> bool:
    """Whether a folder holds a finished design of this key, every file readable."""
    try:
        summary = read_json(folder / "summary.json")
        read_arrays(folder / "sigma.npz", ARRAYS)
    except StorageError:
        return False
    return belongs(summary, key)


def run_design(settings: Settings, job: Job, out: Path, progress: Progress) -> None:
    """Design, judge and store one job, unless it is there already."""
    folder, key = out / "designs" / job.name, key_of(settings, job)
    make_folder(folder)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    problem = problem_of(settings)
    progress.stage("design")
    effort = Effort(**{field.name: getattr(settings, field.name) for field in dataclasses.fields(Effort)})
    made = make(problem, job, effort, progress)
    omega = 2 * np.pi * np.geomspace(1.0, 1000.0, settings.n_frequencies)
    values = {"fingerprint": key, **dataclasses.asdict(job), **made.figures}
    values["box"], values["n_full"] = problem.box, problem.at(np.mean(problem.box, axis=1)).n_x
    sigma = np.zeros((0, len(omega)))
    if made.plants is not None:
        progress.stage("truth", 1)
        figures, sigma = judged(problem, made, settings.n_truth, omega, progress)
        values |= figures
    if made.fitted is not None:
        made.fitted.save(folder / "controller.npz")
    write_arrays(folder / "sigma.npz", ARRAYS, {"omega": omega, "sigma": sigma})
    write_json(folder / "summary.json", values)  # last: it says that the design is finished
