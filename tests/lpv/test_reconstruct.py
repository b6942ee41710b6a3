"""The controller from R, S: it reaches the level of the inequalities, continuously in p."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, SynthesisError
from lpvhinf.lpv.bounded_real import frozen_norm, proven_level, smallest_margin
from lpvhinf.lpv.gridded import gridded_lmis
from lpvhinf.lpv.reconstruct import (
    ConstantFactor,
    check_reconstructible,
    constant_factor,
    controller_matrices,
    feedthrough,
    loop_lyapunov,
)
from lpvhinf.lpv.solve_lmi import solve_lmi
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.lpv.small_plants import random_plant


def solved(plant: GeneralizedPlant) -> tuple[Array, Array, float]:
    lmis = gridded_lmis([plant], [[0.0]], constant="both", r_max=1e5)
    solution = solve_lmi(lmis.problem, gap=1e-2)
    assert solution.usable
    R, S = lmis.lyapunov(solution).at([0.0])
    return R, S, solution.gamma


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_closed_loop_reaches_the_level(seed: int) -> None:
    plant = random_plant(seed)
    R, S, gamma = solved(plant)
    level, zero = 1.01 * gamma, np.zeros((4, 4))
    factor = constant_factor("N", R, S)
    K = controller_matrices(plant, R, S, level, factor, np.zeros((2, 2)))
    P, _ = loop_lyapunov(R, S, factor, zero, zero)
    loop = plant.close(*K)
    proven = proven_level(*loop, P, np.zeros_like(P))
    assert frozen_norm(*loop) <= proven * (1 + 1e-9) <= level * (1 + 1e-6)
    assert smallest_margin(*loop, P, np.zeros_like(P), 1.001 * proven) > 0.0
    # a controller that is not this one proves less
    worse = plant.close(K[0], 1.5 * K[1], K[2], K[3])
    assert proven_level(*worse, P, np.zeros_like(P)) > proven


def test_any_factor_gives_the_same_controller_up_to_its_state() -> None:
    plant = random_plant(3)
    R, S, gamma = solved(plant)
    other = ConstantFactor(side="M", matrix=np.random.default_rng(0).normal(size=(4, 4)) + 4.0 * np.eye(4))
    responses = []
    for factor in (constant_factor("N", R, S), constant_factor("M", R, S), other):
        A, B, C, _ = controller_matrices(plant, R, S, 1.02 * gamma, factor, np.zeros((2, 2)))
        responses.append(C @ np.linalg.solve(2.0j * np.eye(4) - A, B))
    for response in responses[1:]:
        assert np.allclose(response, responses[0], rtol=1e-6)


@pytest.mark.parametrize("seed", [0, 5])
def test_feedthrough_reaches_what_parrott_allows(seed: int) -> None:
    plant = random_plant(seed, direct=1.0)
    D12, D21, D11 = plant.D12, plant.D21, plant.D11
    left = np.eye(3) - D12 @ np.linalg.pinv(D12)
    right = np.eye(3) - np.linalg.pinv(D21) @ D21
    floor = max(np.linalg.norm(left @ D11, 2), np.linalg.norm(D11 @ right, 2))
    for gamma in (1.001 * floor, 1.5 * floor):
        assert np.linalg.norm(D11 + D12 @ feedthrough(plant, gamma) @ D21, 2) <= gamma * (1 + 1e-9)
    with pytest.raises(SynthesisError, match="feed-through alone"):
        feedthrough(plant, 0.99 * floor)


@pytest.mark.parametrize("side", ["M", "N"])
def test_rate_of_the_loop_lyapunov_matrix(side: str) -> None:
    """P and dP/dt agree with differences along R(t) where the other matrix is constant."""
    rng = np.random.default_rng(4)
    M = rng.normal(size=(3, 3))
    R0, S0 = M @ M.T + 3.0 * np.eye(3), 2.0 * np.eye(3)
    slope = 0.3 * (M + M.T)
    factor = constant_factor(side, R0, S0)

    def pair(t: float) -> tuple[Array, Array]:
        return (R0 + t * slope, S0) if side == "N" else (R0, S0 + t * slope)

    zero, h = np.zeros((3, 3)), 1e-5
    rates = (slope, zero) if side == "N" else (zero, slope)
    P, P_dot = loop_lyapunov(*pair(0.0), factor, *rates)
    ahead, behind = (loop_lyapunov(*pair(t), factor, zero, zero)[0] for t in (h, -h))
    assert np.allclose(P_dot, (ahead - behind) / (2 * h), rtol=1e-6, atol=1e-6 * np.abs(P_dot).max())
    assert np.linalg.eigvalsh(P)[0] > 0.0
    assert np.allclose(P[:3, :3], S0)
    assert np.allclose(np.linalg.inv(P)[:3, :3], R0)


def test_both_varying_takes_the_rate_into_the_controller() -> None:
    """With R and S both moving, the inequality holds with the controller for that rate, and the rate matters."""
    plant = random_plant(1)
    R, S, gamma = solved(plant)
    R_dot, S_dot = 0.02 * R, -0.02 * S
    factor = constant_factor("N", R, S)
    level, zero = 1.3 * gamma, np.zeros((2, 2))
    moving = controller_matrices(plant, R, S, level, factor, zero, R_dot, S_dot)
    still = controller_matrices(plant, R, S, level, factor, zero)
    P, P_dot = loop_lyapunov(R, S, factor, R_dot, S_dot)
    right, wrong = (proven_level(*plant.close(*K), P, P_dot) for K in (moving, still))
    assert not np.allclose(moving[0], still[0])
    assert right < wrong


def test_refusals() -> None:
    P = random_plant(0)
    parts = [P.A, P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21]
    with pytest.raises(AssumptionError, match=r"D22 at p = 1 is not zero .*0\.5"):
        check_reconstructible(GeneralizedPlant(*parts, 0.5 * np.eye(2)), "at p = 1")
    parts[6] = np.ones((3, 2))
    with pytest.raises(AssumptionError, match=r"D12 .* rank 1, wanted 2 .*small weight"):
        check_reconstructible(GeneralizedPlant(*parts), "at p = 1")
    parts[6], parts[7] = P.D12, np.zeros((2, 3))
    with pytest.raises(AssumptionError, match=r"D21 .* rank 0, wanted 2 .*small noise"):
        check_reconstructible(GeneralizedPlant(*parts), "at p = 1")
