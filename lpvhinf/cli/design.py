"""The command `design`: from a specification in TOML to the folder of a design."""

from __future__ import annotations

import argparse
import hashlib
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

import lpvhinf
from lpvhinf.checks import Array, positive
from lpvhinf.cli.settings_file import read_settings, take_table
from lpvhinf.cli.terminal import TerminalProgress
from lpvhinf.codesign.assembly import ARCHITECTURES
from lpvhinf.errors import StorageError
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS
from lpvhinf.progress import Progress
from lpvhinf.storage import make_folder, read_arrays, write_arrays, write_json
from lpvhinf.stored_design import MACHINE

CHECKPOINT = "lpvhinf.Checkpoint"
SAVE_EVERY = 3.0  # seconds between two checkpoints
PLANT: dict[str, Any] = {
    "plant_modes": 15, "magnetics": "exact", "n_flex": 1, "actuation": "over", "input_decoupling": "extended",
    "sensing": "all", "mode_weight": 1.0, "degree": 48,
}  # fmt: skip
SEARCH = (
    "architecture", "problem", "n_positions", "starts", "exchange_rounds", "exchange_tolerance", "n_search",
    "max_iterations", "tolerance", "time_limit", "seed", "jobs",
)  # fmt: skip
SETTINGS = """\
The TOML file holds the settings of lpvhinf.Specification (f_bw, epsilon, Q, delay, n_notches, order_K_RB, [schedule]
and the others), and two tables:
  [plant]   plant_modes, magnetics, n_flex, actuation, input_decoupling, sensing, mode_weight, degree
  [search]  architecture, problem, n_positions, starts, exchange_rounds, exchange_tolerance, n_search, max_iterations,
            tolerance, time_limit, seed, jobs
Options of the command line win over it. The folder takes the design's arrays and systems, machine.json with all
settings, and while the design is made a checkpoint: after an interrupt the same command goes on from there."""


def add(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "design", help="design a controller for the planar actuator benchmark", description=__doc__,
        epilog=SETTINGS, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    command.add_argument("settings", nargs="?", type=Path, help="TOML file, see below")
    command.add_argument("--architecture", choices=ARCHITECTURES, help="default output-observer")
    command.add_argument("--n-flex", type=int, help="controlled flexible modes, default 1")
    command.add_argument("--plant-modes", type=int, help="flexible modes of the plant model, default 15")
    command.add_argument("--magnetics", choices=KINDS, help="field of the magnets, default exact")
    command.add_argument("--jobs", type=int, help="processes that share the starts, default 1")
    command.add_argument("--out", type=Path, required=True, help="folder for the design")
    command.set_defaults(run=run, interrupted="run the same command again to go on")


def run(arguments: argparse.Namespace) -> None:
    """Make a design, store it, print its report."""
    specification, plant_settings, search = read(arguments)
    record = {"plant": plant_settings, "search": search, "specification": specification_record(specification)}
    out = make_folder(arguments.out)  # before the work, which would else be lost
    keeper = Keeper(out, record)
    with TerminalProgress() as progress:
        machine = lpvhinf.mmpa.benchmark(
            n_flex=plant_settings["plant_modes"], magnetics=plant_settings["magnetics"], progress=progress
        )
        rest = {name: value for name, value in plant_settings.items() if name not in ("plant_modes", "magnetics")}
        plant = lpvhinf.decouple(machine, **rest)
        made = lpvhinf.codesign(
            plant,
            search["architecture"],
            specification,
            warm_start=keeper.found(progress),
            progress=progress,
            checkpoint=keeper,
            **{name: value for name, value in search.items() if name != "architecture"},
        )
    write_json(out / MACHINE, record | {"lpvhinf": lpvhinf.__version__})
    made.save(out)
    keeper.path.unlink(missing_ok=True)
    print(made.report())


def read(arguments: argparse.Namespace) -> tuple[lpvhinf.Specification, dict[str, Any], dict[str, Any]]:
    """Specification, settings of the plant and of the search, from the file and the options.

    Raises
    ------
    DomainError
        If the file is missing, is not TOML, or holds an unknown setting.
    """
    settings = read_settings(arguments.settings)
    plant = PLANT | take_table(settings, "plant", PLANT)
    search = {"architecture": "output-observer"} | take_table(settings, "search", SEARCH)
    for table, name in (
        (plant, "plant_modes"), (plant, "n_flex"), (plant, "magnetics"), (search, "architecture"), (search, "jobs"),
    ):  # fmt: skip
        if getattr(arguments, name) is not None:
            table[name] = getattr(arguments, name)
    for name in ("tolerance", "time_limit"):
        if name in search:
            positive(name, search[name])
    return lpvhinf.Specification.from_mapping(settings), plant, search


def specification_record(specification: lpvhinf.Specification) -> dict[str, Any]:
    """The settings of a specification for JSON."""
    return {name: dict(v) if name == "schedule" else v for name, v in vars(specification).items()}


class Keeper:
    """Keeps the best parameters so far beside the design that is being made, and finds them again."""

    def __init__(self, folder: Path, record: dict[str, Any]) -> None:
        self.path, self._last = folder / "checkpoint.npz", time.monotonic()
        search = {k: v for k, v in record["search"].items() if k not in ("jobs", "time_limit")}
        text = json.dumps([record["plant"], search, record["specification"], lpvhinf.__version__], sort_keys=True)
        self.key = hashlib.sha256(text.encode()).hexdigest()[:16]

    def __call__(self, theta: Array, gamma: float) -> None:
        """Take note of better parameters, not more often than every few seconds."""
        if time.monotonic() - self._last < SAVE_EVERY:
            return
        self._last = time.monotonic()
        write_arrays(self.path, CHECKPOINT, {"theta": theta, "gamma": gamma, "key": np.array(self.key)})

    def found(self, progress: Progress) -> Array | None:
        """What an interrupted run with the same settings left behind."""
        if not self.path.is_file():
            return None
        try:
            data = read_arrays(self.path, CHECKPOINT)
        except StorageError as error:
            progress.log(f"checkpoint not usable, starting anew: {error}")
            return None
        if str(data["key"]) != self.key:
            return None
        progress.log(f"going on from a checkpoint at gamma {float(data['gamma']):.4f}")
        return np.asarray(data["theta"])
