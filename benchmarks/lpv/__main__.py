"""``python -m benchmarks.lpv [--solver NAME] [--limit SECONDS] [--gap GAP] [--tiny] [--out DIR]``.

The inequalities of gridded synthesis, 10 to 80 states, 1 to 81 grid points, 1 to 6 basis functions, by the structured
solver and by general ones through cvxpy. Every solve is a process of its own with a time limit. Every run is written at
once: a call that was stopped goes on where it ended. Delete the CSV file to begin anew.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.hinfstruct.store import append, read_rows
from benchmarks.lpv.cases import OTHERS, OURS, SIZES, TINY, Size
from benchmarks.lpv.report import FILE, LPVRun, write_report
from benchmarks.lpv.worker import in_a_process
from benchmarks.runner import environment
from lpvhinf.lpv.reference import installed


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is missing, and write the report."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.lpv", description=__doc__)
    known = (OURS, *(name for name in OTHERS if name in installed()))
    parser.add_argument("--solver", choices=known, action="append", help="may be repeated; all installed if left out")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds of each solve (default %(default)s)")
    parser.add_argument("--gap", type=float, default=1e-5, help="relative gap of gamma (default %(default)s)")
    parser.add_argument("--largest", type=int, default=80, help="states of the largest size (default %(default)s)")
    parser.add_argument("--tiny", action="store_true", help="small sizes, to try the command")
    parser.add_argument("--out", type=Path, default=Path("results/benchmarks"), help="folder (default %(default)s)")
    given = parser.parse_args(argv)
    for name in ("limit", "gap", "largest"):
        if not (getattr(given, name) > 0.0 and math.isfinite(getattr(given, name))):
            parser.error(f"--{name} is {getattr(given, name)}, wanted a finite number above 0")
    path, where = given.out / FILE, environment()
    earlier = {row.run.key: row.run for row in read_rows(path, LPVRun)}
    for solver in given.solver or known:
        unfinished: list[Size] = []
        for size in TINY if given.tiny else SIZES:
            key = (size.n_x, size.n_grid, size.n_basis, solver, given.gap, given.limit)
            if size.n_x > given.largest or any(_larger(size, other) for other in unfinished):
                continue
            run = earlier.get(key)
            if run is None:
                run = _run(size, solver, given.gap, given.limit)
                append(path, run, where)
                write_report(given.out)
                print(run, flush=True)
            if not run.finished:
                unfinished.append(size)
    print(f"written: {write_report(given.out)}")
    return 0


def _larger(size: Size, other: Size) -> bool:
    """Whether a size is at least as large as another in every respect."""
    return size.n_x >= other.n_x and size.n_grid >= other.n_grid and size.n_basis >= other.n_basis


def _run(size: Size, solver: str, gap: float, limit: float) -> LPVRun:
    found: dict[str, Any] = {"gamma": math.inf, "gamma_lower": -math.inf, "margin": math.nan, "iterations": 0}
    found |= {"wall": math.nan, "cpu": math.nan, "memory": math.nan, **in_a_process(size, solver, gap, limit)}
    return LPVRun(
        n_x=size.n_x, n_grid=size.n_grid, n_basis=size.n_basis, solver=solver, gap=gap, time_limit=limit, **found
    )


if __name__ == "__main__":
    raise SystemExit(main())
