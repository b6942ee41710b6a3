"""Position dependence of the controlled modes: what conventional decoupled inputs do to them, what outputs see of them.

Both are times the root of the mover's mass: rigid vertical motion would have the gain 1. Torques are those of a newton
at 100 mm. Inputs share one colour scale, outputs another.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plotting.positions import signed_map
from lpvhinf.plotting.style import new_figure, save_figure, style
from paper_figures.plant_results import arrays

NAME = "plant_modal_gains"
INPUTS = ("$F_x$", "$F_y$", "$F_z$", "$T_x$", "$T_y$", "$T_z$")
OUTPUTS = ("beam z1", "point of control")
TICKS = (-50, 0, 50)


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study plant."""
    data = arrays(results, "maps")
    outputs = np.stack([data["mode_at_z1"], data["mode_at_point_of_control"]], axis=2)
    n_modes, n_inputs = data["mode_force"].shape[1:]
    with style():
        figure = new_figure(width="two", ratio=0.135 + 0.098 * n_modes)
        # an empty column parts the two kinds
        widths = [1.0] * n_inputs + [0.15] + [1.0] * len(OUTPUTS)
        axes = figure.subplots(n_modes, len(widths), sharex=True, sharey=True, squeeze=False, width_ratios=widths)
        for ax in axes[:, n_inputs]:
            ax.set_visible(False)
        forces, seen = axes[:, :n_inputs], axes[:, n_inputs + 1 :]
        text = r"force on the mode per newton, $\times \sqrt{m}$ [-]"
        _maps(forces, data["axis"], data["mode_force"], INPUTS, text, aspect=40)
        _maps(seen, data["axis"], outputs, OUTPUTS, r"mode seen there, $\times \sqrt{m}$ [-]", aspect=15)
        for k, ax in enumerate(axes[:, 0]):
            ax.set_ylabel(f"mode {k + 1}\n{data['mode_hertz'][k]:.1f} Hz\n$p_y$ [mm]")
        return list(save_figure(figure, out / NAME))


def _maps(axes: Any, axis: Array, gains: Array, names: tuple[str, ...], text: str, *, aspect: float) -> None:
    """Maps of gains (N, n_modes, n), mode by mode, on one colour scale."""
    n = len(axis)
    limit = 0.1 * float(np.ceil(10.0 * np.max(np.abs(gains))))
    for mode, row in enumerate(axes):
        for column, ax in enumerate(row):
            drawn = signed_map(ax, axis, gains[:, mode, column].reshape(n, n), limit)
            ax.set_xticks(TICKS)
            ax.set_yticks(TICKS)
    for ax, name in zip(axes[0], names, strict=True):
        ax.set_title(name, pad=3)
    for ax in axes[-1]:
        ax.set_xlabel("$p_x$ [mm]")
    ticks = limit * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    bar = axes[0, 0].figure.colorbar(drawn, ax=axes, location="bottom", aspect=aspect, pad=0.02, ticks=ticks)
    bar.set_label(text)
