"""Damping of the controlled mode against epsilon, and what it costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lpvhinf.errors import StorageError
from lpvhinf.plotting.style import ROLES, new_figure, save_figure, style
from lpvhinf.storage import read_json

NAME = "damping_trade"


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from the summaries in a results folder of the study output_observer."""
    names = read_json(results / "designs.json")
    summaries = [read_json(results / "designs" / name / "summary.json") for name in names]
    observers = sorted(
        (s for s in summaries if s["architecture"] == "output-observer" and s["sensing"] == "all"),
        key=lambda s: s["epsilon"],
    )
    reference = [s for s in summaries if s["name"] == "conventional"]
    if not observers or not reference:
        raise StorageError(f"{results} has no finished observer and conventional designs. Run the study first.")
    epsilon = np.array([s["epsilon"] for s in observers])

    def column(key: str) -> np.ndarray:
        return np.array([np.nan if s[key] is None else s[key] for s in observers], dtype=float)

    with style():
        figure = new_figure(width="two", ratio=0.33)
        left, middle, right = figure.subplots(1, 3)
        color, plain = ROLES["output-observer"], ROLES["rigid-body"]
        left.semilogx(epsilon, column("mode_peak_dB"), "o-", color=color, label="controlled mode")
        left.semilogx(epsilon, column("flexible_peak_dB"), "s--", color=color, label="all frequencies", mfc="white")
        left.axhline(reference[0]["mode_peak_dB"], color=plain, label="conventional")
        left.set_ylabel("worst flexible-mode peak [dB]")
        left.set_ylim(5.0, 50.0)  # room for the legend above the conventional line
        left.legend(loc="upper right")
        controlled = 100.0 * np.array([min(s["damping_min"]) for s in observers])
        middle.loglog(epsilon, controlled, "o-", color=color, label="controlled mode")
        middle.loglog(
            epsilon, 100.0 * column("discarded_damping_min"), "s--", color=color, label="discarded modes", mfc="white"
        )
        middle.axhline(100.0 * reference[0]["discarded_damping_min"], color=plain, label="conventional, discarded")
        middle.set_ylabel("least damping over P [%]")
        middle.legend()
        right.semilogx(epsilon, column("gamma"), "o-", color=color, label="observer")
        right.axhline(reference[0]["gamma"], color=plain, label="conventional (4-block)")
        right.set_ylabel(r"$\gamma$")
        right.set_ylim(0.0, 1.4 * float(np.nanmax(column("gamma"))))
        right.legend()
        for ax in (left, middle, right):
            ax.set_xlabel(r"$\epsilon$")
        return list(save_figure(figure, out / NAME))
