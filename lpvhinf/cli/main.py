"""The console script `lpvhinf`."""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Sequence
from pathlib import Path

import lpvhinf
from lpvhinf.cli.exit_status import exit_status
from lpvhinf.cli.terminal import TerminalProgress
from lpvhinf.errors import DomainError
from lpvhinf.storage import make_folder


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(prog="lpvhinf", description="Structured H-infinity design for motion systems.")
    top.add_argument("--version", action="version", version=f"lpvhinf {lpvhinf.__version__}")
    commands = top.add_subparsers(dest="command", required=True)
    design = commands.add_parser("design", help="design a controller for the planar actuator benchmark")
    design.add_argument("settings", nargs="?", type=Path, help="TOML file with settings of lpvhinf.Specification")
    design.add_argument("--architecture", default="output-observer", choices=["rigid-body", "output-observer"])
    design.add_argument("--n-flex", type=int, default=1, help="controlled flexible modes")
    design.add_argument("--plant-modes", type=int, default=15, help="flexible modes of the plant model")
    design.add_argument(
        "--magnetics", default="exact", choices=["exact", "first-harmonic"], help="field of the magnets"
    )
    design.add_argument("--out", type=Path, required=True, help="folder for the design's arrays")
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run; the exit status is 0, 1 after an error of ours, 130 after an interrupt."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: design(arguments), interrupted="nothing was written")


def design(arguments: argparse.Namespace) -> None:
    """The command `design`: make one, store it, print its report."""
    specification = read_specification(arguments.settings)
    make_folder(arguments.out)  # before the work, which would else be lost
    with TerminalProgress() as progress:
        actuator = lpvhinf.mmpa.benchmark(
            n_flex=arguments.plant_modes, magnetics=arguments.magnetics, progress=progress
        )
        plant = lpvhinf.decouple(actuator, n_flex=arguments.n_flex)
        made = lpvhinf.codesign(plant, arguments.architecture, specification, progress=progress)
    made.save(arguments.out)
    print(made.report())


def read_specification(path: Path | None) -> lpvhinf.Specification:
    """The specification in a TOML file, or the default one.

    Raises
    ------
    DomainError
        If the file is missing, is not TOML, or holds an unknown setting.
    """
    if path is None:
        return lpvhinf.Specification()
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DomainError(f"settings {path} cannot be read as TOML: {error}.") from error
    return lpvhinf.Specification.from_mapping(values)
