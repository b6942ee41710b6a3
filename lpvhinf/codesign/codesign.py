"""Structured co-design of K_RB, L and xi over all positions."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box, positive, read_only, whole_number
from lpvhinf.codesign.assembly import ARCHITECTURES, ERROR_OBSERVER, RIGID_BODY, Assembly
from lpvhinf.codesign.design import Design
from lpvhinf.codesign.error_based import check_error_based
from lpvhinf.codesign.positions import design_positions, plant_family
from lpvhinf.codesign.specification import Specification
from lpvhinf.codesign.starts import observer_starts, rigid_starts
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct import HinfstructResult, hinfstruct
from lpvhinf.hinfstruct.continuum import hinfstruct_over_box
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.generalized import GeneralizedPlant

# The polish follows kinks far better than BFGS, which only leads it to a good region.
DESCENT_TOLERANCE = 0.05
# A conventional design that an observer design begins with: positions, and relative decrease that is worth a step.
WARM_POSITIONS, WARM_TOLERANCE = 6, 0.01
# Iterations of the solver in the first round of an exchange and in the others, and the gain that is worth a round.
FIRST_ITERATIONS, ROUND_ITERATIONS, ROUND_GAIN = 12, 10, 0.005
# Positions that the solver sees at once, unless more are asked for; and climbs of each search for a worse one.
MAX_ACTIVE = 24
N_REFINE = 3

Checkpoint = Callable[[Array, float], None]


def codesign(
    decoupled: DecoupledPlant,
    architecture: str = "output-observer",
    specification: Specification | None = None,
    *,
    problem: str | None = None,
    positions: ArrayLike | None = None,
    n_positions: int = 13,
    warm_start: Design | ArrayLike | None = None,
    rigid_start: ArrayLike | None = None,
    starts: int = 2,
    exchange_rounds: int = 12,
    exchange_tolerance: float = 0.01,
    n_search: int = 128,
    max_iterations: int = 150,
    tolerance: float = 1e-4,
    time_limit: float | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress = SILENT,
    checkpoint: Checkpoint | None = None,
) -> Design:
    r"""Minimise the largest :math:`\|M(p)\|_\infty` over P with the structure diag(K_RB, L, xi).

    A design with scheduled gains (`Specification.schedule`) begins with the one of constant gains, unless it has a
    `warm_start`.

    The norm counts at a set of design positions, with the plant model itself. Positions found to be
    worse join the set, positions that do not matter leave it if it grows beyond 15, and the design goes on,
    until none is worse by `exchange_tolerance`. If the rounds run out the best of them counts.

    Parameters
    ----------
    decoupled : DecoupledPlant
        From `decouple`.
    architecture : "rigid-body", "output-observer" or "error-observer"
        The conventional design of K_RB, or a co-design with the output-based or the error-based modal observer.
    specification : Specification
    problem : "six-block" or "two-by-two", optional
        The paper's problem for the output-based observer, whose first four blocks are that of the conventional
        design, or the one for the error-based observer, whose left column is that of the conventional design. By
        default the one of the architecture; compare designs under one problem, or by `column_norms`.
    positions : (N, n_p), optional
        Design positions; default the corners of P and an even spread, `n_positions` in all.
    warm_start : Design or (n_theta,), optional
        A conventional design gives K_RB to start an observer design from; one of the same architecture, or
        its parameters, are the start itself. Without it a rough conventional design is made first.
    rigid_start : (n_parameters of K_RB,), optional
        Parameters of K_RB that an observer design starts from, in place of a conventional design.
    starts : int
        Number of starts: rules of thumb for K_RB; for an observer the best of a screening of Riccati and damping
        gains.
    exchange_rounds, exchange_tolerance, n_search
        At most so many rounds of worst-position exchange, each over `n_search` positions.
    max_iterations : int
        Of each phase of the solver.
    tolerance : float
        Relative decrease of gamma that is still worth a step.
    time_limit : [s], optional
        Per solver run.
    seed, jobs : int
    progress : Progress
    checkpoint : callable, optional
        Gets every better (theta, gamma), so that a caller can save it.

    Returns
    -------
    Design

    Raises
    ------
    DomainError
        If the architecture or the problem is unknown, a position lies outside of P, or a number is out of its range.
    AssumptionError
        If a mode that an error-based observer is to estimate is not observable at some position.
    SynthesisError
        If no stabilising parameters are found.

    Warns
    -----
    LpvHinfWarning
        If a bandwidth reaches a mode that nobody controls, or a feedforward of the known model leaves rigid-body
        motion in the error, which an error-based observer takes for motion of the modes.
    """
    began = time.monotonic()
    spec = Specification() if specification is None else specification
    if architecture not in ARCHITECTURES:
        raise DomainError(f"architecture is {architecture!r}, wanted one of {', '.join(ARCHITECTURES)}.")
    if architecture != RIGID_BODY and decoupled.n_flex == 0:
        raise DomainError("n_flex is 0, wanted at least 1 preserved flexible mode for an observer design.")
    for name, value, least in (
        ("n_positions", n_positions, 1),
        ("starts", starts, 1),
        ("exchange_rounds", exchange_rounds, 0),
        ("n_search", n_search, 1),
        ("max_iterations", max_iterations, 1),
        ("seed", seed, 0),
        ("jobs", jobs, 1),
    ):
        whole_number(name, value, least)
    positive("exchange_tolerance", exchange_tolerance)
    spec.warn_if_demanding(decoupled)
    assembly = Assembly(plant=decoupled, specification=spec, architecture=architecture, problem_name=problem)
    if architecture == ERROR_OBSERVER:
        check_error_based(assembly)
    active = (
        design_positions(decoupled.box, n_positions, seed=seed)
        if positions is None
        else points_in_box(positions, decoupled.box, name="positions")
    )

    own: Design | None = None
    if assembly.layout.scheduled and warm_start is None:
        # the same with constant gains first: what it finds is a start, and its positions are those that count
        warm_start = own = codesign(
            decoupled, architecture, dataclasses.replace(spec, schedule={}), problem=problem, positions=active,
            rigid_start=rigid_start, starts=starts, exchange_rounds=exchange_rounds,
            exchange_tolerance=exchange_tolerance, n_search=n_search, max_iterations=max_iterations,
            tolerance=tolerance, time_limit=time_limit, seed=seed, jobs=jobs, progress=progress,
        )  # fmt: skip
        active = own.positions
    if architecture != RIGID_BODY and warm_start is None and rigid_start is None:
        warm_start = own = codesign(
            decoupled, RIGID_BODY, spec, problem=assembly.problem_name, positions=active[:WARM_POSITIONS], starts=1,
            exchange_rounds=0, n_search=1, seed=seed, max_iterations=max_iterations,
            tolerance=max(tolerance, WARM_TOLERANCE), time_limit=time_limit, progress=progress,
        )  # fmt: skip
    begin = _initial(assembly, active, warm_start, rigid_start, starts)
    progress.stage(f"{architecture}: {len(active)} positions, {assembly.structure.n_parameters} parameters")

    def at_positions(
        plants: Sequence[GeneralizedPlant], points: Array, initial: Sequence[Array] | None
    ) -> HinfstructResult:
        fresh = initial is None or initial is begin
        most = FIRST_ITERATIONS if fresh else ROUND_ITERATIONS
        return hinfstruct(
            plants,
            assembly.structure,
            points=points if assembly.layout.scheduled else None,
            initial=begin if initial is None else list(initial),
            starts=0,
            seed=seed,
            jobs=jobs,
            max_iterations=max_iterations,
            polish_iterations=min(most, max_iterations) if exchange_rounds else None,
            tolerance=tolerance,
            descent_tolerance=DESCENT_TOLERANCE if fresh else None,
            time_limit=time_limit,
            progress=progress,
            checkpoint=checkpoint,
            bound=False,  # of every position: many times the work of the design
        )

    found = hinfstruct_over_box(
        plant_family(assembly),
        assembly.structure,
        at_positions,
        positions=active,
        max_active=MAX_ACTIVE,
        max_rounds=exchange_rounds + 1,
        tolerance=exchange_tolerance,
        gain=ROUND_GAIN,
        n_search=n_search,
        n_refine=N_REFINE,
        seed=seed,
        initial=begin,
        progress=progress,
    )
    result = found.result
    assert result.worst_position is not None
    return Design(
        assembly=assembly,
        parameters=read_only(result.parameters),
        positions=read_only(found.positions),
        gammas=read_only(result.gammas),
        gamma_worst=result.gamma_worst,
        worst_position=read_only(result.worst_position),
        optimality=result.optimality,
        status=result.status,
        seconds=time.monotonic() - began,
        evaluations=found.evaluations if own is None else found.evaluations + own.evaluations,
    )


def _initial(
    assembly: Assembly,
    active: Array,
    warm_start: Design | ArrayLike | None,
    rigid_start: ArrayLike | None,
    starts: int,
) -> list[Array]:
    """Starts of the solver, from what the caller has."""
    if isinstance(warm_start, Design) and warm_start.architecture == assembly.architecture:
        return [_translated(assembly, warm_start)]
    if warm_start is not None and not isinstance(warm_start, Design):
        return [finite_array("warm_start", warm_start, (assembly.structure.n_parameters,))]
    if isinstance(warm_start, Design):
        rigid_start = assembly.rigid_body.parameters(warm_start.K_RB)
    if rigid_start is None:
        return rigid_starts(assembly, starts)
    rigid = finite_array("rigid_start", rigid_start, (assembly.rigid_body.n_parameters,))
    if assembly.observer is None:
        return [assembly.layout.expanded(rigid)]
    return observer_starts(assembly, active, rigid, starts)


def _translated(assembly: Assembly, design: Design) -> Array:
    """The parameters of a design of the same architecture, K_RB in this design's units."""
    return assembly.translated(design.assembly, np.asarray(design.parameters))
