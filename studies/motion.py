"""Scans with p moving along: what each stored design gains at the point of control, and at which positions.

The designs come from the results folders of other studies that lie beside the folder of this one. One part a design:
scans from several positions, each with the set-point alone ("tracking") and with noise of sensors and currents and a
floor that moves ("disturbed"). The report and the figure are made from these folders alone.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import lpvhinf
from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa import MMPA, benchmark
from lpvhinf.progress import Progress
from lpvhinf.simulation import (
    Actuators,
    MotionLimits,
    Scan,
    cumulative_power,
    floor_acceleration,
    rms_and_peak,
    scan,
    settling_time,
    simulate,
    window_errors,
)
from lpvhinf.simulation.loop import Motion
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import make_folder, read_json, write_json
from studies.motion_report import write_report
from studies.plant_results import Found, finished, save
from studies.record import run_record
from studies.settings import fingerprint

__all__ = ["NAME", "Settings", "run", "run_part", "write_report"]

NAME = "motion"
SCENARIOS = ("tracking", "disturbed")
SCAN_AXIS, HEIGHT = 1, 2
EVERY = 40  # samples between two positions at which the commutation is computed
POSITIVE = (
    "length", "velocity", "step", "acceleration", "jerk", "snap", "slit", "tolerance", "period", "delay",
    "floor_velocity", "current_limit",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    designs: tuple[str, ...]
    centres: tuple[float, ...]
    length: float
    velocity: float
    step: float
    lines: int
    settle_time: float
    acceleration: float
    jerk: float
    snap: float
    slit: float
    tolerance: float
    period: float
    delay: float
    noise: float
    quantisation: float
    floor_velocity: float
    floor_band: tuple[float, ...]
    current_noise: float
    current_limit: float
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        for name in POSITIVE:
            positive(name, getattr(self, name))
        for name in ("settle_time", "noise", "quantisation", "current_noise"):
            if finite_array(name, getattr(self, name), ()) < 0.0:
                raise DomainError(f"{name} is {getattr(self, name)}, wanted 0 or more.")
        finite_array("floor_band", self.floor_band, (2,))
        finite_array("centres", self.centres, (None,))
        for name, least in (("lines", 1), ("seed", 0), ("jobs", 1)):
            whole_number(name, getattr(self, name), least)
        if not self.designs or not self.centres:
            raise DomainError("designs or centres is empty, wanted at least one of each.")
        for design in self.designs:
            if design.count("/") != 1:
                raise DomainError(f"designs has {design!r}, wanted names such as output_observer/observer.")
        if len(set(map(part_name, self.designs))) < len(self.designs):
            raise DomainError(f"designs is {list(self.designs)}, wanted every design once.")


def part_name(design: str) -> str:
    """Name of the folder of a design's part."""
    return design.replace("/", "-")


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`, from the designs beside it; finished parts are kept."""
    began = time.time()
    make_folder(out)
    keys = {part_name(name): key_of(settings, name, out.parent) for name in settings.designs}
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "parts.json", keys)
    jobs = [(part_name(name), (settings, name, out)) for name in settings.designs]
    run_jobs(run_part, jobs, jobs=settings.jobs, progress=progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began))
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


def key_of(settings: Settings, design: str, source: Path) -> str:
    """A key of everything that a stored part depends on, the design itself included.

    Raises
    ------
    StorageError
        If there is no such design.
    """
    relevant = {k: value for k, value in dataclasses.asdict(settings).items() if k not in ("jobs", "designs")}
    summary = read_json(design_folder(source, design) / "summary.json")
    return fingerprint(relevant, design, summary["fingerprint"], lpvhinf.__version__)


def design_folder(source: Path, design: str) -> Path:
    """Where a design of another study is kept."""
    study, name = design.split("/")
    folder = source / study / "designs" / name
    if not (folder / "summary.json").is_file():
        raise StorageError(f"{folder} holds no finished design. Run the study {study} into {source / study} first.")
    return folder


def run_part(settings: Settings, design: str, out: Path, progress: Progress) -> None:
    """Simulate one design and store what it does, unless it is there already."""
    folder, key = out / "parts" / part_name(design), key_of(settings, design, out.parent)
    make_folder(folder)
    if finished(folder, key):
        progress.log("taken from the results folder")
        return
    save(folder, key, scans(settings, design, out.parent, progress))


@lru_cache(maxsize=1)
def _machine(magnetics: str, n_modes: int) -> MMPA:
    return benchmark(n_flex=n_modes, magnetics=magnetics)


def machine(source: Path, design: str) -> tuple[MMPA, DecoupledPlant]:
    """The machine that a design was made for, and its decoupling, from the settings of the design's study."""
    known = read_json(source / design.split("/")[0] / "settings.json")
    summary = read_json(design_folder(source, design) / "summary.json")
    found = _machine(known["magnetics"], int(known["n_plant_modes"]))
    kind = summary.get("input_decoupling", "extended")
    return found, decouple(found, n_flex=int(known["n_flex"]), input_decoupling=kind, degree=0)


def scans(settings: Settings, design: str, source: Path, progress: Progress) -> Found:
    """All scans of a design."""
    folder = design_folder(source, design)
    plant, controller = (LPVStateSpace.load(folder / f"{name}.npz") for name in ("plant", "controller"))
    true, decoupled = machine(source, design)
    check_modes(plant, decoupled)
    actuators = Actuators(
        matrix=lambda points: decoupled.matrices(points)[1],
        bias=true.levitation_current,
        limit=settings.current_limit,
        every=EVERY,
    )
    starts = [(x, y) for x in settings.centres for y in settings.centres]
    progress.stage("scans", len(starts) * len(SCENARIOS))
    rows: list[dict[str, Any]] = []
    arrays: dict[str, Any] = {"centres": np.array(starts)}
    for number, centre in enumerate(starts):
        path = scan_about(centre, settings, true.box)
        for scenario in SCENARIOS:
            disturbed = scenario == "disturbed"
            began = time.process_time()
            motion = simulate(
                plant,
                controller,
                path.trajectory,
                period=settings.period,
                delay=settings.delay,
                noise=settings.noise if disturbed else 0.0,
                quantisation=settings.quantisation if disturbed else 0.0,
                disturbance=disturbance(settings, path, true) if disturbed else None,
                actuators=actuators,
                seed=settings.seed,
            )
            seconds = time.process_time() - began
            row = {"centre": centre, "scenario": scenario, "status": motion.status, "cpu_seconds": seconds}
            if motion.stopped is None:
                errors = errors_at_the_point(motion, true, decoupled.n_flex)
                row |= judged(settings, path, motion, errors)
                if number == 0:  # at a corner the mode is seen well: for the figure
                    arrays |= kept(settings, path, motion, errors, scenario)
            rows.append(row)
            progress.update()
    return Found(values={"design": design, "rows": rows, "duration": path.trajectory.duration}, arrays=arrays)


def check_modes(plant: LPVStateSpace, decoupled: DecoupledPlant) -> None:
    """The stored plant and the machine have the same modes, signs included, or the point of control is another one's.

    Raises
    ------
    StorageError
        If not.
    """
    centre = np.mean(plant.box, axis=1)[None] + 0.1 * (plant.box[:, 1] - plant.box[:, 0])
    stored, wanted = plant.C.sample(centre)[0][:, 0::2], decoupled.sample(centre).C[0]
    if stored.shape != wanted.shape or np.max(np.abs(stored - wanted)) > 1e-3 * np.max(np.abs(wanted)):
        raise StorageError("the stored plant has other modes than the machine of its settings. Run its study again.")


def scan_about(centre: Sequence[float], settings: Settings, box: Array) -> Scan:
    """A scan along y with its lines about a centre."""
    slow = np.full(6, 1.0)
    limits = MotionLimits(
        velocity=slow, acceleration=settings.acceleration * slow, jerk=settings.jerk, snap=settings.snap
    )
    start, step = np.zeros(6), np.zeros(6)
    start[:2] = centre[0] - 0.5 * settings.step * (settings.lines - 1), centre[1] - 0.5 * settings.length
    step[0] = settings.step
    return scan(
        start,
        axis=SCAN_AXIS,
        length=settings.length,
        velocity=settings.velocity,
        limits=limits,
        lines=settings.lines,
        step=step,
        settle_time=settings.settle_time,
        period=settings.period,
        box=box,
    )


def disturbance(settings: Settings, path: Scan, true: MMPA) -> Array:
    """Modal accelerations by a floor that moves and by noise of the coil currents, (N, n_modes)."""
    times = path.trajectory.times(settings.period)
    rng = np.random.default_rng(settings.seed + 1)
    every = 10  # samples between two positions at which the gains are computed
    points = path.trajectory.position(times[::every])[:, : len(true.box)]
    gains = true.modal.input_gains(np.clip(points, true.box[:, 0], true.box[:, 1]))
    gains[:, : true.modal.n_rb] = true.modal.rigid_body_scaling @ gains[:, : true.modal.n_rb]
    noise = settings.current_noise * rng.standard_normal((len(times), gains.shape[2]))
    out = np.concatenate([noise[i * every : (i + 1) * every] @ gain.T for i, gain in enumerate(gains)])
    out[:, :3] -= floor_acceleration(
        len(times), 3, period=settings.period, velocity_rms=settings.floor_velocity,
        band=(settings.floor_band[0], settings.floor_band[1]), seed=settings.seed + 2,
    )  # fmt: skip
    return np.asarray(out)


def errors_at_the_point(motion: Motion, true: MMPA, n_flex: int) -> dict[str, Array]:
    """Error at the point of control (N, 6), the part of it that is flexible, and that of the controlled modes."""
    gains = true.performance_gains(motion.positions)
    n_rb = true.modal.n_rb
    gains[:, :, :n_rb] = gains[:, :, :n_rb] @ np.linalg.inv(true.modal.rigid_body_scaling)
    whole = motion.error_of(gains)
    gains[:, :, :n_rb] = 0.0
    flexible = motion.error_of(gains)
    gains[:, :, n_rb + n_flex :] = 0.0
    return {"whole": whole, "flexible": flexible, "controlled": motion.error_of(gains)}


def judged(settings: Settings, path: Scan, motion: Motion, errors: dict[str, Array]) -> dict[str, Any]:
    """The measures of one scan."""
    width = settings.slit / settings.velocity
    out: dict[str, Any] = {}
    for kind, error in errors.items():
        found = window_errors(motion.times, error, path.windows, width)
        out[kind] = {
            "MA": found.moving_average,
            "MSD": found.moving_deviation,
            "peak": found.peak,
            "rms": found.rms,
        }
    begin, end = path.windows[0]
    constant = begin - settings.settle_time
    part = (motion.times >= constant - 0.5 * settings.period) & (motion.times <= end)
    height = errors["whole"][part, HEIGHT : HEIGHT + 1]
    out["settling"] = settling_time(motion.times[part], height, settings.tolerance, after=motion.times[part][0])[0]
    rms, peak = rms_and_peak(motion.feedback)
    out |= {"feedback_rms": rms, "feedback_peak": peak, "current_peak": np.max(motion.peak_current)}
    return out


def kept(settings: Settings, path: Scan, motion: Motion, errors: dict[str, Array], scenario: str) -> dict[str, Array]:
    """Arrays of the figure: errors over time, and the cumulative power within the first line."""
    begin, end = path.windows[0]
    line = (motion.times >= begin) & (motion.times <= end)
    out = {f"{scenario}_times": motion.times, f"{scenario}_windows": path.windows}
    for kind, error in errors.items():
        power = cumulative_power(error[line], settings.period)
        out |= {f"{scenario}_{kind}": error, f"{scenario}_{kind}_power": power.power, f"{scenario}_hertz": power.hertz}
    return out
