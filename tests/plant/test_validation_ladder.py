"""The high-fidelity actuator as a whole: response, energy, rigid limit, conditioning and currents.

The lower rungs are in test_plate.py (free plate, finite elements, mover) and test_exact_magnetics.py (forces, reaction,
linked flux).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.decoupling import decouple
from lpvhinf.fitting import spread_points
from lpvhinf.plant import MechanicalModel
from lpvhinf.plant.mmpa import MMPA, MMPAParameters, benchmark
from lpvhinf.plant.mmpa.mover import mover

POSITIONS = np.array([[0.0, 0.0], [0.06, -0.06], [0.0233, 0.0411]])


@pytest.fixture(scope="module")
def plant() -> MMPA:
    return benchmark()


def mechanical_response(model: MechanicalModel, p: Array, omega: float) -> tuple[Array, Array, Array]:
    """q (n_q, n_u), Phi_a and Phi_s at one frequency and position, from M, D and K themselves."""
    phi_a, phi_s = np.asarray(model.input_map(p[None])[0]), np.asarray(model.output_map(p[None])[0])
    return np.linalg.solve(-(omega**2) * model.M + 1j * omega * model.D + model.K, phi_a), phi_a, phi_s


@pytest.mark.parametrize("p", POSITIONS)
def test_energy_balance(plant: MMPA, p: Array):
    omega = 2 * np.pi * 200.0
    q, phi_a, _ = mechanical_response(plant.mechanical, p, omega)
    u = np.random.default_rng(0).standard_normal(160)
    v = 1j * omega * (q @ u)
    supplied = 0.5 * np.real(np.conj(v) @ (phi_a @ u))
    dissipated = 0.5 * np.real(np.conj(v) @ (plant.mechanical.D @ v))
    kinetic = 0.5 * np.real(np.conj(v) @ (plant.mechanical.M @ v))
    assert dissipated > 0.0
    assert supplied == pytest.approx(dissipated, rel=1e-9)
    # what is dissipated is the modal damping of the motion that the modal model sees
    modal, at = plant.modal, plant.modal.gains(p[None])
    eta = (at.input_gains[0] @ u) / (modal.omega**2 - omega**2 + 2j * modal.zeta * modal.omega * omega)
    in_modes = np.sum(modal.zeta * modal.omega * np.abs(omega * eta) ** 2)
    assert in_modes == pytest.approx(dissipated, rel=0.05)
    assert kinetic > dissipated / omega


def test_residues_are_input_times_output_gains(plant: MMPA):
    # poles and residues of the equations of motion, against the gains of the modal model
    p = POSITIONS[2]
    model = plant.mechanical
    n = len(model.M)
    inverse = np.linalg.inv(model.M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ model.K, -inverse @ model.D]])
    phi_a, phi_s = np.asarray(model.input_map(p[None])[0]), np.asarray(model.output_map(p[None])[0])
    poles, left, right = scipy.linalg.eig(A, left=True)
    gains = plant.modal.gains(p[None])
    B, C = gains.input_gains[0], gains.output_gains[0]
    for mode in (6, 7, 8, 12):
        w, zeta = plant.modal.omega[mode], plant.modal.zeta[mode]
        damped = w * np.sqrt(1.0 - zeta**2)
        k = int(np.argmin(np.abs(poles - (-zeta * w + 1j * damped))))
        assert abs(poles[k] - (-zeta * w + 1j * damped)) < 1e-6 * w
        scale = np.conj(left[:, k]) @ right[:, k]
        residue = np.outer(phi_s @ right[:n, k], np.conj(left[n:, k]) @ inverse @ phi_a) / scale
        expected = np.outer(C[:, mode], B[mode]) / (2j * damped)
        assert np.max(np.abs(residue - expected)) < 1e-3 * np.max(np.abs(expected))


@pytest.mark.parametrize("p", POSITIONS)
def test_frequency_response_of_the_modal_model(plant: MMPA, p: Array):
    gains, modal = plant.modal.gains(p[None]), plant.modal
    for hertz in (10.0, 100.0, 300.0):
        omega = 2 * np.pi * hertz
        q, _, phi_s = mechanical_response(plant.mechanical, p, omega)
        eta = gains.input_gains[0] / (modal.omega**2 - omega**2 + 2j * modal.zeta * modal.omega * omega)[:, None]
        response = gains.output_gains[0] @ eta + gains.compliance[0]
        # 15 modes up to 1.4 kHz; of the others the static compliance
        assert np.max(np.abs(response - phi_s @ q)) < 4e-3 * np.max(np.abs(response))


def test_rigid_limit(plant: MMPA):
    stiff = replace(plant.mechanical, K=1e6 * plant.mechanical.K)
    p, omega = POSITIONS[2], 2 * np.pi * 50.0
    q, _, phi_s = mechanical_response(stiff, p, omega)
    inertia = scipy.linalg.block_diag(plant.mass * np.eye(3), plant.inertia)
    rigid = np.linalg.solve(inertia, plant.wrench_matrix(p[None])[0]) / -(omega**2)
    root = np.linalg.inv(plant.modal.rigid_body_scaling)
    seen = plant.modal.output_gains(p[None])[0][:, :6] @ root
    assert np.max(np.abs(phi_s @ q - seen @ rigid)) < 1e-5 * np.max(np.abs(seen @ rigid))
    # the plate as it is deviates visibly at the same frequency: the limit says something
    q, _, phi_s = mechanical_response(plant.mechanical, p, omega)
    assert np.max(np.abs(phi_s @ q - seen @ rigid)) > 1e-2 * np.max(np.abs(seen @ rigid))


def row_scaled_condition(B: Array, weights: Array) -> Array:
    """Condition numbers of the rows of active coils, forces against torques over 0.1 m."""
    root = np.sqrt(weights)[:, None, :]
    scale = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
    return np.asarray(np.linalg.cond(B / scale[:, None] * root))


def test_condition_numbers(plant: MMPA):
    points = spread_points(plant.box, 60)
    weights = plant.coil_weights(points)
    wrench = row_scaled_condition(plant.wrench_matrix(points), weights)
    assert 1.8 < wrench.min() <= wrench.max() < 2.7  # 2.1 to 2.6 with forty coils switched hard
    B = plant.modal.input_gains(points)[:, :11] * np.sqrt(weights)[:, None, :]
    rows = np.linalg.cond(B / np.linalg.norm(B, axis=2, keepdims=True))
    assert rows.max() < 5.0  # at most 4 with forty coils


def test_force_constants_and_currents(plant: MMPA):
    points = spread_points(plant.box, 200)
    kz = np.abs(plant.wrench_matrix(points)[:, 2])
    assert kz[:, :80].max() == pytest.approx(7.4, rel=0.02)
    assert kz[:, 80:].max() == pytest.approx(3.7, rel=0.03)
    levitation = np.abs(plant.levitation_current(points))
    assert 1.9 < levitation.max() < 2.6  # 2.4 with smooth weights
    rms40 = np.sqrt(np.sum(levitation**2, axis=1) / 40.0)  # of 40 active coils, as in the description
    assert 0.6 < rms40.min() <= rms40.max() < 0.82
    assert np.abs(plant.levitation_current(points, [10.0, 0.0, 0.0])).max() < 4.05  # amplifier: 4 A
    force = np.einsum("nij,nj->ni", plant.wrench_matrix(points), plant.levitation_current(points))
    assert force == pytest.approx(np.array([[0.0, 0.0, 9.81 * plant.mass, 0.0, 0.0, 0.0]]).repeat(200, 0), abs=1e-9)


def test_position_dependence(plant: MMPA):
    # torsion at the first z-beam and at the point of control; umbrella per newton of vertical force
    p = np.array([[0.0, 0.0], [0.06, 0.06]])
    root = np.sqrt(plant.mass)
    assert np.abs(plant.modal.output_gains(p)[:, 0, 6]) * root == pytest.approx([0.77, 0.04], abs=0.01)
    assert np.abs(plant.performance_gains(p)[:, 2, 6]) * root == pytest.approx([0.02, 0.66], abs=0.01)
    # the description switches the twenty strongest coils of each layer on and off
    umbrella = []
    for B, W in zip(plant.modal.input_gains(p), plant.wrench_matrix(p), strict=True):
        strong = np.linalg.norm(W / np.array([[1.0, 1.0, 1.0, 0.1, 0.1, 0.1]]).T, axis=0)
        active = np.concatenate([np.argsort(-strong[:80])[:20], 80 + np.argsort(-strong[80:])[:20]])
        umbrella.append(abs(B[8, active] @ np.linalg.pinv(W[:, active])[:, 2]) * root)
    # its field was sampled every 5 mm and its modal force taken at the conductors: a looser comparison
    assert umbrella == pytest.approx([0.53, 0.21], abs=0.08)


def test_decoupling_is_exact_in_the_exact_field(plant: MMPA):
    report = decouple(plant, n_flex=3).verify(spread_points(plant.box, 40))
    assert report.rigid_body < 1e-11
    assert report.preserved_excitation < 1e-12


def test_commutation_on_the_first_harmonic_is_a_realistic_model_error():
    real = benchmark(commutation="first-harmonic")
    assert real.known is not real.modal
    points = spread_points(real.box, 40)
    unit = decouple(real, n_flex=1).sample(points).B[:, :6, :6]
    error = np.abs(unit - np.eye(6))
    diagonal = np.einsum("nii->ni", error)[:, :3]
    assert 0.001 < diagonal.max() < 0.15


def test_mover_alone_has_the_published_frequencies():
    body = mover(MMPAParameters())
    values = scipy.linalg.eigh(body.K, body.M, eigvals_only=True)
    hertz = np.sqrt(np.maximum(values[6:], 0.0)) / (2 * np.pi)
    published = [139.4, 206.5, 259.9, 362, 368, 645, 655, 671, 745, 817, 1118, 1131, 1240, 1290, 1406]
    assert hertz[:15] == pytest.approx(published, abs=0.5)


def test_tables_fit_in_memory(plant: MMPA):
    tables = plant.mechanical.input_map.coils.tables  # type: ignore[attr-defined]
    assert sum(table.coefficients.nbytes for table in tables) < 4e8
