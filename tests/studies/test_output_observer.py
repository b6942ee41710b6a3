"""Guards the study of the output-based observer on its tiny preset: its claims, and that anyone can recompute them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import read_arrays, read_json
from studies import codesign_folder, output_observer
from studies.output_observer import Job, Settings, jobs_of

DESIGNS = ("conventional", "conventional-rigid", "observer")
COMPARED = ("conventional", "observer")
FILES = ("plant", "controller", "closed_loop", "performance_loop", "design", "measures", "responses")


@dataclass(frozen=True)
class Stored:
    """One design of the results folder, as arrays."""

    folder: Path

    def system(self, name: str) -> LPVStateSpace:
        return LPVStateSpace.load(self.folder / f"{name}.npz")

    @cached_property
    def design(self) -> dict[str, Any]:
        return read_arrays(self.folder / "design.npz", "lpvhinf.Design")

    @cached_property
    def measures(self) -> dict[str, Any]:
        return read_arrays(self.folder / "measures.npz", codesign_folder.MEASURES)

    @cached_property
    def responses(self) -> dict[str, Any]:
        return read_arrays(self.folder / "responses.npz", codesign_folder.RESPONSES)

    @cached_property
    def summary(self) -> dict[str, Any]:
        return dict(read_json(self.folder / "summary.json"))


@pytest.fixture(scope="module")
def stored(tiny_results: Path) -> Callable[[str], Stored]:
    designs = {name: Stored(tiny_results / "designs" / name) for name in DESIGNS}
    return designs.__getitem__


@pytest.fixture(scope="module")
def plants(tiny_results: Path) -> Callable[[str], DecoupledPlant]:
    """The plant model itself, from the stored settings alone."""
    settings = read_json(tiny_results / "settings.json")
    del settings["study"]
    wanted = Settings(**settings | {"epsilons": tuple(settings["epsilons"])})
    jobs: dict[str, Job] = {job.name: job for stage in jobs_of(wanted) for job in stage}
    made = {name: output_observer.decoupled_plant(wanted, jobs[name]) for name in COMPARED}
    return made.__getitem__


def poles(A: Array) -> Array:
    return np.asarray(np.linalg.eigvals(A))


def largest_gap(found: Array, wanted: Array) -> float:
    """Largest distance of a pole in one set to the nearest in the other, relative to its size (at least 1 rad/s)."""
    distance = np.abs(found[:, None] - wanted[None])
    there = np.min(distance, axis=1) / np.maximum(np.abs(found), 1.0)
    back = np.min(distance, axis=0) / np.maximum(np.abs(wanted), 1.0)
    return float(max(np.max(there), np.max(back)))


# The claims


def test_crossover_with_the_observer_is_the_conventional_one(stored: Callable[[str], Stored]) -> None:
    conventional, observer = (np.mean(stored(name).measures["crossover"], axis=0) for name in COMPARED)
    assert conventional.shape == (6,)
    assert np.all(np.abs(observer / conventional - 1.0) < 0.1)
    assert np.all(conventional > 0.7 * 40.0)  # Hz: a pair of loops that are equally slow would not do
    assert np.all(conventional < 1.3 * 40.0)


def test_the_controlled_mode_is_15_dB_lower_at_its_worst_position(stored: Callable[[str], Stored]) -> None:
    conventional, observer = (20 * np.log10(np.max(stored(name).measures["mode_peak"])) for name in COMPARED)
    assert conventional - observer >= 15.0


def test_the_flexible_peak_is_15_dB_lower_with_the_discarded_modes_included(stored: Callable[[str], Stored]) -> None:
    conventional, observer = (20 * np.log10(np.max(stored(name).measures["flexible_peak"])) for name in COMPARED)
    assert conventional - observer >= 15.0


def test_the_observer_damps_the_controlled_mode_and_spares_the_others(stored: Callable[[str], Stored]) -> None:
    conventional, observer = (stored(name).measures for name in COMPARED)
    assert np.min(observer["damping"]) > 10.0 * np.max(conventional["damping"])
    assert np.min(observer["discarded_damping"]) > 0.5 * np.min(conventional["discarded_damping"]) > 0.0


@pytest.mark.parametrize("name", COMPARED)
def test_every_local_loop_on_the_dense_grid_is_stable(stored: Callable[[str], Stored], name: str) -> None:
    measures = stored(name).measures
    assert len(measures["dense"]) == len(measures["poles"]) == 15**2
    assert np.max(measures["poles"]) < 0.0


def test_the_report_says_that_the_claims_hold(tiny_results: Path) -> None:
    report = read_json(tiny_results / "report.json")
    assert [claim["holds"] for claim in report["claims"]] == [True] * 4
    text = (tiny_results / "report.md").read_text("utf-8")
    assert text.count("## Summary") == 1
    assert all(claim["value"] in text for claim in report["claims"])


# The folder


def test_the_folder_is_complete(tiny_results: Path) -> None:
    assert {path.name for path in tiny_results.iterdir()} == {
        "designs", "designs.json", "report.md", "report.json", "run.json", "settings.json",
    }  # fmt: skip
    assert {path.name for path in (tiny_results / "designs").iterdir()} == set(DESIGNS)
    for name in DESIGNS:
        files = {path.name for path in (tiny_results / "designs" / name).iterdir()}
        assert files == {"summary.json", *(f"{file}.npz" for file in FILES)}


def test_json_files_hold_no_NaN(tiny_results: Path) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    files = sorted(tiny_results.rglob("*.json"))
    assert len(files) == 4 + len(DESIGNS)
    for path in files:
        json.loads(path.read_text("utf-8"), parse_constant=refuse)


def test_the_run_is_recorded(tiny_results: Path) -> None:
    record, settings = read_json(tiny_results / "run.json"), read_json(tiny_results / "settings.json")
    assert {"python", "numpy", "scipy", "lpvhinf", "slycot", "control"} <= set(record["versions"])
    assert record["seed"] == settings["seed"] == 0
    assert record["wall_time_s"] > 1.0
    assert settings["study"] == output_observer.NAME
    assert settings["n_plant_modes"] == 4


# Anyone can recompute it


@pytest.mark.parametrize("name", COMPARED)
def test_stored_loops_have_the_poles_that_were_measured(stored: Callable[[str], Stored], name: str) -> None:
    """The fit moves the slow poles that decide by less than the input gains are wrong."""
    design = stored(name)
    points, measured = design.measures["dense"][::28], design.measures["poles"][::28]
    loop = design.system("closed_loop")
    found = np.array([np.max(poles(A).real) for A in loop.A.sample(points)])
    error = design.summary["fit_error"]["B"]
    assert 0.0 < error < 0.05
    assert np.allclose(found, measured, rtol=error, atol=0.0)


@pytest.mark.parametrize("name", COMPARED)
def test_stored_loops_have_the_blocks_that_the_figure_shows(stored: Callable[[str], Stored], name: str) -> None:
    design = stored(name)
    scale_y, scale_u = design.design["scaling_output"][:6], design.design["scaling_input"]
    omega = design.responses["omega"]
    left = np.concatenate([scale_y, 1.0 / scale_u[:6]])
    right = np.concatenate([1.0 / scale_y, scale_u])
    columns = (slice(0, 6), slice(6, 12), slice(12, 13))
    # the centre is a node of the fit, and exact there; the last position is the worst one
    for where, tolerance in ((4, 1e-9), (-1, design.summary["fit_error"]["B"])):
        A, B, C, D = (m[0] for m in design.system("closed_loop").sample(design.responses["points"][[where]]))
        T = np.array([C[:12] @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D[:12] for w in omega])
        T = left[:, None] * T * right
        for i, rows in enumerate((slice(0, 6), slice(6, 12))):
            for j, cols in enumerate(columns):
                found = np.linalg.svd(T[:, rows, cols], compute_uv=False)[:, 0]
                wanted = design.responses["sigma"][where, i, j]
                assert np.max(np.abs(found - wanted)) < tolerance * np.max(wanted)


@pytest.mark.parametrize("name", COMPARED)
def test_the_performance_loop_has_the_norms_of_the_design(stored: Callable[[str], Stored], name: str) -> None:
    design = stored(name)
    positions, gammas = design.design["positions"], design.design["gammas"]
    assert np.max(gammas) == design.summary["gamma"] <= design.summary["gamma_worst"]
    system = design.system("performance_loop")
    for p, gamma in zip(positions, gammas, strict=True):
        A, B, C, D = (m[0] for m in system.sample(p[None]))
        assert np.max(poles(A).real) < 0.0
        assert hinf_norm(A, B, C, D).norm == pytest.approx(gamma, rel=design.summary["fit_error"]["B"])


@pytest.mark.parametrize("name", COMPARED)
def test_controller_and_plant_closed_by_hand_have_the_poles_of_the_loop(
    stored: Callable[[str], Stored], name: str
) -> None:
    design = stored(name)
    plant, controller, loop = (design.system(file) for file in ("plant", "controller", "closed_loop"))
    points = design.measures["points"][[0, 4, 5]]
    for (A, B, C, D), (Ak, Bk, Ck, Dk), wanted in zip(
        zip(*plant.sample(points), strict=True),
        zip(*controller.sample(points), strict=True),
        loop.A.sample(points),
        strict=True,
    ):
        # (e, y) = feed y with e = -y_RB; without an observer the modal force is left alone
        feed, n_u = np.vstack([-np.eye(6, len(C)), np.eye(len(C))]), len(Ck)
        assert not np.any(Dk)
        assert n_u == (7 if name == "observer" else 6)
        B, D = B[:, :n_u], D[:, :n_u]
        by_hand = np.block([[A, B @ Ck], [Bk @ feed @ C, Ak + Bk @ feed @ D @ Ck]])
        assert by_hand.shape == wanted.shape
        assert largest_gap(poles(by_hand), poles(wanted)) < 1e-6


@pytest.mark.parametrize("name", COMPARED)
def test_frozen_plants_have_the_measured_poles_with_the_stored_controller(
    stored: Callable[[str], Stored], plants: Callable[[str], DecoupledPlant], name: str
) -> None:
    """No fit in between: the plant model itself, from the settings, and the controller from its file."""
    design = stored(name)
    points, measured = design.measures["dense"][::56], design.measures["poles"][::56]
    frozen, controller = plants(name).frozen(points), design.system("controller").sample(points)
    for system, Ak, Bk, Ck, value in zip(frozen, *controller[:3], measured, strict=True):
        A, B, C, D = (m[0] for m in system.sample(points[:1]))
        feed, n_u = np.vstack([-np.eye(6, len(C)), np.eye(len(C))]), len(Ck)
        closed = np.block([[A, B[:, :n_u] @ Ck], [Bk @ feed @ C, Ak + Bk @ feed @ D[:, :n_u] @ Ck]])
        assert np.max(poles(closed).real) == pytest.approx(value, rel=1e-6)
