"""Structured H-infinity synthesis: the entry point."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.errors import DimensionError, DomainError, SynthesisError
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.oracle import SMALLEST, Budget, NormOracle
from lpvhinf.hinfstruct.result import HinfstructResult, PhaseRecord
from lpvhinf.hinfstruct.runs import Outcome, Task, descend, polish
from lpvhinf.hinfstruct.structures import ControllerStructure, realize_checked
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.generalized import GeneralizedPlant

Checkpoint = Callable[[Array, float], None]

#: Starts whose norm is above this multiple of the best one are not polished.
HOPELESS = 1.5


def hinfstruct(
    plants: GeneralizedPlant | Sequence[GeneralizedPlant],
    controller: ControllerStructure,
    *,
    constraints: Sequence[object] = (),
    points: ArrayLike | None = None,
    starts: int = 3,
    seed: int = 0,
    initial: ArrayLike | Sequence[ArrayLike] | None = None,
    time_limit: float | None = None,
    progress: Progress = SILENT,
    checkpoint: Checkpoint | None = None,
    jobs: int = 1,
    max_iterations: int = 300,
    tolerance: float = 1e-7,
    descent_tolerance: float = 1e-2,
) -> HinfstructResult:
    r"""Tune a structured controller for the smallest H-infinity norm over several plants.

    .. math:: \min_\theta \max_i \| F_l(P_i, K(\theta)) \|_\infty
              \quad\text{subject to every loop being internally stable}, \quad u = + K(\theta) y

    The problem is nonsmooth and nonconvex: the result is a local minimum, the best
    over the starts. Phases: (0) the largest real part of the closed-loop poles is
    minimised until all plants are stable; (1) BFGS with a weak Wolfe line search;
    (2) a bundle / SQP polish over all near-maximal peaks. Trial steps rely on tracked
    peaks, accepted steps pass a Hamiltonian level test, and the result is recomputed by
    the exact norm on every plant.

    Parameters
    ----------
    plants : GeneralizedPlant or a sequence of them
        The largest norm counts.
    controller : ControllerStructure
        Such as `StaticGain`, `FixedOrder`, or any object that follows the protocol.
    constraints : sequence
        Must be empty in this version.
    points : (n_plants, n_p), optional
        Positions handed to a scheduled structure as `p`, one a plant.
    starts : int
        Random starts besides `initial`.
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
        Of each phase.
    tolerance : float
        Relative decrease of gamma that counts as progress in the polish.
    descent_tolerance : float
        Relative decrease of gamma in 15 iterations below which BFGS hands over to the polish. Smaller values pay
        with many plants, where kinks slow both phases down.

    Raises
    ------
    DimensionError
        If sizes of plants, controller, points or initial parameters disagree.
    DomainError
        If a value is not finite, not positive where it must be, or an option is not supported.
    SynthesisError
        If no start stabilises every plant; its `.result` holds the best parameters reached.

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
    models = _plants(plants, controller)
    positions = _positions(points, len(models))
    given = _initial(initial, controller.n_parameters)
    if len(constraints) != 0:
        raise DomainError(
            f"constraints has {len(constraints)} entries, wanted (): hard constraints are not supported in this "
            "version. Put the goal into the performance channel with a weight."
        )
    for name, value, least in (
        ("starts", starts, 0 if given else 1),
        ("seed", seed, 0),
        ("jobs", jobs, 1),
        ("max_iterations", max_iterations, 1),
    ):
        if not isinstance(value, (int, np.integer)) or value < least:
            raise DomainError(f"{name} is {value!r}, wanted an integer of at least {least}.")
    positive("tolerance", tolerance)
    positive("descent_tolerance", descent_tolerance)
    deadline = np.inf if time_limit is None else time.monotonic() + positive("time_limit", time_limit, "s")
    realize_checked(controller, given[0] if given else controller.initial(np.random.default_rng(seed)), positions[0])

    def task(start: int, theta: Array | None, seconds: float) -> Task:
        return Task(
            plants=models,
            structure=controller,
            points=positions,
            start=start,
            theta=theta,
            seed=seed,
            seconds=seconds,
            max_iterations=max_iterations,
            tolerance=tolerance,
            descent_tolerance=descent_tolerance,
        )

    begins: list[Array | None] = [*given, *([None] * starts)]
    runner = _Runner(progress, checkpoint, jobs, deadline)
    with threadpool_limits(limits=1):
        outcomes = runner.map(descend, [task(k, theta, np.inf) for k, theta in enumerate(begins)], share=0.4)
        best = min(outcome.gamma for outcome in outcomes)
        if np.isfinite(best):
            hopeful = sorted(
                (o for o in outcomes if o.gamma <= max(HOPELESS * best, SMALLEST)), key=lambda o: (o.gamma, o.start)
            )
            polished = runner.map(polish, [task(o.start, o.theta, np.inf) for o in hopeful], share=1.0)
        else:
            polished = []
        history = tuple(record for outcome in [*outcomes, *polished] for record in outcome.history)
        oracle = NormOracle(ClosedLoops(models, controller, positions), Budget())
        if not polished:
            closest = min(outcomes, key=lambda o: (o.abscissa, o.start))
            status = (
                f"no start stabilises every plant: the smallest abscissa reached is {closest.abscissa:.4g} rad/s "
                f"({closest.reason}). Check that the plants are stabilisable with this structure, raise starts, "
                "max_iterations or time_limit, or pass a stabilising initial."
            )
            result = _result(oracle, closest, controller, positions, status, history)
            raise SynthesisError(status, result)
        # tracked peaks rank the candidates, exact norms decide
        ranked = sorted(polished, key=lambda o: (o.gamma, o.start))
        results = [_result(oracle, o, controller, positions, _status(o), history) for o in ranked[:3]]
    return min(results, key=lambda r: r.gamma)


def _plants(
    plants: GeneralizedPlant | Sequence[GeneralizedPlant], controller: ControllerStructure
) -> tuple[GeneralizedPlant, ...]:
    for name in ("n_u", "n_y", "n_x", "n_parameters", "realize", "pullback", "initial"):
        if not hasattr(controller, name):
            raise DomainError(
                f"controller is {type(controller).__name__} without {name!r}, wanted an object that follows the "
                "ControllerStructure protocol, such as StaticGain(n_u, n_y)."
            )
    models = (
        (plants,) if isinstance(plants, GeneralizedPlant) else tuple(plants) if isinstance(plants, Sequence) else ()
    )
    if not models or not all(isinstance(P, GeneralizedPlant) for P in models):
        raise DomainError(
            f"plants is {type(plants).__name__}, wanted a GeneralizedPlant or a sequence with at least one. "
            "Convert a state space by GeneralizedPlant.from_control, or freeze an LPV plant at chosen positions."
        )
    for i, P in enumerate(models):
        if (P.n_u, P.n_y) != (controller.n_u, controller.n_y):
            raise DimensionError(
                f"plants[{i}] has n_u={P.n_u}, n_y={P.n_y}, but the controller has n_u={controller.n_u}, "
                f"n_y={controller.n_y}. Make them equal."
            )
        if min(P.n_w, P.n_z) < 1:
            raise DimensionError(f"plants[{i}] has n_w={P.n_w}, n_z={P.n_z}, wanted at least one of each.")
    return models


def _positions(points: ArrayLike | None, n: int) -> tuple[Array | None, ...]:
    if points is None:
        return (None,) * n
    return tuple(read_only(row) for row in finite_array("points", points, (n, None)))


def _initial(initial: ArrayLike | Sequence[ArrayLike] | None, n: int) -> list[Array]:
    if initial is None:
        return []
    array = finite_array("initial", initial)  # type: ignore[arg-type]
    if array.ndim == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != n or array.shape[0] < 1:
        raise DimensionError(
            f"initial has shape {array.shape}, wanted ({n},) or (starts, {n}), the controller's n_parameters."
        )
    return list(array.copy())


class _Runner:
    """Runs tasks here or in processes, shares the time, and keeps the best for the listeners."""

    def __init__(self, progress: Progress, checkpoint: Checkpoint | None, jobs: int, deadline: float) -> None:
        self.progress, self.checkpoint, self.jobs, self.deadline = progress, checkpoint, jobs, deadline
        self.best = np.inf
        self.iteration = 0

    def map(self, work: Callable[..., Outcome], tasks: list[Task], share: float) -> list[Outcome]:
        """Outcomes in the order of the tasks; all tasks together take at most `share` of the time left."""
        end = time.monotonic() + share * (self.deadline - time.monotonic()) if np.isfinite(self.deadline) else np.inf
        workers = min(self.jobs, len(tasks))
        if workers == 1:
            out = []
            for k, task in enumerate(tasks):
                self.progress.stage(f"{work.__name__} {k + 1} of {len(tasks)} (start {task.start})")
                out.append(work(_limited(task, end, len(tasks) - k), self.hear))
            return out
        self.progress.stage(f"{work.__name__}, {len(tasks)} starts in {workers} processes", len(tasks))
        waves = -(-len(tasks) // workers)
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, mp_context=context, initializer=_single_thread) as pool:
            futures = [pool.submit(work, _limited(task, end, waves)) for task in tasks]
            for future in futures:
                outcome = future.result()
                self.hear("", outcome.theta, outcome.gamma)
            return [future.result() for future in futures]

    def hear(self, phase: str, theta: Array, value: float) -> None:
        """Pass on the norm (while stabilising: the abscissa) at theta; a better point goes to the checkpoint."""
        self.iteration += 1
        if phase == "stabilise":
            self.progress.update(1, abscissa=value, iteration=self.iteration)
            return
        if value < self.best:
            self.best = value
            if self.checkpoint is not None:
                self.checkpoint(theta.copy(), value)
        self.progress.update(1, gamma=self.best, iteration=self.iteration)


def _limited(task: Task, end: float, parts: int) -> Task:
    return replace(task, seconds=max(0.0, (end - time.monotonic()) / parts))


def _single_thread() -> None:
    threadpool_limits(limits=1)


def _status(outcome: Outcome) -> str:
    if outcome.reason == "time limit":
        return (
            "stopped by time_limit before convergence; the controller is valid. Raise time_limit, or pass its "
            "parameters as initial to go on."
        )
    if outcome.reason == "iteration limit":
        return (
            "stopped by max_iterations before convergence; the controller is valid. Raise max_iterations, or pass its "
            "parameters as initial to go on."
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
    history: tuple[PhaseRecord, ...],
) -> HinfstructResult:
    import control

    norms = oracle.exact(outcome.theta)
    gammas = np.array([norm.norm for norm in norms])
    worst = int(np.argmax(gammas))
    A, B, C, D = controller.realize(outcome.theta, positions[worst])
    return HinfstructResult(
        gamma=float(gammas[worst]),
        controller=control.ss(A, B, C, D),
        parameters=read_only(outcome.theta),
        gammas=read_only(gammas),
        gamma_worst=float(gammas[worst]),
        worst_position=positions[worst],
        worst_frequency=norms[worst].omega,
        lower_bound=None,
        optimality=outcome.optimality,
        status=status,
        history=history,
        stabilizing=bool(np.all(np.isfinite(gammas))),
    )
