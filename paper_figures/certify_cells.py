"""The cells of a certificate over P, coloured by the margin with which the claim is proved on each.

Also ``python -m paper_figures.certify_cells --from DIR --out DIR``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.cli.exit_status import exit_status
from lpvhinf.errors import StorageError
from lpvhinf.plotting.style import GREY, new_figure, save_figure, style
from lpvhinf.storage import read_arrays, read_json

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME = "certify_cells"
ARRAYS = "lpvhinf.PlantStudy"
PREFERRED = ("output_observer/conventional/frozen", "output_observer/observer/frozen")


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study certify.

    The conventional and the observer's loop where they are there, else the first proved claim on two coordinates.

    Raises
    ------
    StorageError
        If no frozen claim on two coordinates is proved.
    """
    shown = [(name, data) for name in _names(results) if (data := _cells(results, name)) is not None]
    wanted = [pair for pair in shown if pair[0] in PREFERRED] or shown[:1]
    if not wanted:
        raise StorageError(
            f"{results} has no proved claim at frozen positions of a plane. Run the study certify first."
        )
    low = min(float(data["margins"].min()) for _, data in wanted)
    high = max(float(data["margins"].max()) for _, data in wanted)
    with style(axes_grid=False):
        figure = new_figure(width="two" if len(wanted) > 1 else "one", ratio=0.5 if len(wanted) > 1 else 0.85)
        axes = figure.subplots(1, len(wanted), squeeze=False)[0]
        for ax, (name, data) in zip(axes, wanted, strict=True):
            picture = _draw(ax, data, low, high)
            study, design, _ = name.split("/")
            ax.set_title(f"{design} ({study.replace('_', ' ')}): {len(data['cells'])} cells", pad=4)
        bar = figure.colorbar(picture, ax=list(axes), fraction=0.05, pad=0.02)
        bar.set_label("margin of the scaled inequality (0.5 is the largest tried)")
        return list(save_figure(figure, out / NAME))


def _names(results: Path) -> list[str]:
    """Claims at frozen positions, in the order of the preferred ones first."""
    names = [name for name in read_json(results / "claims.json") if name.endswith("/frozen")]
    return sorted(names, key=lambda name: (PREFERRED.index(name) if name in PREFERRED else len(PREFERRED), name))


def _cells(results: Path, name: str) -> dict[str, Any] | None:
    """Cells and margins of a claim that is proved over a plane."""
    folder = results / "claims" / name
    data = dict(read_arrays(folder / "arrays.npz", ARRAYS))
    proved = read_json(folder / "summary.json")["outcome"] == "proved"
    return data if proved and data["cells"].shape[1] == 2 else None


def _draw(ax: Axes, data: dict[str, Any], low: float, high: float) -> Any:
    """Rectangles in mm."""
    from matplotlib.collections import PolyCollection

    cells: Array = 1e3 * data["cells"]
    (x0, x1), (y0, y1) = np.moveaxis(cells, 0, -1)
    corners = np.stack([np.stack(pair, axis=-1) for pair in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))], axis=1)
    picture = PolyCollection(list(corners), array=data["margins"], edgecolors=GREY, linewidths=0.3)
    picture.set_clim(low, high)
    ax.add_collection(picture)
    box = 1e3 * data["box"]
    ax.set_xlim(*box[0])
    ax.set_ylim(*box[1])
    ax.set_aspect("equal")
    ax.set_xlabel("$p_x$ [mm]")
    ax.set_ylabel("$p_y$ [mm]")
    return picture


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the figure; the exit status is 1 after an error of ours."""
    parser = argparse.ArgumentParser(prog="python -m paper_figures.certify_cells", description="Draw proved cells.")
    parser.add_argument("--from", dest="source", type=Path, required=True, help="results folder of the study certify")
    parser.add_argument("--out", type=Path, required=True, help="folder for the figure")
    arguments = parser.parse_args(argv)

    def work() -> None:
        make(arguments.source, arguments.out)

    return exit_status(work)


if __name__ == "__main__":
    sys.exit(main())
