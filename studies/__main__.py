"""python -m studies list | run NAME [--preset tiny|paper|FILE.toml] [--out DIR] | report DIR."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lpvhinf.cli.exit_status import exit_status
from lpvhinf.cli.terminal import TerminalProgress
from studies import error_observer, feedforward, full_actuation, lpv, motion, output_observer, plant, robustness
from studies.results import of_the_study
from studies.settings import load_settings

STUDIES: dict[str, Any] = {
    output_observer.NAME: output_observer,
    error_observer.NAME: error_observer,
    plant.NAME: plant,
    feedforward.NAME: feedforward,
    full_actuation.NAME: full_actuation,
    lpv.NAME: lpv,
    motion.NAME: motion,
    robustness.NAME: robustness,
}


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(prog="python -m studies", description="Reproduce the studies of the project.")
    commands = top.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="name the studies and their presets")
    run = commands.add_parser("run", help="run a study; what is finished in the folder is kept")
    run.add_argument("name", choices=sorted(STUDIES))
    run.add_argument("--preset", default="paper", help="tiny, paper, where there is one full, or a .toml file")
    run.add_argument("--out", type=Path, help="results folder, default results/NAME")
    run.add_argument("--jobs", type=int, help="processes, default as in the preset")
    report = commands.add_parser("report", help="write the report of a results folder anew")
    report.add_argument("folder", type=Path)
    return top


def carry_out(arguments: argparse.Namespace) -> None:
    """The command that the arguments name."""
    if arguments.command == "list":
        for name, study in STUDIES.items():
            print(f"{name}: {(study.__doc__ or '').splitlines()[0]}")
    elif arguments.command == "run":
        study = STUDIES[arguments.name]
        settings = load_settings(study.Settings, arguments.name, arguments.preset, jobs=arguments.jobs)
        with TerminalProgress() as progress:
            study.run(settings, arguments.out or Path("results") / arguments.name, progress)
    else:
        of_the_study(arguments.folder, STUDIES).write_report(arguments.folder)


def main(argv: Sequence[str] | None = None) -> int:
    """Run; the exit status is 0, 1 after an error of ours, 130 after an interrupt."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: carry_out(arguments), interrupted="run the same command again to go on")


if __name__ == "__main__":
    sys.exit(main())
