"""The COMPleib systems with the norms known for them, and one run of the solver."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.hinfstruct.measuring import Stopwatch, finished, slicot_ratio
from lpvhinf.errors import LpvHinfError, StorageError
from lpvhinf.hinfstruct import ControllerStructure, FixedOrder, StaticGain, hinfstruct
from lpvhinf.statespace.generalized import GeneralizedPlant

MATRICES = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")
#: Systems that are solved with controllers of order 1 and 2 too.
DYNAMIC = ("AC4", "AC7", "HE1", "NN2")


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A system, the controller's order, the seed, and what is known; NaN where nothing is."""

    name: str
    order: int
    seed: int
    best_known: float
    hifoo: float
    hifoo_cpu: float

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return self.name, self.order, self.seed


@dataclass(frozen=True, kw_only=True)
class CompleibRun:
    """The outcome of one seed; `ratio` is gamma over the best known norm, `slicot` SLICOT's norm over gamma."""

    name: str
    order: int
    seed: int
    gamma: float
    ratio: float
    best_known: float
    hifoo: float
    hifoo_cpu: float
    wall: float
    cpu: float
    trials: int
    exact: int
    slicot: float
    largest_parameter: float
    status: str

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return self.name, self.order, self.seed

    def __str__(self) -> str:
        return (
            f"{self.name:6} order {self.order} seed {self.seed}: gamma {self.gamma:.6g}, ratio {self.ratio:.4f}, "
            f"{self.cpu:.1f} s"
        )


def problems(folder: Path, seeds: Iterable[int]) -> list[Problem]:
    """For every seed static output feedback for every system, then orders 1 and 2 for a few.

    Raises
    ------
    StorageError
        If the folder has no reference.json that can be read.
    """
    try:
        systems = json.loads((folder / "reference.json").read_text("utf-8"))["systems"]
    except (OSError, ValueError, KeyError) as error:
        raise StorageError(f"{folder}/reference.json cannot be read: {error}. Name the folder by --data.") from error
    out = []
    for seed in seeds:
        for name, known in systems.items():
            hifoo = known.get("hifoo", {})
            out.append(
                Problem(
                    name=name,
                    order=0,
                    seed=seed,
                    best_known=float(known["best_known_gamma"]),
                    hifoo=float(hifoo.get("gamma", np.nan)),
                    hifoo_cpu=float(hifoo.get("cpu_s", np.nan)),
                )
            )
        nothing = {"best_known": np.nan, "hifoo": np.nan, "hifoo_cpu": np.nan}
        out += [Problem(name=n, order=k, seed=seed, **nothing) for n in DYNAMIC if n in systems for k in (1, 2)]
    return out


def load(folder: Path, name: str) -> GeneralizedPlant:
    """One system; u = + K y."""
    with np.load(folder / f"{name}.npz") as data:
        return GeneralizedPlant(*[data[key] for key in MATRICES])


def solve(plant: GeneralizedPlant, problem: Problem) -> CompleibRun:
    """Solve with the default settings; the norm is checked by SLICOT on the closed loop."""
    n_u, n_y = plant.n_u, plant.n_y
    structure: ControllerStructure = FixedOrder(problem.order, n_u, n_y) if problem.order else StaticGain(n_u, n_y)
    gamma, slicot, trials, exact, largest = np.inf, np.nan, 0, 0, np.nan
    watch = Stopwatch()
    try:
        result = hinfstruct(plant, structure, seed=problem.seed)
    except LpvHinfError as error:
        (wall, cpu), status = watch.read(), f"{type(error).__name__}: {error}"
    else:
        (wall, cpu), status, gamma = watch.read(), result.status, result.gamma
        trials, exact = result.evaluations.trials, result.evaluations.exact
        largest = float(np.max(np.abs(result.parameters)))
        finished(result.interrupted)
        slicot = slicot_ratio([plant.close(*structure.realize(result.parameters))], [gamma])
    return CompleibRun(
        name=problem.name,
        order=problem.order,
        seed=problem.seed,
        gamma=gamma,
        ratio=gamma / problem.best_known,
        best_known=problem.best_known,
        hifoo=problem.hifoo,
        hifoo_cpu=problem.hifoo_cpu,
        wall=wall,
        cpu=cpu,
        trials=trials,
        exact=exact,
        slicot=slicot,
        largest_parameter=largest,
        status=status,
    )
