"""Trust-region bundle / SQP: minimise the largest of several cuts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import scipy.sparse
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.oracle import Budget, Cut, Oracle, Point
from lpvhinf.hinfstruct.quasi_newton import Descent


@dataclass(slots=True, eq=False)
class Subproblem:
    """Step, multipliers of the soft cuts (they sum to one) and predicted decrease."""

    step: Array
    multipliers: Array
    decrease: float


def quadratic_model(values: Array, G: Array, hard: NDArray[np.bool_], B: Array, radius: float) -> Subproblem | None:
    r"""Minimise :math:`\max_i (f_i + g_i^T d) + d^T B d / 2` over :math:`|d_k| \le` radius.

    Parameters
    ----------
    values : (m,) the f_i minus their maximum, none positive
    G : (m, n) rows g_i
    hard : (m,) True for rows that are constraints f_i + g_i^T d <= 0 instead
    B : (n, n) positive semidefinite
    radius : float
    """
    n = G.shape[1]
    # unit-sized variables d / radius; hard rows to unit size
    size = np.where(hard, np.maximum(np.linalg.norm(G, axis=1) * radius, np.abs(values)), 1.0)
    size = np.where(size > 0.0, size, 1.0)
    P = np.zeros((n + 1, n + 1))
    P[:n, :n] = B * radius**2
    rows = np.hstack([G * (radius / size)[:, None], np.where(hard, 0.0, -1.0)[:, None]])
    solution = _dense_interior_point(P, rows, -values / size) or _sparse_interior_point(P, rows, -values / size)
    if solution is None:
        return None
    x, z = solution
    d = np.clip(x[:n], -1.0, 1.0) * radius
    # a solver's word is not taken: the decrease is computed from the cuts
    decrease = -float(np.max((values + G @ d)[~hard]))
    if not decrease > 0.0:
        return None
    multipliers = np.where(hard, 0.0, np.maximum(z, 0.0))
    return Subproblem(d, multipliers / max(float(np.sum(multipliers)), 1e-300), decrease)


def _dense_interior_point(P: Array, rows: Array, b: Array) -> tuple[Array, Array] | None:
    """Minimise x^T P x / 2 + t, t the last entry of x, subject to rows x <= b and |x_k| <= 1 but for t.

    Cuts are dense, and there are far more of them than parameters: a solver on the normal equations takes a
    fortieth of the time of one that factorises the sparse KKT system.
    """
    import piqp

    n = P.shape[0] - 1
    bound = np.append(np.ones(n), np.inf)
    solver = piqp.DenseSolver()
    solver.settings.verbose = False
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-10
    cost = np.append(np.zeros(n), 1.0)
    solver.setup(np.asfortranarray(P), cost, None, None, np.asfortranarray(rows), None, b, -bound, bound)
    if solver.solve() != piqp.PIQP_SOLVED:
        return None
    return _finite(np.asarray(solver.result.x), np.asarray(solver.result.z_u))


def _sparse_interior_point(P: Array, rows: Array, b: Array) -> tuple[Array, Array] | None:
    """The same problem by a slower solver that copes with worse conditioning."""
    import clarabel

    m, n = rows.shape[0], P.shape[0] - 1
    eye = scipy.sparse.hstack([scipy.sparse.identity(n), scipy.sparse.csc_matrix((n, 1))])
    A = scipy.sparse.vstack([scipy.sparse.csc_matrix(rows), eye, -eye], format="csc")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    cost, right = np.append(np.zeros(n), 1.0), np.concatenate([b, np.ones(2 * n)])
    cones = [clarabel.NonnegativeConeT(m + 2 * n)]
    solution = clarabel.DefaultSolver(scipy.sparse.csc_matrix(np.triu(P)), cost, A, right, cones, settings).solve()
    return _finite(np.asarray(solution.x), np.asarray(solution.z)[:m])


def _finite(x: Array, z: Array) -> tuple[Array, Array] | None:
    return (x, z) if x.size and np.all(np.isfinite(x)) and np.all(np.isfinite(z)) else None


def shortest_combination(G: Array) -> tuple[float, Array]:
    r"""Length and weights of the shortest convex combination of the rows of G, by nonnegative least squares."""
    size = max(float(np.max(np.linalg.norm(G, axis=1))), 1e-300)
    # min |[G^T; 1] mu - [0; 1]| over mu >= 0 is solved by a multiple of the shortest combination
    lhs = np.vstack([G.T / size, np.ones(G.shape[0])])
    rhs = np.zeros(lhs.shape[0])
    rhs[-1] = 1.0
    try:
        mu, _ = scipy.optimize.nnls(lhs, rhs, maxiter=30 * G.shape[0])
    except RuntimeError:
        mu = np.zeros(G.shape[0])
    if not np.sum(mu) > 0.0:
        mu = (np.arange(G.shape[0]) == np.argmin(np.linalg.norm(G, axis=1))).astype(float)
    mu = mu / np.sum(mu)
    return float(np.linalg.norm(G.T @ mu)), np.asarray(mu)


def convex_model(H: Array, G: Array, weights: Array) -> Array:
    """A positive semidefinite stand-in for the Hessian of the Lagrangian.

    Curvature across the kink (along differences of active gradients) does not matter
    to the step, as the cuts decide there: it is raised first. What is negative still is turned round.
    """
    centred = (G - weights @ G) * np.sqrt(weights)[:, None]
    across = centred.T @ centred
    size = float(np.linalg.norm(across, 2)) if G.size else 0.0
    if size > 0.0:
        H = H + across * (2.0 * float(np.linalg.norm(H, 2)) / size)
    eigenvalues, vectors = np.linalg.eigh(0.5 * (H + H.T))
    floor = 1e-9 * max(float(np.max(np.abs(eigenvalues), initial=0.0)), 1e-12)
    return np.asarray((vectors * np.maximum(np.abs(eigenvalues), floor)) @ vectors.T)


def bundle(
    oracle: Oracle,
    start: Point,
    budget: Budget,
    *,
    max_iterations: int = 150,
    tolerance: float = 1e-7,
    target: float = -np.inf,
    accepted: Callable[[Point], None] | None = None,
) -> Descent:
    r"""Polish a minimiser of a maximum of smooth functions.

    Each step minimises the largest of the linearised cuts plus :math:`d^T B d / 2` over a
    trust region, with B the convexified Hessian of the Lagrangian at the multipliers
    of the last model: Newton's method along the kink. After a failed step the
    functions that decided there join the cuts. The optimality measure is the length of
    the shortest convex combination of the gradients of the cuts within 1e-4 of the maximum.

    References
    ----------
    Apkarian and Noll (2006), IEEE Transactions on Automatic Control 51, 71-86;
    Apkarian, Noll and Prot (2008), SIAM Journal on Optimization 19, 281-306.
    """
    point = start
    n = point.theta.size
    radius = 0.1 * max(1.0, float(np.linalg.norm(point.theta, np.inf)))
    B: Array | None = None
    missed: list[Point] = []
    slow = 0
    for iteration in range(max_iterations):
        cuts = oracle.cuts(point, missed)
        G = np.array([cut.gradient for cut in cuts])
        hard = np.array([cut.hard for cut in cuts])
        values = np.array([cut.value for cut in cuts]) - np.where(hard, 0.0, point.value)
        values = np.minimum(values, 0.0)
        active = np.flatnonzero(~hard & (values >= -1e-4))
        optimality, weights = shortest_combination(G[active])
        if point.value < target:
            return Descent(point, "target reached", iteration, optimality)
        if budget.spent:
            return Descent(point, "time limit", iteration, optimality)
        if B is None:
            B = _lagrangian(oracle, point, cuts, active, weights, G)
            if B is None:
                B = np.eye(n) * float(np.max(np.linalg.norm(G[~hard], axis=1))) / max(radius * np.sqrt(n), 1e-12)
        model = quadratic_model(values, G, hard, B, radius)
        if model is None or model.decrease <= 1e-2 * tolerance:
            return Descent(point, "no predicted decrease", iteration, optimality)
        trial = oracle.evaluate(point.theta + model.step, point.value - 0.01 * model.decrease)
        if trial.value <= point.value - 0.01 * model.decrease:
            trial = oracle.confirm(trial)
        ratio = (point.value - trial.value) / model.decrease
        size = float(np.max(np.abs(model.step)))
        if ratio >= 0.01:
            slow = slow + 1 if point.value - trial.value < tolerance else 0
            point, missed, B = trial, [], None
            if accepted is not None:
                accepted(point)
            if ratio > 0.7 and size > 0.8 * radius:
                radius *= 2.5
            elif ratio < 0.2:
                radius *= 0.5
            if slow >= 5:
                return Descent(point, "converged", iteration + 1, optimality)
        else:
            missed = [*missed, trial][-4:]
            radius = 0.3 * size
            if radius < 1e-10 * max(1.0, float(np.linalg.norm(point.theta, np.inf))):
                return Descent(point, "trust region vanished", iteration, optimality)
    return Descent(point, "iteration limit", max_iterations, optimality)


def _lagrangian(
    oracle: Oracle, point: Point, cuts: list[Cut], active: NDArray[np.intp], weights: Array, G: Array
) -> Array | None:
    chosen = [(float(w), int(k)) for w, k in zip(weights, active, strict=True) if w > 1e-6]
    H = oracle.hessian(point, [w for w, _ in chosen], [cuts[k] for _, k in chosen])
    if H is None or not np.all(np.isfinite(H)):
        return None
    return convex_model(H, G[[k for _, k in chosen]], np.array([w for w, _ in chosen]))
