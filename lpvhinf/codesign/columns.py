"""Norms of the columns of the weighted M: what designs of any architecture have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, points_in_box, read_only
from lpvhinf.codesign.design import Design
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.problems import checked_problem
from lpvhinf.progress import SILENT, Progress

BATCH = 64  # positions whose plant gains are held at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class ColumnNorms:
    """Exact norms of the columns of M at N positions; infinite where the loop is not stable.

    Attributes
    ----------
    problem : str
        "six-block" or "two-by-two".
    points : (N, n_p) [m]
    rigid : (N,)
        Of the rigid-body columns: (w1, w2) of the six blocks, w1 of the 2x2 blocks.
    flexible : (N,)
        Of the column of the force on the flexible modes; 0 without a preserved mode.
    whole : (N,)
        Of M.
    """

    problem: str
    points: Array
    rigid: Array
    flexible: Array
    whole: Array


def column_norms(
    design: Design, points: ArrayLike, *, problem: str | None = None, progress: Progress = SILENT
) -> ColumnNorms:
    """Measure a design on the columns of M, with the plant model itself and the filters of its specification.

    Designs of different architectures, or tuned for different problems, are comparable on the columns of one problem:
    all of them exist in every architecture, tuned for or not.

    Parameters
    ----------
    design : Design
    points : (N, n_p) [m]
    problem : "six-block" or "two-by-two", optional
        By default the one that the design was tuned for.

    Raises
    ------
    DomainError
        If there is no such problem, or a position lies outside of P.
    """
    name = design.problem if problem is None else checked_problem(problem)
    plant = design.assembly.plant
    where = points_in_box(points, plant.box, name="points")
    n_flex = plant.n_flex
    rows = []
    for start in range(0, len(where), BATCH):
        for A, B, C, D in design.frozen(where[start : start + BATCH], weighted=True, problem=name):
            n_rigid = B.shape[1] - n_flex
            parts = (slice(0, n_rigid), slice(n_rigid, None), slice(None))
            rows.append([hinf_norm(A, B[:, w], C, D[:, w]).norm if B[:, w].size else 0.0 for w in parts])
            progress.update()
    norms = np.array(rows).reshape(len(where), 3)
    rigid, flexible, whole = (read_only(column) for column in norms.T)
    return ColumnNorms(problem=name, points=read_only(where), rigid=rigid, flexible=flexible, whole=whole)
