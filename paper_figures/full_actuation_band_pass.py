"""Fully actuated plants: gamma, coupling of the loops and damping against the Q of the band-pass.

Lines: all gains held, those of the first design. Markers: tuned for their own Q.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter, NullLocator, StrMethodFormatter

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.plotting.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, new_figure, save_figure, style
from studies.full_actuation_report import plants, title, tuned
from studies.results import summaries

NAME = "full_actuation_band_pass"
COLORS = (BLACK, BLUE, VERMILION, GREEN, ORANGE, PURPLE)
MARKERS = ("o", "s", "^", "D", "v", "P")


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from the summaries in a results folder of the study full_actuation."""
    designs = summaries(results, "design")
    names = plants(designs)
    if len(names) > len(COLORS):
        raise StorageError(f"{results} has {len(names)} plants, wanted at most {len(COLORS)}. Run it with fewer.")
    with style():
        figure = new_figure(width="two", ratio=0.34)
        left, middle, right = figure.subplots(1, 3)
        for name, color, marker in zip(names, COLORS, MARKERS, strict=False):
            own, held = tuned(designs, name), designs[f"{name}-start"]["held"]
            look: dict[str, Any] = {"color": color, "marker": marker, "markersize": 4, "label": title(name)}
            _both(left, own, held, "gamma", 1.0, look)
            _both(middle, own, held, "plant_change", 100.0, look)
            _both(right, own, held, "damping_min", 100.0, look)
            right.plot(
                *_curve(own, "damping_median", 100.0), ls="", mfc="white", color=color, marker=marker, markersize=4
            )
        left.set_ylabel(r"$\gamma$")
        left.set_ylim(0.0, 1.1 * left.get_ylim()[1])
        middle.set_ylabel("rigid-body plant changes by [%]")
        right.set_ylabel("least, median (white) damping [%]")
        shown = sorted({float(row["Q"]) for name in names for row in designs[f"{name}-start"]["held"]})
        for ax in (left, middle, right):
            ax.set_xscale("log")
            ax.set_xticks(shown, [f"{Q:g}" for Q in shown])
            ax.xaxis.set_minor_locator(NullLocator())
            ax.set_xlabel("$Q$ of the band-pass")
        for ax in (middle, right):
            ax.set_yscale("log")
            ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            ax.yaxis.set_minor_formatter(NullFormatter())
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(names))
        return list(save_figure(figure, out / NAME))


def _both(ax: Axes, own: list[Any], held: list[Any], key: str, factor: float, look: dict[str, Any]) -> None:
    """Markers for what was tuned, and a line for gains held."""
    ax.plot(*_curve(own, key, factor), ls="", **look)
    ax.plot(*_curve(held, key, factor), color=look["color"])


def _curve(rows: list[Any], key: str, factor: float) -> tuple[Array, Array]:
    """Q and values, NaN where a loop is not stable."""

    def value(row: Any) -> float:
        found = row[key][0] if isinstance(row[key], list) else row[key]
        return float("nan") if found is None else factor * float(found)

    return np.array([float(row["Q"]) for row in rows]), np.array([value(row) for row in rows])
