"""Coil currents at one position, and the largest one over P, for levitation and horizontal acceleration.

In the maps over P a line stands where the largest current passes the limit of the amplifiers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from lpvhinf.plotting.coils import draw_coils
from lpvhinf.plotting.positions import MM, SIGNED, amount_map
from lpvhinf.plotting.style import BLACK, VERMILION, new_figure, save_figure, style
from lpvhinf.storage import read_json
from paper_figures.plant_results import arrays

NAME = "plant_coil_currents"
ROWS = ("levitation", "+x", "+y")


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study plant."""
    data, place = arrays(results, "maps"), arrays(results, "geometry")
    values = read_json(results / "parts" / "maps" / "summary.json")
    loads = [str(name) for name in data["loads"]]
    chosen = [loads.index(name) for name in ROWS]
    at, largest = data["currents_at"][chosen], data["largest_current"][chosen]
    limit = float(np.ceil(np.max(np.abs(at))))
    low, high = float(np.floor(np.min(largest))), float(np.ceil(np.max(largest)))
    n = len(data["axis"])
    with style():
        figure = new_figure(width="two", ratio=1.0)
        axes = figure.subplots(3, 3)
        for row, name in enumerate(ROWS):
            for layer, ax in enumerate(axes[row, :2]):
                mine = place["coil_layer"] == layer
                centres, sizes = place["coil_centres"][mine], place["coil_sizes"][mine]
                coils = draw_coils(ax, centres, sizes, at[row][mine], (-limit, limit), SIGNED)
                _mover(ax, place)
            amounts = amount_map(
                axes[row, 2], data["axis"], largest[row].reshape(n, n), low, high, lines=[values["current_limit"]]
            )
            axes[row, 2].plot(*(MM * place["position"]), "o", mfc="white", mec=BLACK, markersize=4)
            axes[row, 2].set_xticks((-50, 0, 50))
            axes[row, 2].set_yticks((-50, 0, 50))
            axes[row, 2].set_ylabel("$p_y$ [mm]", labelpad=-4)
            load = name if name == "levitation" else f"{values['acceleration']:g} m/s² along ${name}$"
            axes[row, 0].set_ylabel(f"{load}\n$y$ [mm]")
        for ax, title in zip(axes[0], ("upper layer", "lower layer", "largest of all coils, over P"), strict=True):
            ax.set_title(title, pad=3)
        for ax, label in zip(axes[2], ("$x$ [mm]", "$x$ [mm]", "$p_x$ [mm]"), strict=True):
            ax.set_xlabel(label)
        bar = figure.colorbar(coils, ax=axes[:, :2], location="bottom", aspect=44, pad=0.02)
        bar.set_label("coil current with the mover at the marked position [A]")
        ticks = np.arange(low, high + 1.0)
        bar = figure.colorbar(amounts, ax=axes[:, 2], location="bottom", aspect=22, pad=0.02, ticks=ticks)
        bar.ax.axvline(values["current_limit"], color=VERMILION, linewidth=0.9)
        bar.set_label("largest current [A]; line: amplifier limit")
        return list(save_figure(figure, out / NAME))


def _mover(ax: Axes, place: dict[str, Any]) -> None:
    """Outline and centre of the mover, and the stator's limits."""
    side, (x, y) = MM * float(place["side"]), MM * place["position"]
    ax.add_patch(Rectangle((x - side / 2, y - side / 2), side, side, fill=False, edgecolor=BLACK, linewidth=1.0))
    ax.plot(x, y, "o", mfc="white", mec=BLACK, markersize=4)
    edge = MM * float(np.max(np.abs(place["coil_centres"]) + place["coil_sizes"] / 2)) + 8.0
    ax.set_xlim(-edge, edge)
    ax.set_ylim(-edge, edge)
    ax.set_xticks((-200, 0, 200))
    ax.set_yticks((-200, 0, 200))
