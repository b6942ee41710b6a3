"""Frequency responses of the decoupled plant at many positions, conventional and extended decoupling.

Times omega^2, accelerations: the rigid body is the line of 0 dB, and what departs from it is flexible.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lpvhinf.plotting.frequency import decibel
from lpvhinf.plotting.style import BLACK, SKY, VERMILION, new_figure, save_figure, style
from lpvhinf.storage import read_json
from paper_figures.plant_results import arrays

NAME = "plant_frf"
FIRST_HZ = 50.0  # below, all curves lie on the line
TICKS_HZ = (100, 300, 1000)
RANGE_DB = (-40.0, 50.0)
COLUMNS = ("$z$", "$r_x$", "$r_y$", "$z$ at the point of control")


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study plant."""
    data = arrays(results, "responses")
    n_flex = read_json(results / "parts" / "responses" / "summary.json")["n_flex"]
    hertz, corner = data["omega"] / (2 * np.pi), len(data["points"]) - 1
    shown = hertz >= FIRST_HZ
    hertz = hertz[shown]
    rows = (("conventional", "conventional"), ("extended", f"extended, {n_flex} modes"))
    with style():
        figure = new_figure(width="two", ratio=0.5)
        axes = figure.subplots(2, 4, sharex=True, sharey=True)
        for row, (name, text) in enumerate(rows):
            for column, title in enumerate(COLUMNS):
                ax, curves = axes[row, column], decibel(data[name][:, column] * data["omega"] ** 2)[:, shown]
                thin = ax.plot(hertz, curves.T, color=SKY, linewidth=0.4)
                (one,) = ax.plot(hertz, curves[corner], color=VERMILION, linewidth=0.8)
                (ideal,) = ax.plot(hertz, 0.0 * hertz, color=BLACK, linestyle=(0, (4, 2)), linewidth=0.9)
                ax.set_xscale("log")
                ax.set_xticks(TICKS_HZ, [str(f) for f in TICKS_HZ])
                ax.set_xlim(hertz[0], hertz[-1])
                ax.set_ylim(*RANGE_DB)
                if row == 0:
                    ax.set_title(title, pad=3)
                else:
                    ax.set_xlabel("frequency [Hz]")
            axes[row, 0].set_ylabel(f"{text}\n$\\omega^2 |G|$ [dB]")
        place = ", ".join(f"{1e3 * x:.0f}" for x in data["points"][corner])
        figure.legend(
            [thin[0], one, ideal],
            [f"{corner + 1} positions over P", f"p = ({place}) mm", "rigid body, $G = 1/s^2$"],
            loc="outside upper center",
            ncols=3,
        )
        return list(save_figure(figure, out / NAME))
