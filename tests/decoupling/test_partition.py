"""Guards the dynamics of independent modes and the compliance of the discarded ones."""

from __future__ import annotations

import numpy as np

from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.decoupling.partition import compliance_correction, mode_dynamics
from lpvhinf.fitting import spread_points


def test_modes_have_their_frequencies_and_damping() -> None:
    omega, zeta = np.array([0.0, 3.0, 50.0]), np.array([0.0, 0.1, 0.02])
    A = mode_dynamics(omega, zeta)
    for i, (w, z) in enumerate(zip(omega, zeta, strict=True)):
        block = A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        assert np.allclose(np.poly(block), [1.0, 2 * z * w, w**2], rtol=0, atol=1e-12)
    outside = A * (1.0 - np.kron(np.eye(3), np.ones((2, 2))))
    assert np.all(outside == 0.0)


def test_correction_is_the_formula_of_eq_9() -> None:
    rng = np.random.default_rng(0)
    omega, zeta = np.array([2.0, 5.0, 7.0]), np.array([0.1, 0.02, 0.3])
    C, B = rng.standard_normal((4, 2, 3)), rng.standard_normal((4, 3, 2))
    A_d = mode_dynamics(omega, zeta)
    correction = compliance_correction(C, B, omega)
    for k in range(4):
        C_d, B_d = np.kron(C[k], [[1.0, 0.0]]), np.kron(B[k], [[0.0], [1.0]])
        assert np.allclose(correction[k], -C_d @ np.linalg.solve(A_d, B_d), rtol=0, atol=1e-14)


def test_correction_is_the_static_gain_of_what_is_left_out(
    small_plant: DecoupledPlant, decoupled_mmpa: DecoupledPlant
) -> None:
    for plant in (small_plant, decoupled_mmpa):
        points = spread_points(plant.box, 5)
        left_out = slice(2 * (plant.n_rb + plant.n_flex), None)
        correction = plant.static_correction(points)
        for k, system in enumerate(plant.frozen(points)):
            A, B, C, D = (m[0] for m in system.sample(points[:1]))
            static = D - C[:, left_out] @ np.linalg.solve(A[left_out, left_out], B[left_out])
            scale = np.max(np.abs(static))
            assert scale > 0.0
            assert np.allclose(correction[k], static, rtol=0, atol=1e-12 * scale)
            assert not np.allclose(D, static, rtol=0, atol=1e-3 * scale)
