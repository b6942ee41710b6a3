"""Scans with moving p: what the controlled mode adds to the error, its power, and the factor in MSD per position."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lpvhinf.plotting.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, new_figure, save_figure, style
from lpvhinf.storage import read_json
from paper_figures.plant_results import arrays

NAME = "motion"
HEIGHT = 2
COLOURS = (BLACK, VERMILION, BLUE, PURPLE, GREEN, ORANGE, SKY)
MARKERS = "oDs^vPX"


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study motion."""
    report = read_json(results / "report.json")
    order = report["settings"]["designs"]
    stored = {name: part["design"] for name, part in report["parts"].items()}
    parts = dict(sorted(stored.items(), key=lambda item: order.index(item[1])))
    # drawn from the largest to the smallest, so that none is hidden
    data = {name: arrays(results, name) for name in parts}
    shown = [name for name in parts if "disturbed_times" in data[name]]
    looks = dict(zip(parts, zip(COLOURS, MARKERS, strict=True), strict=False))
    with style():
        figure = new_figure(width="two", ratio=0.66)
        grid = figure.subplots(2, 2)
        over_time, power, tracking, disturbed = grid.ravel()
        for name in sorted(shown, key=lambda n: -float(np.std(data[n]["disturbed_controlled"][:, HEIGHT]))):
            one, colour = data[name], looks[name][0]
            over_time.plot(
                1e3 * one["disturbed_times"], 1e9 * one["disturbed_controlled"][:, HEIGHT], color=colour, linewidth=0.6
            )
        for name in shown:
            one, colour = data[name], looks[name][0]
            rms = 1e9 * np.sqrt(one["disturbed_whole_power"][:, HEIGHT])
            power.semilogx(one["disturbed_hertz"][1:], rms[1:], color=colour, label=parts[name].split("/")[1])
        if shown:
            for low, high in 1e3 * data[shown[0]]["disturbed_windows"]:
                over_time.axvspan(low, high, color="0.92", zorder=0)
        over_time.set_xlabel("time [ms]")
        over_time.set_ylabel("height, controlled mode [nm]")
        over_time.set_title("disturbed; lines shaded", pad=3)
        power.set_xlabel("frequency [Hz]")
        power.set_ylabel("cumulative rms [nm]")
        power.set_title("disturbed, height, first line", pad=3)
        power.set_xlim(5.0, 5e3)
        for ax, scenario, kind in ((tracking, "tracking", "whole"), (disturbed, "disturbed", "controlled")):
            rows = [row for row in report["factors"] if row["scenario"] == scenario and "whole" in row]
            centres = list(dict.fromkeys(tuple(row["centre"]) for row in report["factors"]))
            for name, design in parts.items():
                mine = [row for row in rows if row["design"] == design]
                at = [centres.index(tuple(row["centre"])) for row in mine]
                colour, marker = looks[name]
                values = [row[kind][HEIGHT] or np.nan for row in mine]
                ax.semilogy(at, values, marker, color=colour, markersize=4, fillstyle="none")
            ax.axhline(1.0, color=BLACK, linewidth=0.8)
            ax.set_xticks(range(len(centres)), [f"{1e3 * x:g}\n{1e3 * y:g}" for x, y in centres])
            ax.set_xlabel("centre of the scan, $x$ above $y$ [mm]")
            ax.set_ylabel("factor in MSD, " + {"whole": "whole error", "controlled": "controlled mode"}[kind])
            ax.set_title(f"{scenario}, height; above 1 is better", pad=3)
        handles, labels = power.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return list(save_figure(figure, out / NAME))
