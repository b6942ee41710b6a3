"""Co-designs of the planar actuator over the whole box: the cases, and one run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.hinfstruct.measuring import Stopwatch, finished, slicot_ratio
from benchmarks.hinfstruct.out_of_plane import out_of_plane
from lpvhinf.codesign import Specification, codesign
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import LpvHinfError
from lpvhinf.plant.mmpa import MMPA, benchmark

ARCHITECTURES = ("rigid-body", "output-observer")


@dataclass(frozen=True, kw_only=True)
class Setting:
    """The plant and the design: flexible modes in all, the field, the degree of the polynomial model, options."""

    modes: int = 15
    magnetics: str = "exact"
    degree: int = 48
    f_bw: float = 40.0
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)


FULL = Setting()
#: A coarse one, to try the command.
TINY = Setting(
    modes=3,
    magnetics="first-harmonic",
    degree=6,
    options={"n_positions": 2, "starts": 1, "exchange_rounds": 0, "n_search": 4, "max_iterations": 3},
)


@dataclass(frozen=True, kw_only=True)
class Case:
    """Axes, preserved modes and architecture of a co-design."""

    axes: int
    n_flex: int
    architecture: str
    setting: Setting

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return self.axes, self.n_flex, self.architecture, self.setting.modes, self.setting.magnetics


@dataclass(frozen=True, kw_only=True)
class ActuatorRun:
    """The outcome of one co-design.

    `states` of the closed loop without, `states_weighted` with shaping filters. `gamma` counts over the `positions`
    of the active set, `gamma_worst` over P, as far as searched; `slicot` is SLICOT's norm over the one reported, of
    the position where it is farthest from one. `exact` norms were taken; `every_model` those of a solver that evaluates
    every model at every step, `saving` their ratio. `fit` [s] is the polynomial model of the plant, made before and not
    in `wall`; `fit_observer` [s] that of the observer, which `wall` contains.
    """

    axes: int
    n_flex: int
    architecture: str
    modes: int
    magnetics: str
    states: int
    states_weighted: int
    parameters: int
    positions: int
    gamma: float
    gamma_worst: float
    optimality: float
    slicot: float
    exact: int
    every_model: int
    saving: float
    jobs: int
    wall: float
    cpu: float
    fit: float
    fit_observer: float
    status: str

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return self.axes, self.n_flex, self.architecture, self.modes, self.magnetics

    def __str__(self) -> str:
        return (
            f"{self.axes} axes, {self.n_flex} preserved, {self.architecture}: gamma {self.gamma:.4f}, over P "
            f"{self.gamma_worst:.4f}, {self.wall:.1f} s, CPU {self.cpu:.1f} s (fit {self.fit:.1f} s)"
        )


def cases(setting: Setting) -> list[Case]:
    """6 and 3 axes, 1 and 3 preserved modes, without and with the observer."""
    return [
        Case(axes=axes, n_flex=n_flex, architecture=architecture, setting=setting)
        for axes in (6, 3)
        for n_flex in (1, 3)
        for architecture in ARCHITECTURES
    ]


def solve(case: Case, *, jobs: int) -> ActuatorRun:
    """Design; the norms over the active set are checked by SLICOT on the closed loops."""
    setting = case.setting
    decoupled, fit = _decoupled(setting, case.axes, case.n_flex)
    specification = Specification(f_bw=setting.f_bw)
    found: dict[str, Any] = {"states": 0, "states_weighted": 0, "parameters": 0, "positions": 0}
    found |= {"gamma": np.inf, "gamma_worst": np.inf, "optimality": np.nan, "slicot": np.nan, "fit_observer": 0.0}
    found |= {"exact": 0, "every_model": 0, "saving": np.nan}
    watch = Stopwatch()
    try:
        design = codesign(decoupled, case.architecture, specification, jobs=jobs, **setting.options)
    except LpvHinfError as error:
        (wall, cpu), status = watch.read(), f"{type(error).__name__}: {error}"
    else:
        (wall, cpu), status = watch.read(), design.status
        finished(design.status.startswith("interrupted"))
        K = design.assembly.structure.realize(design.parameters)
        loops = [plant.close(*K) for plant in design.assembly.generalized_plants(design.positions)]
        first = design.positions[:1]
        anew, again = dataclasses.replace(design.assembly), Stopwatch()
        observed = anew.observer is not None
        found |= {
            "fit_observer": again.read()[0] if observed else 0.0,
            "states": len(design.frozen(first)[0][0]),
            "states_weighted": len(loops[0][0]),
            "parameters": len(design.parameters),
            "positions": len(design.positions),
            "gamma": design.gamma,
            "gamma_worst": design.gamma_worst,
            "optimality": design.optimality,
            "slicot": slicot_ratio(loops, design.gammas),
            "exact": design.evaluations.exact,
            "every_model": design.evaluations.every_model,
            "saving": design.evaluations.every_model / design.evaluations.exact,
        }
    return ActuatorRun(
        axes=case.axes,
        n_flex=case.n_flex,
        architecture=case.architecture,
        modes=setting.modes,
        magnetics=setting.magnetics,
        jobs=jobs,
        wall=wall,
        cpu=cpu,
        fit=fit,
        status=status,
        **found,
    )


@lru_cache(maxsize=1)
def _plant(setting: Setting) -> MMPA:
    return benchmark(n_flex=setting.modes, magnetics=setting.magnetics)


@lru_cache(maxsize=1)
def _decoupled(setting: Setting, axes: int, n_flex: int) -> tuple[DecoupledPlant, float]:
    """The decoupled plant, and seconds for its polynomial model."""
    plant = _plant(setting)
    if axes == 6:
        decoupled = decouple(plant, n_flex=n_flex, degree=setting.degree)
    else:
        decoupled = decouple(out_of_plane(plant), n_flex=n_flex, degree=setting.degree, weight=plant.coil_weights)
    watch = Stopwatch()
    _ = decoupled.system
    return decoupled, watch.read()[0]
