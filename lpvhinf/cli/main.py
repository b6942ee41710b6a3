"""The console script `lpvhinf`: one module a command, each with its arguments (`add`) and its work (`run`)."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import lpvhinf
from lpvhinf.cli import certify, check, design, export, simulate, view
from lpvhinf.cli.exit_status import exit_status

COMMANDS = (design, certify, check, simulate, view, export)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(
        prog="lpvhinf",
        description="Structured H-infinity design for motion systems whose flexible modes change with position.",
        epilog="Exit status: 0 done, 1 an error or a claim that is not proved, 2 wrong arguments, 130 interrupted.",
    )
    top.add_argument("--version", action="version", version=f"lpvhinf {lpvhinf.__version__}")
    commands = top.add_subparsers(dest="command", required=True)
    for command in COMMANDS:
        command.add(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run; the exit status is the command's, 1 after an error of ours, 130 after an interrupt."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: arguments.run(arguments), interrupted=arguments.interrupted)
