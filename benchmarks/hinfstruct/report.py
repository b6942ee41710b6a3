"""The results of the benchmark of structured synthesis as CSV and as a page of Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.hinfstruct.problems import Run
from lpvhinf.storage import write_text

#: A run counts as a success up to this multiple of the best known norm, or below this norm.
WITHIN, VANISHING = 1.001, 1e-3

LIMITATIONS = (
    "The best known norms are upper bounds on the optimum, reached by any method so far; a ratio of one is no proof.",
    "HIFOO's figures are of one run of three starts under GNU Octave on another day; its CPU seconds are of that "
    "machine. Systems without a figure are left out of its sums.",
    "CPU seconds are of this process with one thread; they vary by some 20 % with other work on the machine.",
    "Where the infimum lies at infinite gain, the largest parameter tells; such a gain is not for practice.",
    "Static output feedback, and orders 1 and 2 for a few systems, without a best known norm to compare with.",
)


def read_runs(path: Path) -> list[Run]:
    """Runs of an earlier, perhaps unfinished, call."""
    if not path.exists():
        return []
    kinds: dict[str, Any] = {f.name: {"str": str, "int": int, "float": float}[str(f.type)] for f in fields(Run)}
    with path.open(encoding="utf-8", newline="") as stream:
        return [Run(**{name: kinds[name](row[name]) for name in kinds}) for row in csv.DictReader(stream)]


def write_results(folder: Path, runs: list[Run], where: Mapping[str, str]) -> None:
    """Write hinfstruct.csv, one row a run with the environment in every row, and hinfstruct.md."""
    buffer = io.StringIO()
    rows = [asdict(run) | dict(where) for run in runs]
    writer = csv.DictWriter(buffer, fieldnames=list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(folder / "hinfstruct.csv", buffer.getvalue())
    write_text(folder / "hinfstruct.md", report(runs, where))


def success(run: Run) -> bool:
    """Reached the best known norm."""
    return run.gamma <= max(WITHIN * run.best_known, VANISHING if run.best_known < VANISHING else 0.0)


def report(runs: Iterable[Run], where: Mapping[str, str]) -> str:
    """The results as a page of Markdown."""
    groups: dict[tuple[str, int], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.name, run.order), []).append(run)
    static = [g for (_, order), g in groups.items() if order == 0]
    reached = sum(sum(map(success, g)) >= 0.9 * len(g) for g in static)
    records = [g[0].name for g in static if min(r.ratio for r in g) < 1.0 / WITHIN and g[0].best_known > VANISHING]
    compared = [g for g in static if np.isfinite(g[0].hifoo_cpu)]
    lines = ["# Structured H-infinity synthesis: COMPleib", ""]
    lines += [f"- Systems within {WITHIN} of the best known norm for nine of ten seeds: {reached} of {len(static)}."]
    lines += [f"- New smallest norms: {', '.join(records) if records else 'none'}."]
    lines += [
        f"- CPU of a seed over the systems that HIFOO solved: {sum(median(r.cpu for r in g) for g in compared):.0f} s "
        f"(HIFOO {sum(g[0].hifoo_cpu for g in compared):.0f} s); over all {_total(static):.0f} s; most for a "
        f"system {max((r.cpu for g in static for r in g), default=np.nan):.1f} s.",
        f"- Largest difference from SLICOT: {max((abs(r.slicot - 1.0) for g in static for r in g), default=0.0):.1e}.",
        "",
        "| system | order | seeds | reached | gamma, best | median | worst | best known | HIFOO | ratio, worst "
        "| CPU [s] | HIFOO [s] | evaluations |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for (system, order), g in groups.items():
        gammas = [r.gamma for r in g]
        known = np.isfinite(g[0].best_known)
        lines.append(
            f"| {system} | {order} | {len(g)} | {sum(map(success, g)) if known else '-'} | {min(gammas):.6g} "
            f"| {median(gammas):.6g} | {max(gammas):.6g} | {_number(g[0].best_known)} | {_number(g[0].hifoo)} "
            f"| {max(r.ratio for r in g):.4f} | {median(r.cpu for r in g):.1f} | {_number(g[0].hifoo_cpu)} "
            f"| {median(r.trials for r in g):.0f} |"
        )
    lines += ["", "## Machine and versions", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in where.items()]
    lines += ["", "## Limitations", "", *[f"- {text}" for text in LIMITATIONS]]
    return "\n".join(lines) + "\n"


def _total(groups: list[list[Run]]) -> float:
    return float(sum(median(r.cpu for r in g) for g in groups))


def _number(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else "-"
