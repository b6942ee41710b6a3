"""The command `check`: check a certificate again, from its bytes, as `python -m lpvhinf.certify check` does."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lpvhinf.certify.verdict import recheck


def add(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "check", help="check a certificate again", description=__doc__,
        epilog="Exit status: 0 proved, 1 not proved, 2 not a certificate, 130 interrupted.",
    )  # fmt: skip
    command.add_argument(
        "file", type=Path, metavar="CERTIFICATE", help="what `lpvhinf certify` or Certificate.save wrote"
    )
    command.add_argument("--exact", action="store_true", help="integers instead of floating point with rounding bounds")
    command.add_argument("--system", type=Path, help="LPVStateSpace file that the claim has to speak of")
    command.set_defaults(run=run, interrupted="not proved")


def run(arguments: argparse.Namespace) -> int:
    """Print the verdict; the status is that of the verdict."""
    verdict = recheck(arguments.file, exact=arguments.exact, system=arguments.system)
    print(verdict.message)
    return verdict.status
