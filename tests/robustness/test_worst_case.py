"""Guards the search for the worst plant, and the report, against answers that are found in other ways."""

from __future__ import annotations

import dataclasses
import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from lpvhinf.codesign import Design
from lpvhinf.decoupling import decouple
from lpvhinf.errors import DomainError
from lpvhinf.plant import ModalModel
from lpvhinf.robustness import (
    Analysis,
    ControlledPlant,
    MonteCarlo,
    Uncertainty,
    monte_carlo,
    robustness_report,
    share_bounds,
    worst_case,
)
from lpvhinf.robustness.outcomes import BETTER, FIGURES
from lpvhinf.storage import write_json


@pytest.fixture(scope="module")
def run(small: ControlledPlant, mild: Uncertainty) -> MonteCarlo:
    return monte_carlo(small, mild, 60)


@pytest.mark.parametrize("figure", FIGURES)
def test_it_is_worse_than_the_sample(run: MonteCarlo, figure: str) -> None:
    found = worst_case(run, figure, n_starts=2, max_evaluations=150)
    better = BETTER[figure]
    assert better * found.value < better * found.sampled_value
    assert better * found.value == pytest.approx(np.min(better * found.tries), rel=1e-2)
    # and it is what it says of that plant
    analysis = Analysis(run.subject, run.uncertainty)
    again = run.uncertainty.samples(run.subject.plant, found.unit[None])
    assert again.omega == pytest.approx(found.sample.omega)
    assert analysis.measure(again, [figure], exact=True).figure(figure)[0] == pytest.approx(found.value, rel=1e-7)


@pytest.mark.parametrize("figure", ["abscissa", "least_damping"])
def test_no_corner_of_the_box_is_worse(small: ControlledPlant, figure: str) -> None:
    """Three damping ratios, three frequencies and the position: all corners, on a grid of positions."""
    given = Uncertainty(mass=(0.0, 0.0), misalignment=(0.0, 0.0), damping=(5e-3, 1e-2))
    d = given.dimension(small.plant)
    unit = np.full((64 * 21, d), 0.5)
    for k, (corner, place) in enumerate(itertools.product(itertools.product([0.0, 1.0], repeat=6), range(21))):
        unit[k, :6], unit[k, -1] = corner, place / 20
    values = Analysis(small, given).measure(given.samples(small.plant, unit), [figure]).figure(figure)
    found = worst_case(monte_carlo(small, given, 50), figure, n_starts=2)
    worst = np.min(BETTER[figure] * values)
    assert BETTER[figure] * found.value <= worst + 1e-6 * abs(worst)


def test_it_ends_where_it_may_not_look_any_more(run: MonteCarlo) -> None:
    assert worst_case(run, n_starts=1, max_evaluations=30).evaluations <= 30
    single = worst_case(run, n_starts=1, max_evaluations=1)
    assert single.value == pytest.approx(single.sampled_value, rel=1e-9)
    assert single.evaluations == 1


def test_an_unstable_plant_ends_the_search_for_a_norm(small: ControlledPlant, wide: Uncertainty) -> None:
    run = monte_carlo(small, wide, 40)
    found = worst_case(run, "sensitivity", n_starts=1)
    assert np.isinf(found.value)
    assert found.outcomes.unstable.all()
    assert found.evaluations == 1


def test_arguments_are_checked(run: MonteCarlo) -> None:
    with pytest.raises(DomainError, match="no option 'gain'"):
        worst_case(run, "gain")
    for name in ("n_starts", "max_evaluations"):
        with pytest.raises(DomainError, match=f"{name} is 0"):
            worst_case(run, **{name: 0})  # type: ignore[arg-type]


def test_a_plant_without_controlled_modes(small_modal: ModalModel, small_design: Design, mild: Uncertainty) -> None:
    plant = decouple(small_modal, n_flex=0, degree=4)
    whole = ControlledPlant.of(small_design)
    scaling = dataclasses.replace(whole.scaling, input=whole.scaling.input[:2])
    A, B, C, D = (m[0] for m in whole.controller.sample([[0.0]]))
    K = type(whole.controller).from_coefficients(A, B, C[:2], D[:2], box=plant.box)
    run = monte_carlo(ControlledPlant(plant=plant, controller=K, scaling=scaling), mild, 3)
    assert run.outcomes.damping.shape == (3, 0)
    assert "damping" not in robustness_report(run)["quantiles"]
    with pytest.raises(DomainError, match="figure is 'damping', but the plant has no controlled mode"):
        worst_case(run, "damping")


@pytest.mark.parametrize(("count", "n"), [(0, 10), (3, 10), (10, 10), (7, 10_000)])
def test_bounds_are_those_of_an_exact_binomial_test(count: int, n: int) -> None:
    wanted = scipy.stats.binomtest(count, n).proportion_ci(0.9, method="exact")
    assert share_bounds(count, n, 0.9) == pytest.approx((wanted.low, wanted.high), rel=1e-9, abs=1e-15)


def test_bounds_of_no_experiment() -> None:
    for arguments, message in (
        ((3, 2), "count is 3, wanted at most n = 2"),
        ((0, 0), "n is 0"),
        ((0, 5, 1.0), "confidence is 1.0, wanted a number between 0 and 1"),
    ):
        with pytest.raises(DomainError, match=message):
            share_bounds(*arguments)


def test_a_report_is_plain_json(small: ControlledPlant, wide: Uncertainty, tmp_path: Path) -> None:
    run = monte_carlo(small, wide, 50)
    case = worst_case(run, n_starts=1, max_evaluations=40)
    write_json(tmp_path / "report.json", robustness_report(run, [case]))
    found = json.loads((tmp_path / "report.json").read_text("utf-8"))
    unstable = found["unstable"]
    assert unstable["count"] == int(np.sum(run.outcomes.abscissa >= 0.0)) > 0
    assert unstable["lower"] < unstable["share"] == unstable["count"] / 50 < unstable["upper"]
    quantiles = found["quantiles"]["abscissa"]
    ordered = np.sort(run.outcomes.abscissa)
    assert [quantiles[level] for level in ("0", "0.5", "1")] == [ordered[0], ordered[24], ordered[49]]
    assert found["quantiles"]["sensitivity"]["1"] is None  # infinite: an unstable loop
    worst = found["worst_sampled"]["abscissa"]
    assert worst["figures"]["abscissa"] == quantiles["1"]
    assert worst["sample"]["position"] == run.samples.position[worst["plant"]].tolist()
    assert found["worst_searched"]["abscissa"]["value"] == case.value >= quantiles["1"]
    assert found["uncertainty"]["delay"] == 1.5e-3
