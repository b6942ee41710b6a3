"""The Lyapunov polynomial of a claim about rates: weight, values at Chebyshev points, degree."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import scipy.linalg

from lpvhinf.certify.global_lyapunov import GlobalLyapunov, pack_symmetric
from lpvhinf.certify.weights import BlendedWeight, blended_weight, lyapunov_values
from lpvhinf.checks import Array
from lpvhinf.polynomial import ChebyshevMatrix, from_nodes, nodes
from lpvhinf.statespace import LPVStateSpace

SIZES = (1, 3, 5, 9, 13, 21, 29, 37, 45, 49, 65)  # Chebyshev points along every axis
MOST_POINTS = 2500
LARGE = 30  # with more states than this, small numbers of points are not worth a try
GOOD_FIT = 0.05  # largest error of the fitted inequality, relative to its weight
ENOUGH = 2.0  # room for so many times the rates ends the search for a weight
#: relative damping of a light mode, decay kept of the other block, positions per axis, width in half boxes
CHOICES = ((0.03, 0.5, 3, 0.4), (0.1, 0.5, 3, 0.4), (0.03, 0.9, 3, 0.4), (0.03, 0.5, 1, 1.0), (1.0, 0.5, 3, 1.0))


def spread(box: Array, count: int, share: float = 0.85) -> Array:
    """A regular grid of `count` positions per axis inside the box, (count^n_p, n_p)."""
    steps = np.linspace(-share, share, count) if count > 1 else np.zeros(1)
    unit = np.array(list(product(steps, repeat=len(box))))
    middle, half = box.mean(axis=1), 0.5 * (box[:, 1] - box[:, 0])
    return np.asarray(middle + unit * half)


def shifted_samples(system: LPVStateSpace, points: Array, decay: float) -> Array:
    """A(p) + decay I at positions (N, n_p)."""
    return np.asarray(system.A.sample(points) + decay * np.eye(system.n_x))


def slopes(system: LPVStateSpace, points: Array) -> Array:
    """(N, n_p, n, n) derivatives of A."""
    return np.stack([system.A.derivative(axis).sample(points) for axis in range(system.n_p)], axis=1)


def speed_room(A: Array, slope: Array, weight: Array, weight_slope: Array, reach: Array) -> float:
    """How many times the rates `reach` (n_p,) the Lyapunov matrix with `weight` allows at one position."""
    n = len(A)
    P = scipy.linalg.solve_continuous_lyapunov(A.T, -weight)
    inverse = scipy.linalg.solve_triangular(np.linalg.cholesky(weight), np.eye(n), lower=True)
    used = 0.0
    for D, W, v in zip(slope, weight_slope, reach):
        dP = scipy.linalg.solve_continuous_lyapunov(A.T, -(D.T @ P + P @ D + W))
        used += v * float(np.max(np.abs(np.linalg.eigvalsh(inverse @ (dP + dP.T) @ inverse.T)))) / 2.0
    return 1.0 / max(used, 1e-300)


def choose_weight(system: LPVStateSpace, box: Array, decay: float, reach: Array) -> tuple[BlendedWeight, float] | None:
    """The weight with the most room for rates at positions spread over the box, and that room."""
    best: tuple[BlendedWeight, float] | None = None
    half = 0.5 * (box[:, 1] - box[:, 0])
    test = np.concatenate([spread(box, 3, 1.0), spread(box, 2, 0.5)])
    tested, tested_slopes = shifted_samples(system, test, decay), slopes(system, test)
    for light, room, count, width in CHOICES:
        where = spread(box, count, 1.0)
        W = blended_weight(
            where, shifted_samples(system, where, decay), slopes(system, where), width * half, light, room
        )
        if W is None:
            continue
        try:
            most = min(speed_room(A, D, W.at(p), W.slopes(p), reach) for p, A, D in zip(test, tested, tested_slopes))
        except np.linalg.LinAlgError:
            continue
        if best is None or most > best[1]:
            best = (W, most)
        if most > ENOUGH:
            break
    return best


def fitted(
    box: Array,
    values: Callable[[Array], Array | None],
    inequality: Callable[[Array, Array], Array],
    first: int = 21,
    good: float = GOOD_FIT,
) -> GlobalLyapunov | None:
    """The Lyapunov matrices `values`(points) as a polynomial of the least degree whose inequality is close enough.

    Parameters
    ----------
    inequality : (points, P) -> N (N_points, m, m), the matrix that is to be positive definite
    first : number of points per axis to begin with where there are many states
    good : largest deviation of N, relative to itself
    """
    n_p = len(box)
    rng = np.random.default_rng(0)
    test = box[:, 0] + rng.uniform(size=(10, n_p)) * (box[:, 1] - box[:, 0])
    test[: 2**n_p] = np.array(list(product(*box.tolist())))[:10]
    wanted = values(test)
    if wanted is None:
        return None
    goal = inequality(test, wanted)
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(0.5 * (goal + np.swapaxes(goal, 1, 2))))
    except np.linalg.LinAlgError:
        return None
    best = None
    for size in SIZES:
        if size**n_p > MOST_POINTS:
            break
        if size < first <= MOST_POINTS ** (1.0 / n_p) and wanted.shape[-1] > LARGE:
            continue
        P = values(nodes((size,) * n_p, box))
        if P is None:
            return None
        S = np.linalg.cholesky(P.mean(axis=0)).T
        T = np.linalg.inv(S)
        X = from_nodes((T.T @ P @ T).reshape(*(size,) * n_p, *S.shape), n_p)
        best = GlobalLyapunov(S=S, X=pack_symmetric(X).astype(np.float32))
        fit = S.T @ ChebyshevMatrix(X, box).sample(test) @ S
        error = inverse @ (inequality(test, fit) - goal) @ np.swapaxes(inverse, 1, 2)
        if float(np.max(np.abs(np.linalg.eigvalsh(error + np.swapaxes(error, 1, 2))))) / 2.0 <= good:
            break
    return best


def decrease(system: LPVStateSpace, decay: float, points: Array, P: Array) -> Array:
    """-(A'P + PA) - 2 decay P at positions."""
    A = shifted_samples(system, points, decay)
    return np.asarray(-(np.swapaxes(A, 1, 2) @ P + P @ A))


def weighted_values(system: LPVStateSpace, decay: float, weight: BlendedWeight, points: Array) -> Array | None:
    """Solutions of the Lyapunov equations at positions (N, n_p)."""
    return lyapunov_values(shifted_samples(system, points, decay), np.array([weight.at(p) for p in points]))


def rate_candidate(
    system: LPVStateSpace, box: Array, decay: float, reach: Array
) -> tuple[GlobalLyapunov, float] | None:
    """P(p) for rates up to `reach` (n_p,), and the room it has at the positions looked at; None without one."""
    chosen = choose_weight(system, box, decay, reach)
    if chosen is None:
        return None
    weight, room = chosen
    lyapunov = fitted(
        box,
        lambda points: weighted_values(system, decay, weight, points),
        lambda points, P: decrease(system, decay, points, P),
    )
    return None if lyapunov is None else (lyapunov, room)
