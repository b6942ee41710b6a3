"""The minimisers on maxima of known functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.bundle import bundle
from lpvhinf.hinfstruct.problem import Budget, Cut, Point
from lpvhinf.hinfstruct.quasi_newton import bfgs
from lpvhinf.hinfstruct.subproblem import convex_model, curved_step, quadratic_model, shortest_combination


class MaxOfQuadratics:
    """max_i (x - c_i)^T H_i (x - c_i) / 2 + b_i, infinite where x[0] > wall."""

    def __init__(self, seed: int, n: int, m: int, wall: float = np.inf) -> None:
        rng = np.random.default_rng(seed)
        self.centres, self.offsets, self.wall = rng.standard_normal((m, n)), rng.standard_normal(m), wall
        roots = rng.standard_normal((m, n, n))
        self.scale = 1.0
        self.H = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(n)

    def parts(self, x: Array) -> tuple[Array, Array]:
        d = x - self.centres
        Hd = np.einsum("kij,kj->ki", self.H, d)
        return 0.5 * np.sum(d * Hd, axis=1) + self.offsets, Hd

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        return Point(theta, np.inf if theta[0] > self.wall else float(np.max(self.parts(theta)[0])))

    def confirm(self, point: Point) -> Point:
        return point

    def gradient(self, point: Point) -> Array:
        values, gradients = self.parts(point.theta)
        return np.asarray(gradients[np.argmax(values)])

    def cuts(self, point: Point, missed: Sequence[Point] = (), earlier: Sequence[Cut] = ()) -> list[Cut]:
        return [Cut(float(v), g, (i,)) for i, (v, g) in enumerate(zip(*self.parts(point.theta), strict=True))]

    def hessians(self, point: Point, cuts: Sequence[Cut]) -> Array | None:
        return self.H[[cut.label[0] for cut in cuts]]

    def metric(self, point: Point) -> Array | None:
        return self.scale * np.mean(self.H, axis=0)


@pytest.mark.parametrize("seed", range(4))
def test_bundle_reaches_the_optimality_condition_of_a_convex_maximum(seed: int) -> None:
    oracle = MaxOfQuadratics(seed, 6, 5)
    run = bundle(oracle, oracle.evaluate(np.full(6, 3.0)), Budget(), tolerance=1e-10)
    # zero lies in the convex hull of the active gradients: a global minimum, as the function is convex
    assert run.optimality < 1e-4
    assert run.iterations < 60


class LargestEigenvalue:
    """lambda_max(A_0 + sum_k x_k A_k) + |x|^2 / 20: one cut, and the family of all others."""

    def __init__(self, seed: int, n: int, size: int) -> None:
        rng = np.random.default_rng(seed)
        roots = rng.standard_normal((n + 1, size, size))
        self.A = roots + roots.transpose(0, 2, 1)

    def value(self, x: Array) -> tuple[float, Array]:
        values, vectors = np.linalg.eigh(self.A[0] + np.tensordot(x, self.A[1:], axes=1))
        return float(values[-1]) + 0.05 * float(x @ x), vectors[:, -1]

    def cut(self, x: Array, v: Array, family: Eigenvectors | None = None) -> Cut:
        moved = np.einsum("i,kij,j->k", v, self.A[1:], v)
        family = Eigenvectors(self, x) if family is None else family
        return Cut(float(v @ self.A[0] @ v + x @ moved + 0.05 * x @ x), moved + 0.1 * x, (0,), family=family)

    def evaluate(self, theta: Array, cutoff: float = np.inf) -> Point:
        return Point(theta, self.value(theta)[0])

    def confirm(self, point: Point) -> Point:
        return point

    def gradient(self, point: Point) -> Array:
        return self.cut(point.theta, self.value(point.theta)[1]).gradient

    def cuts(self, point: Point, missed: Sequence[Point] = (), earlier: Sequence[Cut] = ()) -> list[Cut]:
        return [self.cut(point.theta, self.value(point.theta)[1])]

    def hessians(self, point: Point, cuts: Sequence[Cut]) -> Array | None:
        return np.array([0.1 * np.eye(point.theta.size)] * len(cuts))

    def metric(self, point: Point) -> Array | None:
        return np.eye(point.theta.size)


@dataclass(frozen=True)
class Eigenvectors:
    oracle: LargestEigenvalue
    x: Array

    def best(self, d: Array) -> Cut:
        return self.oracle.cut(self.x, self.oracle.value(self.x + d)[1], self)


@pytest.mark.parametrize("seed", range(3))
def test_bundle_minimises_a_multiple_largest_eigenvalue(seed: int) -> None:
    oracle = LargestEigenvalue(seed, 8, 6)
    run = bundle(oracle, oracle.evaluate(np.ones(8)), Budget(), tolerance=1e-8)
    x = cp.Variable(8)
    S = oracle.A[0] + sum(x[k] * oracle.A[k + 1] for k in range(8))
    best = cp.Problem(cp.Minimize(cp.lambda_max(S) + 0.05 * cp.sum_squares(x))).solve(solver=cp.CLARABEL)
    assert run.point.value == pytest.approx(best, abs=1e-5)
    values = np.linalg.eigvalsh(oracle.A[0] + np.tensordot(run.point.theta, oracle.A[1:], axes=1))
    assert values[-2] == pytest.approx(values[-1], abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_bfgs_comes_close_to_the_same_minimum(seed: int) -> None:
    oracle = MaxOfQuadratics(seed, 6, 5)
    best = bundle(oracle, oracle.evaluate(np.full(6, 3.0)), Budget(), tolerance=1e-10).point.value
    run = bfgs(oracle, oracle.evaluate(np.full(6, 3.0)), Budget(), tolerance=1e-10, max_iterations=1000)
    assert best - 1e-8 <= run.point.value <= best + 1e-4 * max(1.0, abs(best))


def test_points_outside_the_domain_are_never_returned() -> None:
    oracle = MaxOfQuadratics(0, 3, 3, wall=-1.0)
    start = oracle.evaluate(np.full(3, -2.0))
    for run in (bfgs(oracle, start, Budget()), bundle(oracle, start, Budget())):
        assert np.isfinite(run.point.value)
        assert run.point.theta[0] <= -1.0
        assert run.point.value < start.value


def test_target_and_deadline() -> None:
    oracle = MaxOfQuadratics(1, 3, 2)
    start = oracle.evaluate(np.full(3, 5.0))
    assert bfgs(oracle, start, Budget(), target=start.value + 1.0).reason == "target reached"
    assert bfgs(oracle, start, Budget(deadline=0.0)).reason == "time limit"
    assert bundle(oracle, start, Budget(deadline=0.0)).reason == "time limit"


def test_shortest_combination() -> None:
    length, weights = shortest_combination(np.array([[1.0, 1.0], [1.0, -3.0]]))
    assert length == pytest.approx(1.0)
    np.testing.assert_allclose(weights, [0.75, 0.25])
    assert shortest_combination(np.array([[1.0, 0.0], [-2.0, 0.0]]))[0] == pytest.approx(0.0, abs=1e-12)


def test_quadratic_model_keeps_hard_rows() -> None:
    # minimise -d0 + d0^2/20 with d0 <= 0.5 hard and |d| <= 2
    G = np.array([[-1.0, 0.0], [1.0, 0.0]])
    model = quadratic_model(np.array([0.0, -0.5]), G, np.array([False, True]), 0.1 * np.eye(2), 2.0)
    assert model is not None
    np.testing.assert_allclose(model.step, [0.5, 0.0], atol=1e-7)
    assert model.decrease == pytest.approx(0.5)


def test_curved_step_follows_a_curved_kink() -> None:
    # max(|x|^2 / 2 + x1, |x|^2 / 2 - x1) - x0 on a box: the minimum is (1, 0), where both are -1/2
    G, H = np.array([[-1.0, 1.0], [-1.0, -1.0]]), np.array([np.eye(2), np.eye(2)])
    step = curved_step(np.zeros(2), G, H, [0, 1], np.array([False, False]), np.array([0.5, 0.5]), 2.0)
    assert step is not None
    np.testing.assert_allclose(step.step, [1.0, 0.0], atol=1e-6)
    assert step.decrease == pytest.approx(0.5)


def test_curved_step_takes_negative_curvature_to_the_edge() -> None:
    step = curved_step(np.zeros(1), np.array([[0.1]]), np.array([[[-1.0]]]), [0], np.array([False]), np.ones(1), 0.5)
    assert step is not None
    np.testing.assert_allclose(step.step, [-0.5], atol=1e-6)


@pytest.mark.parametrize("scale", [1e-8, 1e8])
def test_bundle_does_not_depend_on_the_size_of_the_metric_alone(scale: float) -> None:
    oracle = MaxOfQuadratics(2, 6, 5)
    oracle.scale = scale
    best = bundle(oracle, oracle.evaluate(np.full(6, 3.0)), Budget(), tolerance=1e-10)
    assert best.optimality < 1e-4


def test_convex_model_is_positive_semidefinite() -> None:
    rng = np.random.default_rng(0)
    H = rng.standard_normal((5, 5))
    model = convex_model(H + H.T, rng.standard_normal((2, 5)), np.array([0.3, 0.7]))
    assert np.min(np.linalg.eigvalsh(model)) > 0.0
