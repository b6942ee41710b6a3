"""Guards the perturbed plants: each kind of perturbation against a plant that is built that way from the start."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DomainError
from lpvhinf.plant import ModalModel
from lpvhinf.plant.mmpa import MMPA, Effects, MMPAParameters, benchmark
from lpvhinf.robustness import ControlledPlant, Samples
from lpvhinf.robustness.misalignment import misaligned
from lpvhinf.robustness.perturbed_plant import ModalStack, PerturbedPlants

POINTS = np.array([[0.06, 0.06], [-0.06, 0.013], [0.0, 0.0], [0.021, -0.044]])
ERROR = (40e-6, -25e-6)


@dataclass(frozen=True)
class Machine:
    """A true plant with the known one of another."""

    modal: ModalModel
    known: ModalModel
    coil_weights: Any


def physical(subject: ControlledPlant, stack: ModalStack, zeros: NDArray[np.complex128]) -> Array:
    """Responses (N, n_omega, n_out, n_in) in physical units, from sums over modes."""
    s = zeros[None, :, None]
    below = s**2 + 2.0 * stack.zeta[:, None] * stack.omega[:, None] * s + stack.omega[:, None] ** 2
    G = np.einsum("nim,nwm,nmj->nwij", stack.C, 1.0 / below, stack.B) + stack.D[:, None]
    return np.asarray(G / subject.scaling.output[:, None] / subject.scaling.input)


def direct(plant: DecoupledPlant, points: Array, zeros: NDArray[np.complex128]) -> Array:
    """The same from a plant that was built as it is."""
    gains, s = plant.sample(points), zeros[:, None]
    below = s**2 + 2.0 * plant.zeta * plant.omega * s + plant.omega**2
    return np.asarray(np.einsum("nim,wm,nmj->nwij", gains.C, 1.0 / below, gains.B) + gains.D[:, None])


OMEGA = 1j * 2 * np.pi * np.array([3.0, 50.0, 138.0, 205.0, 900.0])


def agree(subject: ControlledPlant, samples: Samples, plant: DecoupledPlant, tolerance: float = 1e-9) -> None:
    found = physical(subject, PerturbedPlants(subject, 1e-4).at(samples), OMEGA)
    wanted = direct(plant, samples.position, OMEGA)
    # channels have different units
    size = np.max(np.abs(wanted), axis=(0, 1))
    assert np.max(np.abs(found - wanted) / size) < tolerance


def test_a_plant_that_is_not_perturbed(actuator: ControlledPlant) -> None:
    agree(actuator, Samples.nominal(actuator.plant, POINTS), actuator.plant)


@pytest.mark.parametrize(
    "options", [{}, {"input_decoupling": "rigid-body"}, {"actuation": "full"}, {"sensing": "rigid-body"}], ids=str
)
def test_misalignment_is_that_of_the_effects(few_modes: MMPA, parameters: MMPAParameters, options: Any) -> None:
    """Also at the corner of P, where the commutation believes the mover outside of P."""
    shifted = benchmark(
        parameters, n_flex=3, magnetics="first-harmonic", effects=Effects(commutation_misalignment=ERROR)
    )
    believed = decouple(shifted, n_flex=2, degree=2, **options).sample(POINTS)
    plant = decouple(few_modes, n_flex=2, degree=2, **options)
    found = misaligned(plant, 50e-6).sample(np.hstack([POINTS, np.tile(ERROR, (4, 1))]))
    before = plant.sample(POINTS)
    for name in ("B", "C", "D"):
        wanted = getattr(believed, name)
        scale = np.max(np.abs(wanted), axis=0)
        assert np.all(np.abs(getattr(found, name) - wanted) <= 1e-9 * np.max(np.abs(wanted)) + 1e-9 * scale)
    assert np.max(np.abs(before.B - believed.B)) > 1e-4 * np.max(np.abs(believed.B))  # it does something


def test_the_actuators_own_misalignment_stays(parameters: MMPAParameters) -> None:
    own, more = (10e-6, 0.0), (20e-6, 5e-6)
    machine = benchmark(parameters, n_flex=1, magnetics="first-harmonic", effects=Effects(commutation_misalignment=own))
    both = tuple(np.add(own, more).tolist())
    wanted = benchmark(parameters, n_flex=1, magnetics="first-harmonic", effects=Effects(commutation_misalignment=both))
    found = misaligned(decouple(machine, degree=2), 50e-6).sample(np.hstack([POINTS, np.tile(more, (4, 1))]))
    gains = decouple(wanted, degree=2).sample(POINTS).B
    assert np.allclose(found.B, gains, rtol=1e-9, atol=1e-9)


def test_damping_is_that_of_the_effects(actuator: ControlledPlant, parameters: MMPAParameters) -> None:
    true = benchmark(parameters, n_flex=3, magnetics="first-harmonic", effects=Effects(damping_factor=0.25))
    samples = Samples.nominal(actuator.plant, POINTS)
    samples = dataclasses.replace(samples, zeta=0.25 * samples.zeta)
    agree(actuator, samples, decouple(true, n_flex=1, degree=2), 1e-7)


def test_frequencies(actuator: ControlledPlant, few_modes: MMPA) -> None:
    factor = np.array([1.02, 0.99, 0.98])
    omega = few_modes.modal.omega.copy()
    omega[6:] *= factor
    true = Machine(dataclasses.replace(few_modes.modal, omega=omega), few_modes.known, few_modes.coil_weights)
    samples = Samples.nominal(actuator.plant, POINTS)
    agree(actuator, dataclasses.replace(samples, omega=samples.omega * factor), decouple(true, degree=2))


def test_a_denser_mover_has_larger_masses(
    actuator: ControlledPlant, few_modes: MMPA, parameters: MMPAParameters
) -> None:
    """All densities times 1.02: masses, inertias and modal masses by that, frequencies by its inverse root."""
    factor = 1.02
    names = ("plate_density", "magnet_density", "bar_mass")
    heavier = dataclasses.replace(parameters, **{name: factor * getattr(parameters, name) for name in names})
    heavy = benchmark(heavier, n_flex=3, magnetics="first-harmonic")
    assert heavy.mass == pytest.approx(factor * few_modes.mass, rel=1e-12)
    true = Machine(heavy.modal, few_modes.known, few_modes.coil_weights)
    samples = Samples.nominal(actuator.plant, POINTS)
    samples = dataclasses.replace(
        samples,
        omega=samples.omega / np.sqrt(factor),
        zeta=np.tile(heavy.modal.zeta[6:], (4, 1)),
        mass=factor * samples.mass,
        modal_mass=factor * samples.modal_mass,
    )
    agree(actuator, samples, decouple(true, degree=2), 1e-7)


def test_masses_of_axes_that_are_coupled(small: ControlledPlant, small_modal: ModalModel) -> None:
    """M becomes F M F: the rigid part of the response is its inverse over s^2, with the force of a unit input, M."""
    position, mass = np.array([[0.03]]), np.array([[1.02, 0.97]])
    samples = dataclasses.replace(Samples.nominal(small.plant, position), mass=mass)
    stack = PerturbedPlants(small, 0.0).at(samples)
    rigid = (stack.C[0, :2, :2] @ stack.B[0, :2]) / small.scaling.output[:2, None] / small.scaling.input
    F, M = np.diag(np.sqrt(mass[0])), small_modal.mass_matrix_rb
    assert rigid[:, :2] == pytest.approx(np.linalg.inv(F @ M @ F) @ M, rel=1e-10, abs=1e-10)


def test_a_misalignment_beyond_the_range_is_an_error(actuator: ControlledPlant) -> None:
    samples = Samples.nominal(actuator.plant, POINTS[:1])
    with pytest.raises(DomainError, match=r"misalignment goes up to 0\.002 m, wanted at most 0\.0001 m"):
        PerturbedPlants(actuator, 1e-4).at(dataclasses.replace(samples, misalignment=np.array([[0.0, 2e-3]])))
