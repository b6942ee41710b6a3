"""The largest values of many functions of the position at once, by a spread of samples and a pattern search."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.fitting import spread_points

FIRST_STEP = 0.06  # of the box
LAST_STEP = 1e-3
APART = 0.15  # starts of one function differ at least so much, as a fraction of the box


def largest_over_box(
    functions: Callable[[Array], Array], box: Array, *, n_search: int = 256, n_starts: int = 3, seed: int = 0
) -> tuple[Array, Array]:
    """Maxima of n functions over a box; lower bounds on their suprema, not certificates.

    From the best of `n_search` spread positions (the corners among them) every function climbs by its own pattern
    search: to the best of its neighbours along the axes, or to steps of half the length. All climb in step, so that
    the functions are evaluated at many positions at a time.

    Parameters
    ----------
    functions : (N, n_p) -> (N, n)
    box : (n_p, 2)
    n_search, n_starts, seed : int
        Positions of the spread, and climbs of every function.

    Returns
    -------
    values (n,), positions (n, n_p)

    Examples
    --------
    >>> value, place = largest_over_box(lambda p: -((p - 0.3) ** 2), np.array([[0.0, 1.0]]), n_search=8)
    >>> bool(abs(place[0, 0] - 0.3) < 1e-3)
    True
    """
    low, width = box[:, 0], box[:, 1] - box[:, 0]
    n_p = len(box)
    corners = np.stack([x.ravel() for x in np.meshgrid(*box, indexing="ij")], axis=-1)
    points = np.vstack([corners, spread_points(box, max(n_search - len(corners), 1), seed)])
    samples = functions(points)
    n = samples.shape[1]
    owners, starts = [], []
    for k in range(n):
        chosen: list[int] = []
        for i in np.argsort(-samples[:, k], kind="stable"):
            if all(np.max(np.abs(points[i] - points[j]) / width) > APART for j in chosen):
                chosen.append(int(i))
            if len(chosen) == n_starts:
                break
        owners += [k] * len(chosen)
        starts += chosen
    owner, at, best = np.array(owners), points[starts], samples[starts, owners]
    step = np.full(len(owner), FIRST_STEP)
    pattern = np.vstack([np.eye(n_p), -np.eye(n_p)])
    while np.any(active := step >= LAST_STEP):
        moving = np.flatnonzero(active)
        tries = at[moving, None] + step[moving, None, None] * pattern * width
        tries = np.clip(tries, low, low + width)
        found = functions(tries.reshape(-1, n_p)).reshape(len(moving), len(pattern), n)
        own = found[np.arange(len(moving)), :, owner[moving]]
        j = np.argmax(own, axis=1)
        value = own[np.arange(len(moving)), j]
        # round-off is no hill: a function that is zero would be climbed for ever
        better = value > best[moving] + 1e-9 * np.abs(best[moving])
        at[moving[better]], best[moving[better]] = tries[np.flatnonzero(better), j[better]], value[better]
        step[moving[~better]] /= 2.0
    values, places = np.empty(n), np.empty((n, n_p))
    for k in range(n):
        i = np.flatnonzero(owner == k)
        top = i[np.argmax(best[i])]
        values[k], places[k] = best[top], at[top]
    return values, places
