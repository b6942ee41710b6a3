"""Guards dynamic uncertainty: weights that cover, channels, robust gains in closed form, designs, the comparison."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError, SynthesisError
from lpvhinf.hinfstruct import FixedOrder, StaticGain, check_structure, hinf_norm
from lpvhinf.hinfstruct.plant_families import FrozenFamily
from lpvhinf.hinfstruct.response import Response, largest_sigma
from lpvhinf.hinfstruct.uncertainty import (
    compare_designs,
    deviation,
    hinfstruct_robust,
    resonance_grid,
    robust_gain,
    uncertain_plant,
    uncertainty_weight,
)
from lpvhinf.hinfstruct.uncertainty.channel import delta_closed
from lpvhinf.hinfstruct.uncertainty.magnitude_fit import fit_above, realize
from lpvhinf.hinfstruct.uncertainty.robust_gain import gains_at
from lpvhinf.hinfstruct.uncertainty.small_gain import WithScalings, scaled_plant
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.hinfstruct.plants import first_order, random_plant

System = tuple[Array, Array, Array, Array]
GRID = np.geomspace(1.0, 1e4, 60)
FINE = np.geomspace(0.5, 2e4, 4001)


def lag(gain: float, pole: float) -> System:
    return np.array([[-pole]]), np.array([[1.0]]), np.array([[gain * pole]]), np.zeros((1, 1))


def modes(p: float, *, discarded: bool = True) -> System:
    """A mass with two inputs and outputs, a preserved mode, and two discarded ones whose gains move with p."""
    omega = np.array([0.0, 120.0, 400.0, 900.0])
    zeta = np.array([0.0, 0.01, 0.01, 0.02])
    shapes = np.array([[1.0, 0.3], [0.2, 0.5], [np.cos(3.0 * p), 0.4 * np.sin(2.0 * p)], [0.3 * p, np.cos(p)]])
    blocks = [np.array([[0.0, 1.0], [-(w**2), -2.0 * z * w]]) for w, z in zip(omega, zeta, strict=True)]
    B = np.vstack([np.vstack([np.zeros(2), row]) for row in shapes])
    C = np.hstack([np.column_stack([row, np.zeros(2)]) for row in shapes])
    n = 8 if discarded else 4
    return block_diag(*blocks)[:n, :n], B[:n], C[:, :n], np.zeros((2, 2))


# Deviations


def test_deviations_in_closed_form() -> None:
    nominal, other = lag(1.0, 2.0), lag(1.5, 3.0)
    s = 1j * GRID
    G, G_nom = 4.5 / (s + 3.0), 2.0 / (s + 2.0)
    assert np.allclose(deviation(nominal, [other], GRID), np.abs(G - G_nom), rtol=1e-12, atol=0.0)
    for kind in ("input", "output"):
        assert np.allclose(deviation(nominal, [other], GRID, kind=kind), np.abs(G / G_nom - 1.0), rtol=1e-10, atol=0.0)
    own = deviation([nominal, other], [other, other], GRID)
    assert np.allclose(own[0], np.abs(G - G_nom))
    assert np.all(own[1] == 0.0)


def test_units_of_the_channels() -> None:
    nominal, other = modes(0.0, discarded=False), modes(0.4)
    left, right = np.array([2.0, 0.5]), np.array([3.0, 0.1])
    found = deviation(nominal, [other], GRID, left=left, right=right)[0]
    E = Response(*other).at(GRID) - Response(*nominal).at(GRID)
    wanted = [np.linalg.norm(np.diag(1.0 / left) @ e @ np.diag(1.0 / right), 2) for e in E]
    assert np.allclose(found, wanted, rtol=1e-9)


def test_multiplicative_deviations_reproduce_the_plant() -> None:
    nominal, other = modes(0.0, discarded=False), modes(0.4)
    G, G_nom = Response(*other).at(GRID), Response(*nominal).at(GRID)
    inside = np.linalg.solve(G_nom, G - G_nom)
    assert np.allclose(deviation(nominal, [other], GRID, kind="input")[0], largest_sigma(inside), rtol=1e-6)


def test_what_is_no_input_uncertainty_is_refused() -> None:
    tall = (np.array([[-1.0]]), np.ones((1, 1)), np.array([[1.0], [0.0]]), np.zeros((2, 1)))
    turned = (np.array([[-1.0]]), np.ones((1, 1)), np.array([[1.0], [0.1]]), np.zeros((2, 1)))
    with pytest.raises(AssumptionError, match=r"outside the range .* Use kind='additive'"):
        deviation(tall, [turned], GRID, kind="input")
    assert deviation(tall, [turned], GRID, kind="output").shape == (1, 60)


# Weights


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_magnitude_of_the_order_is_met(order: int) -> None:
    s = 1j * GRID
    sizes = np.abs(
        np.prod([(s / z + 1.0) / (s / p + 1.0) for z, p in [(5.0, 50.0), (900.0, 300.0), (2e3, 3e3)][:order]], 0)
    )
    fitted = fit_above(GRID, sizes, order)
    ratio = fitted.magnitude(GRID) / sizes
    assert np.min(ratio) >= 1.0 - 1e-12
    assert np.max(ratio) < 1.01
    A, B, C, D = realize(fitted)
    assert A.shape == (order, order)
    assert np.max(np.linalg.eigvals(A).real) < 0.0
    assert np.max(np.linalg.eigvals(A - B @ C / D[0, 0]).real) < 0.0  # minimum phase
    assert np.allclose(np.abs(Response(A, B, C, D).at(GRID)[:, 0, 0]), fitted.magnitude(GRID), rtol=1e-9)


def test_higher_orders_are_tighter() -> None:
    plants = [modes(p) for p in np.linspace(-0.5, 0.5, 5)]
    excess = [
        uncertainty_weight(modes(0.0, discarded=False), plants, GRID, order=order).largest_excess for order in (0, 2, 4)
    ]
    assert excess[0] > excess[1] > excess[2]
    assert excess[2] < 0.5 * excess[0]


@pytest.mark.parametrize("kind", ["additive", "input", "output"])
def test_the_weight_covers_between_its_frequencies_and_positions(kind: str) -> None:
    nominal = modes(0.0, discarded=False)
    fitted_to = [modes(p) for p in np.linspace(-0.5, 0.5, 9)]
    others = [modes(p) for p in np.linspace(-0.49, 0.49, 23)]
    W = uncertainty_weight(nominal, fitted_to, GRID, kind=kind, order=4, margin=1.1)
    grid = np.concatenate([FINE[(FINE >= 1.0) & (FINE <= 1e4)], resonance_grid(others, 1.0, 1e4, per_decade=50)])
    for systems in (fitted_to, others):
        found = W.covers(nominal, systems, grid)
        assert found.covered
        assert found.n_systems == len(systems)
        assert found.ratio > 0.8  # and not by far: somewhere it is tight
    E = deviation(nominal, others, grid, kind=kind)
    assert np.all(W.magnitude(grid) >= E)
    assert (W.kind, W.order) == (kind, 4)


def test_a_plant_that_is_not_covered_is_found() -> None:
    nominal = modes(0.0, discarded=False)
    W = uncertainty_weight(nominal, [modes(p) for p in (-0.1, 0.0, 0.1)], GRID, order=4)
    far = W.covers(nominal, [modes(0.0), modes(2.5)])
    assert far.ratio > 1.0
    assert far.index == 1
    assert not far.covered
    size = deviation(nominal, [modes(2.5)], np.array([far.omega]))[0, 0]
    assert size / W.magnitude([far.omega])[0] == pytest.approx(far.ratio)


def test_resonances_between_given_frequencies_are_covered() -> None:
    """A grid with nothing near the light modes: their poles are added to it."""
    nominal, plants = modes(0.0, discarded=False), [modes(0.3)]
    W = uncertainty_weight(nominal, plants, [1.0, 50.0, 2000.0, 1e4], order=4)
    assert W.covers(nominal, plants, resonance_grid(plants, 100.0, 1200.0)).covered


def test_wrong_weights() -> None:
    nominal, plants = modes(0.0, discarded=False), [modes(0.3)]
    for options, error, message in (
        ({"kind": "both"}, DomainError, "kind is 'both', wanted one of additive, input, output"),
        ({"order": -1}, DomainError, "order is -1"),
        ({"margin": 0.9}, DomainError, r"margin is 0\.9, wanted at least 1"),
        ({"floor": 0.0}, DomainError, r"floor is 0\.0"),
        ({"left": [1.0]}, DimensionError, r"left has shape \(1,\)"),
        ({"right": [1.0, -1.0]}, DomainError, "right is .* wanted entries above 0"),
    ):
        with pytest.raises(error, match=message):
            uncertainty_weight(nominal, plants, GRID, **options)  # type: ignore[arg-type]
    with pytest.raises(DomainError, match="omega has 1 different entries"):
        uncertainty_weight(nominal, plants, [3.0])
    with pytest.raises(DomainError, match="no system deviates"):
        uncertainty_weight(nominal, [nominal], GRID)
    with pytest.raises(DimensionError, match="nominal holds 1 systems, wanted one or 2"):
        uncertainty_weight([nominal], plants * 2, GRID)


# Channels


@pytest.mark.parametrize("kind", ["additive", "input", "output"])
def test_a_delta_of_the_set_gives_the_perturbed_loop(kind: str) -> None:
    """z = (y, u), w adds to y: with a constant weight the perturbed plant can be written down."""
    rng = np.random.default_rng(4)
    A = rng.standard_normal((3, 3)) - 3.0 * np.eye(3)
    B, C = rng.standard_normal((3, 2)), rng.standard_normal((2, 3))
    eye, zero = np.eye(2), np.zeros((2, 2))
    P = GeneralizedPlant(
        A, np.zeros((3, 2)), B, np.vstack([C, np.zeros((2, 3))]), C, np.vstack([eye, zero]), np.vstack([zero, eye]), eye
    )
    systems = [(A, B, 1.3 * C, zero), (A, B, 0.8 * C, zero)]
    left, right = (np.array([2.0, 3.0]), np.array([0.5, 1.5]))
    W = uncertainty_weight((A, B, C, zero), systems, GRID, kind=kind, order=0, left=left, right=right)
    # an input uncertainty takes the ways of u, but the weight on u itself does not see it
    uncertain = uncertain_plant(P, W, enters_as=None if kind == "input" else slice(0, 2))
    Delta = 0.4 * rng.standard_normal((2, 2))
    member = delta_closed(uncertain, Delta)
    E = np.diag(left) @ (W.D[0, 0] * Delta) @ np.diag(right)
    G = {
        "additive": (B, C, E),
        "input": (B @ (eye + E), C, zero),
        "output": (B, (eye + E) @ C, zero),
    }[kind]
    for s in (0.0, 1.7j):
        R = np.linalg.inv(s * np.eye(3) - A)
        wanted = G[1] @ R @ G[0] + G[2]
        x = np.linalg.inv(s * np.eye(len(member.A)) - member.A)
        assert np.allclose(member.C2 @ x @ member.B2 + member.D22, wanted)
        assert np.allclose((member.C1 @ x @ member.B2 + member.D12)[:2], wanted)


def test_the_smaller_side_carries_the_weight() -> None:
    P = random_plant(2, sizes=(3, 2, 3, 1))
    systems = [(P.A, P.B2, gain * P.C2, gain * P.D22) for gain in (0.9, 1.0, 1.1)]
    W = uncertainty_weight(systems[1], systems, GRID, order=1)
    uncertain = uncertain_plant(P, W)
    assert (uncertain.n_d, uncertain.n_q, uncertain.plant.n_x) == (1, 2, P.n_x + 1)
    assert (uncertain.plant.n_w, uncertain.plant.n_z) == (P.n_w + 1, P.n_z + 2)
    with pytest.raises(DimensionError, match="enters_as names 2 disturbances, wanted 1"):
        uncertain_plant(P, W, enters_as=slice(0, 2))
    with pytest.raises(DimensionError, match="adds names 1 disturbances, wanted 2"):
        uncertain_plant(P, W, adds=slice(0, 1))


# Robust gains


def test_a_robust_gain_in_closed_form() -> None:
    """q = a d + b w, z = c d + e w, all constants: the largest |e + c b / (1/D - a)| is at D = 1."""
    M = np.array([[0.4, 0.7], [1.5, 0.3]])
    found = robust_gain(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), M, n_d=1, n_q=1)
    assert found.gain == pytest.approx(0.3 + 1.5 * 0.7 / 0.6, rel=1e-7)
    assert (found.nominal, found.stability) == (0.3, 0.4)
    unstable = robust_gain(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 3.0 * M, n_d=1, n_q=1)
    assert unstable.gain == np.inf
    assert not unstable.robustly_stable


def test_a_robust_gain_of_a_lag_in_closed_form() -> None:
    """z = w / (s + 1 - d / 2): the worst Delta = 1 halves the pole, and doubles the static gain."""
    found = robust_gain(
        np.array([[-1.0]]), np.array([[0.5, 1.0]]), np.array([[1.0], [1.0]]), np.zeros((2, 2)), n_d=1, n_q=1
    )
    assert found.gain == pytest.approx(2.0, rel=1e-6)
    assert found.stability == pytest.approx(0.5)


def test_no_delta_beats_the_robust_gain_and_one_reaches_it() -> None:
    """Random complex blocks: sampled unitary Deltas stay below, and come near."""
    rng = np.random.default_rng(0)
    M = 0.35 * (rng.standard_normal((5, 4)) + 1j * rng.standard_normal((5, 4)))
    M[:2, :2] *= 0.7 / np.linalg.norm(M[:2, :2], 2)
    bound = gains_at(M[None], 2, 2)[0][0]
    best = 0.0
    for _ in range(4000):
        u, v = (rng.standard_normal((2, 1)) + 1j * rng.standard_normal((2, 1)) for _ in range(2))
        Delta = u @ v.conj().T / (np.linalg.norm(u) * np.linalg.norm(v))  # rank one is enough
        closed = M[2:, 2:] + M[2:, :2] @ Delta @ np.linalg.solve(np.eye(2) - M[:2, :2] @ Delta, M[:2, 2:])
        best = max(best, float(np.linalg.norm(closed, 2)))
    assert best <= bound * (1.0 + 1e-9)
    assert best > 0.95 * bound


def test_a_scaled_norm_of_one_proves_the_robust_gain() -> None:
    """With the controller's scaling blocks set by hand the ordinary norm is that of the scaled loop."""
    P = random_plant(3, n=4, sizes=(3, 1, 3, 1), with_D22=False)
    systems = [(P.A, P.B2, gain * P.C2, gain * P.D22) for gain in (0.95, 1.0, 1.05)]
    uncertain = uncertain_plant(P, uncertainty_weight(systems[1], systems, GRID, order=1))
    structure, theta = StaticGain(1, 1), np.array([-0.02])
    loop = uncertain.plant.close(*structure.realize(theta))
    gamma, d = 2.0, 0.6
    for order, extra in ((0, [np.log(d)]), (1, [np.log(d), 0.4, -0.3])):
        scaled = WithScalings(structure, uncertain.n_d, uncertain.n_q, order, 2.0)
        A, B, C, D = scaled_plant(uncertain, gamma).close(*scaled.realize(np.concatenate([theta, extra])))
        for s in (0.0, 3.0j):
            T = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
            M = loop[2] @ np.linalg.solve(s * np.eye(len(loop[0])) - loop[0], loop[1]) + loop[3]
            scale = d if order == 0 else d * (s + 2.0 * np.exp(0.4)) / (s + 2.0 * np.exp(-0.3))
            M[:1] *= scale
            M[:, :1] /= scale
            M[1:] /= gamma
            assert np.allclose(T, M)


@pytest.mark.parametrize("order", [0, 1])
def test_the_derivatives_of_the_scalings(order: int) -> None:
    assert check_structure(WithScalings(FixedOrder(2, 2, 1), 2, 3, order, 5.0)) < 1e-6
    assert len(WithScalings(FixedOrder(2, 2, 1), 2, 3, order).names) == FixedOrder(2, 2, 1).n_parameters + 1 + 2 * order


# Designs


def uncertain_lag(size: float = 0.3) -> tuple[GeneralizedPlant, FrozenFamily]:
    """x' = x + w1 + (1 + e) u, z = (x, u), y = x + w2 with |e| <= size, e = size * p."""
    P = first_order()

    def frozen(points: Array) -> list[GeneralizedPlant]:
        return [
            GeneralizedPlant(P.A, P.B1, (1.0 + size * p[0]) * P.B2, P.C1, P.C2, P.D11, P.D12, P.D21) for p in points
        ]

    return P, FrozenFamily(frozen, [[-1.0, 1.0]])


def test_a_robust_design_is_better_than_the_nominal_one_where_it_counts() -> None:
    P, family = uncertain_lag()
    systems = [(m.A, m.B2, m.C2, m.D22) for m in family.sample(np.array([[-1.0], [0.0], [1.0]]))]
    W = uncertainty_weight(systems[1], systems, GRID, kind="input", order=0, margin=1.0001)
    # d adds to u at the plant, as w1 does; the output u does not see it
    uncertain = uncertain_plant(P, W, enters_as=slice(0, 1))
    structure = StaticGain(1, 1)
    found = compare_designs(
        family, uncertain, structure, np.array([[-1.0], [0.0], [1.0]]), starts=1, n_search=8, max_iterations=60
    )
    nominal, several, robust = (found.designs[name] for name in ("nominal", "multi-model", "uncertainty"))
    for design in (nominal, several, robust):
        assert design.gamma_nominal <= design.gamma_worst <= design.gamma_robust * (1.0 + 1e-6)
    assert nominal.gamma_nominal == pytest.approx(1.0 + np.sqrt(3.0), rel=1e-3)
    assert several.gamma_worst < 0.99 * nominal.gamma_worst
    assert robust.gamma_robust < 0.97 * nominal.gamma_robust
    assert robust.gamma_robust <= several.gamma_robust * (1.0 + 1e-6)
    assert robust.stability < 1.0
    # a fine search over the one gain finds nothing better
    tries = [robust_gain(*uncertain.plant.close(*structure.realize(np.array([k]))), n_d=1, n_q=1).gain
             for k in np.linspace(-8.0, -1.5, 131)]  # fmt: skip
    assert robust.gamma_robust <= 1.01 * min(tries)
    assert "| uncertainty |" in found.table()


def test_too_large_an_uncertainty_is_said_so() -> None:
    """120 % of input uncertainty around an unstable plant: no controller is robustly stable."""
    P, family = uncertain_lag(1.2)
    systems = [(m.A, m.B2, m.C2, m.D22) for m in family.sample(np.array([[-1.0], [0.0], [1.0]]))]
    W = uncertainty_weight(systems[1], systems, GRID, kind="input", order=0)
    found = hinfstruct_robust(uncertain_plant(P, W, enters_as=slice(0, 1)), StaticGain(1, 1), starts=1, rounds=2)
    assert found.gamma_robust == np.inf
    assert found.stability >= 1.0
    assert found.status.startswith("not robustly stable: the norm from d to q is")


def test_the_figures_are_those_of_the_loop() -> None:
    P, family = uncertain_lag()
    systems = [(m.A, m.B2, m.C2, m.D22) for m in family.sample(np.array([[-1.0], [0.0], [1.0]]))]
    W = uncertainty_weight(systems[1], systems, GRID, kind="input", order=0)
    uncertain = uncertain_plant(P, W, enters_as=slice(0, 1))
    result = hinfstruct_robust(uncertain, StaticGain(1, 1), starts=1, scaling_order=1, rounds=2)
    K = tuple(
        np.atleast_2d(m) for m in (result.controller.A, result.controller.B, result.controller.C, result.controller.D)
    )
    assert hinf_norm(*P.close(*StaticGain(1, 1).realize(result.parameters))).norm == pytest.approx(result.gamma_nominal)
    assert K[3][0, 0] == pytest.approx(result.parameters[0])
    # the tuned scaling proves a bound: the level times the scaled norm, where that is at most one
    proved = [r.level for r in result.rounds if r.scaled_norm <= 1.0]
    assert proved
    assert result.gamma_robust <= min(proved) * (1.0 + 1e-6)
    worst = max(
        hinf_norm(*delta_closed(uncertain, [[e]]).close(*StaticGain(1, 1).realize(result.parameters))).norm
        for e in np.linspace(-0.999, 0.999, 11)
    )
    assert worst <= result.gamma_robust * (1.0 + 1e-6)


def test_wrong_robust_designs() -> None:
    P, _ = uncertain_lag()
    W = uncertainty_weight(lag(1.0, 1.0), [lag(1.2, 1.0)], GRID, kind="input", order=0)
    uncertain = uncertain_plant(P, W)
    with pytest.raises(DomainError, match="scaling_order is 2, wanted 0 or 1"):
        hinfstruct_robust(uncertain, StaticGain(1, 1), scaling_order=2)
    with pytest.raises(DimensionError, match="plants holds 0 plants"):
        hinfstruct_robust([], StaticGain(1, 1))
    with pytest.raises(DimensionError, match=r"initial has shape \(2,\)"):
        hinfstruct_robust(uncertain, StaticGain(1, 1), initial=[0.0, 0.0])
    with pytest.raises(SynthesisError, match="initial does not stabilise"):
        hinfstruct_robust(uncertain, StaticGain(1, 1), initial=[0.0])
