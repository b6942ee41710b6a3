"""python -m paper_figures [NAME] --from DIR --out DIR: draw figures from a results folder, without solving anything."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from lpvhinf.errors import LpvHinfError
from paper_figures import damping_trade, six_block

FIGURES = {six_block.NAME: six_block, damping_trade.NAME: damping_trade}


def main(argv: Sequence[str] | None = None) -> int:
    """Draw one figure or all; the exit status is 1 after an error of ours."""
    parser = argparse.ArgumentParser(prog="python -m paper_figures", description="Draw figures from a results folder.")
    parser.add_argument("name", nargs="?", choices=sorted(FIGURES), help="all if left out")
    parser.add_argument("--from", dest="source", type=Path, required=True, help="results folder of a study")
    parser.add_argument("--out", type=Path, required=True, help="folder for the figures")
    arguments = parser.parse_args(argv)
    try:
        for name in [arguments.name] if arguments.name else sorted(FIGURES):
            for path in FIGURES[name].make(arguments.source, arguments.out):
                print(path)
    except LpvHinfError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
