"""python -m paper_figures [NAME] --from DIR --out DIR: draw figures from a results folder, without solving anything."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lpvhinf.cli.exit_status import exit_status
from lpvhinf.errors import DomainError
from paper_figures import (
    certify_cells,
    damping_trade,
    feedforward_excitation,
    feedforward_steps,
    full_actuation_band_pass,
    lpv_gamma,
    motion,
    plant_coil_currents,
    plant_frf,
    plant_modal_gains,
    plant_mode_shapes,
    plant_top_view,
    robustness,
    six_block,
    trade_off,
    two_by_two,
)
from studies.results import of_the_study

# The figures of each study; a results folder says in settings.json which study it comes from.
FIGURES: dict[str, dict[str, Any]] = {
    "output_observer": {module.NAME: module for module in (six_block, damping_trade)},
    "error_observer": {module.NAME: module for module in (two_by_two, trade_off)},
    "plant": {
        module.NAME: module
        for module in (plant_top_view, plant_mode_shapes, plant_modal_gains, plant_coil_currents, plant_frf)
    },
    "feedforward": {module.NAME: module for module in (feedforward_excitation, feedforward_steps)},
    "full_actuation": {full_actuation_band_pass.NAME: full_actuation_band_pass},
    "lpv": {lpv_gamma.NAME: lpv_gamma},
    "certify": {certify_cells.NAME: certify_cells},
    "motion": {motion.NAME: motion},
    "robustness": {robustness.NAME: robustness},
}


def draw(name: str | None, source: Path, out: Path) -> None:
    """Draw one figure of a results folder, or all of its study.

    Raises
    ------
    DomainError
        If the figure belongs to another study.
    StorageError
        If the folder does not say which study it comes from, or lacks data.
    """
    figures = of_the_study(source, FIGURES)
    if name is not None and name not in figures:
        raise DomainError(
            f"{source} has no data for the figure {name!r}, only for {', '.join(sorted(figures))}. "
            "Name the folder of the study that it belongs to."
        )
    for one in [name] if name else sorted(figures):
        for path in figures[one].make(source, out):
            print(path)


def main(argv: Sequence[str] | None = None) -> int:
    """Draw one figure or all of a study; the exit status is 1 after an error of ours."""
    names = sorted(name for figures in FIGURES.values() for name in figures)
    parser = argparse.ArgumentParser(prog="python -m paper_figures", description="Draw figures from a results folder.")
    parser.add_argument("name", nargs="?", choices=names, help="all of the folder's study if left out")
    parser.add_argument("--from", dest="source", type=Path, required=True, help="results folder of a study")
    parser.add_argument("--out", type=Path, required=True, help="folder for the figures")
    arguments = parser.parse_args(argv)
    return exit_status(lambda: draw(arguments.name, arguments.source, arguments.out))


if __name__ == "__main__":
    sys.exit(main())
