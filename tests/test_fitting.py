"""Guards fits from samples: their convergence, exactness on polynomials, and the error that they report."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.fitting import degrees, interpolate, least_squares, spread_points
from lpvhinf.polynomial import ChebyshevMatrix

BOX = np.array([[-1.0, 1.0], [0.0, 0.5]])


def resonance(width: float) -> Callable[[Array], Array]:
    """1 / (1 + (p/width)^2): analytic up to the poles +-j width."""
    return lambda points: 1.0 / (1.0 + (points[:, :1, None] / width) ** 2)


@pytest.mark.parametrize("width", [0.5, 1.0, 2.0])
def test_interpolation_converges_at_the_rate_of_the_nearest_pole(width: float) -> None:
    tried = np.arange(8, 27, 2)
    errors = [interpolate(resonance(width), box=[[-1.0, 1.0]], degree=int(d), n_test=256).relative_error for d in tried]
    usable = np.array(errors) > 1e-13
    slope = np.polyfit(tried[usable], np.log(np.array(errors)[usable]), 1)[0]
    rate = -np.log(width + np.sqrt(1.0 + width**2))  # of the Bernstein ellipse through the poles
    assert 1.1 * rate < slope < 0.9 * rate


def test_kinks_converge_slowly() -> None:
    tried = np.array([8, 16, 32, 64])
    fits = [interpolate(lambda p: np.abs(p)[:, :, None], box=[[-1.0, 1.0]], degree=int(d), n_test=4096) for d in tried]
    slope = np.polyfit(np.log(tried), np.log([fit.relative_error for fit in fits]), 1)[0]
    assert -1.2 < slope < -0.8  # of first order, and not taken for smooth


def polynomial_samples(points: Array) -> Array:
    coefficients = np.random.default_rng(1).standard_normal((4, 3, 2, 3))
    return ChebyshevMatrix(coefficients, BOX).sample(points)


def test_least_squares_recovers_a_polynomial() -> None:
    points = spread_points(BOX, 40, seed=3)
    fit = least_squares(points, polynomial_samples(points), box=BOX, degree=(3, 2))
    elsewhere = spread_points(BOX, 100, seed=4)
    assert np.allclose(fit.matrix.sample(elsewhere), polynomial_samples(elsewhere), rtol=0, atol=1e-11)
    assert fit.relative_error < 1e-12
    assert fit.n_test == 40
    too_low = least_squares(points, polynomial_samples(points), box=BOX, degree=(2, 2))
    assert too_low.relative_error > 1e-3


@pytest.mark.parametrize("points", [spread_points(BOX, 11), np.tile(spread_points(BOX, 3), (20, 1))])
def test_too_few_positions_are_refused(points: Array) -> None:
    with pytest.raises(AssumptionError, match=r"of the 12 coefficients.*Give more positions"):
        least_squares(points, polynomial_samples(points), box=BOX, degree=(3, 2))


def wave(points: Array) -> Array:
    return np.stack([np.sin(9.0 * points), np.cos(points)], axis=2)


def test_reported_error_is_the_error() -> None:
    fit = interpolate(wave, box=BOX, degree=6, n_test=50)
    where = spread_points(BOX, 50)
    deviation = np.abs(fit.matrix.sample(where) - wave(where))
    assert np.array_equal(fit.error, np.max(deviation, axis=0))
    assert fit.scale == np.max(np.abs(wave(where)))
    assert fit.relative_error == pytest.approx(np.max(deviation) / np.max(np.abs(wave(where))), rel=1e-14)
    assert fit.relative_error > 1e-4
    elsewhere = spread_points(BOX, 500, seed=7)  # what is reported tells of other positions, too
    assert np.max(np.abs(fit.matrix.sample(elsewhere) - wave(elsewhere))) < 2.0 * np.max(fit.error)


def test_error_of_a_zero_function() -> None:
    fit = interpolate(lambda points: np.zeros((len(points), 2, 2)), box=BOX, degree=2)
    assert fit.relative_error == 0.0
    assert fit.matrix.trimmed().is_constant


def test_spread_points_fill_the_box() -> None:
    points = spread_points(BOX, 100)
    assert points.shape == (100, 2)
    assert len(np.unique(points, axis=0)) == 100
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=3, range=BOX.tolist())
    assert np.min(counts) >= 8
    assert np.array_equal(points, spread_points(BOX, 100))
    assert not np.array_equal(points, spread_points(BOX, 100, seed=1))


def test_degrees() -> None:
    assert degrees(3, 2) == (3, 3)
    assert degrees([3, 0], 2) == (3, 0)
    assert degrees(np.array([4, 1]).tolist(), 2) == (4, 1)
    for wrong in (-1, [1, 2, 3], 2.5, [1, -1]):
        with pytest.raises(DimensionError, match="whole numbers"):
            degrees(wrong, 2)  # type: ignore[arg-type]


def test_functions_that_return_something_else() -> None:
    with pytest.raises(DimensionError, match=r"function\(points\)"):
        interpolate(lambda points: points, box=BOX, degree=2)
    with pytest.raises(DimensionError, match=r"function\(points\)"):
        interpolate(lambda points: np.ones((1, 2, 2)), box=BOX, degree=2)
    with pytest.raises(DomainError, match="finite"):
        interpolate(lambda points: np.where(points[:, :, None] < 0.0, np.nan, 1.0), box=BOX, degree=2)
    with pytest.raises(DomainError, match="finite"):  # only found where the error is measured
        interpolate(lambda p: np.where(np.abs(p[:, :1, None]) < 0.2, np.nan, 1.0), box=BOX, degree=(1, 1))


def test_samples_that_do_not_fit() -> None:
    points = spread_points(BOX, 10)
    with pytest.raises(DimensionError, match="values"):
        least_squares(points, np.ones((9, 1, 1)), box=BOX, degree=1)
    with pytest.raises(DomainError, match="outside"):
        least_squares(points + 5.0, np.ones((10, 1, 1)), box=BOX, degree=1)
