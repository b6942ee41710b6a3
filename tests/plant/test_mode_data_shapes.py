"""Mode shapes as polynomials: fits of nodes, power series, Kirchhoff's kinematics, solids."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import polynomial

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant import fit_shapes
from lpvhinf.plant.mode_data.mode_shapes import power_shapes

RNG = np.random.default_rng(3)
AREA = np.array([[-0.1, 0.3], [0.05, 0.25]])  # off centre, not square


def grid(n_x: int, n_y: int, area: Array = AREA) -> Array:
    x, y = (np.linspace(*side, n) for side, n in zip(area, (n_x, n_y), strict=True))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def inside(n: int, area: Array = AREA) -> Array:
    return np.asarray(area[:, 0] + RNG.random((n, 2)) * np.ptp(area, axis=1))


def bending(at: Array) -> Array:
    """Three smooth shapes with the wavelengths of a plate's first modes, (..., 3)."""
    x, y = 10.0 * at[..., 0], 10.0 * at[..., 1]
    return np.stack([np.sin(x) * y, np.cos(1.5 * x) - 0.3 * y**2, np.sin(x + 1.5 * y)], axis=-1)


def test_power_series_are_evaluated_and_differentiated_exactly() -> None:
    c = RNG.standard_normal((6, 4, 1, 2)) * 10.0 ** np.arange(6)[:, None, None, None]
    shapes = power_shapes(c, AREA)
    at, height = inside(50), 0.013
    w, w_x, w_y = (
        np.stack([polynomial.polyval2d(*at.T, d[:, :, 0, k]) for k in range(2)], axis=-1)
        for d in (c, polynomial.polyder(c, axis=0), polynomial.polyder(c, axis=1))
    )
    field = shapes.at(np.column_stack([at, np.full(50, height)]))
    for found, wanted in zip(np.moveaxis(field, 1, 0), (-height * w_x, -height * w_y, w), strict=True):
        assert np.allclose(found, wanted, rtol=1e-11, atol=1e-11 * np.max(np.abs(wanted)))


def test_in_plane_motion_of_power_series_is_kept_and_tilted() -> None:
    c = RNG.standard_normal((3, 3, 3, 1))
    shapes = power_shapes(c, AREA)
    at = inside(20)
    u, v, w = (polynomial.polyval2d(*at.T, c[:, :, k, 0]) for k in range(3))
    assert np.allclose(shapes.at(at)[..., 0], np.column_stack([u, v, w]), rtol=1e-12)
    slope = polynomial.polyval2d(*at.T, polynomial.polyder(c[:, :, 2, 0], axis=1))
    assert np.allclose(shapes.at(np.column_stack([at, np.full(20, 0.02)]))[:, 1, 0], v - 0.02 * slope, rtol=1e-11)


def test_leaving_nodes_out_tells_the_error_between_the_nodes() -> None:
    at = inside(400)
    errors = []
    for n in (6, 7, 9, 12):
        nodes = grid(n, n)
        fit = fit_shapes(nodes, bending(nodes), tolerance=1.0)
        gap = fit.shapes.at(at)[:, 2] - bending(at)
        true = np.sqrt(np.mean(gap**2, axis=0) / np.mean(bending(at) ** 2, axis=0))
        assert np.all(true < 2.0 * fit.left_out)
        errors.append(np.max(true))
    assert np.all(np.diff(errors) < 0.0)
    assert errors[-1] < 1e-4
    assert np.max(fit.left_out) < 1e-3


def test_a_polynomial_is_found_again_with_its_degree() -> None:
    nodes = grid(11, 11)
    t = (nodes - AREA.mean(axis=1)) / np.ptp(AREA, axis=1)
    fit = fit_shapes(nodes, (t[:, 0] ** 4 * t[:, 1] ** 3)[:, None])
    assert fit.shapes.degree == (4, 4, 1)
    assert fit.left_out[0] < 1e-6
    asked = fit_shapes(nodes, (t[:, 0] ** 4 * t[:, 1] ** 3)[:, None], degree=(5, 3))
    assert asked.shapes.degree == (5, 3, 1)
    at = inside(100)
    assert np.allclose(asked.shapes.at(at), fit.shapes.at(at), atol=1e-7)


def test_noise_is_smoothed_and_measured() -> None:
    nodes, at = grid(15, 15), inside(500)
    noise = 0.02 * RNG.standard_normal((len(nodes), 3))
    fit = fit_shapes(nodes, bending(nodes) + noise, tolerance=0.1)
    size = np.sqrt(np.mean(bending(nodes) ** 2, axis=0))
    assert np.all(np.abs(fit.left_out * size / 0.02 - 1.0) < 0.3)  # what is left out cannot be foretold
    gap = fit.shapes.at(at)[:, 2] - bending(at)
    assert np.all(np.sqrt(np.mean(gap**2, axis=0)) < 0.6 * 0.02)  # the fit itself is better than a node


def test_scattered_nodes_on_a_disc_do_as_well() -> None:
    angle, radius = 2.0 * np.pi * RNG.random(150), 0.15 * np.sqrt(RNG.random(150))
    nodes = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    fit = fit_shapes(nodes, bending(nodes))
    at = 0.7 * nodes[:40]
    assert np.allclose(fit.shapes.at(at)[:, 2], bending(at), atol=2e-3)
    with pytest.raises(DomainError, match=r"outside the mover's x .*within the hull of"):
        fit.shapes.at([[0.14, 0.14]])  # in the bounding box, off the disc


def test_a_beam_with_two_rows_of_nodes() -> None:
    nodes = grid(15, 2)
    shape = np.cos(12.0 * nodes[:, 0]) * (1.0 + nodes[:, 1])
    fit = fit_shapes(nodes, shape[:, None])
    at = inside(50)
    assert np.allclose(fit.shapes.at(at)[:, 2, 0], np.cos(12.0 * at[:, 0]) * (1.0 + at[:, 1]), atol=2e-3)


def test_nodes_at_several_heights_make_a_solid() -> None:
    def field(at: Array) -> Array:
        x, y, z = at[..., 0], at[..., 1], at[..., 2]
        return np.stack([np.sin(8 * x) - 6 * z * y, 4 * z * np.cos(9 * x), np.sin(9 * y) * (1 + x) + 5 * z], axis=-1)

    plane = grid(8, 8)
    nodes = np.vstack([np.column_stack([plane, np.full(len(plane), z)]) for z in (0.0, 0.01, 0.03)])
    fit = fit_shapes(nodes, field(nodes)[..., None])
    assert fit.shapes.degree[2] == 2
    at = np.column_stack([inside(60), 0.03 * RNG.random(60)])
    assert np.allclose(fit.shapes.at(at)[..., 0], field(at), atol=2e-3)
    with pytest.raises(DomainError, match="outside the mover's"):
        fit.shapes.at([[0.0, 0.1, 0.04]])


def test_all_components_in_one_plane_get_kirchhoff_fibres() -> None:
    nodes = np.column_stack([grid(8, 8), np.full(64, 0.02)])
    w = np.sin(8 * nodes[:, 0])
    shapes = np.stack([0.1 * nodes[:, 1], np.zeros(64), w], axis=1)[..., None]
    smooth = fit_shapes(nodes, shapes).shapes
    assert smooth.height == pytest.approx(0.02)
    u = smooth.at([0.05, 0.1, 0.05])[0, 0]
    assert u == pytest.approx(0.1 * 0.1 - 0.03 * 8 * np.cos(8 * 0.05), abs=2e-3)


@pytest.mark.parametrize(
    ("points", "shapes", "options", "error", "words"),
    [
        (grid(2, 3), np.ones((6, 1)), {}, DomainError, "points has 6 nodes, wanted at least 9"),
        (grid(20, 1), np.ones((20, 1)), {}, DomainError, "on one line"),
        (grid(4, 4), np.zeros((16, 1)), {}, DomainError, "mode 1 are 0 at every node"),
        (grid(4, 4), np.ones((15, 1)), {}, DimensionError, r"shapes has shape \(15, 1\)"),
        (grid(4, 4), np.ones((16, 2, 1)), {}, DimensionError, "shapes has shape"),
        (grid(4, 4), np.ones((16, 1)), {"degree": 0}, DomainError, "degree is 0"),
        (grid(4, 4), np.ones((16, 1)), {"degree": 2.5}, DomainError, "degree is 2.5"),
        (grid(4, 4), np.ones((16, 1)), {"degree": (3, 4)}, DomainError, r"only \[4, 4, 1\] different coordinates"),
        (grid(4, 4), np.ones((16, 1)), {"tolerance": 0.0}, DomainError, "tolerance is 0.0"),
        (grid(7, 7), RNG.standard_normal((49, 2)), {}, AssumptionError, r"left out of the fit .* Give more nodes"),
    ],
)
def test_what_cannot_be_fitted_is_named(
    points: Array, shapes: Array, options: dict[str, float], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        fit_shapes(points, shapes, **options)  # type: ignore[arg-type]


def test_interchanged_nodes_are_noticed() -> None:
    nodes = grid(9, 9)
    shapes = bending(nodes)
    fit_shapes(nodes, shapes)
    shapes[[10, 60]] = shapes[[60, 10]]
    with pytest.raises(AssumptionError, match="interchanged nodes"):
        fit_shapes(nodes, shapes)
