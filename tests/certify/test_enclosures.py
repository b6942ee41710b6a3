from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from lpvhinf.certify.cells import Cell, preorder, whole
from lpvhinf.certify.enclosure import ChebyshevEntries, in_system_coordinates, multi_indices
from lpvhinf.certify.positive_definite import dominating_diagonal, needed_shift, positive_definite
from lpvhinf.certify.restriction import bernstein, powers, restriction
from lpvhinf.polynomial import ChebyshevMatrix


def exact_chebyshev(j: int, x: Fraction) -> Fraction:
    before, now = Fraction(1), x
    for _ in range(j):
        before, now = now, 2 * x * now - before
    return before


@pytest.mark.parametrize(("a", "r"), [(Fraction(1, 4), Fraction(1, 4)), (Fraction(-2, 7), Fraction(3, 11))])
def test_restriction_is_exact_to_the_last_bit(a: Fraction, r: Fraction) -> None:
    R = restriction(9, a, r)
    for delta in (Fraction(-1), Fraction(1, 3), Fraction(7, 9)):
        for j in range(9):
            wanted = exact_chebyshev(j, a + r * delta)
            size = sum(abs(Fraction(float(R[j, k])) * exact_chebyshev(k, delta)) for k in range(9))
            found = sum(Fraction(float(R[j, k])) * exact_chebyshev(k, delta) for k in range(9))
            assert abs(found - wanted) <= size * Fraction(1, 2**53)


def test_powers_and_bernstein_form() -> None:
    t = np.linspace(-1.0, 1.0, 7)
    for k in range(9):
        assert np.polynomial.polynomial.polyval(t, powers(8)[k]) == pytest.approx(np.cos(k * np.arccos(t)), abs=1e-12)
    from math import comb

    s = 0.5 * (t + 1.0)
    for d in (1, 3, 6):
        basis = np.array([comb(d, i) * s**i * (1.0 - s) ** (d - i) for i in range(d + 1)])
        assert bernstein(d) @ basis == pytest.approx(np.array([t**k for k in range(d + 1)]), abs=1e-12)
        assert np.max(np.abs(bernstein(d))) <= 1.0


@pytest.mark.parametrize("degree", [1, 3, 5])
@pytest.mark.parametrize("cell", [Cell((2, 3), (1, 6)), Cell((0, 0), (0, 0)), Cell((6, 5), (63, 0))])
def test_enclosures_hold_with_their_slopes(degree: int, cell: Cell) -> None:
    rng = np.random.default_rng(degree)
    c = rng.normal(size=(14, 9, 4)) * 0.7 ** np.add.outer(np.arange(14), np.arange(9))[..., None]
    entries = ChebyshevEntries(c)
    part = entries.local(cell.centre, cell.radius, degree, slopes=True)
    plain = entries.local(cell.centre, cell.radius, degree)
    assert plain.terms == pytest.approx(part.terms)
    M = ChebyshevMatrix(c[..., None, :], [[-1.0, 1.0], [-1.0, 1.0]])
    delta = rng.uniform(-1.0, 1.0, (400, 2))
    delta[:4] = [[-1, -1], [-1, 1], [1, -1], [1, 1]]
    h = np.array([float(r) for r in cell.radius])
    x = np.array([float(v) for v in cell.centre]) + h * delta
    powers_of = np.array([np.prod(delta**b, axis=1) for b in multi_indices(2, degree)])
    error = M.sample(x)[:, 0] - powers_of.T @ part.terms
    assert np.all(np.abs(error) <= part.remainder + 1e-14)
    assert np.all(np.abs(error) <= plain.remainder + 1e-14)
    for axis in range(2):
        slopes = [
            b[axis] * np.prod(delta ** np.maximum(np.array(b) - (np.arange(2) == axis), 0), axis=1)
            for b in multi_indices(2, degree)
        ]
        wrong = h[axis] * M.derivative(axis).sample(x)[:, 0] - np.array(slopes).T @ part.terms
        assert np.all(np.abs(wrong) <= part.slopes[axis] + 1e-13)


def test_a_polynomial_of_low_degree_leaves_round_off_only() -> None:
    c = np.random.default_rng(0).normal(size=(3, 2, 5))
    part = ChebyshevEntries(c).local((Fraction(1, 8), Fraction(0)), (Fraction(1, 8), Fraction(1)), 3)
    assert np.max(part.remainder) < 1e-12


def test_coordinates_of_a_part_of_the_box() -> None:
    box, system = np.array([[0.1, 0.3]]), np.array([[0.0, 0.7]])
    centre, radius = in_system_coordinates(whole(1), box, system)
    low, high, end = Fraction(0.1), Fraction(0.3), Fraction(0.7)
    assert centre[0] - radius[0] == 2 * low / end - 1
    assert centre[0] + radius[0] == 2 * high / end - 1


def test_the_tree_lists_leaves_in_preorder() -> None:
    root = whole(2)
    lower, upper = root.halves(1)
    nodes, leaves = preorder({root: 1, upper: 0}, 2)
    assert nodes.tolist() == [1, -1, 0, -1, -1]
    assert leaves == [lower, *upper.halves(0)]
    assert sum(leaf.share for leaf in leaves) == 1.0
    assert lower.centre == (0, Fraction(-1, 2))


def test_positive_definite_never_accepts_a_singular_matrix() -> None:
    rng = np.random.default_rng(0)
    accepted = 0
    for _ in range(300):
        n = int(rng.integers(1, 12))
        V = rng.integers(-3, 4, size=(n, max(n - 1, 1))).astype(float)  # V V' is exact, and singular for n > 1
        M = V @ V.T if n > 1 else np.zeros((1, 1))
        assert not positive_definite(M)
        # an integer matrix with smallest eigenvalue at least one
        accepted += positive_definite(M + np.eye(n))
    assert accepted == 300
    assert not positive_definite(np.full((2, 2), np.nan))
    assert np.all(needed_shift(np.eye(3)) > 0.0)


def test_spare_is_demanded() -> None:
    assert positive_definite(np.eye(3), 0.99)
    assert not positive_definite(np.eye(3), 1.01)


def test_the_dominating_diagonal_dominates() -> None:
    rng = np.random.default_rng(1)
    F = rng.uniform(size=(6, 6)) ** 8
    F = F + F.T
    f = dominating_diagonal(F)
    for _ in range(50):
        E = F * rng.choice([-1.0, 1.0], size=F.shape)
        E = np.tril(E) + np.tril(E, -1).T
        assert np.linalg.eigvalsh(np.diag(f) - E)[0] >= -1e-14
    assert np.max(f) < 3.0 * np.linalg.eigvalsh(F)[-1]
