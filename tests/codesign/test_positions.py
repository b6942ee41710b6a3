"""Guards the design positions and the worst-position search: inside P, and never less than what was evaluated."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, design_positions, worst_position
from lpvhinf.codesign import positions as module
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.positions import norms_at
from lpvhinf.codesign.starts import observer_starts, rigid_starts

BOX = np.array([[-0.2, 0.1], [1.0, 3.0]])


@pytest.mark.parametrize("n", [4, 5, 13, 40])
def test_design_positions(n: int) -> None:
    points = design_positions(BOX, n, seed=3)
    assert points.shape == (n, 2)
    assert np.all((points >= BOX[:, 0]) & (points <= BOX[:, 1]))
    assert {tuple(p) for p in points} >= set(itertools.product(*BOX))
    assert len({tuple(p) for p in points}) == n
    assert np.array_equal(points, design_positions(BOX, n, seed=3))


def test_design_positions_fill_the_box_and_follow_the_seed() -> None:
    points = design_positions(BOX, 20)
    unit = (points[4:] - BOX[:, 0]) / (BOX[:, 1] - BOX[:, 0])
    quadrants = {tuple(p) for p in (unit > 0.5).tolist()}
    assert len(quadrants) == 4
    assert not np.array_equal(points[4:], design_positions(BOX, 20, seed=1)[4:])


def test_the_first_positions_are_corners() -> None:
    assert design_positions(BOX, 2).tolist() == [[-0.2, 1.0], [-0.2, 3.0]]
    assert design_positions(BOX[:1], 2).tolist() == [[-0.2], [0.1]]


class Search:
    """`norms_at` replaced by a function of p, with a record of what was evaluated."""

    def __init__(self, function: Callable[[Array], float]) -> None:
        self.function, self.points, self.values = function, list[Array](), list[float]()

    def __call__(self, assembly: Assembly, theta: Array, points: Array) -> Array:
        values = [self.function(p) for p in points]
        self.points += list(points)
        self.values += values
        return np.array(values)


def test_the_search_climbs_to_a_narrow_peak(rigid: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(lambda p: 1.0 + float(np.exp(-(((p[0] - 0.0317) / 0.01) ** 2))))
    monkeypatch.setattr(module, "norms_at", search)
    worst = worst_position(rigid.assembly, rigid.parameters, n_search=16)
    assert worst.gamma == np.max(search.values)
    assert worst.gamma == pytest.approx(2.0, rel=1e-4)
    assert worst.position == pytest.approx([0.0317], abs=1e-4)
    assert worst.n_evaluated == len(search.values)
    assert np.all(np.abs(np.array(search.points)) <= 0.1)


def test_candidates_are_apart_and_worst_first(rigid: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "norms_at", Search(lambda p: 3.0 + float(np.cos(100.0 * p[0]))))
    worst = worst_position(rigid.assembly, rigid.parameters, n_search=32, n_refine=3)
    assert len(worst.candidates) == len(worst.gammas) == 3
    assert np.all(np.diff(worst.gammas) <= 0.0)
    assert worst.gamma == worst.gammas[0]
    assert np.array_equal(worst.position, worst.candidates[0])


def test_an_unstable_position_is_the_worst(rigid: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "norms_at", Search(lambda p: np.inf if p[0] > 0.05 else 2.0))
    worst = worst_position(rigid.assembly, rigid.parameters, n_search=16)
    assert worst.gamma == np.inf
    assert worst.position[0] > 0.05


def test_an_instability_that_the_climb_finds_is_infinite(rigid: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    """A band that no position of the spread lies in, on the way up to its edge."""
    spread = Search(lambda p: 2.0 + float(p[0]))
    monkeypatch.setattr(module, "norms_at", spread)
    worst_position(rigid.assembly, rigid.parameters, n_search=4, n_refine=1)
    highest = max(float(p[0]) for p in spread.points[:4])
    monkeypatch.setattr(module, "norms_at", Search(lambda p: np.inf if p[0] > highest + 1e-6 else 2.0 + float(p[0])))
    assert worst_position(rigid.assembly, rigid.parameters, n_search=4, n_refine=1).gamma == np.inf


@pytest.mark.parametrize("seed", [1, 2])
def test_never_less_than_what_was_evaluated(observer: Design, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    search = Search(lambda p: float(norms_at(observer.assembly, observer.parameters, p[None])[0]))
    monkeypatch.setattr(module, "norms_at", search)
    worst = worst_position(observer.assembly, observer.parameters, n_search=4, n_refine=1, seed=seed)
    assert worst.gamma == np.max(search.values)
    assert search.function(worst.position) == pytest.approx(worst.gamma, rel=1e-9)


def test_gamma_worst_of_a_design_covers_its_positions(rigid: Design, observer: Design) -> None:
    for design in (rigid, observer):
        assert design.gamma_worst >= np.max(design.gammas)
        at = norms_at(design.assembly, design.parameters, design.worst_position[None])[0]
        assert at == pytest.approx(design.gamma_worst, rel=1e-9)


def test_exchange_adds_worse_positions(rigid: Design, observer: Design) -> None:
    added = observer.positions[len(rigid.positions) :]
    assert np.array_equal(observer.positions[: len(rigid.positions)], rigid.positions)
    assert np.all(np.abs(added) <= 0.1)


def test_rigid_starts_get_slower(rigid: Design) -> None:
    structure, first = rigid.assembly.rigid_body, rigid.assembly.start(rigid.positions)
    starts = rigid_starts(rigid.assembly, 3)
    assert np.array_equal(starts[0], first)
    gains = [structure.gains(theta) for theta in starts]
    assert np.allclose(gains[1].f_d / gains[0].f_d, 0.8)
    assert np.allclose(gains[2].gain / gains[0].gain, 0.8**4)
    assert len(rigid_starts(rigid.assembly, 0)) == 1


def test_observer_starts_are_stable_and_damp(rigid: Design, observer: Design) -> None:
    starts = observer_starts(observer.assembly, rigid.positions, rigid.parameters, 3)
    assert len(starts) == 3
    for theta in starts:
        K, L, xi = observer.assembly.split(theta)
        assert np.array_equal(K, rigid.parameters)
        assert np.any(L)
        assert np.all(xi > 0.0)
    best = [np.max(norms_at(observer.assembly, theta, rigid.positions)) for theta in starts]
    assert np.isfinite(best[0])
    assert best[0] <= min(best) * 1.06
