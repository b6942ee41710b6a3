"""Gradients and Hessians of peaks and of the spectral abscissa against differences."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.hinfstruct import BlockDiagonal, ControllerStructure, DiagonalGain, FixedOrder, Scaled, StaticGain
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.loop import LoopFactory, augmented_gain
from lpvhinf.hinfstruct.oracle import NormOracle
from lpvhinf.hinfstruct.problem import Budget
from lpvhinf.hinfstruct.stabilise import AbscissaOracle
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.hinfstruct.plants import random_plant

STRUCTURES = [
    StaticGain(2, 2),
    StaticGain(2, 2, mask=[[True, False], [True, True]]),
    DiagonalGain(2, sign=[1, -1]),
    FixedOrder(2, 2, 2),
    FixedOrder(3, 2, 2, form="tridiagonal"),
    BlockDiagonal(FixedOrder(1, 1, 1), StaticGain(1, 1)),
    Scaled(FixedOrder(1, 2, 2), [2.0, 0.5], [1.0, 3.0]),
]


def stable_theta(structure: ControllerStructure, plants: list[GeneralizedPlant]) -> Array:
    rng = np.random.default_rng(0)
    oracle = NormOracle(ClosedLoops(plants, structure, (None,) * len(plants)), Budget())
    for _ in range(400):
        theta = rng.uniform(-5.0, -2.0, 2) if isinstance(structure, DiagonalGain) else 0.3 * structure.initial(rng)
        if np.isfinite(oracle.evaluate(theta).value):
            return theta
    raise AssertionError("no stable theta")


def test_loop_agrees_with_the_plants_own_closure() -> None:
    plant, structure = random_plant(4), FixedOrder(2, 2, 2)
    matrices = structure.realize(0.1 * structure.initial(np.random.default_rng(0)))
    loop = LoopFactory(plant, 2).close(augmented_gain(*matrices))
    assert loop is not None
    for ours, reference in zip((loop.A, loop.B, loop.C, loop.D), plant.close(*matrices), strict=True):
        np.testing.assert_allclose(ours, reference, atol=1e-12)


@pytest.mark.parametrize("with_D22", [True, False])
@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: type(s).__name__)
def test_gradient_and_hessian(structure: ControllerStructure, with_D22: bool) -> None:
    plants = [random_plant(k, with_D22=with_D22) for k in range(3)]
    theta = stable_theta(structure, plants)
    oracle = NormOracle(ClosedLoops(plants, structure, (None,) * 3), Budget(), offset=0.5, guard=0.01)
    point = oracle.evaluate(theta)
    assert np.isfinite(point.value)
    gradient = oracle.gradient(point)
    numeric, hessian = np.empty_like(theta), np.empty((theta.size, theta.size))
    oracle_free = NormOracle(oracle.loops, Budget(), offset=0.5)
    for k in range(theta.size):
        step = 1e-5 * max(1.0, abs(theta[k])) * np.eye(theta.size)[k]
        above, below = oracle.evaluate(theta + step), oracle.evaluate(theta - step)
        numeric[k] = (above.value - below.value) / (2.0 * step[k])
        above, below = oracle_free.evaluate(theta + step), oracle_free.evaluate(theta - step)
        hessian[k] = (oracle_free.gradient(above) - oracle_free.gradient(below)) / (2.0 * step[k])
    np.testing.assert_allclose(gradient, numeric, atol=1e-4 * np.max(np.abs(numeric)))
    first = max((c for c in oracle_free.cuts(oracle_free.evaluate(theta)) if not c.hard), key=lambda c: c.value)
    exact = oracle_free.hessians(oracle_free.evaluate(theta), [first])
    assert exact is not None
    np.testing.assert_allclose(exact[0], hessian, atol=1e-2 * np.max(np.abs(hessian)))


@pytest.mark.parametrize("structure", [StaticGain(2, 2), FixedOrder(2, 2, 2)], ids=["static", "order 2"])
def test_gradient_of_the_abscissa(structure: ControllerStructure) -> None:
    oracle = AbscissaOracle(ClosedLoops([random_plant(k) for k in range(2)], structure, (None,) * 2), Budget())
    theta = 0.2 * structure.initial(np.random.default_rng(2))
    gradient = oracle.gradient(oracle.evaluate(theta))
    for k in range(theta.size):
        step = 1e-6 * np.eye(theta.size)[k]
        numeric = (oracle.evaluate(theta + step).value - oracle.evaluate(theta - step).value) / 2e-6
        assert gradient[k] == pytest.approx(numeric, abs=1e-5 * np.max(np.abs(gradient)))


def test_a_defective_pole_gives_a_finite_gradient() -> None:
    # double integrator with zero gain: a Jordan block at zero
    plant = GeneralizedPlant(
        [[0.0, 1.0], [0.0, 0.0]],
        [[0.0], [1.0]],
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        np.eye(2),
        [[0.0]],
        [[0.0]],
        np.zeros((2, 1)),
    )
    oracle = AbscissaOracle(ClosedLoops([plant], StaticGain(1, 2), (None,)), Budget())
    assert np.all(np.isfinite(oracle.gradient(oracle.evaluate(np.zeros(2)))))


def test_a_cluster_predicts_the_largest_singular_value_where_several_coincide() -> None:
    # four equal axes: a fourfold singular value, which a coupled change of the controller splits
    one = random_plant(4)
    parts = (one.A, one.B1, one.B2, one.C1, one.C2, one.D11, one.D12, one.D21)
    axes = GeneralizedPlant(*[np.kron(np.eye(4), M) for M in parts])
    loops = ClosedLoops([axes], StaticGain(8, 8), (None,))
    oracle = NormOracle(loops, Budget())
    theta = np.zeros(64)
    point = oracle.evaluate(theta)
    top = max((cut for cut in oracle.cuts(point) if not cut.hard), key=lambda cut: cut.value)
    assert top.family is not None
    rng = np.random.default_rng(0)
    for _ in range(5):
        d = 1e-5 * rng.standard_normal(64)
        member = top.family.best(d)
        change = oracle.evaluate(theta + d).value - point.value
        assert member.value + member.gradient @ d - point.value == pytest.approx(change, abs=1e-2 * abs(change))
        assert top.gradient @ d < 0.9 * change


def test_peaks_of_every_plant_become_cuts() -> None:
    plants = [random_plant(k) for k in range(3)]
    oracle = NormOracle(ClosedLoops(plants, StaticGain(2, 2), (None,) * 3), Budget(), fraction=0.01)
    point = oracle.evaluate(np.zeros(4))
    cuts = [cut for cut in oracle.cuts(point) if not cut.hard]
    assert {cut.label[0] for cut in cuts} == {0, 1, 2}
    assert max(cut.value for cut in cuts) == pytest.approx(point.value, abs=1e-9)
