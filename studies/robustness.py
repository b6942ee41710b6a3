"""Robustness of the stored designs: thousands of perturbed plants, the worst ones by search, and the modes behind them.

Every design of the studies output_observer and error_observer that the settings name and that is finished is closed
around perturbed plants, twice:

* spread: the damping of all flexible modes anywhere in its range;
* held: damping ratios as in the design, everything else perturbed as before.

For unstable loops, in continuous time and sampled, the flexible mode behind the least stable pole is named, with the
damping that it would need. Each part ends as a folder of arrays; the report and the figure are made from these alone.
The results of the other studies lie beside the results folder.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import lpvhinf
from lpvhinf.checks import known_options, positive, whole_number
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.progress import Progress
from lpvhinf.robustness import (
    ControlledPlant,
    MonteCarlo,
    Samples,
    Uncertainty,
    monte_carlo,
    robustness_report,
    worst_case,
)
from lpvhinf.robustness.outcomes import FIGURES, Analysis
from lpvhinf.storage import make_folder, write_json
from studies.plant_results import Found, finished, save
from studies.positions import grid
from studies.record import run_record
from studies.robustness_designs import StoredDesign, find
from studies.robustness_modes import LOOPS, SAMPLED, involved, needed_damping
from studies.robustness_report import write_report
from studies.settings import fingerprint

__all__ = ["NAME", "Settings", "parts_of", "run", "run_part", "write_report"]

NAME = "robustness"
SPREAD, HELD = DAMPINGS = ("spread", "held")
# What decides only which parts there are, or how they are computed.
NOT_OF_A_PART = ("designs", "jobs")
LONGEST_DELAY = 2e-3  # that a known plant is tried with [s]
DELAY_STEP = 2e-6  # to which the delay that it bears is found [s]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    designs: tuple[str, ...]
    n_plants: int
    damping: tuple[float, float]
    held_damping: float
    frequency: tuple[float, float]
    mass: tuple[float, float]
    misalignment: tuple[float, float]
    delay: float
    sample_time: float
    n_exact: int
    n_followed: int
    nominal_grid: int
    searched: tuple[str, ...]
    n_starts: int
    max_evaluations: int
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        for name in ("n_plants", "n_followed", "nominal_grid", "n_starts", "max_evaluations", "jobs"):
            whole_number(name, getattr(self, name), 1)
        for name in ("n_exact", "seed"):
            whole_number(name, getattr(self, name), 0)
        known_options("searched", self.searched, FIGURES)
        positive("held_damping", self.held_damping)
        for name in self.designs:
            places = name.split("/") if isinstance(name, str) else []
            if len(places) != 2 or set(places) & {"", ".", ".."}:
                raise DomainError(
                    f"designs has {name!r}, wanted a study and its design, such as 'output_observer/observer'."
                )
        if not self.designs or len(set(self.designs)) != len(self.designs):
            raise DomainError(f"designs is {self.designs}, wanted at least one, each once.")
        for kind in DAMPINGS:
            self.uncertainty(kind)  # checks all ranges

    def uncertainty(self, kind: str) -> Uncertainty:
        """What is uncertain, with the damping spread or held."""
        return Uncertainty(
            damping=self.damping if kind == SPREAD else (self.held_damping, self.held_damping),
            frequency=self.frequency,
            mass=self.mass,
            misalignment=self.misalignment,
            delay=self.delay,
            sample_time=self.sample_time,
        )


def parts_of(designs: list[StoredDesign]) -> dict[str, tuple[StoredDesign, str]]:
    """The parts by name: a design, and how its damping is perturbed."""
    return {f"{design.name.replace('/', '-')}-{kind}": (design, kind) for design in designs for kind in DAMPINGS}


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`; parts that are there already, from the same settings, are kept.

    Raises
    ------
    StorageError
        If none of the designs is finished.
    """
    began = time.time()
    make_folder(out)
    sources = {name: find(out.resolve().parent, name) for name in settings.designs}
    designs, missing = [one for one in sources.values() if one], [name for name, one in sources.items() if not one]
    if not designs:
        raise StorageError(
            f"{out.resolve().parent} has no finished design of {', '.join(settings.designs)}. "
            "Run the studies that make them into the same folder first."
        )
    if missing:
        progress.log(f"left out, as they are not finished: {', '.join(missing)}")
    parts = parts_of(designs)
    keys = {name: key_of(settings, design, kind) for name, (design, kind) in parts.items()}
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "parts.json", keys)  # what belongs to these settings; other folders are leftovers
    write_json(out / "missing.json", missing)
    for name, (design, kind) in parts.items():
        progress.log(name)
        run_part(settings, design, kind, out / "parts" / name, progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began))
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


def key_of(settings: Settings, design: StoredDesign, kind: str) -> str:
    """A key of everything that a stored part depends on."""
    relevant = {key: value for key, value in dataclasses.asdict(settings).items() if key not in NOT_OF_A_PART}
    return fingerprint(relevant, design.name, design.fingerprint, kind, lpvhinf.__version__)


def run_part(settings: Settings, design: StoredDesign, kind: str, folder: Path, progress: Progress) -> None:
    """Perturb, search and store one part, unless it is there already."""
    make_folder(folder)
    key = key_of(settings, design, kind)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    began = time.process_time()
    subject, uncertainty = design.subject(), settings.uncertainty(kind)
    result = monte_carlo(
        subject,
        uncertainty,
        settings.n_plants,
        seed=settings.seed,
        n_exact=settings.n_exact,
        jobs=settings.jobs,
        progress=progress,
        store=folder / f"plants-{fingerprint(design.fingerprint, uncertainty, settings.seed, lpvhinf.__version__)}",
    )
    after = time.process_time()
    cases = [
        worst_case(
            result,
            figure,
            n_starts=settings.n_starts,
            max_evaluations=settings.max_evaluations,
            progress=progress,
        )
        for figure in settings.searched
    ]
    outcomes, samples = result.outcomes, result.samples
    arrays: dict[str, Any] = {**outcomes.arrays(), "zeta": samples.zeta, "position": samples.position}
    values: dict[str, Any] = {
        "design": design.name,
        "kind": kind,
        "architecture": design.summary["architecture"],
        "epsilon": design.summary["epsilon"],
        "magnetics": design.settings["magnetics"],
        "n_plant_modes": design.settings["n_plant_modes"],
        "n_controlled": subject.plant.n_flex,
        "frequency_Hz": subject.plant.omega[subject.plant.n_rb :] / (2 * np.pi),
        "design_damping": subject.plant.zeta[subject.plant.n_rb :],
        "nominal": nominal(settings, subject, uncertainty),
        **robustness_report(result, cases),
        "culprits": {},
    }
    for loop in LOOPS:
        values["culprits"][loop], more = culprits(settings, result, loop, progress)
        arrays |= {f"{loop}_{name}": found for name, found in more.items()}
    values |= {"cpu_s": time.process_time() - began, "cpu_s_plants": after - began}
    save(folder, key, Found(values=values, arrays=arrays))


def nominal(settings: Settings, subject: ControlledPlant, uncertainty: Uncertainty) -> dict[str, float]:
    """The plant as it was known, with the delay, over a grid of positions; and the delay that it bears there."""
    samples = Samples.nominal(subject.plant, grid(subject.plant.box, settings.nominal_grid))
    found = Analysis(subject, uncertainty).measure(samples, ["abscissa", "spectral_radius", "sensitivity"])
    return {
        "abscissa": float(np.max(found.abscissa)),
        "spectral_radius": float(np.max(found.spectral_radius)),
        "sensitivity": float(np.max(found.sensitivity)),
        "delay_margin": delay_margin(subject, uncertainty, samples),
    }


def delay_margin(subject: ControlledPlant, uncertainty: Uncertainty, samples: Samples) -> float:
    """Smallest delay [s] with which a continuous loop of the samples is unstable: by bisection, or infinity."""

    def unstable(delay: float) -> bool:
        changed = dataclasses.replace(uncertainty, delay=delay)
        return bool(np.any(Analysis(subject, changed).measure(samples, ["abscissa"]).unstable))

    low, high = 0.0, LONGEST_DELAY
    if unstable(low):
        return 0.0
    if not unstable(high):
        return np.inf
    while high - low > DELAY_STEP:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return high


def culprits(
    settings: Settings, result: MonteCarlo, loop: str, progress: Progress
) -> tuple[dict[str, Any], dict[str, Any]]:
    """For the first unstable plants: the mode behind it, its damping, and the damping that it would need."""
    outcomes = result.outcomes
    unstable = np.flatnonzero(outcomes.unstable_sampled if loop == SAMPLED else outcomes.unstable)
    which = unstable[: settings.n_followed]
    progress.stage(f"modes behind unstable {loop} loops", len(which))
    analysis, samples = Analysis(result.subject, result.uncertainty), result.samples.take(which)
    found = involved(analysis, samples, loop)
    needed = needed_damping(analysis, samples, found.mode, loop)
    modes, counts = np.unique(found.mode, return_counts=True)
    rows = []
    for mode in modes[np.argsort(-counts, kind="stable")]:
        own = found.mode == mode
        rows.append(
            {
                "mode": int(mode) + 1,
                "count": int(np.sum(own)),
                "pole_Hz": float(np.median(found.frequency[own])),
                "part": float(np.median(found.part[own])),
                "damping_median": float(np.median(found.damping[own])),
                "damping_max": float(np.max(found.damping[own])),
                "needed_median": float(np.median(needed[own])),
                "needed_max": float(np.max(needed[own])),
                "hopeless": int(np.sum(np.isinf(needed[own]))),
            }
        )
    arrays = {"plant": which, "mode": found.mode, "part": found.part, "needed": needed}
    return {"unstable": len(unstable), "followed": len(which), "modes": rows}, arrays
