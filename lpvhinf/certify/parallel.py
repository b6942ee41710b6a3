"""A search over several processes: each takes some of the cells of a first, regular cut."""

from __future__ import annotations

import time

from lpvhinf.certify.cells import Cell, whole
from lpvhinf.certify.search import MOST_CELLS, Prover, Search, bisect
from lpvhinf.jobs import run_jobs
from lpvhinf.progress import SILENT, Progress

CUTS = 4  # bisections before the cells are shared out: 16 cells


def search(
    prover: Prover, n_p: int, *, jobs: int = 1, deadline: float | None, deepest: int, progress: Progress = SILENT
) -> Search:
    """`bisect` from the whole box, over `jobs` processes if above one."""
    if jobs == 1:
        return bisect(prover, [whole(n_p)], deadline=deadline, deepest=deepest, progress=progress)
    found = Search()
    cells = [whole(n_p)]
    for cut in range(CUTS):
        axis = cut % n_p
        for cell in cells:
            found.splits[cell] = axis
        cells = [half for cell in cells for half in cell.halves(axis)]
    limit = None if deadline is None else max(0.0, deadline - time.monotonic())
    tasks = [(f"part {k + 1} of {jobs}", (prover, cells[k::jobs], limit, deepest)) for k in range(jobs)]
    for part in run_jobs(_part, tasks, jobs=jobs, progress=progress):
        found.splits |= part.splits
        found.proved |= part.proved
        found.remaining += part.remaining
        found.suspects += part.suspects
        found.tries += part.tries
        found.reason = found.reason or part.reason
    return found


def _part(prover: Prover, cells: list[Cell], limit: float | None, deepest: int, progress: Progress) -> Search:
    deadline = None if limit is None else time.monotonic() + limit
    return bisect(prover, cells, deadline=deadline, most_cells=MOST_CELLS, deepest=deepest, progress=progress)
