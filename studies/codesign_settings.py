"""What the settings of every study of co-designs have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import finite_array, positive, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS


@dataclass(frozen=True, kw_only=True)
class CodesignSettings:
    """Plant, specification, search and measurement of the designs; see the presets for their meaning."""

    f_bw: float
    n_flex: int
    n_plant_modes: int
    epsilon: float
    epsilons: tuple[float, ...]
    degree: int
    n_positions: int
    exchange_rounds: int
    n_search: int
    starts: int
    max_iterations: int
    stability_grid: int
    measure_grid: int
    response_grid: int
    magnetics: str = "exact"
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        for name in ("f_bw", "epsilon"):
            positive(name, getattr(self, name))
        if np.any(finite_array("epsilons", self.epsilons, (None,)) <= 0.0):
            raise DomainError(f"epsilons is {self.epsilons}, wanted values above 0.")
        for name in ("degree", "exchange_rounds", "seed"):
            whole_number(name, getattr(self, name), 0)
        for name in ("n_flex", "n_plant_modes", "n_positions", "n_search", "starts", "max_iterations", "jobs"):
            whole_number(name, getattr(self, name), 1)
        for name in ("stability_grid", "measure_grid", "response_grid"):
            whole_number(name, getattr(self, name), 1)
        if self.magnetics not in KINDS:
            raise DomainError(f"magnetics is {self.magnetics!r}, wanted one of {', '.join(KINDS)}.")
