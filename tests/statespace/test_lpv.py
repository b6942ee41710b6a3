"""Guards LPV state spaces: evaluation, fits, sizes, and refusal of what does not fit together."""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace import LPVGeneralizedPlant, LPVStateSpace

RandomSystem = Callable[..., LPVStateSpace]
Matrices = tuple[Array, Array, Array, Array]


def smooth(points: Array) -> Matrices:
    """A system that is no polynomial: (N, n_p) to stacked (A, B, C, D)."""
    p, n = points[:, 0], len(points)
    zero, one = np.zeros(n), np.ones(n)
    A = np.stack([np.stack([zero, one], axis=1), np.stack([-np.exp(p), -0.1 * one], axis=1)], axis=1)
    B = np.stack([zero, np.cos(points[:, 1])], axis=1)[:, :, None]
    C = np.stack([1.0 / (2.0 + p), zero], axis=1)[:, None, :]
    return A, B, C, np.zeros((n, 1, 1))


def test_frozen_system_is_the_sampled_one(random_system: RandomSystem, positions: Array) -> None:
    G = random_system(0, 4, 2, 3)
    A, B, C, D = G.sample(positions)
    for k, p in enumerate(positions):
        frozen = G.at(p)
        assert isinstance(frozen, control.StateSpace)
        for ours, theirs in zip((A[k], B[k], C[k], D[k]), (frozen.A, frozen.B, frozen.C, frozen.D), strict=True):
            assert np.allclose(ours, theirs, rtol=0, atol=1e-13)
    assert (G.n_x, G.n_u, G.n_y, G.n_p) == (4, 2, 3, 2)


def test_frozen_system_keeps_its_unused_states() -> None:
    G = LPVStateSpace.from_coefficients(
        np.diag([-1.0, -2.0]), np.zeros((2, 1)), [[1.0, 0.0]], [[0.0]], box=[[0.0, 1.0]]
    )
    assert G.at(0.5).nstates == 2


def test_power_basis(box: Array) -> None:
    A = np.zeros((2, 3, 1, 1))
    A[1, 2] = 4.0
    G = LPVStateSpace.from_coefficients(A, [[1.0]], [[1.0]], [[0.0]], box=box, basis="power")
    assert float(G.at([1.5, 0.25]).A[0, 0]) == pytest.approx(4.0 * 1.5 * 0.25**2, rel=1e-13)
    with pytest.raises(DomainError, match="'chebyshev' or 'power'"):
        LPVStateSpace.from_coefficients(A, [[1.0]], [[1.0]], [[0.0]], box=box, basis="legendre")


def test_interpolation_of_a_smooth_system(box: Array) -> None:
    coarse = LPVStateSpace.interpolate(smooth, box=box, degree=4)
    fine = LPVStateSpace.interpolate(smooth, box=box, degree=(20, 8))
    where = spread_points(box, 64)
    for name, matrix, wanted in zip("ABCD", coarse.system.sample(where), smooth(where), strict=True):
        assert np.allclose(np.max(np.abs(matrix - wanted), axis=0), coarse.errors[name], rtol=1e-6, atol=1e-14)
    assert 1e-4 < np.max(coarse.errors["C"]) < 1e-1
    assert max(np.max(error) for error in fine.errors.values()) < 1e-9
    assert fine.system.D.is_constant  # zero stays zero
    assert fine.n_test == 64


def test_least_squares_fit_recovers_a_system(random_system: RandomSystem, box: Array) -> None:
    G = random_system(1, 3, 1, 2)
    points = spread_points(box, 30, seed=9)
    fit = LPVStateSpace.fit(points, G.sample(points), box=box, degree=(2, 1))
    for ours, theirs in zip(fit.system.matrices, G.matrices, strict=True):
        assert np.allclose(ours.coefficients, theirs.padded(ours.degree), rtol=0, atol=1e-11)
    assert max(np.max(error) for error in fit.errors.values()) < 1e-11
    with pytest.raises(AssumptionError, match="Give more positions"):
        LPVStateSpace.fit(points[:5], [m[:5] for m in G.sample(points)], box=box, degree=2)  # type: ignore[arg-type]


def test_derivative(random_system: RandomSystem, positions: Array) -> None:
    G, h = random_system(2, 3, 2, 2), 1e-6
    p = positions[0]
    step = np.array([0.0, h])
    for rate, above, below in zip(G.derivative(1).sample(p), G.sample(p + step), G.sample(p - step), strict=True):
        assert np.allclose(rate, (above - below) / (2 * h), rtol=0, atol=1e-7)


def test_constant_system(box: Array) -> None:
    G = LPVStateSpace.from_system(control.ss(-1.0, 1.0, 2.0, 0.5), box)
    assert all(matrix.is_constant for matrix in G.matrices)
    assert G.at([0.0, 0.1])(0.0) == pytest.approx(2.5)


def test_sizes_and_boxes_that_do_not_fit(box: Array) -> None:
    A = ChebyshevMatrix(-np.eye(2), box)
    with pytest.raises(DimensionError, match=r"C has shape \(1, 3\)"):
        LPVStateSpace(A, np.ones((2, 1)), np.ones((1, 3)), [[0.0]])
    with pytest.raises(DimensionError, match=r"A has shape \(2, 2\), wanted \(3, 3\)"):
        LPVStateSpace(A, np.ones((3, 1)), np.ones((1, 3)), [[0.0]])
    with pytest.raises(DimensionError, match=r"D has shape \(2, 1\)"):
        LPVStateSpace(A, np.ones((2, 1)), np.ones((1, 2)), [[0.0], [0.0]])
    with pytest.raises(DimensionError, match="name no box"):
        LPVStateSpace([[1.0]], [[1.0]], [[1.0]], [[1.0]])
    with pytest.raises(DimensionError, match="Use one box"):
        LPVStateSpace(A, ChebyshevMatrix(np.ones((2, 1)), 2.0 * box), np.ones((1, 2)), [[0.0]])


@pytest.mark.parametrize("p", [[3.0, 0.1], [np.nan, 0.1]])
def test_positions_outside(random_system: RandomSystem, p: list[float]) -> None:
    with pytest.raises(DomainError):
        random_system(0, 2, 1, 1).at(p)
    with pytest.raises(DomainError):
        random_system(0, 2, 1, 1).sample([p])


def test_representations(random_system: RandomSystem) -> None:
    G = random_system(0, 4, 2, 3)
    assert repr(G).startswith("LPVStateSpace(n_x=4, n_u=2, n_y=3, degree (2, 1)")
    assert "<td>4 x 2</td>" in G._repr_html_()


def test_generalized_plant_over_the_box(random_system: RandomSystem, positions: Array) -> None:
    G = random_system(3, 4, 5, 6)
    P = LPVGeneralizedPlant(G, n_u=2, n_y=3)
    assert (P.n_w, P.n_z) == (3, 3)
    frozen = P.at(positions[1])
    whole, local = frozen.to_control(), G.at(positions[1])
    for name in "ABCD":
        assert np.allclose(getattr(whole, name), getattr(local, name), rtol=0, atol=1e-13)
    assert (frozen.n_w, frozen.n_u, frozen.n_z, frozen.n_y) == (3, 2, 3, 3)
    assert len(P.sample(positions)) == len(positions)
    with pytest.raises(DimensionError, match="do not fit"):
        LPVGeneralizedPlant(G, n_u=6, n_y=1)


def test_generalized_plant_takes_a_number_for_one_coordinate() -> None:
    G = LPVStateSpace.from_coefficients([[[-1.0]], [[0.5]]], [[1.0]], [[1.0]], [[0.0]], box=[[0.0, 1.0]], basis="power")
    assert float(LPVGeneralizedPlant(G, n_u=0, n_y=0).at(0.5).A[0, 0]) == -0.75
