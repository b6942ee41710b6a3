"""Goals: values against definitions, gradients and Hessians against differences, bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct import ControllerStructure, DiagonalGain, FixedOrder, StaticGain, hinf_norm
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.goals import ChannelNorm, ClosedLoopPoles, FrequencyBand, Goal, GoalOracle, H2Norm
from lpvhinf.hinfstruct.problem import Budget, Point
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.hinfstruct.plants import random_plant

STRUCTURES = [StaticGain(2, 2), DiagonalGain(2, sign=[1, -1]), FixedOrder(2, 2, 2, strictly_proper=True, stable=True)]
GOALS = [
    ChannelNorm(outputs=[0, 1], inputs=[2], at_most=0.7),
    ChannelNorm(at_most=2.0, plants=[1]),
    FrequencyBand(outputs=0, inputs=[0, 1], band=(0.2, 0.9), at_most=0.5),
    FrequencyBand(band=(3.0, np.inf), at_most=0.5),
    ClosedLoopPoles(decay=2.0),
    ClosedLoopPoles(damping=0.9),
    ClosedLoopPoles(fastest=1.5),
    H2Norm(outputs=[0, 1, 2], at_most=0.5),
]


def without_feedthrough(seed: int, with_D22: bool = True) -> GeneralizedPlant:
    P = random_plant(seed, with_D22=with_D22)
    return GeneralizedPlant(P.A, P.B1, P.B2, P.C1, P.C2, 0.0 * P.D11, P.D12, 0.0 * P.D21, P.D22)


def oracle_at(goal: Goal, structure: ControllerStructure, n: int = 2) -> tuple[GoalOracle, Array]:
    plants = [without_feedthrough(k) for k in range(n)]
    oracle = GoalOracle([goal], ClosedLoops(plants, structure, (None,) * n), Budget())
    rng = np.random.default_rng(1)
    for _ in range(400):
        theta = rng.uniform(-5.0, -2.0, 2) if isinstance(structure, DiagonalGain) else 0.2 * structure.initial(rng)
        if np.isfinite(oracle.evaluate(theta).value):
            return oracle, theta
    raise AssertionError("no stable theta")


def at(oracle: GoalOracle, theta: Array) -> Point:
    return oracle.confirm(oracle.evaluate(theta))


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("goal", GOALS, ids=lambda g: type(g).__name__)
def test_gradient_and_hessian(goal: Goal, structure: ControllerStructure) -> None:
    oracle, theta = oracle_at(goal, structure)
    point = at(oracle, theta)
    gradient = oracle.gradient(point)
    cut = max(oracle.cuts(point), key=lambda c: c.value)
    assert cut.value == pytest.approx(point.value, abs=1e-9)
    np.testing.assert_allclose(cut.gradient, gradient, atol=1e-9 * np.max(np.abs(gradient)))
    hessian = oracle.hessians(point, [cut])
    assert hessian is not None
    numeric, second = np.empty_like(theta), np.empty((theta.size, theta.size))
    for k in range(theta.size):
        # Richardson extrapolation of central differences
        slopes, bends = [], []
        for h in (2e-4, 1e-4):
            step = h * np.eye(theta.size)[k]
            above, below = at(oracle, theta + step), at(oracle, theta - step)
            slopes.append((above.value - below.value) / (2.0 * h))
            bends.append((oracle.gradient(above) - oracle.gradient(below)) / (2.0 * h))
        numeric[k] = (4.0 * slopes[1] - slopes[0]) / 3.0
        second[k] = (4.0 * bends[1] - bends[0]) / 3.0
    np.testing.assert_allclose(gradient, numeric, atol=1e-6 * max(1.0, np.max(np.abs(numeric))))
    np.testing.assert_allclose(hessian[0], second, atol=1e-4 * max(1.0, np.max(np.abs(second))))


def test_values_are_those_of_their_definitions() -> None:
    import control

    structure = FixedOrder(2, 2, 2, strictly_proper=True, stable=True)
    oracle, theta = oracle_at(GOALS[0], structure)
    loops = oracle.loops
    closed = [factory.close(K) for factory, K in zip(loops.factories, loops.gains(theta), strict=True)]
    for goal in GOALS:
        (value,) = GoalOracle([goal], loops, Budget()).exact(theta)
        wanted = []
        for number in goal.used_plants(2):
            loop = closed[number]
            assert loop is not None
            poles = np.linalg.eigvals(loop.A)
            if isinstance(goal, ClosedLoopPoles):
                wanted.append(
                    np.max(poles.real / 2.0 + 1.0)
                    if goal.decay
                    else np.max(0.9 + poles.real / np.abs(poles))
                    if goal.damping
                    else np.max(np.log(np.abs(poles) / 1.5))
                )
                continue
            rows, columns = goal.channels(3, 3)  # type: ignore[attr-defined]
            part = (loop.A, loop.B[:, columns], loop.C[list(rows)], loop.D[np.ix_(rows, columns)])
            if isinstance(goal, H2Norm):
                wanted.append(control.norm(control.ss(*part), 2))
            elif isinstance(goal, FrequencyBand):
                low, high = goal.band
                omega = np.append(np.geomspace(low, min(high, 1e4), 3000), low)
                grid = [part[2] @ np.linalg.solve(1j * w * np.eye(len(loop.A)) - loop.A, part[1]) for w in omega]
                gains = np.linalg.norm(np.array(grid) + part[3], 2, axis=(1, 2))
                wanted.append(max(np.max(gains), np.linalg.norm(part[3], 2) if np.isinf(high) else 0.0))
            else:
                wanted.append(hinf_norm(*part).norm)
        assert value.value == pytest.approx(max(wanted), rel=1e-6)


def resonances(*modes: tuple[float, float]) -> GeneralizedPlant:
    """Light modes (omega, zeta) in parallel, gain at each resonance 1/(2 zeta); u does nothing much."""
    n = 2 * len(modes)
    A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    for k, (w, zeta) in enumerate(modes):
        A[2 * k, 2 * k + 1], A[2 * k + 1, 2 * k], A[2 * k + 1, 2 * k + 1] = w, -w, -2.0 * zeta * w
        B[2 * k + 1], C[0, 2 * k] = w, 1.0
    return GeneralizedPlant(A, B, 1e-3 * B, C, C, [[0.0]], [[0.0]], [[0.0]])


@pytest.mark.parametrize(
    ("band", "wanted", "omega"),
    [((50.0, 200.0), 500.0, 100.0), ((2.0, 1e3), 500.0, 100.0), ((0.0, 50.0), 50.0, 10.0), ((90.0, 99.0), None, 99.0)],
)
def test_a_narrow_peak_inside_a_band_is_found(band: tuple[float, float], wanted: float | None, omega: float) -> None:
    P = resonances((10.0, 0.01), (100.0, 0.001))
    oracle = GoalOracle([FrequencyBand(band=band, at_most=1.0)], ClosedLoops([P], StaticGain(1, 1), (None,)), Budget())
    (value,) = oracle.exact(np.zeros(1))
    assert value.where == pytest.approx(omega, rel=1e-3)
    if wanted is not None:
        assert value.value == pytest.approx(wanted, rel=0.05)


def test_a_peak_that_tracking_missed_is_found_by_the_level_test(monkeypatch: pytest.MonkeyPatch) -> None:
    from lpvhinf.hinfstruct.goals import gain as module
    from lpvhinf.hinfstruct.peaks import Peaks

    P = resonances((10.0, 0.01), (100.0, 0.001))
    oracle = GoalOracle(
        [FrequencyBand(band=(1.0, 1e3), at_most=1.0)], ClosedLoops([P], StaticGain(1, 1), (None,)), Budget()
    )
    real = module.band_peaks
    monkeypatch.setattr(
        module,
        "band_peaks",
        lambda *args: Peaks(np.array([10.0]), np.array([50.0])) if args[3].size == 0 else real(*args),
    )
    point = oracle.evaluate(np.zeros(1))
    assert point.value == pytest.approx(np.log(50.0))
    assert oracle.confirm(point).value == pytest.approx(np.log(500.0), abs=0.01)


def test_poles_that_nothing_moves_are_left_out() -> None:
    # x2 is a weight at -0.01, driven by x1: u does not move it
    P = GeneralizedPlant(
        [[1.0, 0.0], [1.0, -0.01]],
        [[1.0], [0.0]],
        [[1.0], [0.0]],
        [[0.0, 1.0]],
        [[1.0, 0.0]],
        [[0.0]],
        [[0.0]],
        [[0.0]],
    )
    oracle = GoalOracle([ClosedLoopPoles(decay=1.0)], ClosedLoops([P], StaticGain(1, 1), (None,)), Budget())
    assert oracle.evaluate(np.array([-5.0])).value == pytest.approx(-3.0)


def test_a_defective_pole_has_a_finite_gradient() -> None:
    P = GeneralizedPlant(
        [[-1.0, 1.0], [0.0, -1.0]],
        np.ones((2, 1)),
        [[0.0], [1.0]],
        np.ones((1, 2)),
        [[1.0, 0.0]],
        [[0.0]],
        [[0.0]],
        [[0.0]],
    )
    oracle = GoalOracle([ClosedLoopPoles(decay=2.0)], ClosedLoops([P], StaticGain(1, 1), (None,)), Budget())
    assert np.all(np.isfinite(oracle.gradient(oracle.evaluate(np.zeros(1)))))


def test_unstable_loops_are_outside_the_domain() -> None:
    oracle, theta = oracle_at(GOALS[0], StaticGain(2, 2))
    assert oracle.evaluate(theta + 1e4).value == np.inf
    assert oracle.exact(theta + 1e4)[0].level == np.inf


def test_several_goals_and_a_margin() -> None:
    oracle, theta = oracle_at(GOALS[0], StaticGain(2, 2))
    single = [GoalOracle([goal], oracle.loops, Budget()).evaluate(theta).value for goal in GOALS[:-1]]
    both = GoalOracle(GOALS[:-1], oracle.loops, Budget(), margin=0.01)
    point = at(both, theta)
    assert point.value == pytest.approx(max(single) + 0.01)
    cuts = both.cuts(point, lowest=min(single))
    assert {both.goal_of(cut) for cut in cuts} == set(range(len(GOALS) - 1))
    again = both.cuts(point, missed=[at(both, theta + 0.01)], earlier=cuts)
    assert len(again) >= len(both.cuts(point))
    assert both.metric(point) is not None


def test_feedthrough_of_an_h2_channel_is_an_error() -> None:
    plants = [random_plant(0)]
    with pytest.raises(AssumptionError, match="strictly proper controller"):
        GoalOracle([H2Norm(at_most=1.0)], ClosedLoops(plants, StaticGain(2, 2), (None,)), Budget())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ChannelNorm(outputs=-1, at_most=1.0), "outputs"),
        (lambda: ChannelNorm(outputs=[0, 0], at_most=1.0), "each once"),
        (lambda: ChannelNorm(at_most=0.0), "at_most"),
        (lambda: FrequencyBand(band=(3.0, 1.0)), "low < high"),
        (lambda: FrequencyBand(band=3.0), "band"),  # type: ignore[arg-type]
        (lambda: ClosedLoopPoles(), "bounds nothing"),
        (lambda: ClosedLoopPoles(damping=1.0), "between 0 and 1"),
        (lambda: ClosedLoopPoles(decay=3.0, fastest=2.0), "less than fastest"),
        (lambda: ClosedLoopPoles(decay=1.0, plants=[]), "plants"),
    ],
)
def test_bad_goals(make: Any, message: str) -> None:
    with pytest.raises(DomainError, match=message):
        make()


def test_goals_that_do_not_fit_the_plants() -> None:
    loops = ClosedLoops([random_plant(0)], StaticGain(2, 2), (None,))
    with pytest.raises(DimensionError, match="outputs is"):
        GoalOracle([ChannelNorm(outputs=7, at_most=1.0)], loops, Budget())
    with pytest.raises(DimensionError, match="plants is"):
        GoalOracle([ChannelNorm(plants=[1], at_most=1.0)], loops, Budget())
    with pytest.raises(DomainError, match="wanted ChannelNorm"):
        GoalOracle(["poles"], loops, Budget())  # type: ignore[list-item]
    with pytest.raises(DomainError, match="at least one"):
        GoalOracle([], loops, Budget())
