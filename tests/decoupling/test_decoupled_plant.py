"""Guards the decoupled plant: exact rigid axes and untouched preserved modes at every position of P."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.plant import ModalModel
from lpvhinf.plant.mmpa import MMPA


def everywhere(box: Array, n: int = 200) -> Array:
    corners = np.array(list(itertools.product(*box)))
    return np.vstack([corners, box.mean(axis=1)[None], spread_points(box, n, seed=11)])


def with_output_gains(modal: ModalModel, factors: Array) -> ModalModel:
    """The same plant whose sensors see every mode by another factor."""
    return dataclasses.replace(modal, output_map=lambda points: modal.output_gains(points) * factors)


@pytest.mark.parametrize("n_flex", [1, 2, 3])
def test_structure_of_the_benchmark_at_every_position(mmpa: MMPA, n_flex: int) -> None:
    plant = decouple(mmpa, n_flex=n_flex)
    points = everywhere(plant.box)
    gains, n_rb = plant.sample(points), 6
    assert len(points) >= 200
    assert np.max(np.abs(gains.B[:, :n_rb, :n_rb] - np.eye(n_rb))) < 1e-10
    assert np.max(np.abs(gains.C[:, :, :n_rb] - np.eye(plant.n_out, n_rb))) < 1e-10
    preserved = gains.B[:, n_rb : n_rb + n_flex]
    largest = np.max(np.abs(gains.B[:, n_rb:, :n_rb]), axis=(0, 1))
    assert np.max(np.abs(preserved[:, :, :n_rb]) / largest) < 1e-10
    assert np.max(np.abs(preserved[:, :, n_rb:] - np.eye(n_flex))) < 1e-10
    report = plant.verify(points)
    assert report.n_points == len(points)
    assert max(report.rigid_body, report.preserved_excitation) < 1e-10


def test_rigid_body_decoupling_excites_the_preserved_modes(mmpa: MMPA) -> None:
    points = everywhere(mmpa.box, 60)
    conventional = decouple(mmpa, n_flex=1, input_decoupling="rigid-body").verify(points)
    assert conventional.rigid_body < 1e-10
    assert 0.1 < conventional.preserved_excitation <= 1.0
    assert decouple(mmpa, n_flex=1).verify(points).preserved_excitation < 1e-10


@pytest.mark.parametrize("option", ["extended", "rigid-body"])
def test_transformations_are_one_sided_inverses(mmpa: MMPA, option: str) -> None:
    """Against the physical wrench and sensors of the benchmark, in SI units."""
    plant = decouple(mmpa, n_flex=2, input_decoupling=option)
    points = everywhere(plant.box, 20)
    T_y, T_u = plant.matrices(points)
    mass_matrix = np.diag([mmpa.mass] * 3 + [0.0] * 3)
    mass_matrix[3:, 3:] = mmpa.inertia
    acceleration = np.linalg.solve(mass_matrix, mmpa.wrench_matrix(points) @ T_u)
    assert np.allclose(acceleration, np.eye(6, 8), rtol=0, atol=1e-9)
    seen = mmpa.modal.output_gains(points)[:, :, :6] @ np.linalg.inv(mmpa.modal.rigid_body_scaling)
    assert np.allclose(T_y @ seen, np.eye(9, 6), rtol=0, atol=1e-10)  # three sensors are redundant
    modal_force = mmpa.modal.input_gains(points)[:, 6:8] @ T_u[:, :, 6:]
    assert np.allclose(modal_force, np.eye(2), rtol=0, atol=1e-9)


def flexible_part(modal: ModalModel, p: Array, s: complex) -> Array:
    """The plant's response without its rigid-body modes, as a sum over the flexible ones."""
    B, C, total = modal.input_gains(p)[0], modal.output_gains(p)[0], modal.compliance(p)[0].astype(complex)
    for i in range(modal.n_rb, modal.n_modes):
        w, z = modal.omega[i], modal.zeta[i]
        total += np.outer(C[:, i], B[i]) / (s**2 + 2 * z * w * s + w**2)
    return np.asarray(total)


@pytest.mark.parametrize("name", ["benchmark", "small", "small, rigid-body inputs"])
def test_rigid_axes_are_double_integrators(
    decoupled_mmpa: DecoupledPlant, small_plant: DecoupledPlant, name: str
) -> None:
    plant = decoupled_mmpa if name == "benchmark" else small_plant
    if name.endswith("inputs"):
        plant = decouple(plant.modal, n_flex=2, input_decoupling="rigid-body")
    n_rb = plant.n_rb
    points = everywhere(plant.box, 3)
    T_y, T_u = plant.matrices(points)
    for k, (p, frozen) in enumerate(zip(points, plant.frozen(points), strict=True)):
        local, system = plant.modal.local_model(p), frozen.at(p)
        for s in (5j, 700j, 2 * np.pi * 139.0j):
            whole = T_y[k] @ local(s) @ T_u[k]
            assert np.allclose(system(s), whole, rtol=1e-9, atol=1e-9 * np.max(np.abs(whole)))
            rigid = whole - T_y[k] @ flexible_part(plant.modal, p, s) @ T_u[k]
            wanted = np.zeros((plant.n_out, n_rb + plant.n_flex))
            wanted[:n_rb, :n_rb] = np.eye(n_rb)
            assert np.allclose(rigid * s**2, wanted, rtol=0, atol=1e-9)


@pytest.mark.parametrize("option", ["extended", "rigid-body"])
def test_polynomial_model_is_the_plant_to_within_its_error(small_modal: ModalModel, option: str) -> None:
    plant = decouple(small_modal, n_flex=1, degree=6, input_decoupling=option)
    points = everywhere(plant.box, 40)
    names = {"B": (slice(2 * plant.n_rb + 1, None, 2), slice(None)), "C": (slice(None), slice(2 * plant.n_rb, None, 2))}
    whole = dict(zip("ABCD", plant.system.sample(points), strict=True))
    for k, frozen in enumerate(plant.frozen(points)):
        local = dict(zip("ABCD", (m[0] for m in frozen.sample(points[:1])), strict=True))
        assert np.array_equal(local["A"], whole["A"][k])
        for name in "BCD":
            rows, cols = names.get(name, (slice(None), slice(None)))
            deviation = np.abs(local[name] - whole[name][k])
            error = plant.fit[name].error  # largest at the test positions: twice that elsewhere
            assert np.all(deviation[rows, cols] <= 2.0 * error + 1e-12 * plant.fit[name].scale)
            deviation[rows, cols] = 0.0
            assert np.max(deviation) < 1e-11  # the structural part
    assert 1e-8 < plant.fit["B"].relative_error < 1e-4
    assert decouple(small_modal, n_flex=1, degree=16, input_decoupling=option).fit["B"].relative_error < 1e-13


def test_redundant_sensors_see_flexible_modes_only(mmpa: MMPA, decoupled_mmpa: DecoupledPlant) -> None:
    rigid_only = decouple(mmpa, n_flex=1, sensing="rigid-body", degree=10)
    points = everywhere(mmpa.box, 20)
    assert (decoupled_mmpa.n_out, rigid_only.n_out) == (9, 6)
    for ours, theirs in zip(decoupled_mmpa.matrices(points), rigid_only.matrices(points), strict=True):
        assert np.array_equal(ours[:, :6], theirs[:, :6])
    T_y = decoupled_mmpa.matrices(points)[0][:, 6:]
    assert np.allclose(T_y @ np.swapaxes(T_y, 1, 2), np.eye(3), rtol=0, atol=1e-9)
    C = decoupled_mmpa.sample(points).C
    assert np.max(np.abs(C[:, 6:, :6])) < 1e-10
    assert np.min(np.linalg.norm(C[:, 6:, 6], axis=1)) > 0.1 * np.max(np.linalg.norm(C[:, 6:, 6], axis=1))


def test_redundant_rows_follow_sensors_whose_sensitivity_depends_on_p(small_modal: ModalModel) -> None:
    def uneven(points: Array) -> Array:
        sensitivity = 1.0 + 3.0 * points[:, :, None] * np.array([[1.0], [-1.0], [0.5]])
        return np.asarray(small_modal.output_gains(points) * sensitivity)

    plant = decouple(dataclasses.replace(small_modal, output_map=uneven), n_flex=1)
    points = everywhere(plant.box, 20)
    fixed = plant.redundancy @ uneven(points)[:, :, :2]
    assert np.max(np.abs(fixed)) > 0.1  # fixed rows would see rigid-body motion
    assert np.max(np.abs(plant.sample(points).C[:, 2:, :2])) < 1e-12


def test_fit_error_is_measured(small_plant: DecoupledPlant) -> None:
    for name, fit in small_plant.fit.items():
        where = spread_points(small_plant.box, fit.n_test)
        gains = small_plant.sample(where)
        truth = {"B": gains.B[:, 2:], "C": gains.C[:, :, 2:], "D": gains.D}[name]
        deviation = np.max(np.abs(fit.matrix.sample(where) - truth), axis=0)
        scale = np.max(np.abs(truth))
        assert np.allclose(deviation, fit.error, rtol=1e-6, atol=1e-12 * scale)
        assert fit.scale == pytest.approx(scale, rel=1e-6)


def test_structural_numbers_of_the_polynomial_model_are_exact(decoupled_mmpa: DecoupledPlant) -> None:
    _, B, C, _ = decoupled_mmpa.system.sample(everywhere(decoupled_mmpa.box, 8))
    assert np.all(B[:, :14] == np.kron(np.eye(7), [[0.0], [1.0]]))
    assert np.all(C[:, :, :12] == np.kron(np.eye(9, 6), [[1.0, 0.0]]))


def test_benchmark_needs_no_preparation(mmpa: MMPA, decoupled_mmpa: DecoupledPlant) -> None:
    """The plant's own coil weights are used, also when the modal model alone is given."""
    p = mmpa.box[:, 1][None]
    same = decouple(mmpa.modal, n_flex=1, weight=mmpa.coil_weights)
    assert np.array_equal(same.sample(p).B, decoupled_mmpa.sample(p).B)
    assert decoupled_mmpa.discarded == slice(7, None)
    assert not np.array_equal(decouple(mmpa.modal, n_flex=1).sample(p).B, decoupled_mmpa.sample(p).B)


def test_too_few_actuators(small_modal: ModalModel) -> None:
    fewer = dataclasses.replace(
        small_modal, input_map=lambda p: small_modal.input_gains(p)[:, :, :4], residual=None, input_names=()
    )
    assert decouple(fewer, n_flex=2).n_flex == 2
    with pytest.raises(AssumptionError, match="4 active actuators cannot drive 5 modes"):
        decouple(fewer, n_flex=3)


def test_too_few_sensors(small_modal: ModalModel) -> None:
    fewer = dataclasses.replace(
        small_modal, output_map=lambda p: small_modal.output_gains(p)[:, :1], residual=None, output_names=()
    )
    with pytest.raises(AssumptionError, match="1 sensors cannot tell 2 rigid-body modes apart"):
        decouple(fewer, n_flex=1)


def test_sensors_on_a_nodal_line(small_modal: ModalModel) -> None:
    hidden = with_output_gains(small_modal, np.array([1.0, 1.0, 1.0, 0.0, 1.0]))
    assert decouple(hidden, n_flex=1).n_flex == 1
    with pytest.raises(AssumptionError, match=r"preserved mode 2 \(110\.0 Hz\) is not observable.*lower n_flex"):
        decouple(hidden, n_flex=2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"actuation": "fully"}, "actuation is 'fully', wanted 'over'"),
        ({"input_decoupling": "modal"}, "'extended' or 'rigid-body'"),
        ({"sensing": "some"}, "sensing is 'some', wanted 'all' or 'rigid-body'"),
        ({"n_flex": 4}, "n_flex is 4, wanted 0 to 3"),
        ({"n_flex": -1}, "n_flex is -1"),
        ({"n_flex": 1.5}, "n_flex is 1.5"),
        ({"n_flex": np.nan}, "n_flex is nan"),
        ({"weight": lambda p: np.full((len(p), 7), np.nan)}, r"weight\(points\)\[0, 0\] is nan"),
        ({"weight": lambda p: -np.ones((len(p), 7))}, "wanted entries of at least 0"),
    ],
)
def test_options_that_do_not_exist(small_modal: ModalModel, options: dict[str, Any], message: str) -> None:
    with pytest.raises(DomainError, match=message):
        decouple(small_modal, **options)


@pytest.mark.parametrize("p", [[np.nan, 0.0], [0.2, 0.0]])
def test_positions_outside(decoupled_mmpa: DecoupledPlant, p: list[float]) -> None:
    for evaluate in (decoupled_mmpa.matrices, decoupled_mmpa.sample, decoupled_mmpa.frozen, decoupled_mmpa.verify):
        with pytest.raises(DomainError):
            evaluate([p])


def test_all_and_no_flexible_modes(small_modal: ModalModel) -> None:
    points = everywhere(small_modal.box, 5)
    for n_flex in (0, 3):
        plant = decouple(small_modal, n_flex=n_flex, degree=8)
        assert plant.system.n_u == 2 + n_flex
        assert plant.frozen(points)[0].n_x == 10
        assert max(plant.verify(points).rigid_body, plant.verify(points).preserved_excitation) < 1e-10


def test_a_plant_without_modal_form_is_refused() -> None:
    with pytest.raises(DomainError, match="modal_form"):
        decouple(object())
