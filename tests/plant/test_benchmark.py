"""The planar actuator benchmark: published figures, consistency, commutation, smoothness in p."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant import MechanicalModel
from lpvhinf.plant.mmpa import MMPAParameters, benchmark, weighted_pseudo_inverse
from lpvhinf.plant.mmpa.windows import smoothstep

# Hz; the digits of the benchmark's description
FREQUENCIES = [139.4, 206.5, 259.9, 362, 368, 645, 655, 671, 745, 817, 1118, 1131, 1240, 1290, 1406]
AXIS = np.linspace(-0.06, 0.06, 13)
GRID = np.stack(np.meshgrid(AXIS, AXIS, indexing="ij"), axis=-1).reshape(-1, 2)
UNITS = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])  # torques at a lever of 0.1 m


@pytest.fixture(scope="module")
def plant():
    return benchmark(magnetics="first-harmonic")


@pytest.fixture(scope="module")
def gains(plant):
    return plant.modal.gains(GRID)


def test_published_mass_and_frequencies(plant):
    assert plant.mass == pytest.approx(8.25, abs=0.005)
    assert plant.inertia[0, 0] == pytest.approx(0.062, abs=5e-4)
    assert plant.inertia[2, 2] == pytest.approx(0.125, abs=5e-4)
    assert plant.centre_of_gravity == pytest.approx([0.007, 0.007, 0.0], abs=5e-5)
    assert plant.modal.omega[6:] / (2 * np.pi) == pytest.approx(FREQUENCIES, rel=2e-3)
    assert plant.modal.omega[6:9] / (2 * np.pi) == pytest.approx(FREQUENCIES[:3], abs=0.06)
    assert np.array_equal(plant.modal.zeta, np.repeat([0.0, 0.008], [6, 15])) or np.allclose(
        plant.modal.zeta[6:], 0.008, rtol=1e-9
    )


def test_modal_form_of_the_mover(plant):
    V, M, K = plant.modal.V, plant.mechanical.M, plant.mechanical.K
    assert np.allclose(V.T @ M @ V, np.eye(21), atol=1e-10)
    omega2 = plant.modal.omega**2
    assert np.abs(V.T @ K @ V - np.diag(omega2)).max() < 1e-9 * omega2.max()
    assert np.allclose(np.diag(plant.modal.mass_matrix_rb)[:3], plant.mass)
    assert np.allclose(plant.modal.mass_matrix_rb[3:, 3:], plant.inertia, atol=1e-12)


def test_rigid_output_gains_are_the_geometry_of_the_beams(plant):
    p = np.array([0.02, -0.03])
    C = plant.modal.output_gains(p)[0, :, :6] @ np.linalg.inv(plant.modal.rigid_body_scaling)
    c, s = plant.centre_of_gravity[:2], 0.08
    for row, beam in zip(C[:4], [[s, s], [-s, s], [-s, -s], [s, -s]], strict=True):
        r = np.array(beam) - p - c
        assert row == pytest.approx([0, 0, 1, r[1], -r[0], 0], abs=1e-12)
    for row, y in zip(C[4:7], [s, 0.0, -s], strict=True):
        assert row == pytest.approx([1, 0, 0, 0, 0.012, -(y - p[1] - c[1])], abs=1e-12)
    for row, x in zip(C[7:], [s, -s], strict=True):
        assert row == pytest.approx([0, 1, 0, -0.012, 0, x - p[0] - c[0]], abs=1e-12)


def test_all_rigid_coordinates_are_observable_everywhere(plant, gains):
    C = gains.output_gains[:, :, :6] @ np.linalg.inv(plant.modal.rigid_body_scaling) / UNITS * 0.1
    assert np.linalg.cond(C * np.array([1, 1, 1, 0.1, 0.1, 0.1]) ** -1).max() < 100.0
    assert np.linalg.matrix_rank(C).min() == 6


def test_wrench_figures(plant):
    wrench = plant.wrench_matrix(GRID)
    upper, lower = (np.abs(wrench[:, 2, part]).max() for part in (slice(0, 80), slice(80, 160)))
    assert upper == pytest.approx(7.4, rel=0.1)
    assert lower == pytest.approx(3.7, rel=0.1)
    used = np.sqrt(plant.coil_weights(GRID))[:, None, :]
    condition = np.linalg.cond(wrench / UNITS[:, None] * used)
    assert condition.min() > 1.9
    assert condition.max() < 3.0


def test_rigid_body_gains_are_the_wrench_about_the_centre_of_gravity(plant):
    raw = plant.mechanical.input_map_at(GRID[:5])
    wrench, (c_x, c_y, _) = plant.wrench_matrix(GRID[:5]), plant.centre_of_gravity
    one, x, y = plant.plate.function(1, 0, 0), plant.plate.function(0, 1, 0), plant.plate.function(0, 0, 1)
    F_z = np.einsum("i,nik->nk", one, raw[:, 3:])
    T_x = np.einsum("i,nik->nk", y, raw[:, 3:]) - c_y * F_z
    T_y = -np.einsum("i,nik->nk", x, raw[:, 3:]) + c_x * F_z
    assert np.allclose(wrench, np.stack([raw[:, 0], raw[:, 1], F_z, T_x, T_y, raw[:, 2]], axis=1), atol=1e-12)


def test_levitation_current(plant):
    w = plant.coil_weights(GRID)
    current = plant.levitation_current(GRID)
    wrench = np.einsum("nij,nj->ni", plant.wrench_matrix(GRID), current)
    assert np.allclose(wrench, [0, 0, plant.mass * 9.81, 0, 0, 0], atol=1e-9)
    rms40 = np.sqrt((current**2).sum(axis=1) / 40.0)  # of 40 active coils, as in the description
    assert rms40.min() > 0.6
    assert rms40.max() < 0.82
    assert np.abs(current).max() < 2.9
    assert np.abs(plant.levitation_current(GRID, acceleration=[10.0, 0.0, 0.0])).max() < 4.05  # amplifier: 4 A
    force = np.abs(plant.wrench_matrix(GRID)[:, :3]).sum(axis=1)
    active = np.count_nonzero((w > 1e-6) & (force > 0.01 * force.max()), axis=1)
    assert active.min() >= 40
    assert active.max() <= 64


def test_compliance_stands_for_the_truncated_modes(plant, gains):
    full = benchmark(n_flex=222, magnetics="first-harmonic")
    at = np.array([17, 90])
    B, C = full.modal.input_gains(GRID[at])[:, 21:], full.modal.output_gains(GRID[at])[:, :, 21:]
    wanted = C / full.modal.omega[21:] ** 2 @ B
    assert np.abs(gains.compliance[at] - wanted).max() < 1e-9 * np.abs(wanted).max()
    assert np.allclose(full.modal.zeta[6:], 0.008, rtol=1e-3)
    assert np.abs(gains.compliance).max() > 0.0


def test_local_model_has_its_modes_grouped(plant):
    local = plant.modal.local_model([0.01, 0.02])
    assert local.A.shape == (42, 42)
    assert local.D.shape == (9, 160)
    assert local.A[13, 12] == pytest.approx(-(plant.modal.omega[6] ** 2))
    assert local.output_labels[0] == "z1"


def test_position_dependence_is_large(plant):
    # torsion amplitude times sqrt(mass) at the first z-sensor
    at = plant.modal.output_gains([[0.0, 0.0], [0.06, 0.06]])[:, 0, 6] * np.sqrt(plant.mass)
    assert np.abs(at) == pytest.approx([0.77, 0.04], abs=0.006)


def decoupled_tail(plant, n_flex, degree, axis=0, other=0.007, n=97):
    """Sum of the Chebyshev coefficients above a degree, of the gains that decoupling leaves, over the largest gain."""
    angle = np.pi * (np.arange(n) + 0.5) / n
    points = np.full((n, 2), other)
    points[:, axis] = 0.06 * np.cos(angle)
    wrench = np.linalg.inv(plant.modal.rigid_body_scaling) / UNITS[:, None]
    B = plant.modal.input_gains(points)
    B = np.concatenate([wrench @ B[:, :6], np.sqrt(plant.mass) * B[:, 6:]], axis=1)
    rest = B[:, 6 + n_flex :] @ weighted_pseudo_inverse(B[:, : 6 + n_flex], plant.coil_weights(points))
    cosines = np.cos(np.outer(np.arange(n), angle)) * (2.0 / n)
    coefficients = np.einsum("kn,nij->kij", cosines, rest)
    return float(np.abs(coefficients[degree + 1 :]).sum(axis=0).max() / np.abs(rest).max())


@pytest.mark.parametrize(("axis", "other"), [(0, 0.007), (1, 0.02), (0, 0.055)])
def test_decoupled_gains_converge_in_the_degree(plant, axis, other):
    rigid = [decoupled_tail(plant, 0, degree, axis, other) for degree in (16, 24, 30, 40)]
    assert rigid == sorted(rigid, reverse=True)
    assert rigid[2] < 3e-3
    assert rigid[3] < 6e-4
    assert decoupled_tail(plant, 1, 30, axis, other) < 2.5e-3
    assert decoupled_tail(plant, 1, 40, axis, other) < 5e-4


def test_weights_are_smooth(plant):
    x = np.linspace(-0.06, 0.06, 2001)
    w = plant.coil_weights(np.stack([x, np.full_like(x, 0.01)], axis=1))
    curvature = np.diff(w, n=2, axis=0) / (x[1] - x[0]) ** 2
    jump = np.abs(np.diff(curvature, axis=0)).max()
    assert jump < 0.05 * np.abs(curvature).max()
    t = np.linspace(0.0, 1.0, 11)
    assert np.allclose(smoothstep(t, 2), t**3 * (10 - 15 * t + 6 * t**2))
    for order in (1, 4):
        assert np.allclose(smoothstep(t, order) + smoothstep(1 - t, order), 1.0, atol=1e-15)


def test_weighted_pseudo_inverse_minimises_the_weighted_current():
    rng = np.random.default_rng(3)
    B, w = rng.standard_normal((4, 3, 8)), rng.uniform(0.1, 1.0, (4, 8))
    inverse = weighted_pseudo_inverse(B, w)
    assert np.allclose(B @ inverse, np.eye(3), atol=1e-12)
    root = np.sqrt(w)
    for k in range(4):
        reference = root[k][:, None] * np.linalg.pinv(B[k] * root[k])
        assert np.allclose(inverse[k], reference, atol=1e-12)
        assert np.allclose(weighted_pseudo_inverse(B[k], w[k]), reference, atol=1e-12)
    assert np.allclose(weighted_pseudo_inverse(B[0]), np.linalg.pinv(B[0]), atol=1e-12)


def test_too_few_coils_are_named():
    B = np.random.default_rng(4).standard_normal((2, 3, 6))
    with pytest.raises(AssumptionError, match="Only 2 of 6 inputs are active"):
        weighted_pseudo_inverse(B, [1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    B[1, 2] = B[1, 1]
    with pytest.raises(AssumptionError, match="at position 1: condition number"):
        weighted_pseudo_inverse(B)
    B[1, 2] = 0.0
    with pytest.raises(AssumptionError, match="condition number inf"):
        weighted_pseudo_inverse(B)
    with pytest.raises(DomainError, match="weights has the entry"):
        weighted_pseudo_inverse(B, -np.ones(6))
    with pytest.raises(DimensionError, match="weights has shape"):
        weighted_pseudo_inverse(B, np.ones(5))
    with pytest.raises(DimensionError, match="B has shape"):
        weighted_pseudo_inverse(np.ones(3))
    with pytest.raises(DimensionError, match="positions has shape"):
        weighted_pseudo_inverse(B, positions=np.zeros((3, 2)))


def test_too_few_or_dependent_coils_are_named_with_the_position():
    B = np.random.default_rng(4).standard_normal((2, 3, 6))
    B[1, 2] = B[1, 1] + 2e-7 * B[1, 0, ::-1]
    at = [[0.01, 0.02], [0.03, -0.04]]
    with pytest.raises(AssumptionError, match=r"dependent at p = \[0.03, -0.04\]: condition number \d\.\d+e\+0[67] "):
        weighted_pseudo_inverse(B, positions=at)
    narrow = MMPAParameters(window_short=(0.01, 0.03), window_long=(0.01, 0.03))
    few = benchmark(narrow, magnetics="first-harmonic")
    message = r"Only \d of 160 inputs are active at p = \[-0.06, -0.06\], wanted at least 6.*condition number inf"
    with pytest.raises(AssumptionError, match=message):
        few.levitation_current(GRID)


def test_bad_use_is_named(plant):
    with pytest.raises(DomainError, match="outside the box"):
        plant.coil_weights([[0.07, 0.0]])
    with pytest.raises(DomainError, match="n_flex is -1"):
        benchmark(n_flex=-1)
    with pytest.raises(DomainError, match="n_flex is 223, wanted a whole number from 0 to 222"):
        benchmark(n_flex=223, magnetics="first-harmonic")
    with pytest.raises(DomainError, match="magnetics is 'dipoles', wanted one of exact, first-harmonic"):
        benchmark(magnetics="dipoles")
    with pytest.raises(DomainError, match="magnetics or commutation is 3, wanted one of exact, first-harmonic, or an"):
        benchmark(magnetics="first-harmonic", commutation=3)
    with pytest.raises(DomainError, match="parameters is a dict"):
        benchmark({"side": 0.3})
    with pytest.raises(DomainError, match="effects is a dict"):
        benchmark(effects={})
    with pytest.raises(DimensionError, match="acceleration"):
        plant.levitation_current([[0.0, 0.0]], [1.0])


def test_another_magnetics_is_accepted(plant):
    class Doubled:
        """A stand-in for a more exact field."""

        n_coils = 160

        def wrench(self, points):
            return 2.0 * plant.mechanical.input_map.coils.wrench(points)

    double = benchmark(magnetics=Doubled(), n_flex=3)
    assert double.known is double.modal
    assert np.allclose(double.modal.input_gains(GRID[:2]), 2.0 * plant.modal.input_gains(GRID[:2])[:, :9])
    assert isinstance(double.mechanical, MechanicalModel)


def test_parameters_change_the_plant():
    stiff = benchmark(replace(MMPAParameters(), youngs_modulus=4 * 70e9), n_flex=1, magnetics="first-harmonic")
    assert stiff.modal.omega[6] / (2 * np.pi) == pytest.approx(2 * 139.4, rel=1e-3)
