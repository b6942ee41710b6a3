"""The same problem through cvxpy and a general conic solver: the reference for the structured method.

General solvers keep a dense system for every cone and stop being of use near 20 or 30 states. Their word on accuracy is
not taken: eigenvalues are recomputed, gamma is raised a little where that makes all inequalities hold, and they are
stated once more with a margin where it does not.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.lpv.farkas import ANY_LEVEL, certificate
from lpvhinf.lpv.lmi import LMIProblem, LMISolution
from lpvhinf.lpv.operator import LMIOperator
from lpvhinf.lpv.verdict import holds, lower_bound, rounding

#: How cvxpy calls them.
CONIC = {"clarabel": "CLARABEL", "cvxopt": "CVXOPT", "sdpa": "SDPA", "scs": "SCS"}
#: Relative raises of gamma that are tried until the inequalities hold beyond round-off.
RAISES = (0.0, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)


def reference_solution(
    problem: LMIProblem, *, solver: str = "clarabel", gap: float = 1e-5, time_limit: float | None = None
) -> LMISolution:
    """Solve through cvxpy.

    Parameters
    ----------
    problem : LMIProblem
    solver : "clarabel", "cvxopt", "sdpa" or "scs"
        Only Clarabel and SCS come with this package.
    gap : float
        Relative gap at which the solution counts as optimal; the solver runs at its own tolerances.
    time_limit : float, optional
        Seconds; known to Clarabel and SCS only.

    Raises
    ------
    DomainError
        If the solver is unknown or not installed.
    """
    import cvxpy

    cp: Any = cvxpy  # partly typed: taken as untyped
    name = CONIC.get(solver)
    if name is None or name not in cp.installed_solvers():
        raise DomainError(f"solver is {solver!r}, wanted one that is installed: {', '.join(installed())}.")
    if all(block.Fg is None for block in problem.blocks):
        raise AssumptionError("no block of the problem contains gamma (Fg), so there is nothing to minimise.")
    began = time.monotonic()
    operator = LMIOperator(problem)
    tried = problem
    for attempt in range(2):
        found = _solved(cp, tried, name, _options(solver, time_limit, began))
        if found.unknowns is None:
            break
        reached = _least_level(operator, found.unknowns, found.gamma)
        if reached < np.inf or attempt == 1:
            return _judged(operator, found, reached, solver, gap, time.monotonic() - began)
        tried = _tightened(problem, found.unknowns, found.gamma)  # its inequalities hold up to round-off only
    shown = None if found.multipliers is None else certificate(problem, found.multipliers)
    proved = shown is not None and shown.gamma >= ANY_LEVEL
    zero = operator.matrices(np.zeros(operator.n_variables))
    return LMISolution(
        status="infeasible" if proved else "not solved",
        unknowns=zero,
        gamma=np.inf,
        gamma_lower=np.inf if proved else -np.inf,
        gap=np.inf,
        iterations=found.iterations,
        eigenvalues=problem.smallest_eigenvalues(zero, 0.0),
        certificate=shown if proved else None,
        solver=solver,
        message=f"{solver} said: {found.said}",
        seconds=time.monotonic() - began,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """What the solver returned; None where it returned nothing."""

    unknowns: dict[str, Array] | None
    gamma: float
    multipliers: list[Array] | None
    iterations: int
    said: str


def _solved(cp: Any, problem: LMIProblem, name: str, options: dict[str, float]) -> _Found:
    gamma = cp.Variable()
    variables = {
        u.name: [cp.Variable((u.size, u.size), symmetric=True) for _ in range(u.count)] for u in problem.unknowns
    }
    constraints = [
        [_inequality(cp, block, k, variables, gamma) >> 0 for k in range(block.m)] for block in problem.blocks
    ]
    task = cp.Problem(cp.Minimize(gamma), [c for block in constraints for c in block])
    try:
        with warnings.catch_warnings():  # inaccuracy is judged afterwards, from the numbers
            warnings.simplefilter("ignore")
            task.solve(solver=name, **options)
        said = str(task.status)
    except cp.error.SolverError as failure:
        said = f"failed: {failure}"
    stats = task.solver_stats
    known = gamma.value is not None and all(Y.value is not None for family in variables.values() for Y in family)
    return _Found(
        unknowns={key: np.stack([0.5 * (Y.value + Y.value.T) for Y in family]) for key, family in variables.items()}
        if known
        else None,
        gamma=float(gamma.value) if known else np.inf,
        multipliers=_multipliers(problem, constraints),
        iterations=int(stats.num_iters) if stats is not None and stats.num_iters is not None else 0,
        said=said,
    )


def _judged(
    operator: LMIOperator, found: _Found, reached: float, solver: str, gap: float, seconds: float
) -> LMISolution:
    assert found.unknowns is not None
    problem = operator.problem
    bound = -np.inf if found.multipliers is None else lower_bound(operator, found.multipliers)
    status, closed = "not solved", np.inf
    if reached < np.inf:
        size = max(abs(reached), 1e-12)
        closed = max(reached - found.gamma, reached - bound if np.isfinite(bound) else 0.0) / size
        proved = reached - bound <= gap * size
        said = found.said == "optimal" and reached - found.gamma <= gap * size
        status = "optimal" if proved or said else "feasible"
    return LMISolution(
        status=status,
        unknowns={key: read_only(Y) for key, Y in found.unknowns.items()},
        gamma=reached,
        gamma_lower=bound,
        gap=closed,
        iterations=found.iterations,
        eigenvalues=problem.smallest_eigenvalues(found.unknowns, reached if reached < np.inf else found.gamma),
        solver=solver,
        message=f"{solver} said: {found.said}, gamma {found.gamma:.9g}",
        seconds=seconds,
    )


def _least_level(operator: LMIOperator, unknowns: dict[str, Array], gamma: float) -> float:
    """The least of some levels above gamma at which all inequalities hold; infinity if none does."""
    for share in RAISES:
        level = gamma + share * max(abs(gamma), 1e-12)
        if holds(operator, operator.vector(unknowns, level)):
            return level
    return np.inf


def _tightened(problem: LMIProblem, unknowns: dict[str, Array], gamma: float) -> LMIProblem:
    """Every inequality asks for more than the solution at hand failed by."""
    errors = rounding(problem, unknowns, gamma)
    blocks = []
    for block, Z, error in zip(problem.blocks, problem.evaluate(unknowns, gamma), errors):
        more = 3.0 * np.maximum(-np.linalg.eigvalsh(Z)[:, 0], 0.0) + 3.0 * error
        blocks.append(replace(block, F0=block.F0 - more[:, None, None] * np.eye(block.size)))
    return replace(problem, blocks=blocks)


def _options(solver: str, time_limit: float | None, began: float) -> dict[str, float]:
    if time_limit is None or solver not in ("clarabel", "scs"):
        return {}
    left = max(time_limit - (time.monotonic() - began), 1e-3)
    return {"time_limit" if solver == "clarabel" else "time_limit_secs": left}


def installed() -> list[str]:
    """Names of the conic solvers at hand."""
    import cvxpy

    cp: Any = cvxpy
    return [key for key, name in CONIC.items() if name in cp.installed_solvers()]


def _inequality(cp: Any, block: Any, k: int, variables: dict[str, list[Any]], gamma: Any) -> Any:
    Z = cp.Constant(block.F0[k])
    if block.Fg is not None:
        Z = Z + gamma * block.Fg[k]
    for term in block.terms:
        family, V = variables[term.unknown], term.V[k]
        if np.any(term.inner[k] != 0.0):
            Z = Z + V @ sum(h * Y for h, Y in zip(term.inner[k], family)) @ V.T
        if term.U is not None:
            half = term.U[k] @ sum(c * Y for c, Y in zip(term.value[k], family)) @ V.T
            Z = Z + half + half.T
    return 0.5 * (Z + Z.T)


def _multipliers(problem: LMIProblem, constraints: list[list[Any]]) -> list[Array] | None:
    """The solver's multipliers, moved into the cone."""
    out = []
    for block, each in zip(problem.blocks, constraints):
        values = [c.dual_value for c in each]
        if any(v is None or not np.all(np.isfinite(v)) for v in values):
            return None
        X = np.stack(values) if values else np.zeros_like(block.F0)
        X = 0.5 * (X + X.swapaxes(1, 2))
        least = np.minimum(np.linalg.eigvalsh(X)[:, 0], 0.0)
        out.append(X - least[:, None, None] * np.eye(block.size))
    return out
