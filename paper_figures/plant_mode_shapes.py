"""The first six flexible modes of the mover, with nodal lines and the areas that the vertical beams sweep.

Each shape has its own scale; the titles say the largest deflection, mass-normalised and times the root of the mass, so
that rigid vertical motion would have 1.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lpvhinf.plotting.modes import draw_mode_shape, draw_swept_areas
from lpvhinf.plotting.positions import MM
from lpvhinf.plotting.style import BLACK, new_figure, save_figure, style
from paper_figures.plant_results import arrays

NAME = "plant_mode_shapes"
TICKS = (-100, 0, 100)


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study plant."""
    data = arrays(results, "geometry")
    shapes = data["shapes"]
    peaks = np.max(np.abs(shapes), axis=(1, 2))
    with style():
        figure = new_figure(width="two", ratio=0.63)
        axes = figure.subplots(2, 3, sharex=True, sharey=True)
        for k, ax in enumerate(axes.ravel()):
            drawn = draw_mode_shape(ax, data["shape_axis"], shapes[k] / peaks[k], 1.0)
            draw_swept_areas(ax, data["z_beams"], data["box"])
            ax.plot(*(MM * data["z_beams"].T), "+", color=BLACK, markersize=4)
            ax.set_title(f"mode {k + 1}, {data['shape_hertz'][k]:.1f} Hz, largest {peaks[k]:.2f}", pad=3)
            ax.set_xticks(TICKS)
            ax.set_yticks(TICKS)
        for ax in axes[1]:
            ax.set_xlabel("mover $x$ [mm]")
        for ax in axes[:, 0]:
            ax.set_ylabel("mover $y$ [mm]")
        bar = figure.colorbar(drawn, ax=axes, shrink=0.8, pad=0.015)
        bar.set_label("deflection over the largest of the mode [-]")
        return list(save_figure(figure, out / NAME))
