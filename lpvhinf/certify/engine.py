"""Prove, refute, or leave undecided: stability and L2 gain of a polynomial system for every p of a box."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.certify import arguments
from lpvhinf.certify.cells import Point, grid_points
from lpvhinf.certify.claim import Certificate, Claim, Refutation, Undecided
from lpvhinf.certify.frozen import FrozenStability
from lpvhinf.certify.global_lyapunov import GlobalLyapunov, GlobalProver, constant_lyapunov
from lpvhinf.certify.l2_gain import gain_candidate
from lpvhinf.certify.loop import LoopMatrix
from lpvhinf.certify.outcome import nothing, outcome
from lpvhinf.certify.parallel import search
from lpvhinf.certify.quadratic import common_lyapunov
from lpvhinf.certify.rate import LARGE, rate_candidate
from lpvhinf.certify.refute import unstable_position
from lpvhinf.certify.refute_gain import large_gain
from lpvhinf.certify.refute_quadratic import excluded
from lpvhinf.certify.search import DEEPEST
from lpvhinf.certify.system import L2_GAIN, STABILITY, CanonicalSystem, canonical_system
from lpvhinf.checks import Array, finite_array, whole_number
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace import LPVStateSpace

BOUNDED_DEEPEST = 10  # with a remainder, smaller cells do not help: it stays as large as it is


def stability(
    system: LPVStateSpace,
    *,
    kind: str = "frozen",
    rate: ArrayLike | float | None = None,
    box: ArrayLike | None = None,
    decay: float = 0.0,
    remainder: Mapping[str, ArrayLike] | None = None,
    remainder_is: str = "bounded",
    degree: int | None = None,
    lyapunov_degree: int | None = None,
    lyapunov: GlobalLyapunov | None = None,
    time_limit: float | None = None,
    jobs: int | None = None,
    progress: Progress = SILENT,
) -> Certificate | Refutation | Undecided:
    r"""Prove that x' = A(p) x is stable for every p of a box.

    Parameters
    ----------
    kind : "frozen", "quadratic" or "rate"
        A(p) Hurwitz for every fixed p; one Lyapunov matrix for all p, so that p may move arbitrarily fast; a
        Lyapunov matrix that is a polynomial in p, for dp/dt in the box `rate`.
    rate : (n_p, 2) or a speed
        Lowest and highest dp/dt, with 0 between them; a speed v means [-v, v] on every axis. For kind "rate".
    box : (n_p, 2)
        The part of the system's box; all of it by default.
    decay : [1/s]
        The eigenvalues, or the trajectories, decay faster than this.
    remainder : {"A": (n_x, n_x)}
        Entrywise bound of what the polynomials leave out, at every p.
    remainder_is : "bounded" or "sampled"
        Whether that bound is proved; "sampled" makes the claim conditional on it.
    degree, lyapunov_degree : int
        Degrees of A and of the Lyapunov matrix in the coordinates of a cell.
    lyapunov : GlobalLyapunov
        A P(p) of your own for the kinds "quadratic" and "rate"; found automatically without it.
    time_limit : [s]
    jobs : int
        Processes over which the cells are shared; one by default. A script needs a main guard then.

    Returns
    -------
    Certificate, Refutation or Undecided

    Raises
    ------
    DomainError, DimensionError
        If an argument is outside its set.

    Examples
    --------
    >>> import lpvhinf as lh
    >>> A = [[[0.0, 1.0], [-4.0, -0.2]], [[0.0, 0.0], [1.0, 0.1]]]  # A(p) = A_0 + p A_1
    >>> G = lh.LPVStateSpace.from_coefficients(A, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> proof = stability(G)
    >>> proof.n_cells < 10, proof.margin > 0.0
    (True, True)
    """
    deadline = None if time_limit is None else time.monotonic() + time_limit
    started = time.process_time()
    processes = 1 if jobs is None else whole_number("jobs", jobs, 1)
    where = arguments.sub_box(box, system.box)
    arguments.known("kind", kind, arguments.KINDS)
    claim = Claim(
        property=STABILITY,
        kind=kind,
        box=where,
        decay=arguments.decay_rate(decay),
        rate=arguments.rate_box(rate, kind, len(where)),
        remainder=arguments.remainder_kind(remainder, remainder_is),
    )
    _fits(lyapunov, claim, system.n_x)
    canonical = canonical_system(system, STABILITY)
    bounds = arguments.remainder_bounds(remainder, canonical)
    loop = LoopMatrix(canonical, where, decay=claim.decay, remainder=bounds)
    deepest = BOUNDED_DEEPEST if bounds else DEEPEST
    progress.stage(str(claim))
    if kind == "frozen":
        d, e = _degrees(degree, lyapunov_degree, 4, 3)
        prover = FrozenStability(loop, d, e)
        found = search(prover, len(where), jobs=processes, deadline=deadline, deepest=deepest, progress=progress)
        refutation = _unstable(claim, canonical, [Point(cell.centre) for cell in found.suspects])
        return refutation or outcome(claim, canonical, bounds, found, d, e, started)
    d, e = _degrees(degree, lyapunov_degree, 5, 4)
    candidate = lyapunov
    if candidate is None and kind == "quadratic":
        common = common_lyapunov(system, where, claim.decay, deadline=deadline)
        if common is not None and common.margin <= 0.0:
            excluding = excluded(canonical, where, common.positions, common.multipliers, claim.decay)
            if excluding is not None:
                return Refutation(claim=claim, evidence=excluding)
        candidate = None if common is None else constant_lyapunov(common.P, len(where))
    elif candidate is None:
        assert claim.rate is not None
        suggested = rate_candidate(system, where, claim.decay, np.max(np.abs(claim.rate), axis=1))
        candidate = None if suggested is None else suggested[0]
    if candidate is None:
        refutation = _unstable(claim, canonical, _least_stable(system, where, claim.decay))
        return refutation or nothing(claim, "no Lyapunov matrix was found", started)
    moving = GlobalProver(loop, candidate, d, e, claim.rate)
    found = search(moving, len(where), jobs=processes, deadline=deadline, deepest=deepest, progress=progress)
    if found.reason:
        refutation = _unstable(claim, canonical, _least_stable(system, where, claim.decay))
        if refutation is not None:
            return refutation
    stored = {"S": candidate.S, "X": candidate.X}
    return outcome(claim, canonical, bounds, found, d, moving.lyapunov_degree, started, stored)


def l2_gain(
    system: LPVStateSpace,
    gamma: float,
    *,
    kind: str = "frozen",
    rate: ArrayLike | float | None = None,
    box: ArrayLike | None = None,
    remainder: Mapping[str, ArrayLike] | None = None,
    remainder_is: str = "bounded",
    degree: int | None = None,
    lyapunov_degree: int | None = None,
    lyapunov: GlobalLyapunov | None = None,
    time_limit: float | None = None,
    jobs: int | None = None,
    progress: Progress = SILENT,
) -> Certificate | Refutation | Undecided:
    r"""Prove that the L2 gain from u to y is below gamma for every p of a box.

    Frozen, that is the H-infinity norm of every local system; with kind "rate" it is the induced L2 gain along all
    p(t) with dp/dt in the box `rate`. Stability is part of the claim.

    Parameters
    ----------
    gamma : bound of the gain, above 0
    kind, rate, box, degree, lyapunov_degree, lyapunov, time_limit, jobs
        As for `stability`.
    remainder : {"A": ..., "B": ..., "C": ..., "D": ...}
        Entrywise bounds of what the polynomials leave out.

    Returns
    -------
    Certificate, Refutation or Undecided

    Examples
    --------
    >>> import lpvhinf as lh
    >>> G = lh.LPVStateSpace.from_coefficients([[[-2.0]], [[1.0]]], [[1.0]], [[1.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> type(l2_gain(G, 1.01)).__name__, type(l2_gain(G, 0.9)).__name__  # the gain is 1 / (2 - p)
    ('Certificate', 'Refutation')
    """
    deadline = None if time_limit is None else time.monotonic() + time_limit
    started = time.process_time()
    processes = 1 if jobs is None else whole_number("jobs", jobs, 1)
    where = arguments.sub_box(box, system.box)
    arguments.known("kind", kind, arguments.KINDS)
    bound = float(finite_array("gamma", gamma, ()))
    if bound <= 0.0:
        raise DomainError(f"gamma is {bound}, wanted a bound above 0.")
    claim = Claim(
        property=L2_GAIN,
        kind=kind,
        box=where,
        gamma=bound,
        rate=arguments.rate_box(rate, kind, len(where)),
        remainder=arguments.remainder_kind(remainder, remainder_is),
    )
    _fits(lyapunov, claim, system.n_x)
    canonical = canonical_system(system, L2_GAIN)
    bounds = arguments.remainder_bounds(remainder, canonical)
    progress.stage(str(claim))
    refutation = large_gain(system, canonical, claim)
    if refutation is not None:
        return refutation
    loop = LoopMatrix(canonical, where, gamma=bound, remainder=bounds)
    d, e = _degrees(degree, lyapunov_degree, *((6, 6) if system.n_x > LARGE else (5, 4)))
    reach = np.zeros(len(where)) if claim.rate is None else np.max(np.abs(claim.rate), axis=1)
    candidate = lyapunov or gain_candidate(system, where, bound, reach, constant=kind == "quadratic")
    if candidate is None:
        refutation = _unstable(claim, canonical, _least_stable(system, where, 0.0))
        return refutation or nothing(claim, "no Lyapunov matrix was found", started)
    prover = GlobalProver(loop, candidate, d, e, claim.rate)
    deepest = BOUNDED_DEEPEST if bounds else DEEPEST
    found = search(prover, len(where), jobs=processes, deadline=deadline, deepest=deepest, progress=progress)
    stored = {"S": candidate.S, "X": candidate.X}
    return outcome(claim, canonical, bounds, found, d, prover.lyapunov_degree, started, stored)


def _fits(lyapunov: GlobalLyapunov | None, claim: Claim, n: int) -> None:
    """Errors for a system without states, or a Lyapunov matrix that cannot prove the claim."""
    if n == 0:
        raise DimensionError("the system has no states, wanted at least one: there is nothing to prove.")
    if lyapunov is None:
        return
    if claim.property == STABILITY and claim.kind == "frozen":
        raise DomainError("lyapunov is given, but kind is 'frozen'. Leave it out, or use kind='rate' or 'quadratic'.")
    if claim.kind == "quadratic" and not lyapunov.is_constant:
        raise DomainError("lyapunov depends on p, but kind is 'quadratic': wanted one matrix. Use kind='rate'.")
    shape = (n, n), len(claim.box), n * (n + 1) // 2
    if (lyapunov.S.shape, lyapunov.X.ndim - 1, lyapunov.X.shape[-1]) != shape:
        raise DimensionError(
            f"lyapunov has S {lyapunov.S.shape} and X {lyapunov.X.shape}, wanted S ({n}, {n}) and X with "
            f"{len(claim.box)} axes of degrees and then {shape[2]} numbers."
        )


def _degrees(degree: int | None, lyapunov_degree: int | None, d: int, e: int) -> tuple[int, int]:
    d = d if degree is None else degree
    e = min(e, d + 1) if lyapunov_degree is None else lyapunov_degree
    if not 1 <= d <= 8 or not 0 <= e <= min(8, d + 1):
        raise DomainError(f"degree {d} and lyapunov_degree {e}: wanted 1 to 8, and 0 to degree + 1 but at most 8.")
    return d, e


def _least_stable(system: LPVStateSpace, box: Array, decay: float) -> list[Point]:
    """The least stable position of a regular grid, if it is unstable."""
    points = grid_points(len(box), {1: 64, 2: 16}.get(len(box), 4))
    worst = [float(np.max(np.linalg.eigvals(A).real)) for A in system.A.sample([p.rounded(box) for p in points])]
    k = int(np.argmax(worst))
    return [points[k]] if worst[k] >= -decay else []


def _unstable(claim: Claim, system: CanonicalSystem, suspects: list[Point]) -> Refutation | None:
    for suspect in suspects:
        evidence = unstable_position(system, claim.box, suspect, claim.decay)
        if evidence is not None:
            return Refutation(claim=claim, evidence=evidence)
    return None
