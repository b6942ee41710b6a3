"""Guards plants that deviate from what their decoupling knows: true gains behind known transformations."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.plant import ModalModel

N_RB = 2  # of the small plant, which has three flexible modes


def truncated(modal: ModalModel, n_flex: int) -> ModalModel:
    """The same plant with fewer flexible modes."""
    kept = slice(0, N_RB + n_flex)
    return dataclasses.replace(
        modal,
        omega=modal.omega[kept],
        zeta=modal.zeta[kept],
        input_map=lambda p: modal.input_gains(p)[:, kept],
        output_map=lambda p: modal.output_gains(p)[:, :, kept],
    )


def heavier(modal: ModalModel, factor: float) -> ModalModel:
    """The same plant with `factor` times its mass: gains and S of the rigid-body modes fall with its root."""
    root = np.where(np.arange(modal.n_modes) < N_RB, factor**-0.5, 1.0)
    return dataclasses.replace(
        modal,
        input_map=lambda p: modal.input_gains(p) * root[:, None],
        output_map=lambda p: modal.output_gains(p) * root,
        rigid_body_scaling=modal.rigid_body_scaling / np.sqrt(factor),
        mass_matrix_rb=modal.mass_matrix_rb * factor,
    )


def deviating(modal: ModalModel) -> ModalModel:
    """Misplaced by 1 mm, uneven actuators and sensors, 3 % too heavy, resonances 2 % off."""
    uneven_actuators = 1.0 + 0.04 * np.cos(np.arange(modal.n_u))
    uneven_sensors = 1.0 + 0.01 * np.array([1.0, -1.0, 2.0])

    def shifted(points: Array) -> Array:
        return np.clip(points + 1e-3, modal.box[:, 0], modal.box[:, 1])

    true = heavier(modal, 1.03)
    inputs, outputs = true.input_gains, true.output_gains
    return dataclasses.replace(
        true,
        omega=1.02 * modal.omega,
        input_map=lambda p: inputs(shifted(p)) * uneven_actuators,
        output_map=lambda p: outputs(p) * uneven_sensors[:, None],
    )


def machine(true: ModalModel, known: Any) -> SimpleNamespace:
    return SimpleNamespace(modal=true, known=known)


@pytest.fixture(scope="module")
def inexact(small_modal: ModalModel) -> DecoupledPlant:
    """The deviating plant; its known model has one discarded mode less."""
    return decouple(machine(deviating(small_modal), truncated(small_modal, 2)), n_flex=1, degree=16)


def test_transformations_are_the_known_ones(inexact: DecoupledPlant, small_positions: Array) -> None:
    alone = decouple(inexact.known_modal, n_flex=1)
    for ours, theirs in zip(inexact.matrices(small_positions), alone.matrices(small_positions), strict=True):
        assert np.array_equal(ours, theirs)
    assert np.array_equal(inexact.redundancy, alone.redundancy)


@pytest.mark.parametrize("options", [{}, {"input_decoupling": "rigid-body"}, {"actuation": "full"}])
def test_response_is_the_true_one(small_modal: ModalModel, small_positions: Array, options: dict[str, str]) -> None:
    plant = decouple(machine(deviating(small_modal), small_modal), n_flex=2, **options)
    T_y, T_u = plant.matrices(small_positions)
    for k, (p, frozen) in enumerate(zip(small_positions, plant.frozen(small_positions), strict=True)):
        local, system = plant.modal.local_model(p), frozen.at(p)
        for s in (5j, 700j, 2 * np.pi * 61.0j):
            whole = T_y[k] @ local(s) @ T_u[k]
            assert np.allclose(system(s), whole, rtol=1e-9, atol=1e-12 * np.max(np.abs(whole)))


def test_rigid_axes_are_only_nearly_integrators(inexact: DecoupledPlant, small_positions: Array) -> None:
    """At low frequencies s^2 G is the product of the true rigid-body gains, which the system carries."""
    gains = inexact.sample(small_positions)
    for B in (gains.B[:, :N_RB, :N_RB], gains.C[:, :N_RB, :N_RB]):
        assert 1e-3 < np.max(np.abs(B - np.eye(N_RB))) < 0.2
    assert np.max(np.abs(gains.C[:, N_RB:, :N_RB])) > 1e-3  # redundant sensors see rigid-body motion
    assert np.max(np.abs(gains.B[:, N_RB, :N_RB])) > 1e-3  # the preserved mode is excited
    s = 1e-3j
    for k, frozen in enumerate(inexact.frozen(small_positions)):
        found = s**2 * frozen.at(small_positions[k])(s)[:N_RB, :N_RB]
        assert np.allclose(found, gains.C[k, :N_RB, :N_RB] @ gains.B[k, :N_RB, :N_RB], rtol=0, atol=1e-9)


def test_polynomial_model_carries_the_gains_of_all_modes(inexact: DecoupledPlant) -> None:
    points = spread_points(inexact.box, 30, seed=5)
    gains, (A, B, C, D) = inexact.sample(points), inexact.system.sample(points)
    assert A.shape[1] == 2 * inexact.n_modes == 10
    # the shift is clipped at the end of the box: a kink that limits the fit
    assert np.max(np.abs(B[:, 1::2] - gains.B)) < 3e-3
    assert np.max(np.abs(C[:, :, 0::2] - gains.C)) < 1e-9
    assert np.max(np.abs(D - gains.D)) < 1e-2 * np.max(np.abs(gains.D))
    assert np.all(B[:, 0::2] == 0.0)
    assert inexact.fit["B"].matrix.shape == (5, 3)
    assert inexact.fit["C"].matrix.shape == (3, 5)


def test_known_is_the_exact_plant_of_the_known_model(inexact: DecoupledPlant, small_plant: DecoupledPlant) -> None:
    assert not inexact.exact_inputs
    assert not inexact.exact_outputs
    known, alone = inexact.known, decouple(inexact.known_modal, n_flex=1, degree=16)
    assert known.exact_inputs
    assert known.exact_outputs
    assert known.known is known
    assert known.n_modes == 4
    for ours, theirs in zip(known.system.matrices, alone.system.matrices, strict=True):
        assert np.array_equal(ours.coefficients, theirs.coefficients)
    assert small_plant.known is small_plant


def test_nothing_deviates_if_known_is_modal(small_modal: ModalModel, small_plant: DecoupledPlant) -> None:
    same = decouple(machine(small_modal, small_modal), n_flex=1, degree=16)
    assert same.known is same
    for ours, theirs in zip(same.system.matrices, small_plant.system.matrices, strict=True):
        assert np.array_equal(ours.coefficients, theirs.coefficients)


def test_the_same_numbers_in_another_model_give_the_same_plant(
    small_modal: ModalModel, small_plant: DecoupledPlant, small_positions: Array
) -> None:
    """Known to be inexact, though nothing deviates: all gains are carried, and they are the exact ones."""
    copy = decouple(machine(dataclasses.replace(small_modal), small_modal), n_flex=1, degree=16)
    assert not copy.exact_inputs
    for ours, theirs in zip(
        copy.system.sample(small_positions), small_plant.system.sample(small_positions), strict=True
    ):
        assert np.allclose(ours, theirs, rtol=0, atol=1e-11 * max(1.0, np.max(np.abs(theirs))))
    report = copy.verify(small_positions)
    assert max(report.rigid_body, report.rigid_gain, report.preserved_excitation) < 1e-12


def test_a_wrong_mass_is_reported(small_modal: ModalModel, small_positions: Array) -> None:
    plant = decouple(machine(heavier(small_modal, 1.25), small_modal), n_flex=1)
    report = plant.verify(small_positions)
    assert report.rigid_gain == pytest.approx(1.0 - 1.0 / 1.25, rel=1e-9)
    assert report.rigid_body == pytest.approx(1.0 - 1.0 / 1.25, rel=1e-9)
    assert report.n_points == 5
    assert plant.coupling(small_positions).rigid == pytest.approx(1.0 - 1.0 / 1.25, rel=1e-9)


def test_the_worst_position_is_named(small_modal: ModalModel, small_positions: Array) -> None:
    """Actuators whose strength varies over P: the gain deviates most where they deviate most."""
    worst = float(small_positions[4, 0])
    true = dataclasses.replace(
        small_modal, input_map=lambda p: small_modal.input_gains(p) * (1.3 - 2.0 * np.abs(p - worst))[:, :, None]
    )
    plant = decouple(machine(true, small_modal), n_flex=1)
    report, coupling = plant.verify(small_positions), plant.coupling(small_positions)
    assert report.worst_position.tolist() == [worst]
    assert report.rigid_gain == pytest.approx(0.3, rel=1e-9)
    assert coupling.rigid_at.tolist() == [worst]
    assert coupling.own_gain_max == pytest.approx([1.3], rel=1e-9)


def test_signs_of_mode_shapes_are_free(small_modal: ModalModel, small_positions: Array) -> None:
    flip = np.array([1.0, 1.0, -1.0, 1.0, -1.0])
    true = deviating(small_modal)
    flipped = dataclasses.replace(
        true,
        input_map=lambda p: true.input_gains(p) * flip[:, None],
        output_map=lambda p: true.output_gains(p) * flip,
    )
    one, other = (decouple(machine(m, small_modal), n_flex=1) for m in (true, flipped))
    assert np.array_equal(one.static_correction(small_positions), other.static_correction(small_positions))
    ours, theirs = one.coupling(small_positions), other.coupling(small_positions)
    assert 0.9 < ours.own_gain_min[0] < 1.1
    for field in dataclasses.fields(ours):
        assert np.array_equal(getattr(ours, field.name), getattr(theirs, field.name)), field.name


# Refusals


def test_a_rigid_body_gain_that_is_far_off(small_modal: ModalModel) -> None:
    def scaled(by: float) -> SimpleNamespace:
        true = dataclasses.replace(small_modal, input_map=lambda p: by * small_modal.input_gains(p))
        return machine(true, small_modal)

    for factor, percent in ((-1.0, 200), (1.6, 60), (0.4, 60)):
        message = rf"deviates by {percent} % .*at p = \[.*wanted at most 50 %.*Compare"
        with pytest.raises(AssumptionError, match=message):
            decouple(scaled(factor), n_flex=1)
    for factor in (0.6, 1.4):
        assert decouple(scaled(factor), n_flex=1).verify([[0.0]]).rigid_gain == pytest.approx(0.4, rel=1e-9)


def test_the_position_of_a_local_fault_is_named(small_modal: ModalModel) -> None:
    faulty = dataclasses.replace(
        small_modal,
        input_map=lambda p: small_modal.input_gains(p) * np.where(p > 0.02, -1.0, 1.0)[:, :, None],
    )
    with pytest.raises(AssumptionError, match=r"deviates by 200 % .*at p = \[0\.(0[2-9]|1)"):
        decouple(machine(faulty, small_modal), n_flex=1)


def test_rigid_body_modes_in_another_order(small_modal: ModalModel) -> None:
    """Actuators whose order is another one than the controller believes."""
    swapped = dataclasses.replace(small_modal, input_map=lambda p: small_modal.input_gains(p)[:, :, ::-1])
    with pytest.raises(AssumptionError, match=r"order of actuators, sensors or rigid-body modes"):
        decouple(machine(swapped, small_modal), n_flex=1)


def test_a_mode_that_only_the_known_model_sees(small_modal: ModalModel) -> None:
    hidden = dataclasses.replace(
        small_modal, output_map=lambda p: small_modal.output_gains(p) * np.array([1.0, 1.0, 0.0, 1.0, 1.0])
    )
    for true, known in ((hidden, small_modal), (small_modal, hidden)):
        with pytest.raises(AssumptionError, match=r"preserved mode 1 \(60\.0 Hz\) is not observable"):
            decouple(machine(true, known), n_flex=1)


def test_models_of_different_machines(small_modal: ModalModel) -> None:
    fewer_inputs = dataclasses.replace(
        small_modal, input_map=lambda p: small_modal.input_gains(p)[:, :, :6], residual=None, input_names=()
    )
    fewer_outputs = dataclasses.replace(
        small_modal, output_map=lambda p: small_modal.output_gains(p)[:, :2], residual=None, output_names=()
    )
    smaller = dataclasses.replace(small_modal, box=0.5 * small_modal.box)
    for known, message in (
        (fewer_inputs, "plant.known has n_u = 6, wanted 7"),
        (fewer_outputs, "plant.known has n_y = 2, wanted 3"),
        (smaller, r"plant.known has the box \[\[-0.05, 0.05\]\], wanted \[\[-0.1, 0.1\]\]"),
        (truncated(small_modal, 1), "plant.known has 1 flexible modes, wanted at least n_flex = 2"),
    ):
        with pytest.raises(DimensionError, match=message):
            decouple(machine(small_modal, known), n_flex=2)
    with pytest.raises(DomainError, match=r"plant.known is a NoneType, wanted a ModalModel"):
        decouple(machine(small_modal, None))


def test_the_known_model_must_be_decoupled_exactly(small_modal: ModalModel) -> None:
    few = dataclasses.replace(
        small_modal, input_map=lambda p: small_modal.input_gains(p) * (np.arange(7) < 2), residual=None
    )
    with pytest.raises(AssumptionError, match="cannot drive 3 modes independently"):
        decouple(machine(small_modal, few), n_flex=1)
