"""How the effort grows with states, plants and parameters: the sizes, and one run of the solver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.hinfstruct.flexible_bar import bars
from benchmarks.hinfstruct.measuring import Stopwatch, finished, slicot_ratio
from lpvhinf.errors import LpvHinfError
from lpvhinf.hinfstruct import FixedOrder, hinfstruct

#: Order, inputs and outputs of the controllers: (order + n_u) (order + n_y) parameters.
CONTROLLERS = {10: (1, 1, 4), 40: (3, 2, 5), 160: (6, 4, 10)}


@dataclass(frozen=True, kw_only=True)
class Size:
    """States of every plant, number of plants, parameters of the controller."""

    n_x: int
    n_models: int
    n_parameters: int

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return self.n_x, self.n_models, self.n_parameters


#: The size that all others vary, and the one that has a time to keep.
MIDDLE, LARGE = Size(n_x=50, n_models=5, n_parameters=40), Size(n_x=100, n_models=20, n_parameters=40)
SIZES = (
    *(Size(n_x=n, n_models=5, n_parameters=40) for n in (20, 50, 100, 150)),
    *(Size(n_x=50, n_models=n, n_parameters=40) for n in (1, 20)),
    *(Size(n_x=50, n_models=5, n_parameters=n) for n in (10, 160)),
    LARGE,
)
#: A small one, solved in a moment with these options, to try the command.
TINY, TINY_OPTIONS = (Size(n_x=8, n_models=2, n_parameters=10),), {"starts": 2, "max_iterations": 20}


@dataclass(frozen=True, kw_only=True)
class ScalingRun:
    """The outcome for one size.

    `slicot` is SLICOT's norm over the one reported, of the model where it is farthest from one; `every_model` the
    exact norms of a solver that evaluates every model at every step, `saving` their ratio to `exact`; `lower_bound`
    what no controller of any order beats, NaN if unknown.
    """

    n_x: int
    n_models: int
    n_parameters: int
    order: int
    n_u: int
    n_y: int
    gamma: float
    lower_bound: float
    optimality: float
    slicot: float
    trials: int
    exact: int
    every_model: int
    saving: float
    jobs: int
    wall: float
    cpu: float
    status: str

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return self.n_x, self.n_models, self.n_parameters

    def __str__(self) -> str:
        return (
            f"{self.n_x} states, {self.n_models} plants, {self.n_parameters} parameters: gamma {self.gamma:.6g}, "
            f"{self.wall:.1f} s, CPU {self.cpu:.1f} s, {self.saving:.1f} times fewer exact norms"
        )


def solve(size: Size, *, jobs: int, **options: Any) -> ScalingRun:
    """Solve with the default settings, the lower bound included, or with `options` of `hinfstruct`."""
    order, n_u, n_y = CONTROLLERS[size.n_parameters]
    plants, structure = bars(size.n_x, size.n_models, n_u, n_y), FixedOrder(order, n_u, n_y)
    gamma, below, optimality, slicot, trials, exact, every_model = np.inf, None, np.nan, np.nan, 0, 0, 0
    watch = Stopwatch()
    try:
        result = hinfstruct(plants, structure, seed=0, jobs=jobs, **options)
    except LpvHinfError as error:
        (wall, cpu), status = watch.read(), f"{type(error).__name__}: {error}"
    else:
        (wall, cpu), status = watch.read(), result.status
        gamma, below, optimality, counts = result.gamma, result.lower_bound, result.optimality, result.evaluations
        trials, exact, every_model = counts.trials, counts.exact, counts.every_model
        finished(result.interrupted)
        K = structure.realize(result.parameters)
        slicot = slicot_ratio([plant.close(*K) for plant in plants], result.gammas)
    return ScalingRun(
        n_x=size.n_x,
        n_models=size.n_models,
        n_parameters=size.n_parameters,
        order=order,
        n_u=n_u,
        n_y=n_y,
        gamma=gamma,
        lower_bound=np.nan if below is None else below,
        optimality=optimality,
        slicot=slicot,
        trials=trials,
        exact=exact,
        every_model=every_model,
        saving=every_model / exact if exact else np.nan,
        jobs=jobs,
        wall=wall,
        cpu=cpu,
        status=status,
    )
