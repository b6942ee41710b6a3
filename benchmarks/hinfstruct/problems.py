"""The COMPleib systems with the norms known for them, and one run of the solver."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lpvhinf.errors import LpvHinfError, StorageError
from lpvhinf.hinfstruct import ControllerStructure, FixedOrder, StaticGain, hinf_norm, hinfstruct
from lpvhinf.statespace.generalized import GeneralizedPlant

MATRICES = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")
#: Systems that are solved with controllers of order 1 and 2 too.
DYNAMIC = ("AC4", "AC7", "HE1", "NN2")


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A system, the controller's order, and what is known; NaN where nothing is."""

    name: str
    order: int
    best_known: float
    hifoo: float
    hifoo_cpu: float


@dataclass(frozen=True, kw_only=True)
class Run:
    """The outcome of one seed; `ratio` is gamma over the best known norm, `slicot` that of our norm by SLICOT."""

    name: str
    order: int
    seed: int
    gamma: float
    ratio: float
    best_known: float
    hifoo: float
    hifoo_cpu: float
    cpu: float
    trials: int
    exact: int
    slicot: float
    largest_parameter: float
    status: str


def problems(folder: Path) -> list[Problem]:
    """Static output feedback for every system, then orders 1 and 2 for a few.

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
    for name, known in systems.items():
        hifoo = known.get("hifoo", {})
        out.append(
            Problem(
                name=name,
                order=0,
                best_known=float(known["best_known_gamma"]),
                hifoo=float(hifoo.get("gamma", np.nan)),
                hifoo_cpu=float(hifoo.get("cpu_s", np.nan)),
            )
        )
    nothing = {"best_known": np.nan, "hifoo": np.nan, "hifoo_cpu": np.nan}
    return out + [Problem(name=n, order=k, **nothing) for n in DYNAMIC if n in systems for k in (1, 2)]


def load(folder: Path, name: str) -> GeneralizedPlant:
    """One system; u = + K y."""
    with np.load(folder / f"{name}.npz") as data:
        return GeneralizedPlant(*[data[key] for key in MATRICES])


def solve(plant: GeneralizedPlant, problem: Problem, seed: int) -> Run:
    """Solve with the default settings; the norm is checked by SLICOT on the closed loop."""
    n_u, n_y = plant.n_u, plant.n_y
    structure: ControllerStructure = FixedOrder(problem.order, n_u, n_y) if problem.order else StaticGain(n_u, n_y)
    gamma, slicot, trials, exact, largest = np.inf, np.nan, 0, 0, np.nan
    began = time.process_time()
    try:
        result = hinfstruct(plant, structure, seed=seed)
    except LpvHinfError as error:
        cpu, status = time.process_time() - began, f"{type(error).__name__}: {error}"
    else:
        cpu, status, gamma = time.process_time() - began, result.status, result.gamma
        trials, exact = result.evaluations.trials, result.evaluations.exact
        largest = float(np.max(np.abs(result.parameters)))
        K = result.controller
        slicot = independent_norm(plant.close(K.A, K.B, K.C, K.D)) / gamma
    return Run(
        name=problem.name,
        order=problem.order,
        seed=seed,
        gamma=gamma,
        ratio=gamma / problem.best_known,
        best_known=problem.best_known,
        hifoo=problem.hifoo,
        hifoo_cpu=problem.hifoo_cpu,
        cpu=cpu,
        trials=trials,
        exact=exact,
        slicot=slicot,
        largest_parameter=largest,
        status=status,
    )


def independent_norm(loop: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]) -> float:
    """The norm by SLICOT's AB13DD alone; by the package's own iteration where slycot is missing."""
    A, B, C, D = loop
    try:
        import slycot
    except ImportError:
        return hinf_norm(A, B, C, D).norm
    n = A.shape[0]
    return float(slycot.ab13dd("C", "I", "N", "D", n, B.shape[1], C.shape[0], A, np.eye(n), B, C, D, 1e-10)[0])
