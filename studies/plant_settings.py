"""Settings of the study of the plant, the actuator that they name, and the positions at which it is looked at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lpvhinf.checks import Array, finite_array, points_in_box, positive, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa import MMPA, MMPAParameters, benchmark
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS

N_SHAPES = 6  # flexible modes whose shapes are drawn; the condition number takes five of them


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    magnetics: str
    n_plant_modes: int
    n_flex: int
    n_flexes: tuple[int, ...]
    degrees: tuple[int, ...]
    n_random: int
    windows: tuple[Any, ...]
    window_degree: int
    mode_weights: tuple[float, ...]
    acceleration: float
    position: tuple[float, ...]
    grid: int
    map_grid: int
    shape_grid: int
    frf_grid: int
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        if self.magnetics not in KINDS:
            raise DomainError(f"magnetics is {self.magnetics!r}, wanted one of {', '.join(KINDS)}.")
        whole_number("n_plant_modes", self.n_plant_modes, N_SHAPES)
        positive("acceleration", self.acceleration, "m/s2")
        for name in ("n_flex", "n_random", "map_grid", "shape_grid", "frf_grid", "grid"):
            whole_number(name, getattr(self, name), 1 if name in ("n_flex", "n_random", "frf_grid") else 2)
        for name, least in (("window_degree", 0), ("seed", 0), ("jobs", 1)):
            whole_number(name, getattr(self, name), least)
        for name in ("n_flexes", "degrees"):
            _check_list(name, getattr(self, name))
            for value in getattr(self, name):
                whole_number(name, value, 0)
        for name in ("n_flex", "n_flexes"):
            if np.max(getattr(self, name)) > self.n_plant_modes:
                raise DomainError(
                    f"{name} is {getattr(self, name)}, wanted at most n_plant_modes = {self.n_plant_modes}."
                )
        _check_list("mode_weights", self.mode_weights)
        if np.any(finite_array("mode_weights", self.mode_weights, (None,)) <= 0.0):
            raise DomainError(f"mode_weights is {self.mode_weights}, wanted values above 0.")
        points_in_box(finite_array("position", self.position, (2,)), MMPAParameters().box, name="position")
        finite_array("windows", self.windows, (None, 5))
        _check_list("windows", self.windows)
        for window in self.windows:
            windowed(window)


def _check_list(name: str, value: object) -> None:
    if not isinstance(value, tuple) or not value:
        raise DomainError(f"{name} is {value!r}, wanted a list of at least one value.")


def windowed(window: Any) -> MMPAParameters:
    """The benchmark's parameters with other windows: inner and outer distance, short and long axis [m]; order."""
    short_inner, short_outer, long_inner, long_outer, order = (float(x) for x in window)
    return MMPAParameters(
        window_short=(short_inner, short_outer),
        window_long=(long_inner, long_outer),
        window_order=order,  # type: ignore[arg-type]
    )


def actuator(settings: Settings) -> MMPA:
    """The plant of the study; in one process the same object every time, as its tables are large."""
    return _actuator(settings.magnetics, settings.n_plant_modes)


@lru_cache(maxsize=1)
def _actuator(magnetics: str, n_flex: int) -> MMPA:
    return benchmark(n_flex=n_flex, magnetics=magnetics)


def random_positions(settings: Settings, box: Array) -> Array:
    """Positions that no fit has seen, (n_random, n_p)."""
    rng = np.random.default_rng(settings.seed)
    return np.asarray(rng.uniform(box[:, 0], box[:, 1], (settings.n_random, len(box))))
