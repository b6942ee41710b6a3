from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.lpv.lmi import LMIBlock, LMIProblem, MatrixUnknown, Term
from lpvhinf.lpv.operator import LMIOperator, Triangle
from lpvhinf.lpv.schur import operator_form, schur_complement
from tests.lpv.lmi_problems import gain_problem, positive_stack, random_problem


def test_adjoint_is_the_transpose_of_the_linear_part() -> None:
    rng = np.random.default_rng(1)
    problem = random_problem()
    operator = LMIOperator(problem)
    y = rng.normal(size=operator.n_variables)
    T = [positive_stack(rng, block.m, block.size) for block in problem.blocks]
    forward = sum(float(np.vdot(a, t)) for a, t in zip(operator.linear(y), T))
    assert forward == pytest.approx(float(operator.adjoint(T) @ y), rel=1e-12)


def test_value_is_affine_and_vector_inverts_matrices() -> None:
    rng = np.random.default_rng(2)
    operator = LMIOperator(random_problem())
    y = rng.normal(size=operator.n_variables)
    np.testing.assert_allclose(operator.vector(operator.matrices(y), y[-1]), y, rtol=1e-14)
    for whole, constant, linear in zip(
        operator.value(y), operator.value(np.zeros_like(y)), operator.linear(y), strict=True
    ):
        np.testing.assert_allclose(whole, constant + linear, atol=1e-12)


def test_scaled_triangle_keeps_inner_products() -> None:
    rng = np.random.default_rng(3)
    A, B = positive_stack(rng, 2, 5)
    triangle = Triangle(5)
    assert triangle.packed(A) @ triangle.packed(B) == pytest.approx(float(np.vdot(A, B)))


@pytest.mark.parametrize("seed", range(4))
def test_schur_complement_equals_its_operator_form(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(seed)
    operator = LMIOperator(problem)
    X, W = ([positive_stack(rng, b.m, b.size) for b in problem.blocks] for _ in range(2))
    H = np.full((operator.n_variables, operator.n_variables), 7.0)
    schur_complement(operator, X, W, H)
    assembled = np.tril(H) + np.tril(H, -1).T
    columns = np.stack([operator_form(operator, X, W, e) for e in np.eye(operator.n_variables)])
    np.testing.assert_allclose(assembled, columns, atol=1e-13 * np.abs(columns).max())


def test_schur_complement_in_several_slabs(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    problem = random_problem()
    operator = LMIOperator(problem)
    X, W = ([positive_stack(rng, b.m, b.size) for b in problem.blocks] for _ in range(2))
    whole, slabs = (np.zeros((operator.n_variables, operator.n_variables)) for _ in range(2))
    schur_complement(operator, X, W, whole)
    monkeypatch.setattr("lpvhinf.lpv.schur.SLAB", 1)
    schur_complement(operator, X, W, slabs)
    np.testing.assert_allclose(np.tril(slabs), np.tril(whole), atol=1e-13 * np.abs(whole).max())


def test_fixed_level_moves_gamma_into_the_constant() -> None:
    problem = gain_problem(-np.eye(2), np.eye(2), np.eye(2))
    fixed = problem.at_level(3.0)
    X = {"X": np.eye(2)[None]}
    assert all(block.Fg is None for block in fixed.blocks)
    for one, other in zip(problem.evaluate(X, 3.0), fixed.evaluate(X, -8.0), strict=True):
        np.testing.assert_array_equal(one, other)


def test_bad_descriptions_are_named() -> None:
    eye = np.eye(2)
    with pytest.raises(DomainError, match="F0 of b differs from its transpose"):
        LMIBlock(name="b", F0=np.array([[[0.0, 1.0], [0.0, 0.0]]]), terms=[])
    with pytest.raises(DimensionError, match="Fg of b has shape"):
        LMIBlock(name="b", F0=eye[None], Fg=np.eye(3)[None], terms=[])
    with pytest.raises(DimensionError, match="at most one for each unknown"):
        LMIBlock(name="b", F0=eye[None], terms=[Term("X", eye), Term("X", eye)])
    with pytest.raises(DimensionError, match="value of X in block b has shape"):
        LMIBlock(name="b", F0=eye[None], terms=[Term("X", eye, eye, value=np.ones((1, 2)), inner=np.ones((1, 3)))])
    with pytest.raises(DomainError, match="V of X in block b"):
        LMIBlock(name="b", F0=eye[None], terms=[Term("X", np.full((2, 2), np.nan))])
    block = LMIBlock(name="b", F0=eye[None], terms=[Term("X", eye, inner=np.ones((1, 1)))])
    with pytest.raises(DimensionError, match="names 'X'; the unknowns are"):
        LMIProblem(unknowns=[MatrixUnknown(name="Y", size=2)], blocks=[block])
    with pytest.raises(DimensionError, match="wanted 2 of size 2"):
        LMIProblem(unknowns=[MatrixUnknown(name="X", size=2, count=2)], blocks=[block])
    with pytest.raises(DimensionError, match="different names"):
        LMIProblem(unknowns=[MatrixUnknown(name="X", size=2)] * 2, blocks=[block])
