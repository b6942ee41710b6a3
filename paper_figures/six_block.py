"""The paper's 6-block figure: shaping filters, conventional design and output-based observer over all positions."""

from __future__ import annotations

from pathlib import Path

from lpvhinf.plotting.frequency import BlockCurves, draw_blocks
from lpvhinf.plotting.style import new_figure, save_figure, style
from lpvhinf.storage import read_arrays, read_json

NAME = "six_block"
RESPONSES = "lpvhinf.Responses"
DESIGNS = (
    ("conventional", "rigid-body", "conventional (4-block)"),
    ("observer", "output-observer", "output-based observer (6-block)"),
)


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from a results folder of the study output_observer; nothing is solved here."""
    curves = []
    for name, role, label in DESIGNS:
        folder = results / "designs" / name
        data = read_arrays(folder / "responses.npz", RESPONSES)
        gamma = read_json(folder / "summary.json")["gamma"]
        text = rf"{label}, $\gamma$ = {gamma:.2f}"
        curves.append(BlockCurves(label=text, role=role, omega=data["omega"], sigma=data["sigma"]))
    bounds = read_arrays(results / "designs" / "observer" / "responses.npz", RESPONSES)
    with style():
        figure = new_figure(width="two", ratio=0.56)
        draw_blocks(figure, curves, bounds["bounds"], bounds["omega"])
        return list(save_figure(figure, out / NAME))
