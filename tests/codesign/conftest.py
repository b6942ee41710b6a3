"""Small finished designs for a user's plant, made once: two axes, one controlled and two discarded modes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lpvhinf.codesign import Design, Specification, codesign
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.hinfstruct import Evaluations

WANTED = Specification(f_bw=[12.0, 15.0], expected_error=[2e-6, 5e-5], epsilon=0.05, Q=0.8)


@pytest.fixture(scope="session")
def wanted() -> Specification:
    return WANTED


@pytest.fixture(scope="session")
def rigid(small_plant: DecoupledPlant) -> Design:
    """A conventional design."""
    return codesign(
        small_plant, "rigid-body", WANTED, n_positions=4, starts=1, max_iterations=20, exchange_rounds=0, n_search=4
    )


@pytest.fixture(scope="session")
def observer(small_plant: DecoupledPlant, rigid: Design) -> Design:
    """An observer design that starts from the conventional one."""
    return codesign(
        small_plant,
        "output-observer",
        WANTED,
        positions=rigid.positions,
        warm_start=rigid,
        starts=1,
        max_iterations=10,
        exchange_rounds=1,
        n_search=8,
    )


@pytest.fixture(scope="session")
def with_parameters() -> Callable[[Assembly, list[float] | np.ndarray], Design]:
    """A design with given parameters, tuned by nobody."""

    def make(assembly: Assembly, parameters: list[float] | np.ndarray) -> Design:
        centre = np.mean(assembly.plant.box, axis=1)
        return Design(
            assembly=assembly,
            parameters=np.asarray(parameters, dtype=float),
            positions=centre[None],
            gammas=np.ones(1),
            gamma_worst=1.0,
            worst_position=centre,
            optimality=np.nan,
            status="given",
            seconds=0.0,
            evaluations=Evaluations(trials=0, exact=0, every_model=0),
        )

    return make
