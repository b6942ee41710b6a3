"""Thousands of perturbed plants under one controller, drawn at random."""

from __future__ import annotations

import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array, whole_number
from lpvhinf.codesign import Design
from lpvhinf.errors import DomainError
from lpvhinf.jobs import run_jobs
from lpvhinf.progress import SILENT, Progress
from lpvhinf.robustness.chunk_store import ChunkStore, fingerprint
from lpvhinf.robustness.controlled_plant import ControlledPlant
from lpvhinf.robustness.outcomes import BETTER, Analysis, Outcomes
from lpvhinf.robustness.samples import Samples
from lpvhinf.robustness.uncertainty import Uncertainty

CHUNK = 50  # plants to a file
NORMS = ("sensitivity", "flexible_peak")


@dataclass(frozen=True, kw_only=True, eq=False)
class MonteCarlo:
    """What `monte_carlo` returns.

    Attributes
    ----------
    subject : ControlledPlant
        The plant before it was perturbed, and its controller.
    uncertainty : Uncertainty
    seed : int
    unit : (n, dimension)
        The points of the unit cube that were drawn.
    samples : Samples
        The perturbed plants.
    outcomes : Outcomes
        What became of them; norms by tracked peaks, those of the plants in `recomputed` exactly.
    recomputed : (k,) int
        The plants with the largest norms of the stable ones.
    largest_correction : float
        Largest relative change of a norm by its exact computation.
    """

    subject: ControlledPlant
    uncertainty: Uncertainty
    seed: int
    unit: Array
    samples: Samples
    outcomes: Outcomes
    recomputed: NDArray[np.intp]
    largest_correction: float

    def __len__(self) -> int:
        return len(self.samples)

    def worst(self, figure: str, n: int = 1) -> NDArray[np.intp]:
        """Indices of the n worst plants by a figure of `Outcomes`, the worst first."""
        values = self.outcomes.figure(figure) * BETTER[figure]
        return np.argsort(values, kind="stable")[:n]


def monte_carlo(
    design: Design | ControlledPlant,
    uncertainty: Uncertainty | None = None,
    n: int = 10_000,
    *,
    seed: int = 0,
    n_exact: int = 10,
    jobs: int = 1,
    progress: Progress = SILENT,
    store: str | os.PathLike[str] | None = None,
) -> MonteCarlo:
    """Close the loop around `n` random plants, each at a random position.

    The plants are those of `Uncertainty.samples` at points that are uniform in the unit cube. Plant i of a seed is the
    same for every n and any number of jobs.

    Parameters
    ----------
    design : Design or ControlledPlant
        The controller and the plant that it was made for; T_y, T_u and the observer stay those of the known plant.
    uncertainty : Uncertainty, optional
        Ranges; the default ones if left out.
    n : int
        Number of plants.
    seed : int
    n_exact : int
        Norms of this many worst plants are computed exactly, for each norm.
    jobs : int
        Processes.
    progress : Progress
    store : path, optional
        A folder that takes every finished chunk of plants. A run with the same arguments goes on from there, also for
        another `n` or number of jobs.

    Raises
    ------
    DomainError
        If a number is not a whole one of its range, `design` is neither, or the plant cannot be sent to
        another process.
    StorageError
        If `store` belongs to another run.
    """
    subject, given = ControlledPlant.of(design), Uncertainty() if uncertainty is None else uncertainty
    whole_number("n", n, 1)
    whole_number("seed", seed, 0)
    whole_number("n_exact", n_exact, 0)
    whole_number("jobs", jobs, 1)
    unit = np.random.default_rng(seed).random((n, given.dimension(subject.plant)))
    chunks = {k: min(CHUNK, n - start) for k, start in enumerate(range(0, n, CHUNK))}
    kept = None if store is None else ChunkStore.open(Path(store), fingerprint(subject, given, seed))
    found: dict[int, Outcomes] = {}
    if kept is not None:
        stored = {k: kept.read(k, length) for k, length in chunks.items()}
        found = {k: outcomes for k, outcomes in stored.items() if outcomes is not None}
    missing = [k for k in chunks if k not in found]
    if found:
        progress.log(f"{sum(chunks[k] for k in found)} of {n} plants are there already")
    progress.stage("perturbed plants", sum(chunks[k] for k in missing))
    share = min(jobs, max(1, len(missing)))
    payload: Any = (subject, given) if share == 1 else _packed(subject, given)
    tasks = []
    for i in range(share):
        own = missing[i::share]  # every process gets plants of all parts of the run
        points = {k: unit[k * CHUNK : k * CHUNK + chunks[k]] for k in own}
        tasks.append((f"plants {i + 1}/{share}", (payload, points, kept)))
    for part in run_jobs(_run_chunks, tasks, jobs=share, progress=progress):
        found |= part
    outcomes = Outcomes.join([found[k] for k in chunks])
    samples = given.samples(subject.plant, unit)
    recomputed, outcomes, correction = _with_exact_norms(Analysis(subject, given), samples, outcomes, n_exact)
    return MonteCarlo(
        subject=subject,
        uncertainty=given,
        seed=seed,
        unit=unit,
        samples=samples,
        outcomes=outcomes,
        recomputed=recomputed,
        largest_correction=correction,
    )


def _packed(subject: ControlledPlant, uncertainty: Uncertainty) -> bytes:
    """Both as bytes for another process, once for all of them."""
    try:
        return pickle.dumps((subject, uncertainty), protocol=pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise DomainError(
            f"jobs is above 1, but the plant cannot be sent to another process: {error}. "
            "Use jobs=1, or build the plant from functions and classes of a module."
        ) from error


def _run_chunks(
    payload: Any, points: dict[int, Array], store: ChunkStore | None, progress: Progress
) -> dict[int, Outcomes]:
    """The outcomes of some chunks, stored one by one."""
    subject, uncertainty = pickle.loads(payload) if isinstance(payload, bytes) else payload
    analysis = Analysis(subject, uncertainty)
    total, done, worst, out = sum(map(len, points.values())), 0, -np.inf, {}
    for count, (k, unit) in enumerate(points.items()):
        out[k] = analysis.measure(uncertainty.samples(subject.plant, unit))
        if store is not None:
            store.write(k, out[k])
        done, worst = done + len(unit), max(worst, float(np.max(out[k].abscissa)))
        progress.update(len(unit), largest_real_part=worst)
        if len(points) >= 20 and (count + 1) % (len(points) // 10) == 0:
            progress.log(f"{done} of {total} plants, largest real part {worst:.4g} 1/s")
    return out


def _with_exact_norms(
    analysis: Analysis, samples: Samples, outcomes: Outcomes, n_exact: int
) -> tuple[NDArray[np.intp], Outcomes, float]:
    """The outcomes with exact norms of the plants with the largest ones, which these are, and the largest change."""
    chosen: set[int] = set()
    for name in NORMS:
        values = outcomes.figure(name)
        stable = np.flatnonzero(np.isfinite(values))  # an unstable loop has no norm to compute
        chosen |= set(stable[np.argsort(-values[stable], kind="stable")[:n_exact]].tolist())
    which = np.array(sorted(chosen), dtype=np.intp)
    if len(which) == 0:
        return which, outcomes, 0.0
    exact = analysis.measure(samples.take(which), NORMS, exact=True).arrays()
    arrays, correction = {name: values.copy() for name, values in outcomes.arrays().items()}, 0.0
    for name in NORMS:
        before = arrays[name][which]
        if before.size:
            correction = max(correction, float(np.max(np.abs(exact[name] - before) / before)))
        arrays[name][which] = exact[name]
    return which, Outcomes(**arrays), correction
