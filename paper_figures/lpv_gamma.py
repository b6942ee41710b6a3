"""Scheduled controllers: gamma against the speed of p and the grid, and largest singular values in truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.plotting.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, new_figure, save_figure, style
from lpvhinf.storage import read_arrays
from studies.lpv import ARRAYS
from studies.results import summaries

NAME = "lpv_gamma"
COLORS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE)
MARKERS = ("o", "s", "^", "D", "v")


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from the designs in a results folder of the study lpv."""
    designs = summaries(results, "design")
    curves: dict[tuple[int, int], list[dict[str, Any]]] = {}
    for design in designs.values():
        if design["kind"] == "gridded" and design["degree"] and design["gamma"] is not None:
            curves.setdefault((design["n_grid"], design["degree"]), []).append(design)
    if not curves:
        raise StorageError(f"{results} has no gridded design with a gamma, so there is no curve to draw. Run it again.")
    with style():
        figure = new_figure(width="two", ratio=0.38)
        left, right = figure.subplots(1, 2)
        colors: dict[int, Any] = {}
        for (n, degree), rows in sorted(curves.items()):
            color = colors.setdefault(n, COLORS[len(colors) % len(COLORS)])
            rows.sort(key=lambda d: float(d["speed"]))
            left.plot(
                [d["speed"] for d in rows],
                [d["gamma"] for d in rows],
                color=color,
                marker=MARKERS[(degree - 1) % len(MARKERS)],
                markersize=4,
                label=f"{n * n} points, $R(p)$ of degree {degree}",
            )
        for design in designs.values():
            if design["kind"] == "gridded" and not design["degree"] and design["gamma"] is not None:
                color = colors.get(design["n_grid"], GREY)
                left.axhline(
                    design["gamma"], color=color, ls="--", lw=0.9, label=f"{design['n_grid'] ** 2} points, constant $R$"
                )
            if design["kind"] == "pointwise" and design["n_grid"] == max(colors):
                left.axhline(design["gamma"], color=GREY, ls=":", label="worst point alone (bound)")
        lti = designs["output-observer"]
        if lti["gamma"] is not None:
            left.axhline(lti["gamma"], color=BLACK, ls="-.", lw=0.9, label="co-design, at rest")
        left.set_xlabel("largest speed of $p$ [m/s]")
        left.set_ylabel(r"$\gamma$")
        left.set_ylim(0.0, 1.45 * left.get_ylim()[1])
        left.legend(loc="upper left", ncols=2)

        n, degree = max(curves)
        fastest = max(curves[n, degree], key=lambda d: float(d["speed"]))
        for design, color, label in (
            (lti, BLACK, "co-design"),
            (fastest, colors[n], f"gridded, {n * n} points, {fastest['speed']:g} m/s"),
        ):
            f, lowest, highest = _band(results / "designs" / design["name"])
            if len(f):
                right.fill_between(f, lowest, highest, color=color, alpha=0.25, lw=0.0)
                right.loglog(f, highest, color=color, label=label)
        right.set_xlabel("frequency [Hz]")
        right.set_ylabel(r"$\bar\sigma$, all modes in the plant")
        if right.lines:
            right.legend(loc="upper left")
        return list(save_figure(figure, out / NAME))


def _band(folder: Path) -> tuple[Array, Array, Array]:
    """Frequencies [Hz], smallest and largest value over the positions with a stable loop."""
    stored = read_arrays(folder / "sigma.npz", ARRAYS)
    sigma = stored["sigma"][np.all(np.isfinite(stored["sigma"]), axis=1)]
    if not len(sigma):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    return stored["omega"] / (2 * np.pi), sigma.min(axis=0), sigma.max(axis=0)
