"""Structured H-infinity synthesis: the entry point."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from lpvhinf.checks import Array, positive, read_only, whole_number
from lpvhinf.errors import AssumptionError, SynthesisError
from lpvhinf.hinfstruct.arguments import checked_initial, checked_plants, checked_positions
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.continuum import hinfstruct_over_box
from lpvhinf.hinfstruct.fixed_modes import check_movable, named
from lpvhinf.hinfstruct.goals import Goal
from lpvhinf.hinfstruct.goals_search import check_goals, meet_goals
from lpvhinf.hinfstruct.lower_bound import lower_bound
from lpvhinf.hinfstruct.oracle import SMALL, NormOracle
from lpvhinf.hinfstruct.problem import Budget
from lpvhinf.hinfstruct.result import Evaluations, HinfstructResult
from lpvhinf.hinfstruct.runner import Checkpoint, Runner
from lpvhinf.hinfstruct.runs import Outcome, Task
from lpvhinf.hinfstruct.scheduled import PolynomialBasis, Scheduled
from lpvhinf.hinfstruct.search import Pool, search
from lpvhinf.hinfstruct.structures import ControllerStructure, realize_checked
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

#: Parameters larger than this multiple of one point to a minimum at infinity.
HUGE = 1e5


def hinfstruct(
    plants: GeneralizedPlant | Sequence[GeneralizedPlant] | LPVGeneralizedPlant,
    controller: ControllerStructure,
    *,
    constraints: Sequence[Goal] = (),
    objective: Goal | None = None,
    points: ArrayLike | None = None,
    starts: int | None = None,
    seed: int = 0,
    initial: ArrayLike | Sequence[ArrayLike] | None = None,
    time_limit: float | None = None,
    progress: Progress = SILENT,
    checkpoint: Checkpoint | None = None,
    jobs: int = 1,
    max_iterations: int = 1000,
    polish_iterations: int | None = None,
    tolerance: float = 1e-7,
    descent_tolerance: float | None = 1e-2,
    bound: bool = True,
) -> HinfstructResult:
    r"""Tune a structured controller for the smallest H-infinity norm over several plants.

    .. math:: \min_\theta \max_i \| F_l(P_i, K(\theta)) \|_\infty
              \quad\text{subject to every loop being internally stable}, \quad u = + K(\theta) y

    The problem is nonsmooth and nonconvex: the result is a local minimum, the best
    over the starts. Phases: (0) the largest real part of the closed-loop poles is
    minimised until all plants are stable; (1) BFGS with a weak Wolfe line search;
    (2) a bundle of quadratic cuts over all near-maximal peaks, with a trust region measured by what a step does to
    the loop, so that units and the size of the gain do not matter. Trial steps rely on tracked
    peaks (on the exact norm for a single small loop), accepted steps pass a Hamiltonian level test, and the result is
    recomputed by the exact norm on every plant.

    Ctrl-C ends the run: the best controller so far is returned, and its `status` says "interrupted". A minimum that
    lies at infinite parameters is approached up to 1e9, and the status tells.

    Parameters
    ----------
    plants : GeneralizedPlant, a sequence of them, or LPVGeneralizedPlant
        The largest norm counts; of a plant over a box, the largest over all positions: an active set of them is
        exchanged with the worst position found (`hinfstruct_over_box`).
    controller : ControllerStructure
        Such as `StaticGain`, `FixedOrder`, or any object that follows the protocol.
    constraints : sequence of goals
        Hard constraints, each with a bound: `ChannelNorm`, `FrequencyBand`, `ClosedLoopPoles`, `H2Norm`.
    objective : goal, optional
        What is minimised in place of the norm of the whole loop, which then only ranks the starts.
    points : (n_plants, n_p), optional
        Positions handed to a scheduled structure as `p`, one a plant.
    starts : int, optional
        Random starts besides `initial`: all are stabilised and descend, the better ones are polished in rounds of
        successive halving, the best one to the end. Left out: batches of starts, and of perturbations of the best
        point, until four agree on the best minimum or an effort (a few thousand evaluations) is spent.
    seed : int
        The same seed gives the same result, with any number of jobs, as long as no time limit cuts in.
    initial : (n_parameters,) or a sequence of these, optional
        Starts that are tried first.
    time_limit : float, optional
        Seconds of wall time, looked at between evaluations and shared among the starts.
    progress : Progress
        Hears a stage for every phase and `update(gamma=..., iteration=...)`.
    checkpoint : callable, optional
        `checkpoint(theta, gamma)` is called for every best point so far, so that a long run
        can be saved (with jobs > 1 when a start ends).
    jobs : int
        Processes for the starts. Above one, call from under ``if __name__ == "__main__":``.
    max_iterations : int
        Of each phase of a start.
    polish_iterations : int, optional
        Of the polish of one start, where that is to be shorter; default `max_iterations`.
    tolerance : float
        Relative decrease of gamma that counts as progress in the polish.
    descent_tolerance : float or None
        Relative decrease of gamma in 15 iterations below which BFGS hands over to the polish. None: starts of the
        caller that stabilise are left to the polish at once.
    bound : bool
        Compute `lower_bound`, by full-order synthesis of every plant: a second or two for a hundred states.

    Raises
    ------
    DimensionError
        If sizes of plants, controller, points or initial parameters disagree.
    DomainError
        If a value is not finite, not positive where it must be, or an option is not supported.
    AssumptionError
        If an unstable mode of a plant is not controllable from u or not observable from y.
    KeyboardInterrupt
        If interrupted before any stabilising parameters were found.
    SynthesisError
        If no start stabilises every plant, or none meets the constraints; its `.result` holds the best parameters
        reached.

    References
    ----------
    Apkarian and Noll (2006), IEEE TAC 51, 71-86; Lewis and Overton (2013), Math.
    Programming 141, 135-163; Apkarian, Dao and Noll (2015), IEEE TAC 60, 2857-2869.

    Examples
    --------
    For x' = x + w1 + u, z = (x, u), y = x + w2 the gain u = -k y has its peaks at zero and at
    infinity; they are equal at k = 1 + sqrt 3, which is also the norm there.

    >>> P = GeneralizedPlant([[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...                      [[0.0, 0.0], [0.0, 0.0]], [[0.0], [1.0]], [[0.0, 1.0]])
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> result = hinfstruct(P, StaticGain(1, 1), starts=1)
    >>> result.stabilizing, round(result.gamma, 4)
    (True, 2.7321)
    """
    if isinstance(plants, LPVGeneralizedPlant):

        def solve(
            plants: Sequence[GeneralizedPlant], points: Array, initial: Sequence[Array] | None
        ) -> HinfstructResult:
            return hinfstruct(
                plants, controller, constraints=constraints, objective=objective, points=points,
                starts=starts if initial is None or initial is first else 0, seed=seed,
                initial=None if initial is None else list(initial), time_limit=time_limit, progress=progress,
                checkpoint=checkpoint, jobs=jobs, max_iterations=max_iterations, polish_iterations=polish_iterations,
                tolerance=tolerance, descent_tolerance=descent_tolerance, bound=bound,
            )  # fmt: skip

        first = checked_initial(initial, controller.n_parameters) or None
        return hinfstruct_over_box(
            plants, controller, solve, seed=seed, initial=first, time_limit=time_limit, progress=progress
        ).result
    models = checked_plants(plants, controller)
    positions = checked_positions(points, len(models))
    given = checked_initial(initial, controller.n_parameters)
    if starts is not None:
        whole_number("starts", starts, 0 if given else 1)
    for name, value, least in (("seed", seed, 0), ("jobs", jobs, 1), ("max_iterations", max_iterations, 1)):
        whole_number(name, value, least)
    if polish_iterations is not None:
        whole_number("polish_iterations", polish_iterations, 1)
    positive("tolerance", tolerance)
    if descent_tolerance is not None:
        positive("descent_tolerance", descent_tolerance)
    deadline = np.inf if time_limit is None else time.monotonic() + positive("time_limit", time_limit, "s")
    realize_checked(controller, given[0] if given else controller.initial(np.random.default_rng(seed)), positions[0])
    check_movable(models)
    check_goals(constraints, objective)

    def make(start: int, theta: Array | None) -> Task:
        return Task(
            plants=models,
            structure=controller,
            points=positions,
            start=start,
            theta=theta,
            seed=seed,
            seconds=np.inf,
            max_iterations=max_iterations,
            tolerance=tolerance,
            descent_tolerance=descent_tolerance,
        )

    loops = ClosedLoops(models, controller, positions)
    oracle = NormOracle(loops, Budget())
    cost = len(models) * (1.0 + (loops.n_states / SMALL) ** 2)
    with threadpool_limits(limits=1), Runner(progress, checkpoint, jobs, deadline) as runner:
        most = max_iterations if polish_iterations is None else polish_iterations
        pool = search(runner, make, given, starts, cost, controller.n_parameters, most)
        candidates = pool.ranked()[:3]
        if runner.interrupted and runner.theta is not None:
            candidates = [_heard(runner), *candidates]
        below = _lower_bound(models) if bound else None
        if (constraints or objective is not None) and not runner.interrupted:
            met = [meet_goals(o, loops, constraints, objective, deadline, max_iterations) for o in candidates]
            met.sort(key=lambda m: (max(m.violation, 0.0), m.value, m.outcome.start))
            if met:
                status = _status(met[0].outcome, runner)
                best = replace(
                    _result(oracle, met[0].outcome, controller, positions, status, pool, below),
                    constraints=met[0].constraints,
                    objective=None if objective is None else met[0].value,
                )
                if met[0].feasible:
                    return best
                status = f"no start meets the constraints: {met[0].message}"
                raise SynthesisError(status, replace(best, status=status))
        # tracked peaks rank the candidates, exact norms decide
        results = [_result(oracle, o, controller, positions, _status(o, runner), pool, below) for o in candidates]
        level = (1.0 + 1e-7) * min((r.gamma for r in results), default=np.inf)
        # of equal ones that which is known best to be a minimum
        found = min((r for r in results if r.gamma <= level), key=lambda r: (r.optimality, r.gamma), default=None)
        if found is not None and found.stabilizing:
            return replace(found, interrupted=runner.interrupted)
        if runner.interrupted:
            raise KeyboardInterrupt("interrupted before stabilising parameters were found")
        closest = min(pool.latest.values(), key=lambda o: (o.abscissa, o.start))
        status = _not_stabilised(loops, closest)
        raise SynthesisError(status, _result(oracle, closest, controller, positions, status, pool, below))


def _lower_bound(models: Sequence[GeneralizedPlant]) -> float | None:
    """The largest of the plants' full-order bounds; None where none could be computed."""
    found = []
    for model in models:
        try:
            found.append(lower_bound(model).gamma)
        except AssumptionError:
            continue
    return max(found, default=None)


def _heard(runner: Runner) -> Outcome:
    """The best point of an interrupted run."""
    assert runner.theta is not None
    return Outcome(
        start=-1, theta=runner.theta, gamma=runner.best, abscissa=-np.inf, optimality=np.inf, reason="", history=()
    )


def _not_stabilised(loops: ClosedLoops, closest: Outcome) -> str:
    """The message of a failure: how close it came, and which modes are in the way."""
    modes = []
    for i, (factory, K) in enumerate(zip(loops.factories, loops.gains(closest.theta), strict=True)):
        loop = factory.close(K)
        poles = np.linalg.eigvals(loop.A) if loop is not None else np.zeros(0)
        unstable = poles[poles.real >= 0.0]
        if unstable.size:
            modes.append(f"plants[{i}]: {named(unstable)}")
    where = "; ".join(modes[:5]) if modes else "poles too close to the axis"
    return (
        f"no start stabilises every plant: the smallest abscissa reached is {closest.abscissa:.4g} rad/s "
        f"({closest.reason}), with the unstable closed-loop modes {where}. Check that the plants are stabilisable with "
        "this structure, raise starts, max_iterations or time_limit, or pass a stabilising initial."
    )


def _status(outcome: Outcome, runner: Runner) -> str:
    if runner.interrupted:
        return (
            "interrupted: the controller is the best so far, valid but not converged. Pass its parameters as initial "
            "to go on."
        )
    size = float(np.max(np.abs(outcome.theta), initial=0.0))
    if size > HUGE:
        return (
            f"the parameters grow without bound (largest {size:.2g}): the infimum seems to lie at infinite gain, and "
            f"was approached within bounds ({outcome.reason}). Put a weight on u, or bound the parameters, for a "
            "practical gain."
        )
    if outcome.reason == "time limit":
        return (
            "stopped by time_limit before convergence; the controller is valid. Raise time_limit, or pass its "
            "parameters as initial to go on."
        )
    if outcome.reason == "iteration limit":
        return (
            "stopped by its limit of iterations before convergence; the controller is valid. Raise max_iterations, or "
            "pass its parameters as initial to go on."
        )
    if outcome.gamma <= 1e-6:
        return "the norm is practically zero; nothing is left to gain unless the channels are scaled badly."
    if outcome.optimality <= 1e-3:
        return "converged to a local minimum. Raise starts to look for a better one."
    return (
        f"no further progress ({outcome.reason}); optimality {outcome.optimality:.2g} is not small, so it may not be a "
        "local minimum, or the minimum lies at infinite parameters. Raise starts, or put a weight on u."
    )


def _result(
    oracle: NormOracle,
    outcome: Outcome,
    controller: ControllerStructure,
    positions: tuple[Array | None, ...],
    status: str,
    pool: Pool,
    below: float | None,
) -> HinfstructResult:
    import control

    norms = oracle.exact(outcome.theta)
    gammas = np.array([norm.norm for norm in norms])
    worst = int(np.argmax(gammas))
    return HinfstructResult(
        gamma=float(gammas[worst]),
        controller=(
            controller.over_box(outcome.theta)
            if isinstance(controller, Scheduled) and isinstance(controller.basis, PolynomialBasis)
            else control.ss(*controller.realize(outcome.theta, positions[worst]))
        ),
        parameters=read_only(outcome.theta),
        gammas=read_only(gammas),
        gamma_worst=float(gammas[worst]),
        worst_position=positions[worst],
        worst_frequency=norms[worst].omega,
        lower_bound=below,
        optimality=outcome.optimality,
        status=status,
        history=tuple(pool.history),
        evaluations=Evaluations(
            trials=sum(r.evaluations for r in pool.history),
            exact=sum(r.exact for r in pool.history) + oracle.budget.exact,
            every_model=len(gammas) * sum(r.evaluations for r in pool.history if r.phase != "stabilise"),
        ),
        stabilizing=bool(np.all(np.isfinite(gammas))),
    )
