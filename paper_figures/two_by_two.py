"""The paper's 2x2-block figure: shaping filters, inactive observer and error-based observer at many positions."""

from __future__ import annotations

from pathlib import Path

from lpvhinf.plotting.frequency import TWO_BY_TWO_TITLES, BlockCurves, draw_blocks
from lpvhinf.plotting.style import new_figure, save_figure, style
from lpvhinf.storage import read_arrays, read_json

NAME = "two_by_two"
RESPONSES = "lpvhinf.Responses"


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study error_observer; nothing is solved here."""
    active = f"error-epsilon-{read_json(results / 'settings.json')['epsilon']:g}"
    designs = (("inactive", "rigid-body", "observer inactive"), (active, "error-observer", "error-based observer"))
    curves = []
    for name, role, label in designs:
        folder = results / "designs" / name
        data = read_arrays(folder / "responses.npz", RESPONSES)
        gamma = read_json(folder / "summary.json")["gamma"]
        counted = "left column" if role == "rigid-body" else r"$M$"
        text = rf"{label}, $\gamma$ = {gamma:.2f} ({counted})"
        curves.append(BlockCurves(label=text, role=role, omega=data["omega"], sigma=data["sigma"]))
    bounds = read_arrays(results / "designs" / active / "responses.npz", RESPONSES)
    with style():
        figure = new_figure(width="two", ratio=0.6)
        draw_blocks(figure, curves, bounds["bounds"], bounds["omega"], titles=TWO_BY_TWO_TITLES, every=True)
        return list(save_figure(figure, out / NAME))
