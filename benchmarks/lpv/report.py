"""Runs of the LPV benchmark, and their page from the CSV file alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.hinfstruct.store import read_rows
from benchmarks.lpv.cases import OURS
from lpvhinf.storage import write_text

FILE, PAGE = "lpv.csv", "lpv.md"
HEAD = (
    *("states", "points", "functions", "solver", "gamma", "lower bound"),
    *("margin", "wall s", "CPU s", "MB", "slower by", "status"),
)
LIMITATIONS = (
    "Synthetic bars with 1 % damping and two sensors that move with p; S is constant. Other plants differ.",
    "Seconds are those of the solver, its own preparation included (for the general ones cvxpy's), on one thread.",
    "Memory is what the largest size of the process grew by during the solve.",
    "gamma is the level at which all inequalities hold, recomputed; for general solvers raised by up to 1 % where they "
    "miss the inequalities. The margin is the smallest recomputed eigenvalue of any inequality.",
    "A size that a solver did not finish within the limit is not tried by it with more grid points or functions and as "
    "many states, nor with more states.",
    "Solvers that are not installed are left out.",
)


@dataclass(frozen=True, kw_only=True)
class LPVRun:
    """The outcome of one size with one solver; NaN where there is none. `memory` in MB, times in seconds."""

    n_x: int
    n_grid: int
    n_basis: int
    solver: str
    gap: float
    time_limit: float
    gamma: float
    gamma_lower: float
    margin: float
    iterations: int
    wall: float
    cpu: float
    memory: float
    status: str

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return self.n_x, self.n_grid, self.n_basis, self.solver, self.gap, self.time_limit

    @property
    def finished(self) -> bool:
        """Whether the solver ended in time with an optimum."""
        return self.status.startswith("optimal")

    def __str__(self) -> str:
        return (
            f"{self.n_x} states, {self.n_grid} points, {self.n_basis} functions, {self.solver}: "
            f"gamma {self.gamma:.6g}, {self.wall:.2f} s, {self.memory:.0f} MB; {self.status}"
        )


def write_report(folder: Path) -> Path:
    """Write the page from the CSV file in the folder; return its path."""
    rows = read_rows(folder / FILE, LPVRun)
    ours = {row.run.key[:3] + row.run.key[4:]: row.run for row in rows if row.run.solver == OURS}
    lines = [
        "# LPV synthesis: the structured solver and general ones",
        "",
        f"| {' | '.join(HEAD)} |",
        "|---:|---:|---:|---|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for run in sorted((row.run for row in rows), key=lambda r: (r.n_x, r.n_grid, r.n_basis, r.solver != OURS)):
        base = ours.get(run.key[:3] + run.key[4:])
        ratio = run.cpu / base.cpu if base is not None and run.solver != OURS and base.cpu > 0.0 else np.nan
        figures: tuple[tuple[float, str], ...] = (
            (run.gamma, ".6g"),
            (run.gamma_lower, ".6g"),
            (run.margin, ".1e"),
            (run.wall, ".2f"),
            (run.cpu, ".2f"),
            (run.memory, ".0f"),
            (ratio, ".1f"),
        )
        cells = ["-" if not np.isfinite(v) else format(v, f) for v, f in figures]
        sizes = [str(run.n_x), str(run.n_grid), str(run.n_basis), run.solver]
        lines.append(f"| {' | '.join([*sizes, *cells, run.status.split(':')[0]])} |")
    where = dict.fromkeys("; ".join(f"{key} {value}" for key, value in row.where.items()) for row in rows)
    lines += ["", "## Machine and versions", "", *[f"- {text}" for text in where]]
    lines += ["", "## Limitations", "", *[f"- {text}" for text in LIMITATIONS]]
    write_text(folder / PAGE, "\n".join(lines) + "\n")
    return folder / PAGE
