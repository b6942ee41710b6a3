"""The subproblems of the bundle method: steps that minimise the largest of several cuts, linear or quadratic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import scipy.sparse
from numpy.typing import NDArray

from lpvhinf.checks import Array

#: Rounds in which the quadratic cuts are made linear anew.
ROUNDS = 6


@dataclass(slots=True, eq=False)
class Subproblem:
    """Step, multipliers of the soft cuts (they sum to one), predicted decrease, and d^T H_i d / 2 of bent cuts."""

    step: Array
    multipliers: Array
    decrease: float
    bends: Array | None = None


def quadratic_model(
    values: Array, G: Array, hard: NDArray[np.bool_], B: Array, radius: float, centre: Array | None = None
) -> Subproblem | None:
    r"""Minimise :math:`\max_i (f_i + g_i^T d) + d^T B d / 2` over :math:`|d_k + c_k| \le` radius.

    Parameters
    ----------
    values : (m,) the f_i minus their maximum, none positive
    G : (m, n) rows g_i
    hard : (m,) True for rows that are constraints f_i + g_i^T d <= 0 instead
    B : (n, n) positive semidefinite
    radius : float
    centre : (n,), optional
        c, how far the step is off the middle of the box already; zero if left out.
    """
    n = G.shape[1]
    shift = np.zeros(n) if centre is None else centre / radius
    low, high = np.minimum(-1.0 - shift, 0.0), np.maximum(1.0 - shift, 0.0)
    # unit-sized variables d / radius; hard rows to unit size
    size = np.where(hard, np.maximum(np.linalg.norm(G, axis=1) * radius, np.abs(values)), 1.0)
    size = np.where(size > 0.0, size, 1.0)
    P = np.zeros((n + 1, n + 1))
    P[:n, :n] = B * radius**2
    rows = np.hstack([G * (radius / size)[:, None], np.where(hard, 0.0, -1.0)[:, None]])
    solution = _dense_interior_point(P, rows, -values / size, low, high) or _sparse_interior_point(
        P, rows, -values / size, low, high
    )
    if solution is None:
        return None
    x, z = solution
    d = np.clip(x[:n], low, high) * radius
    # a solver's word is not taken: the decrease is computed from the cuts
    decrease = -float(np.max((values + G @ d)[~hard]))
    if not decrease > 0.0:
        return None
    multipliers = np.where(hard, 0.0, np.maximum(z, 0.0))
    return Subproblem(d, multipliers / max(float(np.sum(multipliers)), 1e-300), decrease)


def _dense_interior_point(P: Array, rows: Array, b: Array, low: Array, high: Array) -> tuple[Array, Array] | None:
    """Minimise x^T P x / 2 + t, t the last entry of x, subject to rows x <= b and low <= x <= high but for t.

    Cuts are dense, and there are far more of them than parameters: a solver on the normal equations takes a
    fortieth of the time of one that factorises the sparse KKT system.
    """
    import piqp

    n = P.shape[0] - 1
    solver = piqp.DenseSolver()
    solver.settings.verbose = False
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-10
    cost = np.append(np.zeros(n), 1.0)
    solver.setup(
        np.asfortranarray(P),
        cost,
        None,
        None,
        np.asfortranarray(rows),
        None,
        b,
        np.append(low, -np.inf),
        np.append(high, np.inf),
    )
    if solver.solve() != piqp.PIQP_SOLVED:
        return None
    return _finite(np.asarray(solver.result.x), np.asarray(solver.result.z_u))


def _sparse_interior_point(P: Array, rows: Array, b: Array, low: Array, high: Array) -> tuple[Array, Array] | None:
    """The same problem by a slower solver that copes with worse conditioning."""
    import clarabel

    m, n = rows.shape[0], P.shape[0] - 1
    eye = scipy.sparse.hstack([scipy.sparse.identity(n), scipy.sparse.csc_matrix((n, 1))])
    A = scipy.sparse.vstack([scipy.sparse.csc_matrix(rows), eye, -eye], format="csc")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    cost, right = np.append(np.zeros(n), 1.0), np.concatenate([b, high, -low])
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


def curved_step(
    values: Array, G: Array, H: Array, bent: Sequence[int], hard: NDArray[np.bool_], weights: Array, radius: float
) -> Subproblem | None:
    r"""Decrease :math:`\max_i (f_i + g_i^T d + d^T H_i d / 2)` within :math:`|d_k| \le` radius.

    The quadratics are made linear at the step so far, a round each, with the convexified Hessian of the Lagrangian
    at the multipliers of the round before; that costs no function value. Near a kink the curvature of every
    single function decides how far a step along the kink may go.

    Parameters
    ----------
    values, G, hard
        As in `quadratic_model`.
    H : (k, n, n)
        Hessians of the cuts `bent`; those of the others count as zero.
    bent : (k,) int
    weights : (m,)
        First guess of the multipliers.
    radius : float
    """
    index = np.asarray(bent, dtype=int)
    d, Hd = np.zeros(G.shape[1]), np.zeros((index.size, G.shape[1]))
    now = values.copy()
    height = float(np.max(values[~hard]))
    base = height
    for _ in range(ROUNDS):
        slopes = G.copy()
        slopes[index] += Hd
        active = weights > 1e-6
        chosen = active[index]
        lagrangian = np.tensordot(weights[index][chosen], H[chosen], axes=1)
        B = convex_model(lagrangian, slopes[active], weights[active])
        below = np.minimum(np.where(hard, now, now - height), 0.0)
        found = quadratic_model(below, slopes, hard, B, radius, d)
        if found is None:
            break
        weights = found.multipliers
        Hs = H @ found.step
        rise, bend = slopes @ found.step, np.zeros(values.size)
        bend[index] = 0.5 * (Hs @ found.step)
        t = 1.0
        while t > 1e-3:
            trial = now + t * rise + t**2 * bend
            new = float(np.max(trial[~hard]))
            if new < height - 0.1 * t * found.decrease and np.all(trial[hard] <= 1e-9):
                break
            t *= 0.5
        else:
            break
        gained = height - new
        d, Hd, now, height = d + t * found.step, Hd + t * Hs, trial, new
        if gained < 0.05 * (base - height):
            break
    return Subproblem(d, weights, base - height, 0.5 * (Hd @ d)) if height < base else None
