"""The command `simulate`: move a stored design along a set-point and measure its error."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.cli.designs import add_design, machine_of
from lpvhinf.cli.motion_report import measures_of, report_lines
from lpvhinf.cli.motion_settings import MotionSettings, planned
from lpvhinf.cli.settings_file import read_settings
from lpvhinf.cli.terminal import TerminalProgress
from lpvhinf.plant.mmpa import MMPA
from lpvhinf.progress import Progress
from lpvhinf.simulation import Actuators, Motion, floor_acceleration, simulate
from lpvhinf.storage import make_folder, write_arrays, write_json, write_text
from lpvhinf.stored_design import StoredDesign

KIND = "lpvhinf.Motion"
EVERY = 40  # samples between two positions at which the commutation is computed
SETTINGS = """\
Tables of the TOML file, with what is used where a setting is left out:
  [trajectory]   kind = "scan" or "point-to-point"; start, end (all axes) [m, rad]; axis, length, velocity, lines, step,
                 settle_time of a scan
  [limits]       velocity, acceleration, jerk, snap: one number, or one for each axis
  [loop]         period = 1e-4, delay = 1.5e-4, settle = 0.05 [s] at rest after the set-point,
                 feedforward = "rigid-body", "snap", "compliance" or "none", noise, quantisation of every output,
                 current_limit [A], error_bound, seed
  [disturbance]  floor_velocity [m/s], floor_band [Hz]
  [measures]     width = 0.02 [s] of the windows of MA and MSD, tolerance [m, rad] for the settling time,
                 at = "sensors" or "point-of-control"
Currents and the point of control need the machine of the design. The folder takes motion.npz (the samples),
motion.json (settings and measures) and motion.md. Exit status: 0 also where limits were reached, 1 if the loop was
stopped."""


def add(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "simulate", help="move a design along a set-point", description=__doc__, epilog=SETTINGS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    add_design(command)
    command.add_argument("settings", nargs="?", type=Path, help="TOML file, see below")
    command.add_argument("--out", type=Path, help="folder, default DESIGN/motion")
    command.set_defaults(run=run, interrupted="nothing was written")


def run(arguments: argparse.Namespace) -> int:
    """Simulate, store, print the measures; 1 if the loop was stopped."""
    design = StoredDesign.open(arguments.design)
    settings = MotionSettings.read(read_settings(arguments.settings))
    out = make_folder(arguments.out or design.folder / "motion")
    with TerminalProgress() as progress:
        motion, error, windows, seconds = move(design, settings, progress)
    measures = measures_of(settings, motion, error, windows)
    arrays = {name: np.asarray(value) for name, value in vars(motion).items() if isinstance(value, np.ndarray)}
    write_arrays(out / "motion.npz", KIND, arrays | {"judged_error": error, "windows": windows})
    record: dict[str, object] = {"design": design.name, "architecture": design.architecture, "settings": vars(settings)}
    record |= {"measures": measures, "cpu_seconds": seconds}
    write_json(out / "motion.json", record)
    lines = report_lines(design, settings, motion, measures)
    write_text(out / "motion.md", "\n".join(lines) + "\n")
    print("\n".join(lines))
    return 0 if motion.stopped is None else 1


def move(design: StoredDesign, settings: MotionSettings, progress: Progress) -> tuple[Motion, Array, Array, float]:
    """The motion, its error where it is judged, the windows that count, and CPU seconds."""
    path = planned(settings, design.box, len(design.f_bw))
    loop = settings.loop
    machine: MMPA | None = None
    actuators = None
    if loop["current_limit"] is not None or settings.measures["at"] == "point-of-control":
        machine, decoupled = machine_of(design, progress)
        if loop["current_limit"] is not None:
            actuators = Actuators(
                matrix=lambda points: decoupled.matrices(points)[1],
                bias=machine.levitation_current,
                limit=loop["current_limit"],
                every=EVERY,
            )
    progress.stage("motion")
    began = time.process_time()
    motion = simulate(
        design.plant,
        design.controller,
        path.trajectory,
        period=loop["period"],
        delay=loop["delay"],
        settle=loop["settle"],
        feedforward=loop["feedforward"],
        noise=loop["noise"],
        quantisation=loop["quantisation"],
        disturbance=floor(settings, path.trajectory.duration + loop["settle"], len(design.f_bw)),
        actuators=actuators,
        error_bound=loop["error_bound"],
        seed=loop["seed"],
    )
    seconds = time.process_time() - began
    error = np.asarray(motion.error) if settings.measures["at"] == "sensors" else at_the_point(motion, machine)
    return motion, error, path.windows, seconds


def floor(settings: MotionSettings, duration: float, n_axes: int) -> Array | None:
    """Accelerations of the rigid axes by a floor that moves, or None."""
    wanted, period = settings.disturbance, settings.loop["period"]
    if wanted["floor_velocity"] == 0.0:
        return None
    N, moved = int(np.ceil(duration / period)) + 2, min(3, n_axes)
    low, high = wanted["floor_band"]
    return -floor_acceleration(
        N, moved, period=period, velocity_rms=wanted["floor_velocity"], band=(low, high),
        seed=settings.loop["seed"] + 1,
    )  # fmt: skip


def at_the_point(motion: Motion, machine: MMPA | None) -> Array:
    """The error at the machine's point of control (N, 6)."""
    assert machine is not None
    gains = machine.performance_gains(motion.positions)
    n_rb = machine.modal.n_rb
    gains[:, :, :n_rb] = gains[:, :, :n_rb] @ np.linalg.inv(machine.modal.rigid_body_scaling)
    return motion.error_of(gains)
