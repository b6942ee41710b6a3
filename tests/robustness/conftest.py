"""Small controlled plants: a user's with two axes, and the planar actuator with few modes and a simple field."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.codesign import Design, Specification
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.hinfstruct import Evaluations
from lpvhinf.plant.mmpa import MMPA, MMPAParameters, benchmark
from lpvhinf.robustness import ControlledPlant, Uncertainty


def untuned(plant: DecoupledPlant, architecture: str, specification: Specification) -> Design:
    """A design by rule of thumb: a stable loop is enough here."""
    assembly = Assembly(plant=plant, specification=specification, architecture=architecture)
    centre = np.mean(plant.box, axis=1)
    return Design(
        assembly=assembly,
        parameters=assembly.start(np.vstack([centre, plant.box.T])),
        positions=centre[None],
        gammas=np.ones(1),
        gamma_worst=1.0,
        worst_position=centre,
        optimality=np.nan,
        status="given",
        seconds=0.0,
        evaluations=Evaluations(trials=0, exact=0, every_model=0),
    )


@pytest.fixture(scope="session")
def small_design(small_plant: DecoupledPlant) -> Design:
    """An observer for a user's plant, whose maps are local functions."""
    return untuned(small_plant, "output-observer", Specification(f_bw=[5.0, 6.0], expected_error=[2e-6, 5e-5]))


@pytest.fixture(scope="session")
def small(small_design: Design) -> ControlledPlant:
    return ControlledPlant.of(small_design)


@pytest.fixture(scope="session")
def parameters() -> MMPAParameters:
    """With few shapes of the plate: 22 flexible modes."""
    return MMPAParameters(ritz_degree=4)


@pytest.fixture(scope="session")
def few_modes(parameters: MMPAParameters) -> MMPA:
    """Three flexible modes, the others as their compliance."""
    return benchmark(parameters, n_flex=3, magnetics="first-harmonic")


@pytest.fixture(scope="session")
def actuator(few_modes: MMPA) -> ControlledPlant:
    """The planar actuator with an observer, which is pickled for other processes."""
    plant = decouple(few_modes, n_flex=1, degree=6)
    return ControlledPlant.of(untuned(plant, "output-observer", Specification(f_bw=20.0)))


@pytest.fixture(scope="session")
def wide() -> Uncertainty:
    """With a delay that is no whole number of samples."""
    return Uncertainty(delay=1.5e-3, sample_time=1e-3, misalignment=(1e-4, 2e-3))


@pytest.fixture(scope="session")
def mild() -> Uncertainty:
    """All loops of the small plant are stable."""
    return Uncertainty(damping=(8e-3, 2e-2), delay=150e-6, misalignment=(1e-4, 1e-3))
