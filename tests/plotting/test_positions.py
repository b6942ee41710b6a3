"""Maps over P and mode shapes: the right value at the right place, lines where the sign changes."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.plotting.coils import draw_coils, rectangles
from lpvhinf.plotting.modes import draw_mode_shape, draw_swept_areas
from lpvhinf.plotting.positions import AMOUNT, SIGNED, amount_map, signed_map
from lpvhinf.plotting.style import BLACK, new_figure, style

AXIS = np.linspace(-0.06, 0.06, 7)


@pytest.fixture
def ax() -> Axes:
    with style():
        axes = new_figure().subplots()
        assert isinstance(axes, Axes)
        return axes


def lines(ax: Axes, color: str) -> list[np.ndarray]:
    """Vertices of the contour lines of a colour."""
    found = []
    for item in ax.collections:
        if not isinstance(item, PatchCollection) and hasattr(item, "levels"):
            same = tuple(np.asarray(item.get_edgecolor())[0]) == to_rgba(color)
            found += [path.vertices for path in item.get_paths() if same and len(path.vertices)]
    return found


def test_a_map_has_its_values_in_their_places(ax: Axes) -> None:
    values = AXIS[:, None] + 10.0 * AXIS[None, :]  # the first index is that along x
    drawn = signed_map(ax, AXIS, values, 0.7)
    places, shown = drawn.get_coordinates(), np.asarray(drawn.get_array())
    assert shown.shape == (7, 7)
    assert np.allclose(shown, 1e-3 * (places[..., 0] + 10.0 * places[..., 1]))  # drawn in mm
    assert drawn.get_clim() == (-0.7, 0.7)
    assert drawn.get_cmap() is SIGNED
    assert ax.get_aspect() == 1.0


def test_zero_is_white_and_the_ends_are_the_palette() -> None:
    assert np.allclose(SIGNED(0.5)[:3], 1.0, atol=0.01)
    assert np.allclose(SIGNED(0.0)[:3], to_rgba("#0072B2")[:3])
    lightness = np.array([np.dot(AMOUNT(x)[:3], [0.3, 0.6, 0.1]) for x in np.linspace(0.0, 1.0, 50)])
    assert np.all(np.diff(lightness) < 0.0)  # also in grey print


def test_the_black_line_is_where_the_sign_changes(ax: Axes) -> None:
    signed_map(ax, AXIS, np.repeat((AXIS - 0.013)[:, None], 7, axis=1), 0.08)
    (vertices,) = lines(ax, BLACK)
    assert np.allclose(vertices[:, 0], 13.0)


@pytest.mark.filterwarnings("error")
def test_a_map_of_one_sign_or_of_zeros_has_no_line(ax: Axes) -> None:
    signed_map(ax, AXIS, np.full((7, 7), 0.1), 1.0)
    signed_map(ax, AXIS, np.zeros((7, 7)), 1.0)
    amount_map(ax, AXIS, np.ones((7, 7)), 0.0, 2.0, lines=[5.0])
    assert lines(ax, BLACK) == []


def test_amounts_have_lines_at_the_wanted_values(ax: Axes) -> None:
    drawn = amount_map(ax, AXIS, np.repeat(AXIS[:, None], 7, axis=1), -0.1, 0.1, lines=[0.02, 5.0])
    assert drawn.get_clim() == (-0.1, 0.1)
    (vertices,) = lines(ax, "#D55E00")
    assert np.allclose(vertices[:, 0], 20.0)


def test_bad_maps(ax: Axes) -> None:
    with pytest.raises(DimensionError, match=r"values has shape \(7, 6\), wanted \(7, 7\)"):
        signed_map(ax, AXIS, np.zeros((7, 6)), 1.0)
    with pytest.raises(DomainError, match=r"limit is 0\.0"):
        signed_map(ax, AXIS, np.zeros((7, 7)), 0.0)
    with pytest.raises(DomainError, match="values"):
        signed_map(ax, AXIS, np.full((7, 7), np.nan), 1.0)
    with pytest.raises(DomainError, match=r"low is 2\.0, wanted a value below high = 1\.0"):
        amount_map(ax, AXIS, np.ones((7, 7)), 2.0, 1.0)


def test_a_mode_shape_fills_the_mover(ax: Axes) -> None:
    axis = np.linspace(-0.15, 0.15, 9)
    draw_mode_shape(ax, axis, np.outer(axis, axis), 0.0225)
    assert ax.get_xlim() == ax.get_ylim() == (-150.0, 150.0)
    assert len(lines(ax, BLACK)) >= 1


def test_swept_areas_hold_every_point_that_a_beam_sees(ax: Axes) -> None:
    box = np.array([[-0.06, 0.04], [-0.02, 0.05]])
    beams = np.array([[0.08, 0.08], [-0.08, -0.03]])
    rng = np.random.default_rng(0)
    for area, beam in zip(draw_swept_areas(ax, beams, box), beams, strict=True):
        left, low = area.get_xy()
        seen = 1e3 * (beam - rng.uniform(box[:, 0], box[:, 1], (200, 2)))
        assert np.all((seen >= (left, low)) & (seen <= (left + area.get_width(), low + area.get_height())))
        assert np.allclose(np.max(seen, axis=0), (left + area.get_width(), low + area.get_height()), atol=2.0)


def test_coils_are_where_they_belong(ax: Axes) -> None:
    centres, sizes = np.array([[0.0, 0.1], [0.04, -0.1]]), np.array([[0.04, 0.12], [0.12, 0.04]])
    drawn = draw_coils(ax, centres, sizes, np.array([0.25, -1.0]), (-1.0, 1.0), SIGNED)
    boxes = [path.get_extents() for path in drawn.get_paths()]
    assert [np.round(box.bounds, 9).tolist() for box in boxes] == [
        [-20.0, 40.0, 40.0, 120.0],
        [-20.0, -120.0, 120.0, 40.0],
    ]
    assert np.array_equal(np.asarray(drawn.get_array()), [0.25, -1.0])
    assert drawn.get_clim() == (-1.0, 1.0)
    with pytest.raises(DimensionError, match="values has shape"):
        draw_coils(ax, centres, sizes, np.zeros(3), (0.0, 1.0), AMOUNT)


def test_turned_rectangles_turn_about_their_centres() -> None:
    (turned,) = rectangles(np.array([[0.1, 0.2]]), np.array([[0.02, 0.02]]), -np.pi / 4)
    corners = turned.get_patch_transform().transform([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert np.allclose(corners.mean(axis=0), [100.0, 200.0])
    assert np.allclose(np.abs(corners - [100.0, 200.0]).max(axis=0), 10.0 * np.sqrt(2.0))
