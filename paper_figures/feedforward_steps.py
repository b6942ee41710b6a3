"""Vibration that the feedforward of a short step leaves, against the time of the step, by decoupling."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lpvhinf.plotting.style import BLACK, BLUE, GREEN, ORANGE, new_figure, save_figure, style
from lpvhinf.storage import read_json
from paper_figures.plant_results import arrays

NAME = "feedforward_steps"
AXES = ("$x$", "$y$", "$z$", "$r_x$", "$r_y$", "$r_z$")
LOOKS = ((BLUE, "s"), (GREEN, "^"), (ORANGE, "D"))


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study feedforward."""
    settings = read_json(results / "settings.json")
    counts = sorted(int(n) for n in settings["n_flexes"])
    parts = {n: arrays(results, f"steps-{n}") for n in counts}
    own = np.arange(len(AXES))
    with style():
        figure = new_figure(width="two", ratio=0.5)
        axes = figure.subplots(2, 3, sharex=True)
        for i, ax in enumerate(axes.ravel()):
            first = parts[counts[0]]
            times = 8e3 * first["snap_times"]
            plain = 1e9 * first["rigid-body_sensors_after"][:, own, own][:, i]
            ax.semilogy(times, plain, "o-", color=BLACK, markersize=4, label="rigid-body decoupling")
            for n, (color, marker) in zip(counts, LOOKS, strict=False):
                left = 1e9 * parts[n]["extended_sensors_after"][:, own, own][:, i]
                ax.semilogy(times, left, f"{marker}-", color=color, markersize=4, label=f"extended, {n} preserved")
            size = 1e6 * settings["distances"][i]
            small, unit = ("nm", "µm") if i < 3 else ("nrad", "µrad")
            ax.set_title(f"{AXES[i]}: {size:g} {unit}", pad=3)
            if i % 3 == 0:
                ax.set_ylabel(f"error after the step [{small}]")
        for ax in axes[1]:
            ax.set_xlabel("time of the step [ms]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return list(save_figure(figure, out / NAME))
