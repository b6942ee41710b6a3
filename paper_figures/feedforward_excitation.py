"""What the rigid-body feedforward does to the preserved modes over P, without and with the extended decoupling.

Forces on the mass-normalised modes per force that accelerates the axis, all on one colour scale. The last column is the
largest of all axes with the extended decoupling, and its number.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lpvhinf.plotting.positions import signed_map
from lpvhinf.plotting.style import new_figure, save_figure, style
from paper_figures.plant_results import arrays

NAME = "feedforward_excitation"
AXES = ("$x$", "$y$", "$z$", "$r_x$", "$r_y$", "$r_z$")
TICKS = (-50, 0, 50)


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study feedforward."""
    data = arrays(results, "maps")
    without, extended = data["rigid-body"], np.max(np.abs(data["extended"]), axis=2)
    n, n_modes = len(data["axis"]), without.shape[1]
    limit = 0.1 * float(np.ceil(10.0 * np.max(np.abs(without))))
    with style():
        figure = new_figure(width="two", ratio=0.13 + 0.115 * n_modes)
        widths = [1.0] * len(AXES) + [0.15, 1.0]  # an empty column parts without and with
        axes = figure.subplots(n_modes, len(widths), sharex=True, sharey=True, squeeze=False, width_ratios=widths)
        for k, row in enumerate(axes):
            for i, ax in enumerate(row[: len(AXES)]):
                drawn = signed_map(ax, data["axis"], without[:, k, i].reshape(n, n), limit)
            row[len(AXES)].set_visible(False)
            amount = extended[:, k].reshape(n, n)
            # white, on the scale of the others: round-off has no sign worth a line
            signed_map(row[-1], data["axis"], np.where(amount < 1e-10, 0.0, amount), limit)
            row[-1].text(0.0, 0.0, f"{np.max(amount):.0e}", ha="center", va="center")
            for ax in row:
                ax.set_xticks(TICKS)
                ax.set_yticks(TICKS)
            row[0].set_ylabel(f"mode {k + 1}\n{data['mode_hertz'][k]:.1f} Hz\n$p_y$ [mm]")
        for ax, name in zip(axes[0], (*AXES, "", "all, extended"), strict=True):
            ax.set_title(name, pad=3)
        for ax in axes[-1]:
            ax.set_xlabel("$p_x$ [mm]")
        ticks = limit * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
        bar = figure.colorbar(drawn, ax=axes, location="bottom", aspect=45, pad=0.02, ticks=ticks)
        bar.set_label("force on the mode per force that accelerates the axis [-]")
        return list(save_figure(figure, out / NAME))
