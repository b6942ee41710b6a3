"""Solves a linear matrix inequality problem by a named method."""

from __future__ import annotations

from lpvhinf.errors import DomainError
from lpvhinf.lpv.lmi import LMIProblem, LMISolution
from lpvhinf.progress import SILENT, Progress

SOLVERS = ("structured", "clarabel", "cvxopt", "sdpa", "scs")


def solve_lmi(
    problem: LMIProblem,
    *,
    solver: str = "structured",
    gap: float = 1e-5,
    max_iterations: int = 100,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> LMISolution:
    """Minimise gamma subject to the inequalities of `problem`.

    Parameters
    ----------
    problem : LMIProblem
    solver : "structured", "clarabel", "cvxopt", "sdpa" or "scs"
        The interior-point method of this package, or the same problem through cvxpy with a solver that is installed.
    gap : float
        Relative gap between gamma and its dual estimate at which to stop. For the design of a controller stop at
        1e-2: the matrices are then well inside the cone.
    max_iterations : int
    time_limit : float, optional
        Seconds of wall time.
    progress : Progress
        Hears `update(gamma=..., gap=...)` every iteration.

    Returns
    -------
    LMISolution
        Never a guess: see its `status`.

    Raises
    ------
    DomainError
        If `solver` is unknown.
    """
    if solver not in SOLVERS:
        raise DomainError(f"solver is {solver!r}, wanted one of {', '.join(SOLVERS)}.")
    if solver == "structured":
        from lpvhinf.lpv.interior_point import interior_point

        return interior_point(problem, gap=gap, max_iterations=max_iterations, time_limit=time_limit, progress=progress)
    from lpvhinf.lpv.reference import reference_solution

    return reference_solution(problem, solver=solver, gap=gap, time_limit=time_limit)
