"""Guards the position continuum: gradients against differences, worst positions known in closed form, exchange."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError, DomainError, SynthesisError
from lpvhinf.hinfstruct import FixedOrder, HinfstructResult, StaticGain, hinf_norm, hinfstruct
from lpvhinf.hinfstruct import position_search as search_module
from lpvhinf.hinfstruct.continuum import ActiveSet, ContinuumResult, first_positions, hinfstruct_over_box
from lpvhinf.hinfstruct.plant_families import FrozenFamily, PolynomialFamily, as_family, whole_matrix
from lpvhinf.hinfstruct.position_gradient import gain_at, gain_slopes, position_gradient
from lpvhinf.hinfstruct.position_search import BoxNorms, worst_over_box
from lpvhinf.hinfstruct.scheduled import PolynomialBasis, Scheduled
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant
from tests.hinfstruct.plants import first_order, random_plant

SQUARE = np.array([[-1.0, 1.0], [0.0, 2.0]])
FREE = StaticGain(1, 1)  # for plants that u does not reach


def lag(gain: float) -> GeneralizedPlant:
    """z = gain / (s + 1) w, out of reach of the controller."""
    zero = [[0.0]]
    return GeneralizedPlant([[-1.0]], [[gain]], zero, [[1.0]], zero, zero, zero, zero)


def hill(gain: Callable[[Array], float], box: Array = SQUARE) -> FrozenFamily:
    """Plants whose norm at p is gain(p)."""
    return FrozenFamily(lambda points: [lag(gain(p)) for p in points], box)


def polynomial_family(seed: int = 0, with_D22: bool = True) -> LPVGeneralizedPlant:
    """A stable plant whose every matrix is quadratic in two coordinates."""
    n_w, n_u, n_z, n_y, n = 3, 2, 2, 2, 4
    rng = np.random.default_rng(seed)
    P = whole_matrix(random_plant(seed, n, (n_w, n_u, n_z, n_y), with_D22))
    coefficients = 0.06 * rng.standard_normal((3, 3, *P.shape))
    coefficients[0, 0] = P
    if not with_D22:
        coefficients[..., n + n_z :, n + n_w :] = 0.0
    system = LPVStateSpace.from_coefficients(
        coefficients[..., :n, :n], coefficients[..., :n, n:], coefficients[..., n:, :n], coefficients[..., n:, n:],
        box=SQUARE,
    )  # fmt: skip
    return LPVGeneralizedPlant(system, n_u=n_u, n_y=n_y)


# Gradients


@pytest.mark.parametrize("scheduled", [False, True])
@pytest.mark.parametrize("with_D22", [False, True])
@pytest.mark.parametrize("omega", [0.0, 1.3, np.inf])
def test_gradient_against_differences(scheduled: bool, with_D22: bool, omega: float) -> None:
    plant = polynomial_family(3, with_D22)
    structure = Scheduled(FixedOrder(2, 2, 2), PolynomialBasis(SQUARE, 1)) if scheduled else FixedOrder(2, 2, 2)
    theta = 0.1 * np.random.default_rng(1).standard_normal(structure.n_parameters)
    p = np.array([0.21, 1.4])

    def sigma(q: Array) -> float:
        A, B, C, D = plant.at(q).close(*structure.realize(theta, q))
        T = D if np.isinf(omega) else C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B) + D
        return float(np.linalg.norm(T, 2))

    K, K_slopes = gain_at(structure, theta, p), gain_slopes(structure, theta, p, SQUARE)
    assert np.any(K_slopes) == scheduled
    value, gradient = position_gradient(*PolynomialFamily(plant).slopes(p)[:2], K, K_slopes, omega)
    assert value == pytest.approx(sigma(p), rel=1e-12)
    for axis, step in enumerate(1e-5 * np.eye(2)):
        difference = (sigma(p + step) - sigma(p - step)) / 2e-5
        assert gradient[axis] == pytest.approx(difference, rel=1e-6, abs=1e-8)


def test_the_norm_has_the_gradient_of_its_peak() -> None:
    family, structure = PolynomialFamily(polynomial_family(5)), StaticGain(2, 2)
    theta, p = np.array([0.1, -0.05, 0.02, 0.08]), np.array([-0.4, 0.7])
    norms = BoxNorms(family, structure, theta)
    value, gradient = norms.slope(p)
    assert value == pytest.approx(norms.exact(p[None])[0][0], rel=1e-8)
    for axis, step in enumerate(1e-4 * np.eye(2)):
        above, below = norms.exact(np.array([p + step, p - step]))[0]
        assert gradient[axis] == pytest.approx((above - below) / 2e-4, rel=1e-5, abs=1e-7)
    assert (norms.n_exact, norms.n_slopes, norms.n_cheap) == (5, 1, 1)


@pytest.mark.parametrize("p", [[0.3, 1.1], [-1.0, 2.0], [1.0, 0.0]])
def test_differences_of_a_callable_agree_with_the_polynomials(p: list[float]) -> None:
    plant = polynomial_family(7)
    exact, by_differences = PolynomialFamily(plant), FrozenFamily(plant.sample, SQUARE)
    at, slopes = exact.slopes(np.array(p))
    other, differences = by_differences.slopes(np.array(p))
    assert np.allclose(whole_matrix(at), whole_matrix(other), rtol=0.0, atol=1e-13)
    assert np.max(np.abs(slopes - differences)) < (1e-6 if abs(p[0]) < 1.0 else 1e-3) * np.max(np.abs(slopes))
    assert (exact.plants_per_slope, by_differences.plants_per_slope) == (1, 5)


# Worst positions in closed form


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("gain", "where", "worst"),
    [
        (lambda p: 3.0 - (p[0] - 0.31) ** 2 - 2.0 * (p[1] - 1.17) ** 2, [0.31, 1.17], 3.0),  # interior
        (lambda p: 2.0 + p[0] - (p[1] - 0.4) ** 2, [1.0, 0.4], 3.0),  # edge
        (lambda p: 1.0 + np.exp(-p[0]) + p[1], [-1.0, 2.0], 3.0 + np.e),  # corner
    ],
)
def test_worst_position(gain: Callable[[Array], float], where: list[float], worst: float, seed: int) -> None:
    found = worst_over_box(hill(gain), FREE, [0.0], n_search=16, n_refine=3, seed=seed)
    assert found.gamma == pytest.approx(worst, rel=1e-6)
    assert found.position == pytest.approx(where, abs=2e-3)
    assert found.gamma == found.gammas[0] == np.max(found.gammas)
    assert found.n_exact <= 3


def test_two_equal_maxima_are_both_found() -> None:
    found = worst_over_box(hill(lambda p: 1.0 + np.cos(2 * np.pi * p[0]) ** 2 - 0.1 * p[1] ** 2), FREE, [0.0])
    tops = found.candidates[found.gammas > 2.0 - 1e-6]
    assert len(tops) >= 4  # at p_0 = -1, -1/2, 0, 1/2, 1 and p_1 = 0: as many as there are climbs, at most
    assert np.max(np.abs(tops[:, 0] * 2.0 - np.round(tops[:, 0] * 2.0))) < 1e-2
    assert len(np.unique(np.round(tops[:, 0] * 2.0))) == len(tops)
    assert np.max(tops[:, 1]) < 1e-2


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_narrow_peak_beside_a_broad_one(seed: int) -> None:
    """The narrow peak's foot covers 2 % of the box and is lower than the broad hill at most positions."""

    def gain(p: Array) -> float:
        narrow = np.exp(-((p[0] + 0.63) ** 2 + (p[1] - 0.47) ** 2) / 0.05**2)
        return float(1.0 + 0.5 * np.exp(-((p[0] - 0.5) ** 2) - (p[1] - 1.5) ** 2) + 2.0 * narrow)

    found = worst_over_box(hill(gain), FREE, [0.0], n_search=512, n_refine=8, seed=seed)
    assert found.gamma == pytest.approx(3.0, rel=0.05)
    assert found.position == pytest.approx([-0.63, 0.47], abs=0.02)
    assert found.n_exact <= 24


def test_the_controller_counts() -> None:
    """x' = (p - 1) x + w + u, z = x, y = x with u = -k y: the norm 1 / (1 + k - p) is largest at p = 1."""
    system = LPVStateSpace.from_coefficients(
        [[[-1.0]], [[1.0]]], np.ones((1, 2)), np.ones((2, 1)), np.zeros((2, 2)), box=[[-1.0, 1.0]], basis="power"
    )
    found = worst_over_box(LPVGeneralizedPlant(system, n_u=1, n_y=1), FREE, [-0.5], n_search=4)
    assert found.gamma == pytest.approx(2.0, rel=1e-9)
    assert found.position == pytest.approx([1.0])
    scheduled = Scheduled(FREE, PolynomialBasis([[-1.0, 1.0]], 1))  # k = 1/2 + 2 p turns the slope around
    found = worst_over_box(LPVGeneralizedPlant(system, n_u=1, n_y=1), scheduled, [-0.5, -2.0], n_search=4)
    assert found.gamma == pytest.approx(2.0, rel=1e-9)
    assert found.position == pytest.approx([-1.0])


def test_known_positions_are_looked_at() -> None:
    spike = hill(lambda p: 1.0 + 5.0 * np.exp(-((p[0] - 0.77) ** 2 + (p[1] - 0.33) ** 2) / 0.01**2))
    without = worst_over_box(spike, FREE, [0.0], n_search=16)
    with_it = worst_over_box(spike, FREE, [0.0], n_search=16, known=[[0.775, 0.335]])
    assert without.gamma < 1.1
    assert with_it.gamma == pytest.approx(6.0, rel=1e-4)


def test_unstable_positions_come_worst_first() -> None:
    def frozen(points: Array) -> list[GeneralizedPlant]:
        zero = [[0.0]]
        return [GeneralizedPlant([[p[0] - 0.8]], [[1.0]], zero, [[1.0]], zero, zero, zero, zero) for p in points]

    found = worst_over_box(FrozenFamily(frozen, SQUARE), FREE, [0.0], n_search=32)
    assert found.gamma == np.inf
    assert found.position[0] == 1.0
    # a thin unstable band that only the climb meets
    thin = FrozenFamily(frozen, [[-1.0, 0.81], [0.0, 2.0]])
    near = search_module.BoxNorms(thin, FREE, np.zeros(1)).climb(np.array([0.5, 1.0]))
    assert near[1] == np.inf
    assert near[0][0] > 0.8


def test_a_peak_that_tracking_misses_is_found_by_the_exact_norm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tracked peaks that know only a frequency where little happens; the climb goes on from what is missed."""

    def frozen(points: Array) -> list[GeneralizedPlant]:
        A, zero = [[0.0, 1.0], [-1.0, -0.2]], [[0.0]]
        return [
            GeneralizedPlant(A, [[0.0], [1.0 - p[0] ** 2]], np.zeros((2, 1)), [[1.0, 0.0]], np.zeros((1, 2)), zero,
                             zero, zero)
            for p in points
        ]  # fmt: skip

    def blind(T: search_module.Response, *, extra: Array, fraction: float) -> search_module.find_peaks:
        omega = np.append(extra, 0.0)
        sigma = np.array([float(np.abs(T.at(np.array([w])))[0, 0, 0]) for w in omega])
        k = int(np.argmax(sigma))
        return type("Peaks", (), {"omega": omega[[k]], "sigma": sigma[[k]]})()

    monkeypatch.setattr(search_module, "find_peaks", blind)
    norms = BoxNorms(FrozenFamily(frozen, [[-1.0, 1.0]]), FREE, np.zeros(1))
    p, value = norms.climb(np.array([0.4]))
    assert p == pytest.approx([0.0], abs=1e-3)
    assert value == pytest.approx(hinf_norm(*frozen(np.zeros((1, 1)))[0].close(*FREE.realize(np.zeros(1)))).norm)
    assert norms.n_exact == 2


# Exchange


def solver(structure: StaticGain, calls: list[Array]) -> Callable[..., HinfstructResult]:
    def solve(plants: Sequence[GeneralizedPlant], points: Array, initial: Sequence[Array] | None) -> HinfstructResult:
        calls.append(np.array(points))
        return hinfstruct(plants, structure, points=points, initial=initial, starts=0 if initial else 1)

    return solve


def tilted(points: Array) -> list[GeneralizedPlant]:
    """x' = a x + w1 + u, z = (x, c u), with the pole a largest at p = 0.37, and the cost c at p = -0.5."""
    out = []
    for p in points:
        a = 1.0 + 1.5 * np.exp(-((p[0] - 0.37) ** 2) / 0.02)
        c = 1.0 + 0.8 * np.exp(-((p[0] + 0.5) ** 2) / 0.05)
        P = first_order()
        out.append(GeneralizedPlant([[a]], P.B1, P.B2, P.C1, P.C2, P.D11, c * P.D12, P.D21))
    return out


@pytest.fixture(scope="module")
def over_box() -> ContinuumResult:
    calls: list[Array] = []
    structure = StaticGain(1, 1)
    family = FrozenFamily(tilted, [[-1.0, 1.0]])
    return hinfstruct_over_box(family, structure, solver(structure, calls), n_positions=3, n_search=16)


def test_exchange_ends_within_the_tolerance(over_box: ContinuumResult) -> None:
    assert over_box.converged
    result = over_box.result
    assert result.gamma <= result.gamma_worst <= 1.01 * result.gamma
    assert len(over_box.rounds) >= 2
    assert result.worst_position is not None
    K = FREE.realize(result.parameters)
    at = hinf_norm(*tilted(np.atleast_2d(result.worst_position))[0].close(*K)).norm
    assert at == pytest.approx(result.gamma_worst, rel=1e-9)
    dense = tilted(np.linspace(-1.0, 1.0, 401)[:, None])
    assert max(hinf_norm(*P.close(*K)).norm for P in dense) <= result.gamma_worst * (1.0 + 1e-6)


def test_the_continuum_costs_more_than_the_first_positions(over_box: ContinuumResult) -> None:
    """And as much as a dense grid around the worst positions does, within the tolerance."""
    dense = hinfstruct(tilted(np.array([[-0.55], [-0.5], [-0.45], [0.32], [0.37], [0.42]])), FREE, starts=1)
    assert over_box.rounds[0].result.gamma < 0.9 * over_box.result.gamma
    assert over_box.result.gamma_worst == pytest.approx(dense.gamma, rel=0.01)


def test_rounds_that_end_too_early_say_so() -> None:
    calls: list[Array] = []
    found = hinfstruct_over_box(
        FrozenFamily(tilted, [[-1.0, 1.0]]), FREE, solver(FREE, calls), n_positions=3, n_search=16, max_rounds=1
    )
    assert not found.converged
    assert found.result.gamma_worst > 1.01 * found.result.gamma
    assert "Raise max_rounds" in found.result.status
    assert len(calls) == 1


def test_an_lpv_plant_over_its_box() -> None:
    """x' = p x + w1 + u with the noise gain |k| at every p: p = 1 decides, where 1 + sqrt 3 is optimal."""
    P = first_order()
    system = LPVStateSpace.from_coefficients(
        [[[0.0]], [[1.0]]], np.hstack([P.B1, P.B2]), np.vstack([P.C1, P.C2]),
        np.block([[P.D11, P.D12], [P.D21, np.zeros((1, 1))]]), box=[[-1.0, 1.0]], basis="power",
    )  # fmt: skip
    found = hinfstruct_over_box(LPVGeneralizedPlant(system, n_u=1, n_y=1), FREE, solver(FREE, []), n_search=8)
    assert found.converged
    assert found.result.gamma_worst == pytest.approx(1.0 + np.sqrt(3.0), rel=1e-4)
    assert found.result.parameters == pytest.approx([-1.0 - np.sqrt(3.0)], rel=1e-4)


def test_starts_that_lead_nowhere_give_way_to_the_solvers_own() -> None:
    tried: list[bool] = []

    def solve(plants: Sequence[GeneralizedPlant], points: Array, initial: Sequence[Array] | None) -> HinfstructResult:
        tried.append(initial is None)
        if initial is not None:
            raise SynthesisError("no way on from here")
        return hinfstruct(plants, FREE, starts=1)

    found = hinfstruct_over_box(FrozenFamily(tilted, [[-1.0, 1.0]]), FREE, solve, n_positions=3, n_search=16)
    assert found.converged
    assert tried[:3] == [True, False, True]
    with pytest.raises(SynthesisError, match="no way on"):
        hinfstruct_over_box(FrozenFamily(tilted, [[-1.0, 1.0]]), FREE, solve, n_search=4, initial=[np.zeros(1)])


def test_the_active_set_drops_what_is_idle_and_keeps_what_comes_back() -> None:
    box = np.array([[0.0, 1.0]])
    active = ActiveSet(np.array([[0.0], [0.5], [1.0]]), box, 4)
    active.exchange(np.array([1.0, 0.5, 0.95]), np.array([[0.2]]))
    assert active.points.ravel().tolist() == [0.0, 0.5, 1.0, 0.2]
    active.exchange(np.array([1.0, 0.5, 0.95, 1.0]), np.array([[0.3]]))  # 0.5 was idle twice
    assert active.points.ravel().tolist() == [0.0, 1.0, 0.2, 0.3]
    active.exchange(np.array([1.0, 0.9, 1.0, 0.99]), np.array([[0.51]]))  # full: the lowest leaves, 0.5 comes back
    assert active.points.ravel().tolist() == [0.0, 0.2, 0.3, 0.51]
    for _ in range(3):
        active.exchange(np.array([1.0, 0.9, 0.9, 0.1]), np.zeros((0, 1)))
    assert active.points.ravel().tolist() == [0.0, 0.2, 0.3, 0.51]


@pytest.mark.parametrize("n", [1, 4, 5, 6, 9])
def test_first_positions(n: int) -> None:
    points = first_positions(SQUARE, n)
    assert points.shape == (n, 2)
    assert points[0].tolist() == [0.0, 1.0]
    assert np.all((points >= SQUARE[:, 0]) & (points <= SQUARE[:, 1]))
    assert len(np.unique(points, axis=0)) == n


# Refusals


def test_wrong_arguments() -> None:
    family = hill(lambda p: 1.0)
    with pytest.raises(DomainError, match="plants is list, wanted an LPVGeneralizedPlant or a family"):
        as_family([lag(1.0)])  # type: ignore[arg-type]
    with pytest.raises(DimensionError, match=r"theta has shape \(2,\)"):
        worst_over_box(family, FREE, [0.0, 0.0])
    with pytest.raises(DomainError, match="n_refine is 0"):
        worst_over_box(family, FREE, [0.0], n_refine=0)
    with pytest.raises(DomainError, match=r"known = \[3.0, 0.0\] is outside the box"):
        worst_over_box(family, FREE, [0.0], known=[[3.0, 0.0]])
    with pytest.raises(DimensionError, match="frozen gave 1 plants for 2 positions"):
        FrozenFamily(lambda points: [lag(1.0)], SQUARE).sample(np.zeros((2, 2)))
    with pytest.raises(DomainError, match=r"tolerance is 0\.0"):
        hinfstruct_over_box(family, FREE, solver(FREE, []), tolerance=0.0)
    with pytest.raises(DomainError, match=r"positions = \[9.0, 0.0\] is outside"):
        hinfstruct_over_box(family, FREE, solver(FREE, []), positions=[[9.0, 0.0]])
