"""The command `view`: one HTML page to look at designs over all positions, without network or server."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lpvhinf.cli.terminal import TerminalProgress
from lpvhinf.viewer import view


def add(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "view", help="write an interactive HTML page of designs", description=__doc__,
        epilog="The page is one file, below 5 MB. Open it in any browser; arrow keys move the position.",
    )  # fmt: skip
    command.add_argument(
        "results", type=Path, metavar="RESULTS", help="folder of a design, or a study's results folder"
    )
    command.add_argument("--out", type=Path, help="page to write, default RESULTS/view.html")
    command.add_argument("--design", action="append", metavar="NAME", help="show only these designs; may be repeated")
    command.add_argument("--grid", type=int, default=13, help="positions along every axis, default 13")
    command.add_argument(
        "--certificates", type=Path, help="results folder of the study certify, default beside RESULTS"
    )
    command.set_defaults(run=run, interrupted="nothing was written")


def run(arguments: argparse.Namespace) -> None:
    """Write the page and name it."""
    out = arguments.out or arguments.results / "view.html"
    with TerminalProgress() as progress:
        made = view(
            arguments.results,
            out,
            designs=arguments.design,
            grid=arguments.grid,
            certificates=arguments.certificates,
            progress=progress,
        )
    print(f"{made.path}: {len(made.designs)} designs, {made.n_positions} positions, {made.size / 1e6:.2f} MB")
