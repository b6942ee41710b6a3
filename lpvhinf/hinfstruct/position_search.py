"""The worst position over a box: a spread of tracked-peak norms, then climbs along the gradient to the position."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import scipy.spatial
from numpy.typing import ArrayLike, NDArray

from lpvhinf.checks import Array, finite_array, points_in_box, read_only, whole_number
from lpvhinf.fitting import spread_points
from lpvhinf.hinfstruct.loop import LoopFactory
from lpvhinf.hinfstruct.norm import exact_norm
from lpvhinf.hinfstruct.peaks import find_peaks
from lpvhinf.hinfstruct.plant_families import PlantFamily, as_family
from lpvhinf.hinfstruct.position_gradient import gain_at, gain_slopes, position_gradient
from lpvhinf.hinfstruct.response import Response
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

#: Positions closer than this fraction of the box (on every axis) do not both start a climb.
APART = 0.1
#: Ends of climbs closer than this fraction are one maximum.
SAME = 0.02
#: Length of a climb's first step, as a fraction of the box: a longer one would leave the hill it starts on.
FIRST_STEP = 0.05
#: Boxes of up to so many coordinates have their corners looked at too.
MOST_CORNERED = 4
#: A position is compared with so many neighbours for every coordinate of the box.
NEIGHBOURS = 3
#: Frozen plants held at a time.
BATCH = 64
#: A climb that an exact norm proves wrong is repeated with the missed frequency so many times.
REPEATS = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class WorstOverBox:
    """The largest norm found over a box: a lower bound on the supremum, not a certificate.

    Attributes
    ----------
    gamma : float
        Exact norm; infinite if an unstable position was found.
    position : (n_p,)
    candidates : (k, n_p)
        Maxima that lie apart from each other, worst first.
    gammas : (k,)
        Exact norms there.
    n_exact, n_cheap, n_slopes, n_plants : int
        Exact norms, norms by tracked peaks (those of the climbs included), gradients, and plants asked for.
    """

    gamma: float
    position: Array
    candidates: Array
    gammas: Array
    n_exact: int
    n_cheap: int
    n_slopes: int
    n_plants: int


class _UnstableError(Exception):
    """A climb met a position whose loop is not stable."""

    def __init__(self, p: Array) -> None:
        super().__init__()
        self.p = p


class BoxNorms:
    """Norms of the closed loop with one controller at any position, counted.

    Parameters
    ----------
    family : PlantFamily
    structure : ControllerStructure
        Gets the position as `p`.
    theta : (n_parameters,)
    """

    def __init__(self, family: PlantFamily, structure: ControllerStructure, theta: Array) -> None:
        self.family, self.structure, self.theta = family, structure, theta
        self.n_exact = self.n_cheap = self.n_slopes = self.n_plants = 0
        self._missed = np.zeros(0)

    def _sampled(self, points: Array) -> Iterator[tuple[Array, GeneralizedPlant]]:
        for start in range(0, len(points), BATCH):
            some = points[start : start + BATCH]
            self.n_plants += len(some)
            yield from zip(some, self.family.sample(some), strict=True)

    def cheap(self, points: Array) -> tuple[Array, Array]:
        """Norms by tracked peaks and spectral abscissas at positions (N, n_p); infinite norms where not stable."""
        norms, abscissas = np.empty(len(points)), np.empty(len(points))
        for k, (p, plant) in enumerate(self._sampled(points)):
            norms[k], _, abscissas[k] = self._peak(plant, gain_at(self.structure, self.theta, p))
        return norms, abscissas

    def _peak(self, plant: GeneralizedPlant, K: Array) -> tuple[float, float, float]:
        """Norm, peak frequency and abscissa by tracked peaks."""
        self.n_cheap += 1
        loop = LoopFactory(plant, K.shape[0] - plant.n_u).close(K)
        if loop is None:
            return np.inf, np.nan, np.inf
        response = Response(loop.A, loop.B, loop.C, loop.D)
        if response.abscissa >= 0.0:
            return np.inf, np.nan, response.abscissa
        peaks = find_peaks(response, extra=self._missed, fraction=0.98)
        return float(peaks.sigma[0]), float(peaks.omega[0]), response.abscissa

    def slope(self, p: Array) -> tuple[float, Array]:
        """Norm by tracked peaks at p and its derivative to the position, (n_p,)."""
        plant, slopes = self.family.slopes(p)
        self.n_plants += self.family.plants_per_slope
        K = gain_at(self.structure, self.theta, p)
        norm, omega, _ = self._peak(plant, K)
        if not np.isfinite(norm):
            return np.inf, np.zeros(len(p))
        self.n_slopes += 1
        K_slopes = gain_slopes(self.structure, self.theta, p, self.family.box)
        return norm, position_gradient(plant, slopes, K, K_slopes, omega)[1]

    def exact(self, points: Array) -> tuple[Array, Array]:
        """Exact norms and their frequencies at positions (N, n_p)."""
        norms, omegas = np.empty(len(points)), np.empty(len(points))
        for k, (p, plant) in enumerate(self._sampled(points)):
            self.n_exact += 1
            K = gain_at(self.structure, self.theta, p)
            loop = LoopFactory(plant, K.shape[0] - plant.n_u).close(K)
            if loop is None:
                norms[k], omegas[k] = np.inf, np.nan
                continue
            found = exact_norm(loop.A, loop.B, loop.C, loop.D, hints=self._missed)
            norms[k], omegas[k] = found.norm, found.omega
        return norms, omegas

    def climb(self, start: Array) -> tuple[Array, float]:
        """Ascend from a position to a local maximum in the box; returns it and its exact norm."""
        box, p = self.family.box, start
        low, width = box[:, 0], (box[:, 1] - box[:, 0]) * FIRST_STEP

        def fall(y: Array) -> tuple[float, Array]:
            here = np.clip(low + y * width, box[:, 0], box[:, 1])
            norm, gradient = self.slope(here)
            if not np.isfinite(norm):
                raise _UnstableError(here)
            size = max(norm, 1e-150)
            return -float(np.log(size)), -gradient * width / size

        best, value = start, -np.inf
        for _ in range(REPEATS + 1):
            try:
                run = scipy.optimize.minimize(
                    fall,
                    (p - low) / width,
                    jac=True,
                    method="L-BFGS-B",
                    bounds=[(0.0, 1.0 / FIRST_STEP)] * len(box),
                    options={"maxiter": 30, "maxfun": 40, "ftol": 1e-8, "gtol": 1e-6},
                )
            except _UnstableError as found:
                return found.p, np.inf
            p = np.clip(low + run.x * width, box[:, 0], box[:, 1])
            norms, omegas = self.exact(p[None])
            if norms[0] > value:
                best, value = p, float(norms[0])
            seen = float(np.exp(-run.fun))
            if not norms[0] > (1.0 + 1e-6) * seen or not np.isfinite(omegas[0]):
                break
            self._missed = np.append(self._missed, omegas[0])[-8:]
        return best, value


def worst_over_box(
    plants: LPVGeneralizedPlant | PlantFamily,
    structure: ControllerStructure,
    theta: ArrayLike,
    *,
    n_search: int = 128,
    n_refine: int = 5,
    seed: int = 1,
    known: ArrayLike | None = None,
) -> WorstOverBox:
    r"""Search a box for the position with the largest norm of the closed loop.

    .. math:: \sup_{p \in P} \| F_l(P(p), K(\theta, p)) \|_\infty

    A spread of positions, the corners, the centre and the positions `known` are looked at by tracked peaks. From
    the worst of them that lie apart, bounded quasi-Newton climbs (L-BFGS-B) follow the derivative of the norm to
    the position; where each ends, the exact norm counts. A peak that only the exact norm saw joins the tracked
    ones, and the climb is repeated.

    Parameters
    ----------
    plants : LPVGeneralizedPlant or a family such as FrozenFamily
    structure : ControllerStructure
    theta : (n_parameters,)
    n_search : int
        Positions of the spread. A peak that is narrower than their spacing may be missed.
    n_refine : int
        Climbs.
    seed : int
        Of the spread.
    known : (N, n_p), optional
        Positions to look at besides, such as worst ones of earlier parameters.

    Returns
    -------
    WorstOverBox

    Raises
    ------
    DimensionError, DomainError
        If theta or a known position does not fit, or a number is below one.

    Examples
    --------
    A first-order loop x' = -(1 + (p - 0.3)^2) x + w, z = x: the norm is 1 / (1 + (p - 0.3)^2).

    >>> from lpvhinf.hinfstruct import StaticGain
    >>> from lpvhinf.hinfstruct.plant_families import FrozenFamily
    >>> def frozen(points):
    ...     return [GeneralizedPlant([[-1.0 - (p[0] - 0.3) ** 2]], [[1.0]], [[0.0]], [[1.0]], [[0.0]],
    ...                              [[0.0]], [[0.0]], [[0.0]]) for p in points]
    >>> worst = worst_over_box(FrozenFamily(frozen, [[-1.0, 1.0]]), StaticGain(1, 1), [0.0], n_search=8)
    >>> round(worst.gamma, 6), round(float(worst.position[0]), 3)
    (1.0, 0.3)
    """
    family = as_family(plants)
    x = finite_array("theta", theta, (structure.n_parameters,))
    whole_number("n_search", n_search, 1)
    whole_number("n_refine", n_refine, 1)
    box = family.box
    points = [spread_points(box, n_search, seed), np.mean(box, axis=1)[None]]
    if len(box) <= MOST_CORNERED:
        points.append(np.array(list(itertools.product(*box))))
    if known is not None and np.size(known):
        points.append(points_in_box(known, box, name="known"))
    where = np.vstack(points)
    norms = BoxNorms(family, structure, x)
    values, abscissas = norms.cheap(where)
    # of unstable positions the one furthest from stability comes first
    order = np.lexsort((-np.where(np.isfinite(values), 0.0, abscissas), -values))
    order = np.concatenate(_hills_first(where, order, box))
    ends = [
        (where[i], np.inf) if not np.isfinite(values[i]) else norms.climb(where[i])
        for i in _apart(where, order, box, APART)[:n_refine]
    ]
    candidates, gammas = np.array([p for p, _ in ends]), np.array([gamma for _, gamma in ends])
    keep = _apart(candidates, np.argsort(-gammas, kind="stable"), box, SAME)
    candidates, gammas = read_only(candidates[keep]), read_only(gammas[keep])
    return WorstOverBox(
        gamma=float(gammas[0]),
        position=candidates[0],
        candidates=candidates,
        gammas=gammas,
        n_exact=norms.n_exact,
        n_cheap=norms.n_cheap,
        n_slopes=norms.n_slopes,
        n_plants=norms.n_plants,
    )


def _hills_first(points: Array, order: NDArray[np.intp], box: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The order, split: first the positions that are worse than their neighbours, then the others.

    Else all climbs would start on one broad hill, and none on a narrow one whose foot alone was seen.
    """
    rank = np.empty(len(order))
    rank[order] = np.arange(len(order))
    unit = (points - box[:, 0]) / (box[:, 1] - box[:, 0])
    _, near = scipy.spatial.cKDTree(unit).query(unit, k=min(NEIGHBOURS * len(box), len(points)))
    top = rank <= np.min(rank[np.reshape(near, (len(points), -1))], axis=1)
    return order[top[order]], order[~top[order]]


def _apart(points: Array, order: Iterable[int], box: Array, fraction: float) -> list[int]:
    """Indices in their order, without those that lie near an earlier one."""
    width = box[:, 1] - box[:, 0]
    out: list[int] = []
    for i in order:
        if all(np.max(np.abs(points[i] - points[j]) / width) > fraction for j in out):
            out.append(int(i))
    return out
