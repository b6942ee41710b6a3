"""Adaptive bisection: cut the box until every cell is proved."""

from __future__ import annotations

import heapq
import time
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lpvhinf.certify.cells import Cell
from lpvhinf.certify.inequality import CellVerdict
from lpvhinf.progress import SILENT, Progress

DEEPEST = 26  # bisections along one axis: cells of 1.5e-8 of the box
MOST_CELLS = 20_000
SLENDER = 2  # a cell is cut at most so many times more along one axis than along another
FAR = 3.0  # an excess above this is halved twice before the next try


class Prover(Protocol):
    """Tests one cell."""

    suspicion: str  # why a search ends at a suspect cell

    def test(self, cell: Cell) -> Attempt:
        """Try to prove the claim on a cell."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Attempt:
    """The test of one cell.

    Attributes
    ----------
    record : arrays to store with a proved cell
    suspect : whether the cell's centre looks like a counterexample
    """

    verdict: CellVerdict
    record: dict[str, NDArray[Any]] = field(default_factory=dict)
    suspect: bool = False


@dataclass(eq=False, kw_only=True)
class Search:
    """What a search found.

    Attributes
    ----------
    splits : axis along which a cell was cut
    proved : margin and record of every proved cell
    remaining : cells without a proof
    suspects : cells whose centre looks like a counterexample
    reason : why it ended without a proof; empty if it is complete
    """

    splits: dict[Cell, int] = field(default_factory=dict)
    proved: dict[Cell, tuple[float, dict[str, NDArray[Any]]]] = field(default_factory=dict)
    remaining: list[Cell] = field(default_factory=list)
    suspects: list[Cell] = field(default_factory=list)
    tries: int = 0
    reason: str = ""

    @property
    def proved_share(self) -> float:
        """Share of the volume that is proved."""
        return float(sum(cell.share for cell in self.proved))


def bisect(
    prover: Prover,
    roots: list[Cell],
    *,
    deadline: float | None = None,
    most_cells: int = MOST_CELLS,
    deepest: int = DEEPEST,
    progress: Progress = SILENT,
) -> Search:
    """Cut `roots` until all cells are proved, one looks like a counterexample, or a limit is reached.

    Large cells come first, so that what remains at a limit is small.

    Parameters
    ----------
    deadline : value of `time.monotonic` at which to stop
    """
    found = Search()
    heap = [(sum(cell.level), cell) for cell in roots]
    heapq.heapify(heap)
    while heap:
        if deadline is not None and time.monotonic() > deadline:
            found.reason = "the time limit was reached"
        elif len(found.proved) + len(heap) > most_cells:
            found.reason = f"more than {most_cells} cells are needed"
        if found.reason:
            break
        _, cell = heapq.heappop(heap)
        attempt = prover.test(cell)
        found.tries += 1
        if attempt.verdict.proved:
            found.proved[cell] = (attempt.verdict.margin, attempt.record)
            progress.update(1, proved_share=found.proved_share, cells=len(found.proved))
            continue
        if attempt.suspect:
            found.suspects.append(cell)
            found.remaining.append(cell)
            found.reason = prover.suspicion
            break
        pieces: list[Cell] = [cell]
        for _ in range(2 if attempt.verdict.excess > FAR else 1):
            pieces = [half for piece in pieces for half in _cut(found, piece, cell, attempt.verdict, deepest)]
        if pieces == [cell]:
            found.remaining.append(cell)
            found.reason = "a cell of the smallest size is not proved"
            break
        for piece in pieces:
            heapq.heappush(heap, (sum(piece.level), piece))
    found.remaining += [cell for _, cell in heap]
    return found


def _cut(found: Search, piece: Cell, cell: Cell, verdict: CellVerdict, deepest: int) -> tuple[Cell, ...]:
    """Two halves of a piece of `cell` along the axis that matters most; the piece itself at the smallest size."""
    level = np.array(piece.level)
    weight = verdict.difficulty * 2.0 ** -(level - np.array(cell.level))
    weight[level >= level.min() + SLENDER] = -1.0
    axis = int(np.argmax(weight))
    if level[axis] >= deepest:
        return (piece,)
    found.splits[piece] = axis
    return piece.halves(axis)
