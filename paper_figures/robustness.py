"""Robustness of stored designs: least stable poles, shares of unstable plants, and damping of the modes behind them.

Left: distribution of the largest real part over the perturbed plants (solid: damping spread, dotted: held). Middle:
shares of unstable plants. Right: share of unstable loops against the damping ratio of the mode that is behind most of
them. Bars: Clopper-Pearson intervals of 95 %.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.plotting.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    new_figure,
    save_figure,
    style,
)
from lpvhinf.robustness import share_bounds
from lpvhinf.storage import read_arrays, read_json
from studies.plant_results import ARRAYS
from studies.results import summaries
from studies.robustness_report import in_order, title

NAME = "robustness"
N_BINS = 6
ALONE = (BLACK, GREY, PURPLE)
COLORS = {"rigid-body": ALONE, "output-observer": (BLUE, SKY), "error-observer": (GREEN, ORANGE, VERMILION)}


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from the arrays in a results folder of the study robustness."""
    settings = read_json(results / "settings.json")
    parts = in_order(summaries(results, "part"), settings)
    colors = _colors(results, parts)
    names = list(colors)
    with style():
        figure = new_figure(width="two", ratio=0.42)
        left, middle, right = figure.subplots(1, 3, width_ratios=(1.0, 0.8, 1.0))
        for name, part in parts.items():
            arrays = read_arrays(results / "parts" / name / "arrays.npz", ARRAYS)
            color, spread = colors[part["design"]], part["kind"] == "spread"
            _distribution(left, arrays["abscissa"], color, ls="-" if spread else ":")
            row = names.index(part["design"]) + (-0.15 if spread else 0.15)
            look: dict[str, Any] = {"color": color, "mfc": color if spread else "white"}
            _share(middle, part["unstable"], row - 0.05, marker="o", **look)
            _share(middle, part["unstable_sampled"], row + 0.05, marker="s", **look)
            if spread:
                _by_damping(right, part, arrays, settings["damping"], color)
        left.axvline(0.0, color=GREY, lw=0.6)
        left.set_xlabel("largest real part of the poles [rad/s]")
        left.set_ylabel("share of plants below [%]")
        left.set_ylim(0.0, 101.0)
        middle.set_xlabel("unstable plants [%]")
        middle.set_xlim(-2.0, 102.0)
        middle.set_yticks(range(len(names)), [])
        middle.set_ylim(len(names) - 0.5, -0.5)
        middle.grid(visible=False, axis="y")
        right.set_xscale("log")
        right.axvline(100.0 * settings["held_damping"], color=GREY, lw=0.6)
        right.set_xlabel("damping ratio of the mode [%]")
        right.set_ylabel("unstable plants [%]")
        right.set_ylim(-2.0, 102.0)
        low, high = (100.0 * value for value in settings["damping"])
        right.set_xticks(ticks := np.unique([low, 2 * low, 5 * low, high]), [f"{tick:g}" for tick in ticks])
        right.xaxis.set_minor_formatter(NullFormatter())
        first = {part["design"]: part for part in parts.values()}
        handles = [Line2D([], [], color=color, label=title(first[name])) for name, color in colors.items()]
        handles += [
            Line2D([], [], color=BLACK, ls="-", marker="o", ms=4, label="damping spread"),
            Line2D([], [], color=BLACK, ls=":", marker="o", ms=4, mfc="white", label="damping held"),
            Line2D([], [], color=BLACK, ls="", marker="s", ms=4, label="sampled"),
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=4)
        return list(save_figure(figure, out / NAME))


def _colors(results: Path, parts: dict[str, Any]) -> dict[str, str]:
    """A colour for each design, by what it is; a `StorageError` where there are more designs than colours."""
    left = {architecture: list(colors) for architecture, colors in COLORS.items()}
    found: dict[str, str] = {}
    for part in parts.values():
        if part["design"] in found:
            continue
        if not left[part["architecture"]]:
            raise StorageError(
                f"{results} has more designs with the architecture {part['architecture']} than the figure has colours, "
                f"wanted at most {len(COLORS[part['architecture']])}. Run the study with fewer designs."
            )
        found[part["design"]] = left[part["architecture"]].pop(0)
    return found


def _distribution(ax: Axes, values: Array, color: str, *, ls: str) -> None:
    """An empirical distribution function."""
    ax.step(np.sort(values), 100.0 * np.arange(1, len(values) + 1) / len(values), where="post", color=color, ls=ls)


def _share(ax: Axes, found: dict[str, Any], row: float, **look: Any) -> None:
    """A share with its interval."""
    share, low, high = (100.0 * float(found[name]) for name in ("share", "lower", "upper"))
    ax.errorbar(share, row, xerr=[[share - low], [high - share]], ms=4, capsize=1.5, ls="", **look)


def _by_damping(ax: Axes, part: dict[str, Any], arrays: dict[str, Array], ends: list[float], color: str) -> None:
    """Shares of unstable continuous loops in bins of the damping of the mode that is behind most of them."""
    modes = part["culprits"]["continuous"]["modes"]
    if not modes or ends[0] == ends[1]:
        return
    zeta = arrays["zeta"][:, modes[0]["mode"] - 1]
    edges = np.geomspace(ends[0], ends[1], N_BINS + 1)
    bins = np.clip(np.searchsorted(edges, zeta, side="right") - 1, 0, N_BINS - 1)
    places, shares, bars = [], [], []
    for k in range(N_BINS):
        unstable = arrays["abscissa"][bins == k] >= 0.0
        if len(unstable) == 0:
            continue
        low, high = share_bounds(int(np.sum(unstable)), len(unstable))
        share = float(np.mean(unstable))
        places.append(100.0 * float(np.sqrt(edges[k] * edges[k + 1])))
        shares.append(100.0 * share)
        bars.append([100.0 * (share - low), 100.0 * (high - share)])
    mode = f"mode {modes[0]['mode']}"
    ax.errorbar(places, shares, yerr=np.transpose(bars), color=color, marker="o", ms=3, capsize=1.5, lw=0.8)
    ax.annotate(mode, (places[0], shares[0]), xytext=(4, 3), textcoords="offset points", color=color, fontsize=7)
