"""Guards the algebra of Chebyshev matrices against sampled algebra and numpy.polynomial."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import chebyshev, polynomial

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.polynomial import ChebyshevMatrix, block, from_nodes, nodes, power_to_chebyshev, scaled

BOX = np.array([[-2.0, 1.0], [0.5, 0.75]])
POINTS = spread_points(BOX, 9)
CORNERS = np.array([[-2.0, 0.5], [-2.0, 0.75], [1.0, 0.5], [1.0, 0.75]])
EVERYWHERE = np.vstack([POINTS, CORNERS])


def random_matrix(seed: int, rows: int, cols: int, degree: tuple[int, int] = (3, 2)) -> ChebyshevMatrix:
    size = (*(d + 1 for d in degree), rows, cols)
    return ChebyshevMatrix(np.random.default_rng(seed).standard_normal(size), BOX)


def test_value_is_that_of_numpy() -> None:
    M = random_matrix(0, 2, 3)
    x = scaled(EVERYWHERE, BOX)
    assert np.max(np.abs(x)) == 1.0
    wanted = np.moveaxis(chebyshev.chebval2d(x[:, 0], x[:, 1], M.coefficients), -1, 0)
    assert np.allclose(M.sample(EVERYWHERE), wanted, rtol=0, atol=1e-13)
    assert np.allclose(M.at(POINTS[2]), wanted[2], rtol=0, atol=1e-13)


degrees = st.tuples(st.integers(0, 5), st.integers(0, 4))


@settings(max_examples=25, deadline=None)
@given(left=degrees, right=degrees, seed=st.integers(0, 10**6))
def test_algebra_is_the_sampled_algebra(left: tuple[int, int], right: tuple[int, int], seed: int) -> None:
    A, B = random_matrix(seed, 2, 3, left), random_matrix(seed + 1, 3, 2, right)
    a, b = A.sample(EVERYWHERE), B.sample(EVERYWHERE)
    cases = [
        (A @ B, a @ b),
        (A + B.T, a + np.swapaxes(b, 1, 2)),
        (A - B.T, a - np.swapaxes(b, 1, 2)),
        (-A, -a),
        (block([[A, np.eye(2)], [np.zeros((3, 3)), B]], BOX), block_samples(a, b)),
        (A[[1], 0:2], a[:, [1], 0:2]),
    ]
    for matrix, wanted in cases:
        assert np.allclose(matrix.sample(EVERYWHERE), wanted, rtol=0, atol=1e-12)
    assert (A @ B).degree == (left[0] + right[0], left[1] + right[1])


def block_samples(a: Array, b: Array) -> Array:
    n = len(a)
    eye, zero = np.broadcast_to(np.eye(2), (n, 2, 2)), np.zeros((n, 3, 3))
    return np.concatenate([np.concatenate([a, eye], axis=2), np.concatenate([zero, b], axis=2)], axis=1)


def test_plain_arrays_are_constants_on_either_side() -> None:
    A, gain = random_matrix(3, 2, 2), np.array([[1.0, 2.0], [3.0, -1.0]])
    a = A.sample(POINTS)
    for matrix, wanted in [
        (gain @ A, gain @ a),
        (A @ gain, a @ gain),
        (gain + A, gain + a),
        (gain - A, gain - a),
        (A - gain, a - gain),
    ]:
        assert isinstance(matrix, ChebyshevMatrix)
        assert matrix.degree == A.degree
        assert np.allclose(matrix.sample(POINTS), wanted, rtol=0, atol=1e-13)


@pytest.mark.parametrize("axis", [0, 1])
def test_derivative_against_differences(axis: int) -> None:
    M, h = random_matrix(5, 2, 2, (4, 5)), 1e-5
    step = np.eye(2)[axis] * h * (BOX[axis, 1] - BOX[axis, 0])
    inner = POINTS[1:]
    numeric = (M.sample(inner + step) - M.sample(inner - step)) / (2 * step[axis])
    assert np.allclose(M.derivative(axis).sample(inner), numeric, rtol=1e-7, atol=1e-7)
    assert np.all(ChebyshevMatrix(np.eye(2), BOX).derivative(axis).coefficients == 0.0)


@pytest.mark.parametrize("axis", [-1, 2])
def test_no_derivative_to_an_axis_that_is_not_there(axis: int) -> None:
    with pytest.raises(DomainError, match=f"axis is {axis}, wanted 0 to 1"):
        random_matrix(0, 2, 2).derivative(axis)


def test_product_rule() -> None:
    A, B = random_matrix(6, 2, 3), random_matrix(7, 3, 2)
    rule = A.derivative(0) @ B + A @ B.derivative(0)
    assert np.allclose((A @ B).derivative(0).sample(POINTS), rule.sample(POINTS), rtol=0, atol=1e-11)


def test_powers_of_p_become_chebyshev_coefficients() -> None:
    powers = np.random.default_rng(8).standard_normal((4, 3, 2, 1))
    M = ChebyshevMatrix(power_to_chebyshev(powers, BOX), BOX)
    wanted = np.moveaxis(polynomial.polyval2d(EVERYWHERE[:, 0], EVERYWHERE[:, 1], powers), -1, 0)
    assert np.allclose(M.sample(EVERYWHERE), wanted, rtol=0, atol=1e-12)
    with pytest.raises(DimensionError, match="2 axes of powers"):
        power_to_chebyshev(powers[0], BOX)


def test_interpolation_on_the_nodes_is_exact() -> None:
    M = random_matrix(9, 2, 2, (4, 3))
    grid = nodes([5, 4], BOX)
    assert np.allclose(from_nodes(M.sample(grid).reshape(5, 4, 2, 2), 2), M.coefficients, rtol=0, atol=1e-13)


def test_constant() -> None:
    M = ChebyshevMatrix([[1.0, 2.0]], BOX)
    assert M.is_constant
    assert M.degree == (0, 0)
    assert np.array_equal(M.sample(POINTS), np.broadcast_to([[1.0, 2.0]], (len(POINTS), 1, 2)))
    assert not random_matrix(0, 1, 2).is_constant


def test_empty_matrices() -> None:
    empty = random_matrix(0, 3, 2)[[], :]
    assert empty.sample(POINTS).shape == (9, 0, 2)
    assert (random_matrix(0, 3, 2) @ empty.T).sample(POINTS).shape == (9, 3, 0)
    assert random_matrix(0, 3, 2).sample(np.zeros((0, 2))).shape == (0, 3, 2)
    assert empty.trimmed().degree == (0, 0)


def test_trimming_drops_trailing_degrees_only() -> None:
    M = random_matrix(10, 2, 2, (2, 1))
    grown = ChebyshevMatrix(M.padded([5, 4]), BOX)
    assert grown.degree == (5, 4)
    assert np.array_equal(grown.trimmed().coefficients, M.coefficients)
    noisy = grown.coefficients + 1e-14
    assert ChebyshevMatrix(noisy, BOX).trimmed().degree == (5, 4)
    assert ChebyshevMatrix(noisy, BOX).trimmed(1e-13).degree == (2, 1)
    gap = ChebyshevMatrix(np.reshape([0.0, 0.0, 3.0], (3, 1, 1, 1)), BOX)  # zeros below a used degree stay
    assert gap.trimmed().degree == (2, 0)
    assert ChebyshevMatrix(np.zeros((4, 4, 2, 2)), BOX).trimmed().is_constant


def test_many_samples_of_the_benchmark(decoupled_mmpa: DecoupledPlant) -> None:
    B = decoupled_mmpa.system.B
    points = spread_points(decoupled_mmpa.box, 10_000)
    samples = B.sample(points)
    for k in [0, 1, 4_999, 7_777, 9_999]:
        assert np.allclose(samples[k], B.at(points[k]), rtol=1e-12, atol=1e-12)
    x = scaled(points[4_321], B.box)
    wanted = chebyshev.chebval2d(x[0], x[1], B.coefficients)
    assert np.allclose(samples[4_321], wanted, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("p", [[1.1, 0.6], [0.0, 0.4999], [np.nan, 0.6], [0.0, np.inf]])
def test_positions_outside_are_refused(p: list[float]) -> None:
    with pytest.raises(DomainError):
        random_matrix(0, 1, 1).at(p)
    with pytest.raises(DomainError):
        random_matrix(0, 1, 1).sample([[0.0, 0.6], p])


def test_round_off_at_the_edge_is_not_outside() -> None:
    M = random_matrix(0, 1, 1)
    assert np.array_equal(M.at([1.0 + 1e-15, 0.5 - 1e-16]), M.at([1.0, 0.5]))


@pytest.mark.parametrize("p", [[0.0], [0.0, 0.6, 0.0]])
def test_positions_of_another_size(p: list[float]) -> None:
    with pytest.raises(DimensionError, match="one row a position"):
        random_matrix(0, 1, 1).at(p)


def test_wrong_coefficients_and_boxes() -> None:
    with pytest.raises(DimensionError, match="axes of degrees"):
        ChebyshevMatrix(np.zeros((2, 1, 1)), BOX)
    with pytest.raises(DimensionError):
        ChebyshevMatrix(np.zeros((0, 2, 1, 1)), BOX)
    with pytest.raises(DomainError, match="wanted a finite number"):
        ChebyshevMatrix([[np.nan]], BOX)
    with pytest.raises(DomainError, match="real"):
        ChebyshevMatrix(np.array([[1.0 + 2.0j]]), BOX)
    with pytest.raises(DomainError, match="lower < upper"):
        ChebyshevMatrix([[1.0]], [[1.0, 1.0]])
    with pytest.raises(DimensionError):
        ChebyshevMatrix([[1.0]], [0.0, 1.0])


@pytest.mark.parametrize("operation", [lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a @ b])
def test_boxes_and_shapes_must_agree(operation: Callable[[ChebyshevMatrix, ChebyshevMatrix], object]) -> None:
    A = random_matrix(0, 2, 2)
    with pytest.raises(DimensionError, match="Use one box"):
        operation(A, ChebyshevMatrix(np.eye(2), 2.0 * BOX))
    with pytest.raises(DimensionError, match="cannot"):
        operation(A, random_matrix(1, 3, 3))


def test_coefficients_are_a_read_only_copy() -> None:
    values = np.ones((1, 1, 2, 2))
    M = ChebyshevMatrix(values, BOX)
    values[:] = 5.0
    assert np.all(M.coefficients == 1.0)
    with pytest.raises(ValueError, match="read-only"):
        M.coefficients[0, 0, 0, 0] = 2.0
