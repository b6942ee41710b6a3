"""``python -m lpvhinf.certify check FILE [--exact] [--system FILE]``: check a certificate again.

The exit status is 0 if its claim is proved, 1 if it is not, 2 if the file is not a certificate; one line says why.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from lpvhinf.certify.verdict import recheck


def main(argv: Sequence[str] | None = None) -> int:
    """Run; the exit status says what the check found."""
    parser = argparse.ArgumentParser(prog="python -m lpvhinf.certify", description="Check certificates again.")
    commands = parser.add_subparsers(dest="command", required=True)
    check = commands.add_parser("check", help="exit status 0: proved, 1: not proved, 2: not a certificate")
    check.add_argument("file", type=Path, help="the certificate")
    check.add_argument("--exact", action="store_true", help="integers instead of floating point with rounding bounds")
    check.add_argument("--system", type=Path, help="LPVStateSpace file that the claim has to speak of")
    arguments = parser.parse_args(argv)
    try:
        verdict = recheck(arguments.file, exact=arguments.exact, system=arguments.system)
    except KeyboardInterrupt:
        print("not proved: interrupted", file=sys.stderr)
        return 130
    print(verdict.message)
    return verdict.status


if __name__ == "__main__":
    sys.exit(main())
