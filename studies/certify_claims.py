"""One claim about one design: prove it, save the certificate, check it again from the file."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lpvhinf.certify import (
    Certificate,
    Refutation,
    Undecided,
    l2_gain,
    largest_quadratic_box,
    largest_rate,
    smallest_gain,
    stability,
)
from lpvhinf.certify.largest import Strongest
from lpvhinf.certify.refute import UnstablePosition
from lpvhinf.certify.refute_gain import LargeGain
from lpvhinf.certify.verdict import recheck
from lpvhinf.checks import Array
from lpvhinf.lpv.bounded_real import frozen_norm
from lpvhinf.progress import Progress
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import read_json
from studies.plant_results import Found
from studies.positions import grid

if TYPE_CHECKING:
    from studies.certify import Job, Settings

CERTIFICATE = "certificate.npz"
ZOOMS = 6  # halvings of the step around the worst position of the grid
Result = Certificate | Refutation | Undecided


def carry_out(settings: Settings, job: Job, folder: Path, progress: Progress) -> tuple[Found, dict[str, Any] | None]:
    """What was found about a claim, and its saved and checked certificate."""
    system = LPVStateSpace.load(job.loop)
    (folder / CERTIFICATE).unlink(missing_ok=True)  # of an earlier run with other settings
    began = time.process_time()
    proof, values = WORK[job.kind](settings, job, system, progress)
    values["cpu_s"] = time.process_time() - began
    values |= {"n_x": system.n_x, "box": system.box, **of_the_design(job)}
    arrays: dict[str, Any] = {"box": system.box}
    arrays |= values.pop("map", {})
    if proof is None:
        return Found(values=values, arrays=arrays), None
    path = folder / CERTIFICATE
    proof.save(path)
    progress.stage("checking the certificate from its file")
    began = time.process_time()
    verdict = recheck(path, system=job.loop)
    certificate = {
        "claim": str(proof.claim),
        "confirmed": verdict.proved,
        "message": verdict.message,
        "cells": proof.n_cells,
        "margin": proof.margin,
        "bytes": path.stat().st_size,
        "check_cpu_s": time.process_time() - began,
    }
    if not verdict.proved:
        values |= {"outcome": "not confirmed", "reason": verdict.message}
    arrays |= {"cells": proof.cells, "margins": proof.margins}
    return Found(values=values, arrays=arrays), certificate


def of_the_design(job: Job) -> dict[str, Any]:
    """What the design's own study measured: error of the plant's fit, least stable pole; None where it says nothing."""
    summary = read_json(job.folder / "summary.json")
    return {name: summary.get(name) for name in ("fit_error", "largest_real_part", "n_dense")}


def described(result: Result) -> dict[str, Any]:
    """The outcome of one attempt, its evidence, and the map of what is open."""
    if isinstance(result, Certificate):
        return {"outcome": "proved", "reason": ""}
    if isinstance(result, Refutation):
        return {"outcome": "refuted", "reason": evidence(result.evidence)}
    return {
        "outcome": "undecided",
        "reason": result.reason,
        "proved_share": result.proved_share,
        "map": {"remaining": result.remaining, "proved": result.proved},
    }


def evidence(found: Any) -> str:
    """Evidence in words."""
    if isinstance(found, UnstablePosition):
        return (
            f"eigenvalue {found.eigenvalue:.6g} 1/s (radius {found.radius:.1e}) at p = "
            f"{np.array2string(found.position, precision=6)}"
        )
    if isinstance(found, LargeGain):
        where = np.array2string(found.position, precision=6)
        return f"gain {found.gain:.6g} at p = {where}, {found.omega / (2 * np.pi):.4g} Hz"
    return f"multipliers Z_k at {len(found.positions)} positions exclude a common Lyapunov matrix"


def _one(result: Result) -> tuple[Certificate | None, dict[str, Any]]:
    return (result if isinstance(result, Certificate) else None), described(result)


def _frozen(
    settings: Settings, job: Job, system: LPVStateSpace, progress: Progress
) -> tuple[Certificate | None, dict[str, Any]]:
    return _one(stability(system, time_limit=settings.time_limit, progress=progress))


def _rate(
    settings: Settings, job: Job, system: LPVStateSpace, progress: Progress
) -> tuple[Certificate | None, dict[str, Any]]:
    result = stability(system, kind="rate", rate=job.rate, time_limit=settings.time_limit, progress=progress)
    return _one(result)


def _family(found: Strongest) -> tuple[Certificate | None, dict[str, Any]]:
    """The strongest proved claim of a family, and why the next is not."""
    values = {"value": found.value, "failed_value": found.failed_value, "n_tried": found.n_tried}
    if found.failed is not None:
        beyond = described(found.failed)
        values |= {"beyond": beyond["outcome"], "reason": beyond["reason"]}
    if found.proof is not None:
        return found.proof, {"reason": "", **values, "outcome": "proved"}
    assert found.failed is not None
    return None, {**values, **described(found.failed)}


def _fastest(
    settings: Settings, job: Job, system: LPVStateSpace, progress: Progress
) -> tuple[Certificate | None, dict[str, Any]]:
    least, most = settings.fastest
    steps, limit = settings.fastest_steps, settings.time_limit
    return _family(largest_rate(system, least=least, most=most, steps=steps, time_limit=limit, progress=progress))


def _quadratic(
    settings: Settings, job: Job, system: LPVStateSpace, progress: Progress
) -> tuple[Certificate | None, dict[str, Any]]:
    limit = settings.time_limit
    return _family(largest_quadratic_box(system, steps=settings.box_steps, time_limit=limit, progress=progress))


def _gain(
    settings: Settings, job: Job, system: LPVStateSpace, progress: Progress
) -> tuple[Certificate | None, dict[str, Any]]:
    progress.stage("largest norm over P")
    found, where = worst_norm(system, settings.gain_grid)
    values: dict[str, Any] = {"found": found, "found_position": where}
    if not np.isfinite(found):
        return None, {**values, "outcome": "undecided", "reason": "unstable at a position: see the claim frozen"}
    gamma, limit = settings.gain_factor * found, settings.time_limit
    if settings.gain_steps == 0:
        proof, more = _one(l2_gain(system, gamma, time_limit=limit, progress=progress))
        return proof, {**values, "value": None if proof is None else gamma, **more}
    proof, more = _family(
        smallest_gain(system, least=found, most=gamma, steps=settings.gain_steps, time_limit=limit, progress=progress)
    )
    return proof, {**values, **more}


def worst_norm(system: LPVStateSpace, steps: int) -> tuple[float, Array]:
    """The largest H-infinity norm found, on a grid and then closer and closer around its worst position."""
    box = system.box
    width = (box[:, 1] - box[:, 0]) / (steps - 1)

    def best_of(points: Array) -> tuple[float, Array]:
        norms = [frozen_norm(*matrices) for matrices in zip(*system.sample(points), strict=True)]
        k = int(np.argmax(norms))
        return float(norms[k]), points[k]

    best, where = best_of(grid(box, steps))
    unit = grid(np.tile([-1.0, 1.0], (len(box), 1)), 3)
    for _ in range(ZOOMS):
        if not np.isfinite(best):
            break
        width = 0.5 * width
        points = np.unique(np.clip(where + unit * width, box[:, 0], box[:, 1]), axis=0)
        value, place = best_of(points)
        if value > best:
            best, where = value, place
    return best, where


WORK: dict[str, Callable[[Any, Any, LPVStateSpace, Progress], tuple[Certificate | None, dict[str, Any]]]] = {
    "frozen": _frozen,
    "rate": _rate,
    "fastest": _fastest,
    "quadratic": _quadratic,
    "gain": _gain,
}
