"""Design positions, and the search for the worst position over the continuum P."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from lpvhinf.checks import Array
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.fitting import spread_points
from lpvhinf.hinfstruct import hinf_norm

UNSTABLE = 1e9  # what the simplex search gets for an infinite norm


def design_positions(box: Array, n: int, *, seed: int = 0) -> Array:
    """`n` positions: the corners, and an even spread whose spacing has nothing in common with a magnet pitch.

    A regular grid at the pitch of the magnets samples every ripple at the same phase and hides it.
    """
    corners = np.array(list(itertools.product(*box)))
    rest = max(0, n - len(corners))
    return np.vstack([corners[:n], spread_points(box, rest, seed)]) if rest else corners[:n]


@dataclass(frozen=True, kw_only=True, eq=False)
class WorstPosition:
    """The largest exact norm found over P.

    Attributes
    ----------
    gamma : float
    position : (n_p,)
    candidates : (k, n_p)
        The worst positions that lie apart from each other, worst first.
    gammas : (k,)
    n_evaluated : int
    """

    gamma: float
    position: Array
    candidates: Array
    gammas: Array
    n_evaluated: int


def norms_at(assembly: Assembly, theta: Array, points: Array) -> Array:
    """Exact norms of M with the plant model itself at positions (N, n_p); infinity where the loop is unstable."""
    gain = assembly.structure.realize(theta)
    return np.array([hinf_norm(*plant.close(*gain)).norm for plant in assembly.generalized_plants(points)])


def worst_position(
    assembly: Assembly, theta: Array, *, n_search: int = 128, n_refine: int = 3, seed: int = 1
) -> WorstPosition:
    """Search P for the largest norm: an even spread, then a simplex search from the worst that lie apart.

    The value is a lower bound on the supremum over P, not a certificate.
    """
    box = assembly.plant.box
    width = box[:, 1] - box[:, 0]
    points = spread_points(box, n_search, seed)
    gammas = norms_at(assembly, theta, points)
    apart: list[int] = []
    for i in np.argsort(-gammas):
        if all(np.max(np.abs(points[i] - points[j]) / width) > 0.1 for j in apart):
            apart.append(int(i))
        if len(apart) == n_refine:
            break
    found_at, found, count = [], [], n_search
    for i in apart:
        if not np.isfinite(gammas[i]):
            found_at.append(points[i])
            found.append(float(gammas[i]))
            continue
        step = 0.03 * width * np.where(points[i] > np.mean(box, axis=1), -1.0, 1.0)
        simplex = np.vstack([points[i], points[i] + np.diag(step)])
        search = scipy.optimize.minimize(
            lambda p: -min(float(norms_at(assembly, theta, np.clip(p, box[:, 0], box[:, 1])[None])[0]), UNSTABLE),
            points[i],
            method="Nelder-Mead",
            bounds=box,
            options={"initial_simplex": simplex, "maxfev": 30, "xatol": 1e-4 * float(np.min(width)), "fatol": 1e-4},
        )
        count += int(search.nfev)
        reached = np.inf if -search.fun >= UNSTABLE else -float(search.fun)
        better = reached > gammas[i]
        found_at.append(np.clip(search.x, box[:, 0], box[:, 1]) if better else points[i])
        found.append(reached if better else float(gammas[i]))
    order = np.argsort(-np.array(found))
    candidates, values = np.array(found_at)[order], np.array(found)[order]
    return WorstPosition(
        gamma=float(values[0]), position=candidates[0], candidates=candidates, gammas=values, n_evaluated=count
    )
