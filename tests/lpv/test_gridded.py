from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct.lower_bound import lower_bound
from lpvhinf.lpv.basis import rate_box, sampled_basis
from lpvhinf.lpv.conditioning import balancing, scaled_plants, time_unit
from lpvhinf.lpv.farkas import certificate
from lpvhinf.lpv.gridded import gridded_lmis
from lpvhinf.lpv.solve_lmi import solve_lmi
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.lpv.small_plants import cosines, moving_mode, random_plant

POINTS = np.linspace(-1.0, 1.0, 3)
PLANTS = [moving_mode(np.array([p])) for p in POINTS]


def powers(p: Array) -> tuple[Array, Array]:
    return np.array([1.0, p[0]]), np.array([[0.0], [1.0]])


def changed(P: GeneralizedPlant, **matrices: Array) -> GeneralizedPlant:
    names = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
    return GeneralizedPlant(*[matrices.get(name, getattr(P, name)) for name in names])


@pytest.mark.parametrize("seed", range(4))
def test_one_point_gives_the_hinf_optimum(seed: int) -> None:
    plant = random_plant(seed, direct=0.1)
    solution = solve_lmi(gridded_lmis([plant], [0.0], constant="both").problem)
    optimum = lower_bound(plant).gamma
    assert solution.status == "optimal"
    assert optimum * (1.0 - 1e-9) <= solution.gamma <= optimum * (1.0 + 1e-3)
    assert solution.gamma_lower <= solution.gamma


def test_units_of_time_state_and_signals_do_not_matter() -> None:
    plant = random_plant(5)
    T, E, F = np.diag([1e3, 1e-2, 1.0, 50.0]), 1e3 * np.eye(2), 1e-4 * np.eye(2)
    scaled = GeneralizedPlant(
        1e3 * T @ plant.A @ np.linalg.inv(T),
        np.sqrt(1e3) * T @ plant.B1,
        np.sqrt(1e3) * T @ plant.B2 @ E,
        np.sqrt(1e3) * plant.C1 @ np.linalg.inv(T),
        np.sqrt(1e3) * F @ plant.C2 @ np.linalg.inv(T),
        plant.D11,
        plant.D12 @ E,
        F @ plant.D21,
    )
    one, other = (solve_lmi(gridded_lmis([P], [0.0], constant="both").problem) for P in (plant, scaled))
    assert other.gamma == pytest.approx(one.gamma, rel=5e-5)


def test_gamma_grows_with_the_rate_and_falls_with_freedom() -> None:
    gamma = {
        (constant, rate): solve_lmi(
            gridded_lmis(PLANTS, POINTS, basis=powers, rate=rate, constant=constant).problem
        ).gamma
        for constant in ("none", "S", "both")
        for rate in (0.0, 0.5)
    }
    slack = 1.0 + 3e-5
    assert gamma["none", 0.0] <= slack * gamma["none", 0.5]
    assert gamma["S", 0.0] <= slack * gamma["S", 0.5]
    assert gamma["none", 0.5] <= slack * gamma["S", 0.5] <= slack**2 * gamma["both", 0.5]
    assert gamma["both", 0.0] == pytest.approx(gamma["both", 0.5], rel=1e-9)


def test_solution_in_the_plants_coordinates_satisfies_the_inequalities_as_published() -> None:
    lmis = gridded_lmis(PLANTS, POINTS, basis=powers, rate=0.5, constant="none")
    solution = solve_lmi(lmis.problem, gap=1e-2)
    pair, gamma = lmis.lyapunov(solution), solution.gamma
    for P, p in zip(PLANTS, POINTS, strict=True):
        R, S = pair.at(p)
        assert np.linalg.eigvalsh(np.block([[R, np.eye(4)], [np.eye(4), S]]))[0] > 0.0
        N_R, N_S = (
            np.linalg.svd(M)[2][M.shape[0] :].T for M in (np.hstack([P.B2.T, P.D12.T]), np.hstack([P.C2, P.D21]))
        )
        for p_dot in (-0.5, 0.2, 0.5):
            R_dot, S_dot = pair.rate_at(p, p_dot)
            for N, L, B, C, D in (
                (N_R, P.A @ R + R @ P.A.T - R_dot, P.B1, P.C1 @ R, P.D11),
                (N_S, P.A.T @ S + S @ P.A + S_dot, P.C1.T, P.B1.T @ S, P.D11.T),
            ):
                outer = np.block(
                    [[N, np.zeros((len(N), B.shape[1]))], [np.zeros((B.shape[1], N.shape[1])), np.eye(B.shape[1])]]
                )
                M = np.block([[L, C.T, B], [C, -gamma * np.eye(len(C)), D], [B.T, D.T, -gamma * np.eye(B.shape[1])]])
                assert np.linalg.eigvalsh(outer.T @ M @ outer)[-1] < 0.0


def test_bound_is_reported_as_active_where_it_is() -> None:
    tight, loose = (gridded_lmis(PLANTS, POINTS, constant="both", r_max=r) for r in (20.0, 1e5))
    small, large = solve_lmi(tight.problem), solve_lmi(loose.problem)
    assert small.gamma > 1.001 * large.gamma
    assert max(tight.bound_activity(small).values()) > 0.99
    assert max(loose.bound_activity(large).values()) < 0.5


def test_basis_is_orthonormalised_and_mapped_back() -> None:
    points = np.linspace(0.0, 0.3, 4)[:, None]
    sampled = sampled_basis(powers, points, np.array([[-2.0, 3.0]]))
    np.testing.assert_allclose(sampled.values.T @ sampled.values, 4.0 * np.eye(2), atol=1e-12)
    np.testing.assert_allclose(sampled.values @ sampled.unit, 1.0)
    Y = np.random.default_rng(0).normal(size=(2, 3, 3))
    given = sampled.matrices(Y)
    for k, p in enumerate(points):
        np.testing.assert_allclose(
            np.tensordot(powers(p)[0], given, 1), np.tensordot(sampled.values[k], Y, 1), atol=1e-12
        )
        np.testing.assert_allclose(
            np.tensordot(powers(p)[1] @ sampled.vertices[k].T, given, axes=(0, 0)),
            np.tensordot(sampled.rates[k], Y, axes=(1, 0)),
            atol=1e-12,
        )


def test_vertices_with_the_same_rates_are_taken_once() -> None:
    points = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
    first_only = sampled_basis(
        lambda p: (np.array([1.0, p[0]]), np.array([[0.0, 0.0], [1.0, 0.0]])),
        points,
        np.array([[-1.0, 1.0], [-1.0, 1.0]]),
    )
    assert [len(rates) for rates in first_only.rates] == [2, 2, 2]


def test_balancing_undoes_a_bad_scaling() -> None:
    rng = np.random.default_rng(0)
    A, B, C = rng.normal(size=(2, 4, 4)), rng.normal(size=(2, 4, 2)), rng.normal(size=(2, 2, 4))
    T = 10.0 ** np.array([3.0, -4.0, 0.0, 1.0])
    found = balancing(T[:, None] * A / T, T[:, None] * B, C / T)
    assert np.ptp(np.log10(found / T)) < 0.8
    assert np.all(np.log2(found) == np.round(np.log2(found)))


def test_time_unit_is_the_mean_frequency_without_integrators() -> None:
    assert time_unit(np.diag([-1.0, -64.0, 0.0])[None]) == 8.0
    assert time_unit(np.zeros((1, 2, 2))) == 1.0


def test_scaled_controls_and_measurements_are_orthonormal() -> None:
    scaled = scaled_plants([random_plant(0), random_plant(1)])
    for P in scaled.plants:
        np.testing.assert_allclose(P.D12.T @ P.D12, np.eye(2), atol=1e-12)
        np.testing.assert_allclose(P.D21 @ P.D21.T, np.eye(2), atol=1e-12)


def test_bad_plants_are_named() -> None:
    P = PLANTS[0]
    with pytest.raises(AssumptionError, match="D22 of plant 1 is not zero"):
        gridded_lmis([P, changed(P, D22=np.ones((1, 1)))], [0.0, 1.0])
    with pytest.raises(AssumptionError, match=r"D12 of plant 0 has singular values.*Give every control a weight"):
        gridded_lmis([changed(P, D12=np.zeros((2, 1)))], [0.0])
    with pytest.raises(AssumptionError, match=r"D21 of plant 0 has singular values.*Give every measurement noise"):
        gridded_lmis([changed(P, D21=np.zeros((1, 2)))], [0.0])
    with pytest.raises(AssumptionError, match=r"the plant at p = \(1\) is not stabilisable"):
        gridded_lmis([P, changed(P, B2=np.array([[0.0], [0.0], [0.0], [1.0]]))], [0.0, 1.0])
    with pytest.raises(AssumptionError, match=r"the plant at p = \(0\) is not detectable"):
        gridded_lmis([changed(P, C2=np.array([[0.0, 0.0, 1.0, 0.0]]))], [0.0])
    with pytest.raises(DimensionError, match="different sizes"):
        gridded_lmis([P, random_plant(0)], [0.0, 1.0])
    with pytest.raises(DimensionError, match="plants is empty"):
        gridded_lmis([], np.zeros((0, 1)))


def test_bad_grids_bases_and_rates_are_named() -> None:
    with pytest.raises(DimensionError, match="one row for each plant"):
        gridded_lmis(PLANTS, [0.0, 1.0])
    with pytest.raises(DomainError, match="empty box"):
        gridded_lmis(PLANTS, POINTS, rate=[[1.0, -1.0]])
    with pytest.raises(DimensionError, match=r"rate has shape \(2, 2\)"):
        rate_box(np.zeros((2, 2)), 1)
    with pytest.raises(AssumptionError, match="no constant term"):
        gridded_lmis(PLANTS, POINTS, basis=lambda p: (p, np.eye(1)))
    with pytest.raises(AssumptionError, match="dependent on this grid"):
        gridded_lmis(PLANTS[:2], POINTS[:2], basis=cosines)
    with pytest.raises(DimensionError, match="basis gradient"):
        gridded_lmis(PLANTS, POINTS, basis=lambda p: (np.ones(2), np.ones((2, 3))))
    with pytest.raises(DomainError, match="constant is 'T'"):
        gridded_lmis(PLANTS, POINTS, constant="T")
    with pytest.raises(DomainError, match="r_max"):
        gridded_lmis(PLANTS, POINTS, r_max=-1.0)
    still = np.column_stack([POINTS, np.zeros(3)])

    def plane(p: Array) -> tuple[Array, Array]:
        return np.array([1.0, p[0], np.cos(p[0]) + p[1]]), np.array([[0.0, 0.0], [1.0, 0.0], [-np.sin(p[0]), 1.0]])

    with pytest.raises(AssumptionError, match=r"grid does not span the box: all points have p\[1\] = 0"):
        gridded_lmis(PLANTS, still, basis=plane, rate=0.1)


def test_labels_tell_point_and_rate() -> None:
    lmis = gridded_lmis(PLANTS, POINTS, basis=powers, rate=0.5, constant="S")
    blocks = {block.name: block for block in lmis.problem.blocks}
    assert blocks["R"].labels[:2] == ("(-1), rate (-0.5)", "(-1), rate (0.5)")
    assert blocks["S"].labels == ("(-1)", "(0)", "(1)")


def test_infeasible_for_every_gamma_is_shown() -> None:
    # two states out of reach of u, stable at each point, without a common Lyapunov matrix: the mean is unstable
    drift = np.array([[-0.1, 2.0], [0.0, -0.1]])
    B1, C1 = np.hstack([np.eye(3), np.zeros((3, 1))]), np.vstack([np.eye(3), np.zeros((1, 3))])
    plants = []
    for left in (drift, drift.T):
        A = -np.eye(3)
        A[:2, :2] = left
        B2, D12 = np.array([[0.0], [0.0], [1.0]]), np.array([[0.0], [0.0], [0.0], [1.0]])
        plants.append(GeneralizedPlant(A, B1, B2, C1, B2.T, np.zeros((4, 4)), D12, D12.T))
    for plant in plants:
        assert solve_lmi(gridded_lmis([plant], [0.0], constant="both").problem).status == "optimal"
    lmis = gridded_lmis(plants, [0.0, 1.0], constant="both")
    solution = solve_lmi(lmis.problem)
    assert solution.status == "infeasible"
    assert solution.certificate is not None
    assert certificate(lmis.problem, list(solution.certificate.multipliers)) is not None
    # without the point that spoils it the same multipliers show nothing
    alone = gridded_lmis(plants[:1] * 2, [0.0, 1.0], constant="both")
    assert certificate(alone.problem, list(solution.certificate.multipliers)) is None
