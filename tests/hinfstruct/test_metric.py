"""The metric of steps: what it measures, and that units do not matter."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.hinfstruct import FixedOrder, StaticGain
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.fixed_modes import immovable
from lpvhinf.hinfstruct.metric import unit_steps
from lpvhinf.hinfstruct.oracle import NormOracle
from lpvhinf.hinfstruct.problem import Budget
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.hinfstruct.plants import random_plant


def metric(plant: GeneralizedPlant, theta: Array) -> Array:
    oracle = NormOracle(ClosedLoops((plant,), StaticGain(plant.n_u, plant.n_y), (None,)), Budget())
    M = oracle.metric(oracle.evaluate(theta))
    assert M is not None
    return M


def test_units_of_inputs_and_outputs_do_not_matter() -> None:
    P = random_plant(1, with_D22=False)
    u, y = np.array([1e3, 1e-2]), np.array([1e2, 10.0])
    Q = GeneralizedPlant(P.A, P.B1, P.B2 / u, P.C1, P.C2 * y[:, None], P.D11, P.D12 / u, P.D21 * y[:, None])
    K = 0.05 * np.random.default_rng(0).standard_normal((2, 2))
    scale = np.outer(u, 1.0 / y)
    d = np.random.default_rng(1).standard_normal(4)
    ours, theirs = metric(P, K.ravel()), metric(Q, (scale * K).ravel())
    moved = scale.ravel() * d
    assert moved @ theirs @ moved == pytest.approx(d @ ours @ d, rel=1e-3)


def test_small_steps_keep_the_loop_stable() -> None:
    P = random_plant(2, with_D22=False)
    loops = ClosedLoops((P,), FixedOrder(1, 2, 2), (None,))
    oracle = NormOracle(loops, Budget())
    theta = 0.1 * np.random.default_rng(3).standard_normal(loops.structure.n_parameters)
    theta[0] = -1.0
    point = oracle.evaluate(theta)
    assert np.isfinite(point.value)
    M = oracle.metric(point)
    assert M is not None
    F = unit_steps(M)
    for direction in np.random.default_rng(4).standard_normal((50, theta.size)):
        step = F @ (0.3 * direction / np.linalg.norm(direction))
        assert np.isfinite(oracle.evaluate(theta + step).value)


def test_unit_steps_are_of_unit_size() -> None:
    root = np.random.default_rng(0).standard_normal((4, 4))
    F = unit_steps(root @ root.T)
    np.testing.assert_allclose(F.T @ root @ root.T @ F, np.eye(4), atol=1e-8)
    assert np.all(np.isfinite(unit_steps(np.zeros((3, 3)))))


def test_immovable_modes() -> None:
    A = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -2.0]])
    assert immovable(A, np.array([[0.0], [1.0], [0.0]])).size == 0
    np.testing.assert_allclose(immovable(A, np.array([[1.0], [0.0], [1.0]])), [1.0, 1.0], atol=1e-6)
    assert immovable(np.diag([-1.0, -2.0]), np.zeros((2, 1))).size == 0
    turn = np.array([[0.0, 3.0], [-3.0, 0.0]])
    np.testing.assert_allclose(immovable(turn, np.zeros((2, 1))), [3.0j], atol=1e-9)
