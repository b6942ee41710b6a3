"""Guards the design positions and the worst-position search: inside P, and never less than what was evaluated."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, WorstPosition, design_positions, worst_position
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.positions import norms_at
from lpvhinf.codesign.starts import observer_starts, rigid_starts
from lpvhinf.fitting import spread_points
from lpvhinf.hinfstruct import StaticGain
from lpvhinf.statespace.generalized import GeneralizedPlant

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


class Model:
    """An assembly whose plants have the norm gain(p) at p, out of reach of the controller, with a record."""

    def __init__(self, gain: Callable[[Array], float]) -> None:
        self.gain, self.points, self.values = gain, list[Array](), list[float]()
        self.structure = StaticGain(1, 1)
        self.plant = SimpleNamespace(box=np.array([[-0.1, 0.1]]))

    def generalized_plants(self, points: Array) -> list[GeneralizedPlant]:
        zero = [[0.0]]
        self.points += list(points)
        self.values += [self.gain(p) for p in points]
        return [
            # an infinite norm is a pole on the right
            GeneralizedPlant([[1.0]], [[1.0]], zero, [[1.0]], zero, zero, zero, zero)
            if np.isinf(self.gain(p))
            else GeneralizedPlant([[-1.0]], [[self.gain(p)]], zero, [[1.0]], zero, zero, zero, zero)
            for p in points
        ]


def search(model: Model, **options: int) -> WorstPosition:
    return worst_position(cast("Assembly", model), np.zeros(1), **options)


def test_the_search_climbs_to_a_narrow_peak() -> None:
    model = Model(lambda p: 1.0 + float(np.exp(-(((p[0] - 0.0317) / 0.01) ** 2))))
    worst = search(model, n_search=16)
    assert worst.gamma == pytest.approx(2.0, rel=1e-6)
    assert worst.position == pytest.approx([0.0317], abs=1e-5)
    assert worst.n_evaluated <= 4
    assert worst.n_tracked >= 16
    assert np.all(np.abs(np.array(model.points)) <= 0.1)


def test_candidates_are_apart_and_worst_first() -> None:
    worst = search(Model(lambda p: 3.0 + float(np.cos(100.0 * p[0]))), n_search=32, n_refine=3)
    assert len(worst.candidates) == len(worst.gammas) == 3
    assert np.all(np.diff(worst.gammas) <= 0.0)
    assert worst.gamma == worst.gammas[0]
    assert np.array_equal(worst.position, worst.candidates[0])
    assert np.min(np.diff(np.sort(worst.candidates.ravel()))) > 0.06  # a period is 0.063


def test_an_unstable_position_is_the_worst() -> None:
    worst = search(Model(lambda p: np.inf if p[0] > 0.05 else 2.0), n_search=16)
    assert worst.gamma == np.inf
    assert worst.position[0] > 0.05


def test_an_instability_that_the_climb_finds_is_infinite() -> None:
    """A band that no position of the spread lies in, on the way up to a top."""
    spread = Model(lambda p: 2.0 + float(p[0]) - 40.0 * max(0.0, float(p[0]) - 0.095))
    search(spread, n_search=4, n_refine=1)
    looked_at = np.array(spread.points).ravel()
    assert np.max(looked_at[looked_at < 0.095]) > 0.09
    seen = looked_at[:6]
    highest = float(np.max(seen[seen < 0.095]))
    banded = Model(lambda p: np.inf if highest + 1e-6 < p[0] < 0.095 else spread.gain(p))
    assert search(banded, n_search=4, n_refine=1).gamma == np.inf


@pytest.mark.parametrize("seed", [1, 2])
def test_the_value_is_the_exact_norm_at_the_position(observer: Design, seed: int) -> None:
    worst = worst_position(observer.assembly, observer.parameters, n_search=4, n_refine=2, seed=seed)
    exact = norms_at(observer.assembly, observer.parameters, worst.candidates)
    assert exact == pytest.approx(worst.gammas, rel=1e-9)
    assert worst.gamma == np.max(worst.gammas)
    spread = norms_at(observer.assembly, observer.parameters, spread_points(observer.assembly.plant.box, 32))
    assert worst_position(observer.assembly, observer.parameters, seed=seed).gamma >= np.max(spread) * (1.0 - 1e-9)


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
