"""The designs of the LPV study: how each is made, and what it is worth on the design plant and in truth."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import LpvHinfError
from lpvhinf.fitting import spread_points
from lpvhinf.hinfstruct import hinf_norm, hinfstruct
from lpvhinf.hinfstruct.lower_bound import lower_bound
from lpvhinf.lpv import (
    FittedController,
    affine_embedding,
    lpvsyn,
    lpvsyn_statefeedback,
    monomials,
    with_constant_channels,
)
from lpvhinf.lpv.result import LPVSynthesisResult
from lpvhinf.progress import Progress
from lpvhinf.statespace.generalized import GeneralizedPlant
from studies.lpv_plants import Problem
from studies.positions import grid

Matrices = tuple[Array, Array, Array, Array]
STRUCTURED = ("rigid-body", "output-observer")


@dataclass(frozen=True, kw_only=True)
class Job:
    """One design: its kind, positions per axis, degree of R(p) and largest speed [m/s] (None: any)."""

    name: str
    kind: str
    n_grid: int
    degree: int = 0
    speed: float | None = None


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Limits of the solvers."""

    max_iterations: int
    gap: float
    backoff: float
    time_limit: float
    fit_degree: int
    f_lag: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """A design: figures to tell, and the loops that it closes.

    Attributes
    ----------
    figures : dict
    plants : callable or None
        points, truth -> the generalized plants that the controller is for; None where it needs the states.
    controller : callable or None
        points (N, 2) -> N controllers.
    fitted : FittedController or None
        What is implemented, where the controller is scheduled.
    """

    figures: dict[str, Any]
    plants: Callable[..., list[GeneralizedPlant]] | None = None
    controller: Callable[[Array], list[Matrices]] | None = None
    fitted: FittedController | None = None


def make(problem: Problem, job: Job, effort: Effort, progress: Progress) -> Made:
    """Make one design; a synthesis that fails is an outcome, and is told."""
    began = time.process_time()
    makers = {
        "pointwise": _pointwise,
        "gridded": _gridded,
        "polytopic": _polytopic,
        "state-feedback": _state_feedback,
        **dict.fromkeys(STRUCTURED, _structured),
    }
    try:
        made = makers[job.kind](problem, job, effort, progress)
    except LpvHinfError as error:
        made = Made(figures={"gamma": None, "status": f"{type(error).__name__}: {error}"})
    made.figures["cpu_s"] = time.process_time() - began
    return made


def _pointwise(problem: Problem, job: Job, effort: Effort, progress: Progress) -> Made:
    """The largest of the levels that no controller beats at a single grid point."""
    bounds = [lower_bound(problem.at(p)).gamma for p in grid(problem.box, job.n_grid)]
    return Made(figures={"gamma": max(bounds), "status": "lower bound at rest"})


def _structured(problem: Problem, job: Job, effort: Effort, progress: Progress) -> Made:
    """A co-design of constant gains on the same generalized plants."""
    points, assembly = grid(problem.box, job.n_grid), problem.assembly
    alone = job.kind == "rigid-body"
    plants = problem.rigid_body if alone else problem.structured
    structure = assembly.rigid_body if alone else assembly.structure
    start = assembly.start(points)
    result = hinfstruct(
        plants(points),
        structure,
        starts=1,
        initial=start[: structure.n_parameters] if alone else start,
        max_iterations=effort.max_iterations,
        tolerance=1e-3,
        bound=False,
        progress=progress,
    )
    K = structure.realize(result.parameters)
    return Made(
        figures={"gamma": result.gamma, "status": result.status, "order": _order(problem, len(K[0]), alone)},
        plants=plants,
        controller=lambda where: [K] * len(where),
    )


def _order(problem: Problem, n_tuned: int, alone: bool) -> int:
    """States of a co-designed controller: integrators and K_RB; observer and band-pass."""
    n_rb, n_flex = problem.assembly.plant.n_rb, problem.assembly.plant.n_flex
    return n_rb + n_tuned + (0 if alone else problem.model.n_x + 2 * n_flex)


def _gridded(problem: Problem, job: Job, effort: Effort, progress: Progress) -> Made:
    result = lpvsyn(
        problem.at,
        grid(problem.box, job.n_grid),
        basis=monomials(job.degree, box=problem.box) if job.degree else None,
        rate=None if job.speed is None else np.outer(np.ones(2), [-job.speed, job.speed]),
        constant="S" if job.degree else "both",
        gap=effort.gap,
        backoff=effort.backoff,
        time_limit=effort.time_limit,
        progress=progress,
    )
    return _scheduled(result, problem.full_order, effort)


def _polytopic(problem: Problem, job: Job, effort: Effort, progress: Progress) -> Made:
    """Without compliance and with lags on y, so that all channels are constant; judged with the one, without these."""
    embedding = affine_embedding(problem.without_compliance, 2)
    vertices = with_constant_channels(embedding.systems, 2 * np.pi * effort.f_lag)
    n_y = vertices[0].n_y
    result = lpvsyn(
        vertices,
        embedding.vertices,
        method="polytopic",
        weights=embedding.weights,
        box=embedding.box,
        gap=effort.gap,
        backoff=effort.backoff,
        time_limit=effort.time_limit,
        progress=progress,
    )

    def uncompensated(points: Array, *, truth: bool = False) -> list[GeneralizedPlant]:
        return problem.full_order(points, truth=truth, compensated=False)

    made = _scheduled(result, uncompensated, effort)
    made.figures.update(share=embedding.share, error_bound=embedding.error_bound, lags=n_y)
    return made


def _state_feedback(problem: Problem, job: Job, effort: Effort, progress: Progress) -> Made:
    """What a controller reaches that knows all states, those of the filters too."""
    result = lpvsyn_statefeedback(
        problem.at,
        grid(problem.box, job.n_grid),
        basis=monomials(job.degree, box=problem.box),
        rate=np.outer(np.ones(2), [-(job.speed or 0.0), job.speed or 0.0]),
        gap=effort.gap,
        time_limit=effort.time_limit,
        progress=progress,
    )
    return Made(figures=_told(result))


def _scheduled(result: LPVSynthesisResult, plants: Callable[..., list[GeneralizedPlant]], effort: Effort) -> Made:
    fitted = result.to_lpv(effort.fit_degree)
    figures = _told(result) | {"fit_error": fitted.fit_error, "order": fitted.n_x}
    return Made(
        figures=figures,
        plants=plants,
        controller=lambda where: list(zip(*fitted.sample(where), strict=True)),
        fitted=fitted,
    )


def _told(result: LPVSynthesisResult) -> dict[str, Any]:
    return {
        "gamma": result.gamma,
        "gamma_lower": result.gamma_lower,
        "gamma_achieved": result.gamma_achieved,
        "lmi_margin": result.lmi_margin,
        "bound_activity": max(result.bound_activity.values()),
        "fastest_pole": result.fastest_pole,
        "status": result.status,
    }


def judged(problem: Problem, made: Made, n: int, omega: Array, progress: Progress) -> tuple[dict[str, Any], Array]:
    """Norms at n positions between the grid points, of the design plant and in truth; singular values in truth.

    The design plant is judged with W_a, the truth without: there the discarded modes are part of the plant.
    """
    assert made.plants is not None
    assert made.controller is not None
    points = spread_points(problem.box, n)
    controllers = made.controller(points)
    near = [_norm(P.close(*K)) for P, K in zip(made.plants(points), controllers, strict=True)]
    plants = [problem.performance(P) for P in made.plants(points, truth=True)]
    loops = [P.close(*K) for P, K in zip(plants, controllers, strict=True)]
    true = np.array([_norm(loop) for loop in loops])
    progress.update(worst=float(true.max()))
    figures = {
        "n_positions": n,
        "near_stable": int(np.sum(np.isfinite(near))),
        "near_worst": float(np.max(near)),
        "true_stable": int(np.sum(np.isfinite(true))),
        "true_worst": float(true.max()),
        "true_median": float(np.median(true)),
    }
    sigma = np.zeros((min(n, 25), len(omega)))
    for row, (A, B, C, D) in zip(sigma, loops, strict=False):
        for k, w in enumerate(omega):
            row[k] = np.linalg.norm(C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D, 2)
    stable = np.isfinite(true[: len(sigma)])
    return figures, np.where(stable[:, None], sigma, np.nan)


def _norm(loop: Matrices) -> float:
    """The H-infinity norm; infinity for a loop that is not stable."""
    return hinf_norm(*loop).norm if np.max(np.linalg.eigvals(loop[0]).real) < 0.0 else np.inf
