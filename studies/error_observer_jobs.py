"""The designs of the study of the error-based observer, and the settings that ask for them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

import lpvhinf
from lpvhinf.checks import finite_array, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.problems import SIX_BLOCK, TWO_BY_TWO
from studies.codesign_settings import CodesignSettings
from studies.settings import fingerprint

INACTIVE = "inactive"
ARCHITECTURES = {"conventional": "rigid-body", "output": "output-observer", "error": "error-observer"}
OBSERVERS = ("error", "output")
# What a job has of its own, or what decides only which jobs there are.
NOT_OF_A_DESIGN = ("f_bw", "n_flex", "epsilon", "epsilons", "seed", "seeds", "mode_counts", "bandwidths", "jobs")


@dataclass(frozen=True, kw_only=True)
class Settings(CodesignSettings):
    """Settings of the study; see the presets for their meaning."""

    seeds: int = 1
    mode_counts: tuple[int, ...] = ()
    bandwidths: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        whole_number("seeds", self.seeds, 1)
        if self.epsilon not in self.epsilons:
            raise DomainError(f"epsilon is {self.epsilon}, wanted one of epsilons = {self.epsilons}.")
        for n in self.mode_counts:
            whole_number("mode_counts", n, 1)
        if len(self.bandwidths) and np.any(finite_array("bandwidths", self.bandwidths, (None,)) <= 0.0):
            raise DomainError(f"bandwidths is {self.bandwidths}, wanted values above 0.")


@dataclass(frozen=True, kw_only=True)
class Job:
    """One design of the study.

    Attributes
    ----------
    group : str
        "trade-off", "modes" or "seeds": the part of the report that it belongs to.
    problem : str
        What it is tuned for.
    start : str, optional
        The design whose K_RB and positions it begins with.
    """

    name: str
    group: str
    architecture: str
    problem: str
    epsilon: float
    f_bw: float
    n_flex: int
    seed: int
    start: str | None = None

    @property
    def measured(self) -> tuple[str, ...]:
        """The problems whose columns are measured, whatever it was tuned for."""
        return (TWO_BY_TWO, SIX_BLOCK) if self.group == "modes" else (TWO_BY_TWO,)


def jobs_of(settings: Settings) -> tuple[list[Job], list[Job]]:
    """The designs of K_RB alone, and the observer designs that start from them."""
    alone: list[Job] = []
    observers: list[Job] = []

    def add(group: str, problems: tuple[str, ...], names: dict[str, str], **values: float) -> None:
        """One design of K_RB, and one of each observer that is named, for each its problem."""
        f_bw, n_flex = values.get("f_bw", settings.f_bw), int(values.get("n_flex", settings.n_flex))
        seed, epsilon = int(values.get("seed", settings.seed)), values.get("epsilon", settings.epsilon)
        for (role, name), problem in zip(names.items(), problems, strict=True):
            first = role == "conventional"
            job = Job(
                name=name,
                group=group,
                architecture=ARCHITECTURES[role],
                problem=problem,
                epsilon=epsilon,
                f_bw=f_bw,
                n_flex=n_flex,
                seed=seed,
                start=None if first else names.get("conventional", INACTIVE),
            )
            (alone if first else observers).append(job)

    add("trade-off", (TWO_BY_TWO,), {"conventional": INACTIVE})
    for epsilon in sorted(settings.epsilons, reverse=True):  # the most demanding first: they take longest
        names = {role: f"{role}-epsilon-{epsilon:g}" for role in OBSERVERS}
        add("trade-off", (TWO_BY_TWO,) * 2, names, epsilon=epsilon)
    for f_bw in settings.bandwidths:
        for n_flex in settings.mode_counts:
            names = {role: f"{role}-{f_bw:g}Hz-{n_flex}" for role in ARCHITECTURES}
            add("modes", (SIX_BLOCK, SIX_BLOCK, TWO_BY_TWO), names, f_bw=f_bw, n_flex=n_flex)
    for k in range(1, settings.seeds):
        names = {"conventional": f"{INACTIVE}-seed-{k}"} | {role: f"{role}-seed-{k}" for role in OBSERVERS}
        add("seeds", (TWO_BY_TWO,) * 3, names, seed=settings.seed + k)
    return alone, observers


def key_of(settings: Settings, job: Job) -> str:
    """A key of everything that a stored design depends on."""
    ours = {name: value for name, value in dataclasses.asdict(settings).items() if name not in NOT_OF_A_DESIGN}
    return fingerprint(ours, job, lpvhinf.__version__)
