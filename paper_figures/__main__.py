"""python -m paper_figures [NAME] --from DIR --out DIR: draw figures from a results folder, without solving anything."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lpvhinf.errors import DomainError, LpvHinfError, StorageError
from lpvhinf.storage import read_json
from paper_figures import (
    damping_trade,
    plant_coil_currents,
    plant_frf,
    plant_modal_gains,
    plant_mode_shapes,
    plant_top_view,
    six_block,
)

# The figures of each study; a results folder says in settings.json which study it comes from.
FIGURES: dict[str, dict[str, Any]] = {
    "output_observer": {module.NAME: module for module in (six_block, damping_trade)},
    "plant": {
        module.NAME: module
        for module in (plant_top_view, plant_mode_shapes, plant_modal_gains, plant_coil_currents, plant_frf)
    },
}


def figures_of(results: Path) -> dict[str, Any]:
    """The figures of the study that a results folder comes from.

    Raises
    ------
    StorageError
        If the folder does not say, or the study has no figures.
    """
    settings = read_json(results / "settings.json")
    study = settings.get("study") if isinstance(settings, dict) else None
    if study not in FIGURES:
        raise StorageError(
            f"{results / 'settings.json'} names the study {study!r}, wanted one of {', '.join(FIGURES)}. "
            "Run the study again."
        )
    return FIGURES[study]


def main(argv: Sequence[str] | None = None) -> int:
    """Draw one figure or all of a study; the exit status is 1 after an error of ours."""
    names = sorted(name for figures in FIGURES.values() for name in figures)
    parser = argparse.ArgumentParser(prog="python -m paper_figures", description="Draw figures from a results folder.")
    parser.add_argument("name", nargs="?", choices=names, help="all of the folder's study if left out")
    parser.add_argument("--from", dest="source", type=Path, required=True, help="results folder of a study")
    parser.add_argument("--out", type=Path, required=True, help="folder for the figures")
    arguments = parser.parse_args(argv)
    try:
        figures = figures_of(arguments.source)
        if arguments.name is not None and arguments.name not in figures:
            raise DomainError(
                f"{arguments.source} has no data for the figure {arguments.name!r}, only for "
                f"{', '.join(sorted(figures))}. Name the folder of the study that it belongs to."
            )
        for name in [arguments.name] if arguments.name else sorted(figures):
            for path in figures[name].make(arguments.source, arguments.out):
                print(path)
    except LpvHinfError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
