"""The largest norms of the columns of M over P, and what an observer does to the rigid-body columns."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign import ColumnNorms, Design, column_norms
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.progress import Progress
from lpvhinf.simulation.search import largest_over_box

COLUMNS = ("rigid", "flexible", "whole")


def columns_over_P(
    design: Design, points: Array, *, problem: str, n_search: int, seed: int, progress: Progress
) -> tuple[ColumnNorms, dict[str, Any]]:
    """The columns at positions (N, n_p), and the largest norm of each that is found over P, for JSON.

    Found at the positions, on a spread, or on a climb of the rigid-body columns from its best position: lower bounds on
    the suprema, not certificates. Where a loop is not stable the norm is infinite, and nothing is climbed.
    """
    progress.stage(f"columns of the {problem} problem", len(points))
    there = column_norms(design, points, problem=problem, progress=progress)
    places = [points]
    found = [np.column_stack([getattr(there, name) for name in COLUMNS])]

    def norms(at: Array) -> Array:
        norms = column_norms(design, at, problem=problem)
        places.append(at)
        found.append(np.column_stack([getattr(norms, name) for name in COLUMNS]))
        return found[-1][:, :1]

    if np.all(np.isfinite(found[0])):
        largest_over_box(norms, design.assembly.plant.box, n_search=n_search, n_starts=1, seed=seed)
    everywhere, values = np.vstack(places), np.vstack(found)
    best = np.argmax(values, axis=0)
    out: dict[str, Any] = {name: float(values[i, k]) for k, (name, i) in enumerate(zip(COLUMNS, best, strict=True))}
    out |= {f"{name}_position_mm": 1e3 * everywhere[i] for name, i in zip(COLUMNS, best, strict=True)}
    return there, out


def coupling(design: Design, points: Array, *, problem: str) -> float:
    r"""How much the observer changes the rigid-body columns of the same K_RB, over positions (N, n_p).

    The largest :math:`\|M_{rigid} - M_{rigid, \xi = 0}\|_\infty / \|M_{rigid, \xi = 0}\|_\infty`; infinite where one of
    the two loops is not stable.
    """
    off = np.array(design.parameters)
    off[len(off) - design.assembly.plant.n_flex :] = 0.0
    alone = dataclasses.replace(design, parameters=off)
    n_flex, worst = design.assembly.plant.n_flex, 0.0
    with_and_without = (d.frozen(points, weighted=True, problem=problem) for d in (design, alone))
    for (A, B, C, D), (A0, B0, C0, D0) in zip(*with_and_without, strict=True):
        n, n_rigid = len(A), B.shape[1] - n_flex
        both = np.zeros((2 * n, 2 * n))
        both[:n, :n], both[n:, n:] = A, A0
        w = slice(0, n_rigid)
        change = hinf_norm(both, np.vstack([B[:, w], B0[:, w]]), np.hstack([C, -C0]), (D - D0)[:, w]).norm
        worst = max(worst, change / hinf_norm(A0, B0[:, w], C0, D0[:, w]).norm if np.isfinite(change) else np.inf)
    return float(worst)
