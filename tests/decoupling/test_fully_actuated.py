"""Guards the extended decoupling of fully actuated plants: least squares, its limits, and the coupling that is left."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple, input_decoupling
from lpvhinf.decoupling.coupling import channel_coupling
from lpvhinf.decoupling.fully_actuated import shared_inputs
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.plant import ModalModel

N_RB = 2


def with_actuators(modal: ModalModel, chosen: list[int]) -> ModalModel:
    return dataclasses.replace(
        modal, input_map=lambda p: modal.input_gains(p)[:, :, chosen], residual=None, input_names=()
    )


@pytest.fixture(scope="module")
def full_modal(small_modal: ModalModel) -> ModalModel:
    """The small plant on two actuators: as many as rigid-body modes."""
    return with_actuators(small_modal, [0, 6])


@pytest.fixture(scope="module")
def points(full_modal: ModalModel) -> Array:
    return np.vstack([full_modal.box.T, spread_points(full_modal.box, 20, seed=3)])


def excitation_of(modal: ModalModel, points: Array, n_flex: int) -> Array:
    """b, from the physical gains."""
    B = modal.input_gains(points)
    return np.asarray(B[:, N_RB : N_RB + n_flex] @ np.linalg.inv(B[:, :N_RB]))


# Least squares


@pytest.mark.parametrize("rho", [0.05, 1.0, 7.0])
@pytest.mark.parametrize("n_flex", [1, 2, 4])
def test_shared_inputs_solve_the_least_squares_problem(rho: float, n_flex: int) -> None:
    b = np.random.default_rng(n_flex).standard_normal((5, n_flex, 3))
    root = np.diag(np.concatenate([np.ones(3), np.full(n_flex, rho)]))
    for found, excitation in zip(shared_inputs(b, rho), b, strict=True):
        wanted = np.linalg.lstsq(root @ np.vstack([np.eye(3), excitation]), root, rcond=None)[0]
        assert np.allclose(found, wanted, rtol=0, atol=1e-12)
        normal = np.eye(3) + rho**2 * excitation.T @ excitation
        formula = np.linalg.solve(normal, np.hstack([np.eye(3), rho**2 * excitation.T]))
        assert np.allclose(found, formula, rtol=0, atol=1e-12)


def test_limits_of_the_mode_weight() -> None:
    b = np.random.default_rng(0).standard_normal((4, 1, 3))
    small, large = shared_inputs(b, 1e-9), shared_inputs(b, 1e9)
    assert np.allclose(small, np.eye(3, 4), rtol=0, atol=1e-15)  # conventional, and no modal input
    assert np.max(np.abs(b @ large[:, :, :3])) < 1e-14  # the mode is left alone,
    assert np.allclose(b @ large[:, :, 3:], 1.0, rtol=0, atol=1e-14)  # its input has it wholly,
    assert np.linalg.matrix_rank(large[:, :, :3], tol=1e-9).tolist() == [2] * 4  # and one direction is lost


def test_a_mode_that_is_not_excited_costs_nothing() -> None:
    assert np.array_equal(shared_inputs(np.zeros((2, 1, 3)), 5.0), np.broadcast_to(np.eye(3, 4), (2, 3, 4)))
    assert np.array_equal(shared_inputs(np.zeros((2, 0, 3)), 5.0), np.broadcast_to(np.eye(3), (2, 3, 3)))


# The decoupled plant


@pytest.mark.parametrize("rho", [0.3, 1.0, 4.0])
def test_gains_have_the_closed_form_of_one_mode(full_modal: ModalModel, points: Array, rho: float) -> None:
    plant = decouple(full_modal, n_flex=1, actuation="full", mode_weight=rho)
    gains, S = plant.sample(points), full_modal.rigid_body_scaling
    b = excitation_of(full_modal, points, 1)
    size = np.sum(b**2, axis=(1, 2))[:, None, None]
    share = rho**2 / (1.0 + rho**2 * size)
    columns = np.swapaxes(b, 1, 2)
    rigid = S @ (np.eye(2) - share * columns @ b) @ np.linalg.inv(S)
    assert np.allclose(gains.B[:, :2, :2], rigid, rtol=0, atol=1e-12)
    assert np.allclose(gains.B[:, :2, 2:], share * (S @ columns), rtol=0, atol=1e-12)
    assert np.allclose(gains.B[:, 2:3, :2], b @ np.linalg.inv(S) / (1.0 + rho**2 * size), rtol=0, atol=1e-12)
    assert np.allclose(gains.B[:, 2:3, 2:], share * size, rtol=0, atol=1e-12)
    assert np.allclose(gains.C[:, :, :2], np.eye(plant.n_out, 2), rtol=0, atol=1e-12)


def test_rigid_inputs_may_stay_the_conventional_ones(full_modal: ModalModel, points: Array) -> None:
    shared = decouple(full_modal, n_flex=2, actuation="full", mode_weight=2.0)
    plain = decouple(full_modal, n_flex=2, actuation="full", mode_weight=2.0, input_decoupling="rigid-body")
    T_u, S = plain.matrices(points)[1], full_modal.rigid_body_scaling
    conventional = np.linalg.inv(full_modal.input_gains(points)[:, :2]) @ np.linalg.inv(S)
    assert np.allclose(T_u[:, :, :2], conventional, rtol=1e-12, atol=0)
    assert np.array_equal(T_u[:, :, 2:], shared.matrices(points)[1][:, :, 2:])
    assert not np.allclose(T_u[:, :, :2], shared.matrices(points)[1][:, :, :2], rtol=1e-2)
    assert plain.coupling(points).excitation == pytest.approx([1.0, 1.0], rel=1e-12)


@pytest.mark.parametrize("option", ["extended", "rigid-body"])
def test_response_and_polynomials_are_those_of_the_plant(full_modal: ModalModel, points: Array, option: str) -> None:
    plant = decouple(full_modal, n_flex=1, actuation="full", input_decoupling=option, degree=24)
    T_y, T_u = plant.matrices(points[:4])
    for k, (p, frozen) in enumerate(zip(points[:4], plant.frozen(points[:4]), strict=True)):
        for s in (5j, 2 * np.pi * 59.0j):
            whole = T_y[k] @ full_modal.local_model(p)(s) @ T_u[k]
            assert np.allclose(frozen.at(p)(s), whole, rtol=1e-9, atol=1e-12 * np.max(np.abs(whole)))
            assert np.allclose(plant.system.at(p)(s), whole, rtol=1e-6, atol=1e-8 * np.max(np.abs(whole)))
    assert plant.known is plant
    C = plant.system.C.sample(points)
    assert np.array_equal(C[:, :, :4], np.broadcast_to(np.kron(np.eye(3, 2), [[1.0, 0.0]]), (len(points), 3, 4)))


def test_static_correction_is_the_static_gain_of_the_discarded_modes(full_modal: ModalModel, points: Array) -> None:
    plant = decouple(full_modal, n_flex=1, actuation="full")
    T_y, T_u = plant.matrices(points)
    B, C = full_modal.input_gains(points)[:, 3:], full_modal.output_gains(points)[:, :, 3:]
    static = T_y @ (C / full_modal.omega[3:] ** 2) @ B @ T_u
    assert np.allclose(plant.static_correction(points), static, rtol=1e-9, atol=1e-12 * np.max(np.abs(static)))


def test_more_actuators_offer_virtual_forces(small_modal: ModalModel, points: Array) -> None:
    """The commands span those of the conventional, weighted decoupling, and no more."""
    weights = np.array([1.0, 0.5, 2.0, 1.0, 0.0, 3.0, 1.0])
    plant = decouple(
        SimpleNamespace(modal=small_modal, coil_weights=lambda p: np.tile(weights, (len(p), 1))),
        actuation="full",
        mode_weight=3.0,
    )
    T_v = input_decoupling(small_modal.input_gains(points)[:, :2], np.tile(weights, (len(points), 1)))
    T_u = plant.matrices(points)[1]
    assert T_u.shape == (len(points), 7, 3)
    residual = T_u - T_v @ np.linalg.pinv(T_v) @ T_u
    assert np.max(np.abs(residual)) < 1e-12 * np.max(np.abs(T_u))
    b = small_modal.input_gains(points)[:, 2:3] @ T_v
    assert np.allclose(T_u[:, :, 2:], T_v @ shared_inputs(b, 3.0)[:, :, 2:], rtol=0, atol=1e-12)


def test_without_modes_it_is_the_conventional_decoupling(full_modal: ModalModel, points: Array) -> None:
    full, over = (decouple(full_modal, n_flex=0, actuation=name, degree=6) for name in ("full", "over"))
    assert full.exact_inputs
    assert np.allclose(full.sample(points).B, over.sample(points).B, rtol=0, atol=1e-12)
    assert full.system.n_u == 2
    assert full.coupling(points).rigid < 1e-12


def test_a_deviating_fully_actuated_plant(full_modal: ModalModel, points: Array) -> None:
    """The coupling is what its known model has, and the deviation does not count it."""
    true = dataclasses.replace(full_modal, input_map=lambda p: 1.1 * full_modal.input_gains(p))
    plant = decouple(SimpleNamespace(modal=true, known=full_modal), actuation="full", mode_weight=50.0)
    assert plant.verify(points).rigid_gain > 0.5
    assert np.allclose(plant.sample(points).B, 1.1 * plant.known.sample(points).B, rtol=1e-12, atol=1e-14)
    assert not plant.known.exact_inputs
    assert plant.known.exact_outputs
    wrong = dataclasses.replace(full_modal, input_map=lambda p: -full_modal.input_gains(p))
    with pytest.raises(AssumptionError, match="deviates by 200 %"):
        decouple(SimpleNamespace(modal=wrong, known=full_modal), actuation="full", mode_weight=0.1)


# The coupling


@pytest.mark.parametrize("rho", [0.3, 1.0, 4.0])
def test_coupling_has_the_closed_form_of_one_mode(full_modal: ModalModel, points: Array, rho: float) -> None:
    found = decouple(full_modal, n_flex=1, actuation="full", mode_weight=rho).coupling(points)
    b = excitation_of(full_modal, points, 1)[:, 0]
    size = np.linalg.norm(b, axis=1)
    gain = (rho * size) ** 2 / (1.0 + (rho * size) ** 2)
    modal = rho**2 * size / (1.0 + (rho * size) ** 2)
    excitation = size / (1.0 + (rho * size) ** 2)
    assert found.n_points == len(points)
    assert found.rigid == pytest.approx(np.max(gain), rel=1e-10)
    assert found.rigid_at.tolist() == points[np.argmax(gain)].tolist()
    assert found.rigid_channel == pytest.approx(np.max(modal[:, None] * np.abs(b), axis=0), rel=1e-10)
    assert found.excitation == pytest.approx([np.max(excitation) / np.max(size)], rel=1e-10)
    assert found.excitation_at.tolist() == [points[np.argmax(excitation)].tolist()]
    assert found.modal_to_rigid == pytest.approx([np.max(modal)], rel=1e-10)
    assert found.modal_to_rigid_at.tolist() == [points[np.argmax(modal)].tolist()]
    assert (found.own_gain_min, found.own_gain_max) == (
        pytest.approx([np.min(gain)], rel=1e-10),
        pytest.approx([np.max(gain)], rel=1e-10),
    )
    assert found.own_gain_min_at.tolist() == [points[np.argmin(gain)].tolist()]
    assert found.modal_to_modal.tolist() == [0.0]


def test_coupling_of_several_modes(full_modal: ModalModel, points: Array) -> None:
    found = decouple(full_modal, n_flex=2, actuation="full", mode_weight=1.5).coupling(points)
    T = shared_inputs(excitation_of(full_modal, points, 2), 1.5)
    B = np.concatenate([T, excitation_of(full_modal, points, 2) @ T], axis=1)
    assert found.rigid == pytest.approx(max(np.linalg.norm(m - np.eye(2), 2) for m in B[:, :2, :2]), rel=1e-9)
    assert found.modal_to_modal == pytest.approx(np.max(np.abs([B[:, 3, 2], B[:, 2, 3]]), axis=1), rel=1e-9)
    assert found.own_gain_min == pytest.approx(np.min([B[:, 2, 2], B[:, 3, 3]], axis=1), rel=1e-9)
    assert found.modal_to_rigid == pytest.approx(np.max(np.linalg.norm(B[:, :2, 2:], axis=1), axis=0), rel=1e-9)


def test_units_do_not_count(full_modal: ModalModel, points: Array) -> None:
    """Millimetres and degrees in place of metres and radians."""
    other = dataclasses.replace(full_modal, rigid_body_scaling=np.diag([1e3, 57.3]) @ full_modal.rigid_body_scaling)
    ours, theirs = (decouple(m, actuation="full").coupling(points) for m in (full_modal, other))
    for field in dataclasses.fields(ours):
        assert np.allclose(getattr(ours, field.name), getattr(theirs, field.name), rtol=1e-9), field.name


def test_over_actuated_plants_are_not_coupled(small_plant: DecoupledPlant, points: Array) -> None:
    found = small_plant.coupling(points)
    assert max(found.rigid, found.excitation[0], found.modal_to_rigid[0]) < 1e-12
    assert found.own_gain_min == pytest.approx([1.0], abs=1e-12)
    conventional = decouple(small_plant.modal, n_flex=1, input_decoupling="rigid-body").coupling(points)
    assert conventional.excitation == pytest.approx([1.0], rel=1e-12)
    assert conventional.rigid < 1e-12


def test_a_mode_that_the_conventional_inputs_leave_alone() -> None:
    for force, wanted in ((0.0, 0.0), (0.2, np.inf)):
        B = np.array([[[1.0, 0.0], [force, 1.0]]])
        assert channel_coupling(np.zeros((1, 1)), B, np.zeros((1, 1, 1))).excitation.tolist() == [wanted]


# Refusals


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode_weight": 0.0}, "mode_weight is 0.0, wanted a finite number above 0"),
        ({"mode_weight": -1.0}, "mode_weight is -1.0"),
        ({"mode_weight": np.nan}, "mode_weight is nan"),
        ({"mode_weight": np.inf}, "mode_weight is inf"),
        ({"mode_weight": "1"}, "mode_weight is '1'"),
        ({"mode_weight": 2.0, "actuation": "over"}, "mode_weight is 2, but actuation 'over' has no use for it"),
        ({"actuation": "under"}, "actuation is 'under', wanted 'over' or 'full'"),
    ],
)
def test_options_that_do_not_exist(full_modal: ModalModel, options: dict[str, Any], message: str) -> None:
    with pytest.raises(DomainError, match=message):
        decouple(full_modal, **{"actuation": "full", **options})


def test_too_few_actuators(small_modal: ModalModel, full_modal: ModalModel) -> None:
    with pytest.raises(AssumptionError, match=r"2 active actuators cannot drive 3 modes.*actuation='full'"):
        decouple(full_modal, n_flex=1)
    with pytest.raises(AssumptionError, match="1 active actuators cannot drive 2 modes"):
        decouple(with_actuators(small_modal, [3]), n_flex=1, actuation="full")
