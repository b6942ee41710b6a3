"""Top view of the actuator at an off-centre position: coil layers with the weights of the commutation, the mover."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Patch, Rectangle

from lpvhinf.plotting.coils import draw_coils, rectangles
from lpvhinf.plotting.positions import AMOUNT, MM
from lpvhinf.plotting.style import BLACK, GREEN, PURPLE, VERMILION, YELLOW, new_figure, save_figure, style
from paper_figures.plant_results import arrays

NAME = "plant_top_view"
TURN = -np.pi / 4  # of the magnet array against the mover
UP, DOWN, ACROSS = "#E8A37A", "#8DBBDA", "#D9D9D9"  # tints: lines on top of them stay readable


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study plant."""
    data = arrays(results, "geometry")
    stator = MM * float(np.max(np.abs(data["coil_centres"]) + data["coil_sizes"] / 2)) + 8.0
    with style(axes_grid=False):
        figure = new_figure(width="two", ratio=0.42)
        axes = figure.subplots(1, 3, width_ratios=[1.0, 1.0, 1.25])
        for layer, ax in enumerate(axes[:2]):
            mine = data["coil_layer"] == layer
            centres, sizes = data["coil_centres"][mine], data["coil_sizes"][mine]
            coils = draw_coils(ax, centres, sizes, data["weights"][mine], (0.0, 1.0), AMOUNT)
            _outline(ax, data)
            _box(ax, data)
            ax.set_xlim(-stator, stator)
            ax.set_ylim(-stator, stator)
            ax.set_xticks((-200, 0, 200))
            ax.set_yticks((-200, 0, 200))
        _mover(axes[2], data)
        axes[0].set_ylabel("$y$ [mm]")
        for ax, title in zip(axes, ("upper coil layer", "lower coil layer", "mover"), strict=True):
            ax.set_title(title, pad=3)
            ax.set_xlabel("$x$ [mm]")
        bar = figure.colorbar(coils, ax=axes[:2], location="bottom", aspect=44, pad=0.02)
        bar.set_label("weight in the commutation [-]")
        figure.legend(handles=_handles(), loc="outside lower center", ncols=5, columnspacing=1.4)
        return list(save_figure(figure, out / NAME))


def _outline(ax: Axes, data: dict[str, Any]) -> None:
    """The mover's edge and centre."""
    side, (x, y) = MM * float(data["side"]), MM * data["position"]
    ax.add_patch(
        Rectangle((x - side / 2, y - side / 2), side, side, fill=False, edgecolor=BLACK, linewidth=1.0, zorder=3)
    )
    ax.plot(x, y, "o", mfc="white", mec=BLACK, markersize=3.5, zorder=5)


def _box(ax: Axes, data: dict[str, Any]) -> None:
    """The box P of the mover's centre."""
    (left, right), (low, high) = MM * data["box"]
    ax.add_patch(
        Rectangle(
            (left, low), right - left, high - low, fill=False, edgecolor=VERMILION, linestyle=(0, (3, 2)), zorder=3
        )
    )


def _mover(ax: Axes, data: dict[str, Any]) -> None:
    """Magnets, mirror bars and beams, seen closer."""
    p, half = MM * data["position"], MM * float(data["side"]) / 2
    _magnets(ax, data)
    inset, length = MM * float(data["bar_inset"]), MM * float(data["bar_length"])
    for corner, width, height in (
        ((half - 2 * inset, -length / 2), 2 * inset, length),
        ((-length / 2, half - 2 * inset), length, 2 * inset),
    ):
        ax.add_patch(Rectangle(p + corner, width, height, facecolor=PURPLE, edgecolor="none", zorder=2.5))
    _outline(ax, data)
    _box(ax, data)
    margin = 70.0
    for y in MM * data["x_beams"]:
        _beam(ax, (p[0] + half + margin, y), (p[0] + half, y))
    for x in MM * data["y_beams"]:
        _beam(ax, (x, p[1] + half + margin), (x, p[1] + half))
    ax.plot(*(MM * data["z_beams"].T), "o", mfc=GREEN, mec="white", mew=0.6, markersize=5.5, zorder=5)
    ax.plot(*(p + MM * data["centre_of_gravity"]), "x", color=BLACK, markersize=5, mew=1.2, zorder=6)
    ax.plot(*(MM * data["point_of_control"]), "D", mfc=YELLOW, mec=BLACK, mew=0.6, markersize=4, zorder=6)
    ax.set_xlim(p[0] - half - 15.0, p[0] + half + margin)
    ax.set_ylim(p[1] - half - 15.0, p[1] + half + margin)
    ax.set_xticks((-100, 0, 100, 200))
    ax.set_yticks((-200, -100, 0, 100))
    ax.set_aspect("equal")


def _magnets(ax: Axes, data: dict[str, Any]) -> None:
    """Cuboids by their polarization, that of the horizontal ones as arrows."""
    polarization, centres = data["magnet_polarization"], data["magnet_centres"] + data["position"]
    vertical = polarization[:, 2]
    for mask, colour in ((vertical > 0.0, UP), (vertical < 0.0, DOWN), (vertical == 0.0, ACROSS)):
        patches = rectangles(centres[mask], data["magnet_sizes"][mask], TURN)
        ax.add_collection(PatchCollection(patches, facecolor=colour, edgecolor="white", linewidth=0.3))
    flat = vertical == 0.0
    turn = np.array([[np.cos(TURN), -np.sin(TURN)], [np.sin(TURN), np.cos(TURN)]])
    direction = polarization[flat, :2] @ turn.T
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    ax.quiver(*(MM * centres[flat].T), *direction.T, pivot="mid", scale=32.0, width=0.004, color="#505050")


def _handles() -> list[Any]:
    """The legend."""
    return [
        Patch(facecolor=UP, label="magnet, polarized up"),
        Patch(facecolor=DOWN, label="down"),
        Patch(facecolor=ACROSS, label="along the arrow"),
        Patch(facecolor=PURPLE, label="mirror bars"),
        Line2D([], [], color=GREEN, marker="o", linewidth=1.0, markersize=4, label="interferometer beams"),
        Line2D([], [], color="none", marker="o", mfc="white", mec=BLACK, markersize=3.5, label="centre of the mover"),
        Line2D([], [], color=VERMILION, linestyle=(0, (3, 2)), linewidth=1.0, label="P, box of the centre"),
        Line2D([], [], color="none", marker="x", mec=BLACK, markersize=5, mew=1.2, label="centre of gravity"),
        Line2D(
            [], [], color="none", marker="D", mfc=YELLOW, mec=BLACK, mew=0.6, markersize=4, label="point of control"
        ),
    ]


def _beam(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A horizontal beam up to its mirror."""
    ax.add_patch(
        FancyArrowPatch(start, end, arrowstyle="-|>,head_length=3,head_width=1.5", color=GREEN, linewidth=0.9,
                        shrinkA=0, shrinkB=0, zorder=4)
    )  # fmt: skip
