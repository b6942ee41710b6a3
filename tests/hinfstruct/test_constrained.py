"""Constrained minimisation: closed forms, optimality conditions, infeasible problems."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.hinfstruct import ControllerStructure, DiagonalGain, FixedOrder, StaticGain
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.goals import (
    MARGIN,
    ChannelNorm,
    ClosedLoopPoles,
    CombinedOracle,
    ConstrainedDescent,
    FrequencyBand,
    Goal,
    GoalOracle,
    H2Norm,
    minimise_constrained,
    objective_oracle,
)
from lpvhinf.hinfstruct.oracle import NormOracle
from lpvhinf.hinfstruct.problem import Budget
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.hinfstruct.plants import random_plant


def noisy_integrator() -> GeneralizedPlant:
    """x' = w1 + u, z = (x, u), y = x + w2.

    With u = -k y: w1 -> x is 1/(s + k), w2 -> u is -k s/(s + k): norms 1/k and k; H2 norm of the first 1/sqrt(2 k).
    """
    return GeneralizedPlant(
        [[0.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], np.zeros((2, 2)), [[0.0], [1.0]], [[0.0, 1.0]]
    )


def mass() -> GeneralizedPlant:
    """x'' = w + u, z = (x, u), y = (x, x'): u = -k x - d x'; poles with natural frequency sqrt k."""
    return GeneralizedPlant(
        [[0.0, 1.0], [0.0, 0.0]],
        [[0.0], [1.0]],
        [[0.0], [1.0]],
        [[1.0, 0.0], [0.0, 0.0]],
        np.eye(2),
        np.zeros((2, 1)),
        [[0.0], [1.0]],
        np.zeros((2, 1)),
    )


def solve(
    plants: list[GeneralizedPlant],
    structure: ControllerStructure,
    objective: Goal | None,
    constraints: list[Goal],
    theta: Array | list[float],
) -> ConstrainedDescent:
    loops = ClosedLoops(plants, structure, (None,) * len(plants))
    budget = Budget()
    goals = GoalOracle(constraints, loops, Budget(), margin=MARGIN)
    return minimise_constrained(
        objective_oracle(objective, loops, budget), goals, np.asarray(theta, dtype=float), budget
    )


BETTER = ChannelNorm(outputs=0, inputs=0)
EFFORT = ChannelNorm(outputs=1, inputs=1)


@pytest.mark.parametrize("start", [-0.1, -1.0, -30.0])
@pytest.mark.parametrize(
    ("objective", "constraint", "gain", "value"),
    [
        (BETTER, ChannelNorm(outputs=1, inputs=1, at_most=2.0), 2.0, 0.5),
        (EFFORT, ChannelNorm(outputs=0, inputs=0, at_most=0.25), 4.0, 4.0),
        (EFFORT, ClosedLoopPoles(decay=3.0), 3.0, 3.0),
        (BETTER, ClosedLoopPoles(fastest=5.0), 5.0, 0.2),
        (EFFORT, H2Norm(outputs=0, inputs=0, at_most=0.5), 2.0, 2.0),
        (H2Norm(outputs=0, inputs=0), ChannelNorm(outputs=1, inputs=1, at_most=8.0), 8.0, 0.25),
        # |k j w/(j w + k)| at w = 3, the end of the band
        (BETTER, FrequencyBand(outputs=1, inputs=1, band=(0.0, 3.0), at_most=12.0 / 5.0), 4.0, 0.25),
    ],
)
def test_one_gain_with_a_closed_form(
    objective: Goal, constraint: Goal, gain: float, value: float, start: float
) -> None:
    run = solve([noisy_integrator()], StaticGain(1, 1), objective, [constraint], [start])
    assert run.feasible
    assert run.theta[0] == pytest.approx(-gain, rel=2e-5)
    assert np.exp(run.objective) == pytest.approx(value, rel=2e-5)
    assert run.optimality < 1e-6
    assert run.reason == "converged"


def test_multipliers_say_what_a_bound_costs() -> None:
    # 1/k with k <= b: log of the optimum is -log b
    run = solve([noisy_integrator()], StaticGain(1, 1), BETTER, [ChannelNorm(outputs=1, inputs=1, at_most=2.0)], [-1.0])
    assert run.multipliers[0] == pytest.approx(1.0, rel=1e-4)
    # 1/sqrt(2 k): half of that
    half = solve(
        *([noisy_integrator()], StaticGain(1, 1), H2Norm(outputs=0, inputs=0)),
        *([ChannelNorm(outputs=1, inputs=1, at_most=2.0)], [-1.0]),
    )
    assert half.multipliers[0] == pytest.approx(0.5, rel=1e-4)


def test_damping_and_speed_of_a_mass() -> None:
    # the stiffest loop, 1/k, with poles no faster than 10 rad/s: both moduli are 10, so k = 100
    run = solve(
        *([mass()], StaticGain(1, 2), ChannelNorm(outputs=0)),
        *([ClosedLoopPoles(damping=0.75, fastest=10.0)], [-1.0, -1.0]),
    )
    k, d = -run.theta
    assert run.feasible
    assert k == pytest.approx(100.0, rel=1e-4)
    assert d >= 2.0 * 0.75 * 10.0 * (1.0 - 1e-4)
    assert np.exp(run.objective) == pytest.approx(0.01, rel=1e-4)


def test_logarithmic_parameters() -> None:
    run = solve(
        *([noisy_integrator()], DiagonalGain(1, sign=-1), BETTER),
        *([ChannelNorm(outputs=1, inputs=1, at_most=2.0)], [0.0]),
    )
    assert np.exp(run.theta[0]) == pytest.approx(2.0, rel=1e-5)


def test_a_constraint_that_is_not_active_changes_nothing() -> None:
    free = solve([noisy_integrator()], StaticGain(1, 1), None, [ChannelNorm(outputs=1, inputs=1, at_most=50.0)], [-1.0])
    assert np.exp(free.objective) == pytest.approx(np.sqrt(2.0), rel=1e-5)
    assert free.multipliers[0] == 0.0


def test_infeasible_constraints_are_reported() -> None:
    # 1/k <= 0.1 and k <= 5 contradict each other
    run = solve(
        *([noisy_integrator()], StaticGain(1, 1), None),
        *([ChannelNorm(outputs=0, inputs=0, at_most=0.1), ChannelNorm(outputs=1, inputs=1, at_most=5.0)], [-1.0]),
    )
    assert not run.feasible
    assert "infeasible" in run.reason
    assert run.violation == pytest.approx(0.5 * np.log(2.0), rel=1e-3)  # both are missed by the factor sqrt 2


@pytest.mark.parametrize("seed", [3, pytest.param(0, marks=pytest.mark.slow), pytest.param(1, marks=pytest.mark.slow)])
def test_karush_kuhn_tucker_point_of_a_larger_problem(seed: int) -> None:
    plants = [random_plant(seed + k, n=4, sizes=(2, 1, 3, 2)) for k in range(2)]
    structure = FixedOrder(2, 1, 2)
    rng = np.random.default_rng(seed)
    loops = ClosedLoops(plants, structure, (None,) * 2)
    norms = NormOracle(loops, Budget())
    theta = next(t for t in (0.3 * structure.initial(rng) for _ in range(400)) if np.isfinite(norms.evaluate(t).value))
    objective = ChannelNorm(outputs=[0, 1])
    free = solve(plants, structure, objective, [ChannelNorm(outputs=2, at_most=1e6)], theta)
    # the other channel there, halfway to what is possible
    other = GoalOracle([ChannelNorm(outputs=2)], loops, Budget())
    there = other.exact(free.theta)[0].value
    least = np.exp(solve(plants, structure, ChannelNorm(outputs=2), [ChannelNorm(at_most=1e6)], theta).objective)
    bound = ChannelNorm(outputs=2, at_most=float(np.sqrt(there * least)))
    run = solve(plants, structure, objective, [bound], free.theta)
    assert run.feasible
    assert run.objective >= free.objective - 1e-4
    assert run.optimality < 1e-3
    assert GoalOracle([bound], loops, Budget()).exact(run.theta)[0].value <= bound.at_most * (1.0 + 1e-9)  # type: ignore[operator]
    # no small feasible step is better
    goals = GoalOracle([bound], loops, Budget())
    value = objective_oracle(objective, loops, Budget())
    for _ in range(60):
        t = run.theta + 1e-3 * rng.standard_normal(run.theta.size)
        if goals.evaluate(t).value <= 0.0:
            assert value.evaluate(t).value >= run.objective - 1e-4


def test_hard_form_never_leaves_the_feasible_set() -> None:
    loops = ClosedLoops([noisy_integrator()], StaticGain(1, 1), (None,))
    goals = GoalOracle([ChannelNorm(outputs=1, inputs=1, at_most=2.0)], loops, Budget())
    hard = CombinedOracle(objective_oracle(BETTER, loops, Budget()), goals, hard=True)
    assert hard.evaluate(np.array([-2.5])).value == np.inf
    point = hard.confirm(hard.evaluate(np.array([-1.0])))
    cuts = hard.cuts(point)
    assert [cut.hard for cut in cuts if cut.label[0] == "constraint"] == [True]
    assert next(cut.value for cut in cuts if cut.hard) == pytest.approx(np.log(0.5))


def test_a_start_that_does_not_stabilise_is_reported() -> None:
    run = solve([noisy_integrator()], StaticGain(1, 1), None, [ChannelNorm(at_most=2.0)], [1.0])
    assert run.reason == "not stabilising"
    assert not run.feasible
