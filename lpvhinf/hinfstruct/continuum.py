"""Structured synthesis over a box of positions: an active set of models, and exchange with the worst position."""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, points_in_box, positive, read_only, whole_number
from lpvhinf.errors import SynthesisError
from lpvhinf.fitting import spread_points
from lpvhinf.hinfstruct.plant_families import PlantFamily, as_family
from lpvhinf.hinfstruct.position_search import BoxNorms, WorstOverBox, worst_over_box
from lpvhinf.hinfstruct.result import Evaluations, HinfstructResult
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

#: A position whose norm stays below this fraction of the largest one is of no use to the active set,
IDLE = 0.8
#: after so many rounds in a row; rounds that end above this multiple of the best one do not count.
PATIENCE, USUAL = 2, 1.5
#: A round that is so many tolerances from its active set is gone on with alone, until rounds do not improve on it.
CLOSE, STALLS = 3.0, 2
#: Positions that one search may add, and those that it looks at, at least.
MOST_ADDED, LEAST_SEARCH = 3, 16


class Solve(Protocol):
    """A structured synthesis for several plants at known positions."""

    def __call__(
        self, plants: Sequence[GeneralizedPlant], points: Array, initial: Sequence[Array] | None
    ) -> HinfstructResult:
        """Solve from `initial`, or from the solver's own starts where it is None."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Round:
    """One round of the exchange.

    Attributes
    ----------
    positions : (N, n_p)
        The active set.
    result : HinfstructResult
        Of the synthesis on the active set.
    worst : WorstOverBox
        What the search over the box then found.
    """

    positions: Array
    result: HinfstructResult
    worst: WorstOverBox


@dataclass(frozen=True, kw_only=True, eq=False)
class ContinuumResult:
    """A structured controller for all positions of a box.

    Attributes
    ----------
    result : HinfstructResult
        `gamma` and `gammas` over the active set; `gamma_worst` and `worst_position` over the box, as far as the
        search found them.
    positions : (N, n_p)
        The active set that the controller was tuned on.
    converged : bool
        No position was found to be worse than the active set by the tolerance.
    rounds : tuple of Round
    n_exact, n_cheap, n_plants : int
        Of the searches: exact norms, norms by tracked peaks, and plants asked for.
    """

    result: HinfstructResult
    positions: Array
    converged: bool
    rounds: tuple[Round, ...]
    n_exact: int
    n_cheap: int
    n_plants: int

    @property
    def evaluations(self) -> Evaluations:
        """Of all rounds of synthesis, and the exact norms of the searches, which any other solver needs as well."""
        searches = Evaluations(trials=0, exact=self.n_exact, every_model=self.n_exact)
        return sum((r.result.evaluations for r in self.rounds), searches)


class ActiveSet:
    """Positions that the synthesis sees; those of no use leave, once: one that comes back stays.

    Parameters
    ----------
    points : (N, n_p)
    box : (n_p, 2)
    limit : int
        Most positions.
    """

    def __init__(self, points: Array, box: Array, limit: int) -> None:
        self.points, self.limit = np.array(points), limit
        self._width = box[:, 1] - box[:, 0]
        self._idle = np.zeros(len(points), dtype=int)
        self._kept = np.zeros(len(points), dtype=bool)
        self._least = np.inf
        self._dropped = np.zeros((0, points.shape[1]))

    def exchange(self, gammas: Array, new: Array) -> None:
        """Drop what stayed below the largest norm for rounds, or what is lowest if it gets too many; add `new`.

        Parameters
        ----------
        gammas : (N,)
            Norms at the positions of the set.
        new : (k, n_p)
            Worse positions, worst first.
        """
        new = new[: self.limit]
        level = float(np.max(gammas))
        self._least = min(self._least, level)
        if level <= USUAL * self._least:  # else one bad position tells nothing about the others
            self._idle = np.where(gammas < IDLE * level, self._idle + 1, 0)
        leave = (self._idle >= PATIENCE) & ~self._kept
        spare = len(self.points) - int(np.sum(leave)) + len(new) - self.limit
        if spare > 0:
            lowest = [i for i in np.argsort(gammas, kind="stable") if not leave[i]]
            leave[lowest[:spare]] = True
        self._dropped = np.vstack([self._dropped, self.points[leave]])
        back = [
            bool(np.any(np.all(np.abs(self._dropped - p) <= 0.05 * self._width, axis=1)))
            if len(self._dropped)
            else False
            for p in new
        ]
        stay = ~leave
        self.points = np.vstack([self.points[stay], new])
        self._idle = np.concatenate([self._idle[stay], np.zeros(len(new), dtype=int)])
        self._kept = np.concatenate([self._kept[stay], np.array(back, dtype=bool)])


def first_positions(box: Array, n: int, seed: int = 0) -> Array:
    """`n` positions (n, n_p): the centre, the corners where they are few, and an even spread."""
    centre = np.mean(box, axis=1)[None]
    corners = np.array(list(itertools.product(*box))) if 2 ** len(box) < n else np.zeros((0, len(box)))
    rest = n - 1 - len(corners)
    return np.vstack([centre, corners, *([spread_points(box, rest, seed)] if rest > 0 else [])])


def hinfstruct_over_box(
    plants: LPVGeneralizedPlant | PlantFamily,
    controller: ControllerStructure,
    solve: Solve,
    *,
    positions: ArrayLike | None = None,
    n_positions: int = 6,
    max_active: int = 15,
    max_rounds: int = 10,
    tolerance: float = 0.01,
    gain: float | None = None,
    n_search: int = 128,
    n_refine: int = 5,
    seed: int = 0,
    initial: Sequence[Array] | None = None,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> ContinuumResult:
    r"""Tune a structured controller for the largest norm over a box of positions.

    .. math:: \min_\theta \sup_{p \in P} \| F_l(P(p), K(\theta, p)) \|_\infty

    An outer loop solves on a few active positions, searches the box for worse ones, adds them, and goes on from
    where it was, until none is worse by `tolerance`. Positions that do not matter for some rounds leave the set.
    The value over the set is an inner bound, the worst value that the search found another one: neither is a
    certificate for the box.

    Parameters
    ----------
    plants : LPVGeneralizedPlant or a family such as FrozenFamily
    controller : ControllerStructure
    solve : callable (plants, points, initial) -> HinfstructResult
        Synthesis on the active set. `initial` is None where the solver shall use its own starts.
    gain : float, optional
        Where `solve` is cut short: rounds go on, too, while one lowers the worst value by more than this, relatively.
        Short rounds keep the worst positions where they are; long ones leave the active set behind.
    positions : (N, n_p), optional
        First active set; default centre, corners and a spread, `n_positions` in all.
    n_positions, max_active, max_rounds : int
        Size of the first and of the largest active set; rounds of synthesis and search.
    tolerance : float
        Relative excess over the active set that counts as worse.
    n_search, n_refine : int
        Positions and climbs of each search, see `worst_over_box`.
    seed : int
        Of the spreads, another one in each round.
    initial : sequence of (n_parameters,), optional
        Starts of the first round.
    time_limit : float, optional
        Seconds of wall time after which no further round begins; `solve` keeps its own.
    progress : Progress
        Hears a stage for every search, and its result.

    Returns
    -------
    ContinuumResult
        Of the round with the smallest worst value, each looked at where any of them was worst.

    Raises
    ------
    DimensionError, DomainError
        If a position or a number does not fit.
    SynthesisError
        If no parameters stabilise the active set.

    References
    ----------
    Apkarian, Dao and Noll (2015), IEEE TAC 60, 2857-2869.
    """
    family = as_family(plants)
    box = family.box
    for name, count in (("n_positions", n_positions), ("max_active", max_active), ("max_rounds", max_rounds)):
        whole_number(name, count, 1)
    positive("tolerance", tolerance)
    end = np.inf if time_limit is None else time.monotonic() + positive("time_limit", time_limit, "s")
    first = (
        first_positions(box, min(n_positions, max_active), seed)
        if positions is None
        else points_in_box(positions, box, name="positions")
    )
    active = ActiveSet(first, box, max(max_active, len(first)))
    rounds: list[Round] = []
    seen = first
    starts = initial
    converged = False
    for number in range(max_rounds):
        points = read_only(active.points)
        result = _solved(solve, family.sample(points), points, starts, rounds)
        progress.stage(f"worst position over the box, round {number + 1}")
        for part in (max(LEAST_SEARCH, n_search // 4), n_search):
            # where a quarter of the search finds far worse positions the rest can wait for a better controller
            worst = worst_over_box(
                family, controller, result.parameters, n_search=min(part, n_search), n_refine=n_refine,
                seed=seed + 1 + number, known=seen,
            )  # fmt: skip
            if worst.gamma > (1.0 + CLOSE * tolerance) * result.gamma or part >= n_search:
                break
        progress.log(f"gamma {result.gamma:.5g} at {len(points)} positions, {worst.gamma:.5g} over the box")
        rounds.append(Round(positions=points, result=result, worst=worst))
        new = worst.candidates[worst.gammas > (1.0 + tolerance) * result.gamma][:MOST_ADDED]
        seen = np.vstack([seen, worst.candidates])
        converged = len(new) == 0
        if converged and (gain is None or (number and worst.gamma > (1.0 - gain) * rounds[-2].worst.gamma)):
            break
        if result.interrupted or time.monotonic() >= end:
            break
        active.exchange(result.gammas, new)
        best = min(rounds, key=lambda r: r.worst.gamma)
        starts = [np.asarray(best.result.parameters)]
        close = best.worst.gamma <= (1.0 + CLOSE * tolerance) * best.result.gamma
        if close and len(rounds) - rounds.index(best) > STALLS:
            break
        if best is not rounds[-1] and not close:
            # neither is good over the box yet: go on with both
            starts.append(np.asarray(result.parameters))
    checks = [] if converged else [BoxNorms(family, controller, np.asarray(r.result.parameters)) for r in rounds]
    final, value, where = rounds[-1], rounds[-1].worst.gamma, rounds[-1].worst.position
    if not converged:
        final, value, where = _best(rounds, checks, seen)
    if final.result.gamma >= value:
        value, where = final.result.gamma, final.positions[int(np.argmax(final.result.gammas))]
    status = final.result.status
    if not converged:
        status += (
            f" After {len(rounds)} rounds a position is still worse than the active set: {value:.5g} against "
            f"{final.result.gamma:.5g}. Raise max_rounds, max_active or time_limit."
        )
    return ContinuumResult(
        result=replace(final.result, gamma_worst=value, worst_position=read_only(where), status=status),
        positions=final.positions,
        converged=converged,
        rounds=tuple(rounds),
        n_exact=sum(c.n_exact for c in checks) + sum(r.worst.n_exact for r in rounds),
        n_cheap=sum(c.n_cheap for c in checks) + sum(r.worst.n_cheap for r in rounds),
        n_plants=sum(c.n_plants for c in checks) + sum(r.worst.n_plants + len(r.positions) for r in rounds),
    )


def _solved(
    solve: Solve,
    plants: Sequence[GeneralizedPlant],
    points: Array,
    starts: Sequence[Array] | None,
    rounds: Sequence[Round],
) -> HinfstructResult:
    """Solve from `starts`; where they lead nowhere after positions joined, from the solver's own."""
    try:
        return solve(plants, points, starts)
    except SynthesisError:
        if not rounds:
            raise
        return solve(plants, points, None)


def _best(rounds: Sequence[Round], checks: Sequence[BoxNorms], seen: Array) -> tuple[Round, float, Array]:
    """The round with the smallest worst norm, every round looked at where any was worst; that norm and position."""
    worst: list[tuple[float, Array]] = []
    for r, norms in zip(rounds, checks, strict=True):
        values, _ = norms.cheap(seen)
        k = int(np.argmax(values))
        beyond = values[k] > r.worst.gamma
        worst.append(
            (float(norms.exact(seen[k : k + 1])[0][0]), seen[k]) if beyond else (r.worst.gamma, r.worst.position)
        )
    chosen = int(np.argmin([value for value, _ in worst]))
    return rounds[chosen], *worst[chosen]
