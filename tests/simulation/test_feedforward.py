"""Guards the rigid-body feedforward: its units, that it leaves preserved modes alone, and the search for the worst."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.plant import ModalModel
from lpvhinf.plant.mmpa import MMPA
from lpvhinf.simulation import RigidBodyFeedforward, mode_excitation, worst_excitation
from lpvhinf.simulation.search import largest_over_box

LIMIT = 1e-10


@pytest.fixture(scope="module")
def points(mmpa: MMPA) -> Array:
    return np.vstack([[[0.0, 0.0]], spread_points(mmpa.box, 12, seed=5)])


def conventional(plant: MMPA | ModalModel, n_flex: int) -> DecoupledPlant:
    return decouple(plant, n_flex=n_flex, input_decoupling="rigid-body", degree=0)


# The feedforward


def test_the_wrench_at_the_actuators_is_mass_times_acceleration(mmpa: MMPA, points: Array) -> None:
    plant = decouple(mmpa, n_flex=3, degree=0)
    acceleration = np.array([10.0, -4.0, 1.0, 20.0, -30.0, 5.0])
    feedforward = RigidBodyFeedforward(plant=plant)
    currents = feedforward.actuators(points, acceleration)
    found = np.einsum("nwu,nu->nw", mmpa.wrench_matrix(points), currents)
    wanted = np.concatenate([mmpa.mass * acceleration[:3], mmpa.inertia @ acceleration[3:]])
    assert np.allclose(found, wanted, rtol=0, atol=1e-9 * np.max(np.abs(wanted)))
    assert np.allclose(feedforward.wrench(acceleration), wanted, rtol=1e-12)


def test_the_decoupled_input_is_the_acceleration(small_modal: ModalModel) -> None:
    """S S^T M_rb is the identity, which makes it so."""
    feedforward = RigidBodyFeedforward(plant=decouple(small_modal, n_flex=2, degree=0))
    a = np.array([[3.0, -7.0], [0.5, 0.0]])
    assert np.allclose(feedforward.modal_forces(a) @ small_modal.rigid_body_scaling.T, a, rtol=1e-12)
    assert feedforward.inputs(a).tolist() == [[3.0, -7.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]]


def test_every_position_may_have_its_own_acceleration(small_plant: DecoupledPlant, small_positions: Array) -> None:
    feedforward = RigidBodyFeedforward(plant=small_plant)
    a = np.arange(2.0 * len(small_positions)).reshape(-1, 2)
    one_by_one = [feedforward.actuators(p[None], row)[0] for p, row in zip(small_positions, a, strict=True)]
    assert np.allclose(feedforward.actuators(small_positions, a), one_by_one)


def test_wrong_accelerations(small_plant: DecoupledPlant) -> None:
    feedforward = RigidBodyFeedforward(plant=small_plant)
    with pytest.raises(DimensionError, match=r"acceleration has shape \(3,\), wanted \(2\)"):
        feedforward.inputs([1.0, 2.0, 3.0])
    with pytest.raises(DomainError, match="acceleration"):
        feedforward.wrench([np.nan, 0.0])


def test_what_the_feedforward_does_not_cancel(small_modal: ModalModel, small_positions: Array) -> None:
    exact = RigidBodyFeedforward(plant=decouple(small_modal, n_flex=1, degree=0))
    assert np.max(exact.residual(small_positions)) < LIMIT
    # two forces for two axes and a mode: the least-squares fit gives up a share of the rigid-body motion
    full = decouple(small_modal, n_flex=1, actuation="full", mode_weight=2.0, degree=0)
    left = RigidBodyFeedforward(plant=full).residual(small_positions)
    assert np.max(left) == pytest.approx(full.coupling(small_positions).rigid, rel=1e-9)
    assert np.min(left) > 0.05


def test_a_wrong_mass_is_not_cancelled(small_modal: ModalModel, small_positions: Array) -> None:
    """A plant with inputs 10 % stronger than known moves 10 % too far in every direction."""
    strong = ModalModel.from_modal_data(
        omega=small_modal.omega,
        zeta=small_modal.zeta,
        input_gains=lambda p: 1.1 * small_modal.input_gains(p),
        output_gains=small_modal.output_gains,
        box=small_modal.box,
        mass_matrix_rb=small_modal.mass_matrix_rb,
        rigid_body_scaling=small_modal.rigid_body_scaling,
    )
    plant = decouple(SimpleNamespace(modal=strong, known=small_modal), n_flex=1, degree=0)
    assert np.allclose(RigidBodyFeedforward(plant=plant).residual(small_positions), 0.1, rtol=1e-9)


# Excitation


@pytest.mark.parametrize("n_flex", [1, 3])
def test_extended_decoupling_leaves_the_preserved_modes_alone(mmpa: MMPA, points: Array, n_flex: int) -> None:
    """The paper's claim, on the benchmark; the conventional decoupling does excite them."""
    found = mode_excitation(decouple(mmpa, n_flex=n_flex, degree=0), points)
    assert found.preserved < LIMIT
    without = mode_excitation(conventional(mmpa, n_flex), points)
    assert np.min(np.max(np.abs(without.relative[:, :n_flex]), axis=(0, 2))) > 0.2  # every one of them
    assert found.discarded > 0.1  # the others are not helped


def test_gains_are_forces_of_the_actuators_on_the_modes(mmpa: MMPA, points: Array) -> None:
    for plant in (decouple(mmpa, n_flex=1, degree=0), conventional(mmpa, 1)):
        currents = plant.matrices(points)[1][:, :, :6]
        wanted = mmpa.modal.input_gains(points)[:, 6:] @ currents
        assert np.allclose(mode_excitation(plant, points).gain, wanted, rtol=0, atol=1e-9 * np.max(np.abs(wanted)))


def test_relative_gains_do_not_depend_on_units(mmpa: MMPA, points: Array) -> None:
    """A unit of relative force accelerates the mass-normalised rigid body by one."""
    found = mode_excitation(conventional(mmpa, 1), points)
    force = np.sqrt(np.diag(mmpa.modal.mass_matrix_rb))
    assert np.allclose(found.relative * force, found.gain)


def test_the_search_beats_a_grid(mmpa: MMPA) -> None:
    plant = conventional(mmpa, 1)
    worst = worst_excitation(plant)
    axes = np.linspace(-0.06, 0.06, 13)
    grid = np.stack([x.ravel() for x in np.meshgrid(axes, axes)], axis=-1)
    sampled = np.max(np.abs(mode_excitation(plant, grid).gain[:, 0]), axis=0)
    assert np.all(worst.gain[0] > 0.98 * sampled)
    at = mode_excitation(plant, worst.position[0]).gain[:, 0]
    assert np.allclose(np.abs(np.diagonal(at)), worst.gain[0], rtol=1e-9)


def test_the_search_finds_nothing_with_the_extended_decoupling(mmpa: MMPA) -> None:
    worst = worst_excitation(decouple(mmpa, n_flex=2, degree=0), n_search=16, n_starts=1)
    assert worst.relative.shape == (2, 6)
    assert np.max(worst.relative) < LIMIT


@pytest.mark.parametrize(("modes", "options"), [([3], {}), ([], {}), ([-1], {}), ([0], {"n_search": 0})])
def test_wrong_searches(small_plant: DecoupledPlant, modes: list[int], options: dict[str, int]) -> None:
    with pytest.raises(DomainError, match=r"modes is|n_search is 0"):
        worst_excitation(small_plant, modes, **options)


# The search


def test_many_functions_at_once() -> None:
    box = np.array([[-1.0, 1.0], [0.0, 4.0]])
    tops = np.array([[0.2, 3.1], [-1.0, 0.0], [0.9, 1.7]])

    def functions(points: Array) -> Array:
        distance = (points[:, None] - tops) / np.array([1.0, 2.0])
        return np.asarray([2.0, 5.0, -1.0] - np.sum(distance**2, axis=2))

    values, places = largest_over_box(functions, box, n_search=32)
    assert np.allclose(values, [2.0, 5.0, -1.0], atol=1e-5)
    assert np.allclose(places, tops, atol=1e-2)


def test_the_higher_of_two_hills() -> None:
    def functions(points: Array) -> Array:
        x = points[:, :1]
        return np.asarray(np.exp(-((x - 0.2) ** 2) / 0.01) + 1.1 * np.exp(-((x - 0.8) ** 2) / 0.002))

    value, place = largest_over_box(functions, np.array([[0.0, 1.0]]), n_search=32)
    assert place[0, 0] == pytest.approx(0.8, abs=1e-3)
    assert value[0] == pytest.approx(1.1, abs=1e-4)
