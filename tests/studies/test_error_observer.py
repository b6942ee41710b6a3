"""Guards the study of the error-based observer: its designs, its trade-off, and claims that can be recomputed."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.codesign import Specification, codesign
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.progress import Progress
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import read_arrays, read_json, write_json
from studies import error_observer
from studies.codesign_folder import MEASURES, RESPONSES
from studies.column_search import columns_over_P, coupling
from studies.error_observer_jobs import Settings, jobs_of, key_of
from studies.error_observer_report import claims, write_report
from studies.error_observer_trade import at_equal_damping, at_equal_epsilon, cost, curve, front
from studies.settings import load_settings

TINY = load_settings(Settings, error_observer.NAME, "tiny")
MAIN = ("inactive", "output-epsilon-0.1", "error-epsilon-0.1")
DESIGNS = {*MAIN, "output-epsilon-0.5", "error-epsilon-0.5"}


class Heard(Progress):
    """Keeps the messages and stages."""

    def __init__(self) -> None:
        self.messages: list[str] = []
        self.stages: list[str] = []

    def log(self, message: str) -> None:
        self.messages.append(message)

    def stage(self, name: str, total: int | None = None) -> None:
        self.stages.append(name)


# The designs that the presets ask for


@pytest.mark.parametrize(("preset", "count"), [("tiny", 5), ("paper", 11), ("full", 41)])
def test_presets_ask_for_so_many_designs(preset: str, count: int) -> None:
    settings = load_settings(Settings, error_observer.NAME, preset)
    alone, observers = jobs_of(settings)
    names = [job.name for job in (*alone, *observers)]
    assert len(names) == len(set(names)) == count
    assert {job.architecture for job in alone} == {"rigid-body"}
    assert {job.start for job in observers} <= {job.name for job in alone}
    assert len({key_of(settings, job) for job in (*alone, *observers)}) == count


def test_the_trade_off_is_one_problem_for_all() -> None:
    settings = load_settings(Settings, error_observer.NAME, "full")
    jobs = [job for stage in jobs_of(settings) for job in stage]
    trade = [job for job in jobs if job.group == "trade-off"]
    assert {job.problem for job in trade} == {"two-by-two"}
    for architecture in ("output-observer", "error-observer"):
        assert {job.epsilon for job in trade if job.architecture == architecture} == {0.03, 0.1, 0.2, 0.3, 0.5}
    modes = [job for job in jobs if job.group == "modes"]
    assert {(job.architecture, job.problem) for job in modes} == {
        ("rigid-body", "six-block"), ("output-observer", "six-block"), ("error-observer", "two-by-two"),
    }  # fmt: skip
    assert {(job.f_bw, job.n_flex) for job in modes} == {(f, n) for f in (40.0, 60.0) for n in (1, 2, 3)}
    assert {job.seed for job in jobs if job.group == "seeds"} == {1, 2, 3, 4}
    same = {job.start for job in modes if job.f_bw == 60.0 and job.n_flex == 3 and job.start}
    assert same == {"conventional-60Hz-3"}


def test_only_what_touches_a_design_changes_its_key() -> None:
    inactive = jobs_of(TINY)[0][0]
    for kept in ({"jobs": 2}, {"epsilons": (0.1, 0.2)}, {"seeds": 3}, {"bandwidths": (60.0,), "mode_counts": (2,)}):
        assert key_of(dataclasses.replace(TINY, **kept), inactive) == key_of(TINY, inactive)  # type: ignore[arg-type]
    for changed in ({"degree": 9}, {"n_positions": 6}, {"magnetics": "exact"}, {"measure_grid": 4}):
        assert key_of(dataclasses.replace(TINY, **changed), inactive) != key_of(TINY, inactive)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"epsilon": 0.2}, r"epsilon is 0\.2, wanted one of epsilons = \(0\.1, 0\.5\)"),
        ({"seeds": 0}, "seeds is 0, wanted a whole number of at least 1"),
        ({"mode_counts": (0,)}, "mode_counts is 0, wanted a whole number of at least 1"),
        ({"bandwidths": (40.0, -1.0)}, r"bandwidths is \(40\.0, -1\.0\), wanted values above 0"),
        ({"measure_grid": 0}, "measure_grid is 0, wanted a whole number"),
    ],
)
def test_wrong_settings(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DomainError, match=message):
        dataclasses.replace(TINY, **changes)


# The trade-off, on designs whose answer is known


def summary(name: str, epsilon: float, peak: float, left: float, crossover: float, **values: Any) -> dict[str, Any]:
    architecture = "rigid-body" if name == "inactive" else f"{name.split('-')[0]}-observer"
    column = {"rigid": left, "flexible": 1.0, "whole": left + 0.1}
    fixed = {
        "group": "trade-off", "architecture": architecture, "epsilon": epsilon, "mode_peak_dB": peak,
        "gamma": left, "gamma_over_P": left + 0.1, "crossover_mean_Hz": [crossover] * 6, "largest_real_part": -5.0,
        "columns": {"two-by-two": column}, "damping_min": [0.1], "controller_states": 34, "multiplications": 300,
        "n_dense": 9,
    }  # fmt: skip
    return {**fixed, **values}


@pytest.fixture
def known() -> dict[str, Any]:
    error = {"controller_states": 22, "multiplications": 100}
    return {
        "inactive": summary("inactive", 0.1, 36.0, 2.0, 40.0, controller_states=18),
        "output-epsilon-0.1": summary("output-epsilon-0.1", 0.1, 20.0, 2.0, 40.0),
        "output-epsilon-0.3": summary("output-epsilon-0.3", 0.3, 10.0, 2.2, 39.0),
        "output-epsilon-0.5": summary("output-epsilon-0.5", 0.5, 12.0, 2.5, 38.0),  # beaten by the one before
        "error-epsilon-0.1": summary("error-epsilon-0.1", 0.1, 25.0, 2.1, 40.0, **error),
        "error-epsilon-0.3": summary("error-epsilon-0.3", 0.3, 15.0, 2.31, 36.0, **error),
        "error-epsilon-0.5": summary("error-epsilon-0.5", 0.5, 5.0, 3.0, 30.0, **error),
    }


def test_cost_goes_from_the_least_to_the_most_damped(known: dict[str, Any]) -> None:
    found = cost(curve(known, "error-observer"))
    assert found is not None
    assert (found["peak_first_dB"], found["peak_last_dB"]) == (25.0, 5.0)
    assert found["left_rise"] == pytest.approx(3.0 / 2.1 - 1.0)
    assert found["crossover_loss"] == pytest.approx(0.25)
    assert cost(curve(known, "error-observer")[:1]) is None


def test_equal_damping_interpolates_on_the_front(known: dict[str, Any]) -> None:
    output = curve(known, "output-observer")
    assert [d["epsilon"] for d in front(output)] == [0.3, 0.1]
    rows = at_equal_damping(curve(known, "error-observer"), output)
    # 25 dB: the least damped output-based design does it; 15 dB: half way; 5 dB: nobody
    assert [row["peak_dB"] for row in rows] == [25.0, 15.0]
    assert [row["left_output"] for row in rows] == pytest.approx([2.0, 2.1])
    assert [row["excess"] for row in rows] == pytest.approx([0.05, 0.1])
    assert rows[1]["crossover_output_Hz"] == pytest.approx(39.5)
    assert at_equal_damping(curve(known, "error-observer"), []) == []


def test_equal_epsilon_compares_gamma_over_P(known: dict[str, Any]) -> None:
    rows = at_equal_epsilon(curve(known, "error-observer"), curve(known, "output-observer"))
    assert [row["epsilon"] for row in rows] == [0.1, 0.3, 0.5]
    assert rows[2]["excess"] == pytest.approx(3.1 / 2.6 - 1.0)


def test_claims_follow_the_figures(known: dict[str, Any]) -> None:
    settings = {"epsilon": 0.1}
    held = [claim["holds"] for claim in claims(settings, known)]
    assert held == [True, True, True, True, True, True]
    known["error-epsilon-0.1"] |= {"mode_peak_dB": 30.0, "controller_states": 30, "multiplications": 301}
    known["error-epsilon-0.3"]["columns"]["two-by-two"]["rigid"] = 2.1
    known["error-epsilon-0.5"] |= {"largest_real_part": 0.1}
    found = claims(settings, known)
    # without the unstable design the left column of the others does not rise
    assert [claim["holds"] for claim in found] == [False] * 6
    assert "not stable somewhere: error-epsilon-0.5" in found[-1]["value"]


def test_an_unstable_or_unbounded_design_takes_no_part(known: dict[str, Any]) -> None:
    known["error-epsilon-0.1"]["gamma_over_P"] = None
    known["error-epsilon-0.3"]["mode_peak_dB"] = None
    assert [d["epsilon"] for d in curve(known, "error-observer")] == [0.5]


# Columns and coupling, on a small plant


@pytest.fixture(scope="module")
def small_design(small_plant: DecoupledPlant) -> Any:
    return codesign(
        small_plant, "error-observer", Specification(f_bw=12.0, epsilon=0.1), positions=[[-0.08], [0.05]],
        exchange_rounds=0, n_search=1, starts=1, max_iterations=1,
    )  # fmt: skip


def test_the_search_finds_no_less_than_a_fine_grid(small_design: Any) -> None:
    box = small_design.assembly.plant.box
    _, found = columns_over_P(
        small_design, np.linspace(*box[0], 3)[:, None], problem="two-by-two", n_search=8, seed=0, progress=Progress()
    )
    fine = np.linspace(*box[0], 101)[:, None]
    norms = []
    for A, B, C, D in small_design.frozen(fine, weighted=True, problem="two-by-two"):
        norms.append([hinf_norm(A, B[:, :2], C, D[:, :2]).norm, hinf_norm(A, B, C, D).norm])
    largest = np.max(norms, axis=0)
    assert found["rigid"] >= 0.999 * largest[0]
    assert found["rigid"] <= found["whole"] <= 1.001 * largest[1]
    assert box[0, 0] <= found["rigid_position_mm"][0] / 1e3 <= box[0, 1]


def test_coupling_is_nothing_without_damping_and_grows_with_it(small_design: Any) -> None:
    points = np.array([[-0.08], [0.05]])
    found = []
    for factor in (0.0, 0.5, 1.0):
        theta = np.array(small_design.parameters)
        theta[-1] *= factor
        found.append(coupling(dataclasses.replace(small_design, parameters=theta), points, problem="two-by-two"))
    assert found[0] < 1e-9
    assert 1e-6 < found[1] < found[2]


# The results of the tiny preset


@pytest.fixture(scope="module")
def summaries(tiny_error_results: Path) -> dict[str, Any]:
    return {name: read_json(tiny_error_results / "designs" / name / "summary.json") for name in DESIGNS}


def test_the_folder_is_complete_and_holds_no_NaN(tiny_error_results: Path) -> None:
    assert {path.name for path in (tiny_error_results / "designs").iterdir()} == DESIGNS

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    for path in tiny_error_results.rglob("*.json"):
        json.loads(path.read_text("utf-8"), parse_constant=refuse)
    assert not list(tiny_error_results.rglob("checkpoint.npz"))


def test_the_error_based_observer_damps_the_mode_by_10_dB(tiny_error_results: Path) -> None:
    inactive, output, error = (
        20
        * np.log10(np.max(read_arrays(tiny_error_results / "designs" / name / "measures.npz", MEASURES)["mode_peak"]))
        for name in MAIN
    )
    assert inactive - error >= 10.0
    assert inactive - output >= 10.0


def test_it_has_12_states_fewer_in_the_stored_controllers(tiny_error_results: Path) -> None:
    states = [LPVStateSpace.load(tiny_error_results / "designs" / name / "controller.npz").n_x for name in MAIN]
    assert states == [18, 18 + 16, 18 + 4]


def test_all_designs_are_stable_on_the_dense_grid(tiny_error_results: Path, summaries: dict[str, Any]) -> None:
    for name, found in summaries.items():
        measures = read_arrays(tiny_error_results / "designs" / name / "measures.npz", MEASURES)
        assert len(measures["dense"]) == len(measures["poles"]) == 7**2
        assert np.max(measures["poles"]) == found["largest_real_part"] < 0.0


def test_columns_over_P_are_no_less_than_on_the_grid(tiny_error_results: Path, summaries: dict[str, Any]) -> None:
    for name, found in summaries.items():
        measures = read_arrays(tiny_error_results / "designs" / name / "measures.npz", MEASURES)
        columns = found["columns"]["two-by-two"]
        for part in ("rigid", "flexible", "whole"):
            assert len(measures[f"{part}_two-by-two"]) == 9
            assert columns[part] >= np.max(measures[f"{part}_two-by-two"])
        assert max(columns["rigid"], columns["flexible"]) <= columns["whole"] * (1.0 + 1e-9)
        counted = columns["rigid" if name == "inactive" else "whole"]
        assert found["gamma_over_P"] == max(found["gamma_worst"], counted)


def test_no_block_exceeds_its_bound_by_more_than_its_norm(tiny_error_results: Path, summaries: dict[str, Any]) -> None:
    for name in MAIN[1:]:
        data = read_arrays(tiny_error_results / "designs" / name / "responses.npz", RESPONSES)
        assert data["sigma"].shape[1:3] == data["bounds"].shape[:2] == (2, 2)
        ratio = np.max(data["sigma"] / data["bounds"])
        assert 0.3 * summaries[name]["gamma_over_P"] < ratio < 1.02 * summaries[name]["gamma_over_P"]


def test_the_report_says_what_was_measured(tiny_error_results: Path, summaries: dict[str, Any]) -> None:
    report = read_json(tiny_error_results / "report.json")
    assert set(report["designs"]) == DESIGNS
    verdicts = {claim["claim"]: claim["holds"] for claim in report["claims"]}
    assert len(verdicts) == 6
    # what a few iterations at five positions can show; the trade-off and the ranking need converged designs
    assert verdicts["active damping of at least 10 dB at the worst position"]
    assert verdicts["2 n_RB = 12 states fewer than the output-based observer"]
    assert verdicts["all local loops stable over P"]
    text = (tiny_error_results / "report.md").read_text("utf-8")
    assert all(claim["value"] in text for claim in report["claims"])
    assert text.count("| error-based | 0.") == text.count("| output-based | 0.") == 2


def test_a_second_run_makes_nothing(tiny_error_results: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in tiny_error_results.rglob("*.npz")}
    listener = Heard()
    error_observer.run(TINY, tiny_error_results, listener)
    assert len([message for message in listener.messages if message.endswith("taken from the results folder")]) == 5
    assert listener.stages == []
    assert before == {path: path.stat().st_mtime_ns for path in tiny_error_results.rglob("*.npz")}


def test_more_modes_and_seeds_have_their_tables(tiny_error_results: Path, tmp_path: Path) -> None:
    """From stored summaries: the sections appear with the designs that they need."""
    designs, keys = {}, {}
    for name in DESIGNS:
        designs[name] = read_json(tiny_error_results / "designs" / name / "summary.json")
    for role, name in zip(("conventional", "output", "error"), MAIN, strict=True):
        columns = {"two-by-two": designs[name]["columns"]["two-by-two"]}
        columns["six-block"] = {"rigid": 7.77}
        designs[f"{role}-60Hz-3"] = designs[name] | {"group": "modes", "f_bw": 60.0, "n_flex": 3, "columns": columns}
        designs[f"{name}-seed-1"] = designs[name] | {"group": "seeds", "gamma": 9.876}
    for name, one in designs.items():
        write_json(tmp_path / "designs" / name / "summary.json", one)
        keys[name] = one["fingerprint"]
    write_json(tmp_path / "designs.json", keys)
    for name in ("settings", "run"):
        write_json(tmp_path / f"{name}.json", read_json(tiny_error_results / f"{name}.json"))
    write_report(tmp_path)
    text = (tmp_path / "report.md").read_text("utf-8")
    modes, seeds = text.split("## More modes and bandwidth")[1].split("## Seeds")
    assert modes.count("| 60 | 3 |") == modes.count("| 7.77 |") == 3
    assert seeds.count("-9.876 |") == 3
