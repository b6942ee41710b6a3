"""The benchmark of structured synthesis: resumes, reports, and skips where the data are missing. No time is tested."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hinfstruct import actuator, scaling
from benchmarks.hinfstruct.__main__ import main
from benchmarks.hinfstruct.compleib import CompleibRun
from benchmarks.hinfstruct.flexible_bar import bars
from benchmarks.hinfstruct.measuring import cpu_seconds, finished, slicot_ratio
from benchmarks.hinfstruct.out_of_plane import out_of_plane
from benchmarks.hinfstruct.report import files, write_report
from benchmarks.hinfstruct.scaling import CONTROLLERS, LARGE, ScalingRun
from benchmarks.hinfstruct.sections import compleib_section, scaling_section
from benchmarks.hinfstruct.store import append, read_rows
from lpvhinf.decoupling import decouple
from lpvhinf.errors import StorageError
from lpvhinf.hinfstruct import FixedOrder, hinf_norm
from lpvhinf.plant.mmpa import MMPA
from tests.hinfstruct.plants import first_order

RUN = CompleibRun(
    name="ONE", order=0, seed=0, gamma=2.0, ratio=1.0, best_known=2.0, hifoo=2.1, hifoo_cpu=1.0, wall=0.2, cpu=0.1,
    trials=9, exact=9, slicot=1.0, largest_parameter=3.0, status='said, "so"',
)  # fmt: skip


def folder_with_one_system(folder: Path) -> Path:
    P = first_order()
    folder.mkdir()
    np.savez(folder / "ONE.npz", A=P.A, B1=P.B1, B=P.B2, C1=P.C1, C=P.C2, D11=P.D11, D12=P.D12, D21=P.D21)
    known = {"best_known_gamma": 1.0 + np.sqrt(3.0), "hifoo": {"gamma": 2.8, "cpu_s": 0.1}}
    (folder / "reference.json").write_text(json.dumps({"systems": {"ONE": known}}))
    return folder


def test_runs_resumes_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data, out = folder_with_one_system(tmp_path / "data"), tmp_path / "out"
    wanted = ["--part", "compleib", "--data", str(data), "--out", str(out)]
    assert main([*wanted, "--seeds", "1"]) == 0
    (first,) = read_rows(files(out)["compleib"], CompleibRun)
    assert first.run.ratio == pytest.approx(1.0, abs=1e-6)
    assert first.run.slicot == pytest.approx(1.0, abs=1e-6)
    assert first.where["numpy"] == np.__version__
    assert main([*wanted, "--seeds", "2"]) == 0
    again = read_rows(files(out)["compleib"], CompleibRun)
    assert [row.run.seed for row in again] == [0, 1]
    assert again[0] == first
    page = (out / "hinfstruct.md").read_text("utf-8")
    assert "1 of 1 (seeds a system: 2)" in page
    assert page.count("Not run.") == 2
    assert "## Limitations" in page
    assert capsys.readouterr().out.count("seed 0") == 1


def test_missing_data_are_no_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--part", "compleib", "--data", str(tmp_path), "--out", str(tmp_path)]) == 0
    assert "skipped" in capsys.readouterr().out


def test_an_unknown_system_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["TWO", "--data", str(folder_with_one_system(tmp_path / "data"))])
    assert "known: ONE" in capsys.readouterr().err


def test_systems_belong_to_one_part(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["ONE", "--part", "mmpa"])
    assert "--part compleib" in capsys.readouterr().err


def test_scaling_runs_once_and_its_norms_hold(tmp_path: Path) -> None:
    wanted = ["--part", "scaling", "--tiny", "--jobs", "1", "--out", str(tmp_path)]
    assert main(wanted) == 0
    (row,) = read_rows(files(tmp_path)["scaling"], ScalingRun)
    run = row.run
    assert run.slicot == pytest.approx(1.0, abs=1e-6)
    assert run.lower_bound <= run.gamma < np.inf
    assert run.saving == pytest.approx(run.every_model / run.exact)
    assert main(wanted) == 0
    assert len(read_rows(files(tmp_path)["scaling"], ScalingRun)) == 1
    assert "| 8 | 2 | 10 |" in (tmp_path / "hinfstruct.md").read_text("utf-8")


@pytest.mark.slow
def test_every_codesign_runs(tmp_path: Path) -> None:
    assert main(["--part", "mmpa", "--tiny", "--jobs", "1", "--out", str(tmp_path)]) == 0
    rows = read_rows(files(tmp_path)["mmpa"], actuator.ActuatorRun)
    assert [row.run.key for row in rows] == [case.key for case in actuator.cases(actuator.TINY)]
    for row in rows:
        assert row.run.slicot == pytest.approx(1.0, abs=1e-6)
    assert "| 3 | 3 | output-observer |" in (tmp_path / "hinfstruct.md").read_text("utf-8")


def test_a_codesign_of_three_axes() -> None:
    case = actuator.Case(axes=3, n_flex=1, architecture="rigid-body", setting=actuator.TINY)
    run = actuator.solve(case, jobs=1)
    assert run.slicot == pytest.approx(1.0, abs=1e-6)
    assert run.states == 2 * (3 + 3) + 3 * 3  # rigid and flexible modes; integrator and low-pass of every axis
    assert run.states_weighted > run.states
    assert run.gamma <= run.gamma_worst


def test_out_of_plane_axes_are_those_of_the_whole_plant(mmpa: MMPA) -> None:
    points = np.array([[0.0, 0.0], [0.021, -0.043]])
    part = decouple(out_of_plane(mmpa), n_flex=2, degree=2, weight=mmpa.coil_weights)
    assert (part.n_rb, part.n_out, part.modal.n_u) == (3, 4, mmpa.modal.n_u)
    T_y, T_u = part.matrices(points)
    whole, modes = mmpa.modal.gains(points), [2, 3, 4, 6, 7]
    S = mmpa.modal.rigid_body_scaling[2:5, 2:5]
    np.testing.assert_allclose(S @ whole.input_gains[:, 2:5] @ T_u[:, :, :3], np.tile(np.eye(3), (2, 1, 1)), atol=1e-9)
    seen = T_y @ whole.output_gains[:, :4][:, :, modes]
    np.testing.assert_allclose(seen[:, :3, :3], np.tile(S, (2, 1, 1)), atol=1e-9)
    np.testing.assert_allclose(part.sample(points).C[:, :, 3:5], seen[:, :, 3:], atol=1e-9)


@pytest.mark.parametrize("n_parameters", CONTROLLERS)
def test_the_gain_that_every_bar_admits_stabilises_it(n_parameters: int) -> None:
    order, n_u, n_y = CONTROLLERS[n_parameters]
    assert FixedOrder(order, n_u, n_y).n_parameters == n_parameters
    D = np.hstack([-np.eye(n_u), -np.eye(n_u), np.zeros((n_u, n_y - 2 * n_u))])
    K = (np.zeros((0, 0)), np.zeros((0, n_y)), np.zeros((n_u, 0)), D)
    models = bars(20, 3, n_u, n_y)
    for model in models:
        damping = np.sort(-np.linalg.eigvals(model.A).real)
        assert damping[1] <= 0.0 < damping[2]  # one rigid mode
        assert np.max(np.linalg.eigvals(model.close(*K)[0]).real) < 0.0
    assert np.all(models[0].A[2:, 2:] != models[1].A[2:, 2:], where=models[0].A[2:, 2:] < 0.0)
    smaller = bars(10, 1, n_u, n_y)[0]
    np.testing.assert_array_equal(smaller.B2, models[0].B2[:10])


def test_a_wrong_norm_of_one_loop_shows() -> None:
    P = first_order()
    loop = P.close(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[-2.0]]))
    gamma = hinf_norm(*loop).norm
    assert slicot_ratio([loop, loop], [gamma, gamma]) == pytest.approx(1.0, abs=1e-8)
    assert slicot_ratio([loop, loop], [gamma, 2.0 * gamma]) == pytest.approx(0.5)


def test_seconds_of_children_count() -> None:
    before = cpu_seconds()
    code = "import time\nwhile time.process_time() < 0.3: pass"
    subprocess.run([sys.executable, "-c", code], check=True)
    assert cpu_seconds() - before >= 0.3


def test_an_interrupted_run_is_not_recorded() -> None:
    finished(False)
    with pytest.raises(KeyboardInterrupt):
        finished(True)


def test_rows_keep_text_and_numbers_and_their_own_environment(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    other = dataclasses.replace(RUN, seed=1, gamma=np.inf, status="two\nlines")
    append(path, RUN, {"numpy": "1"})
    append(path, other, {"numpy": "2"})
    rows = read_rows(path, CompleibRun)
    assert [row.run for row in rows] == [RUN, other]
    assert [row.where["numpy"] for row in rows] == ["1", "2"]


def test_a_file_of_another_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text("name,gamma\nONE,1.0\n")
    with pytest.raises(StorageError, match="another version"):
        read_rows(path, CompleibRun)
    with pytest.raises(StorageError, match="--out"):
        append(path, RUN, {})


def test_records_and_systems_reached() -> None:
    def system(name: str, gammas: list[float], best_known: float) -> list[CompleibRun]:
        return [
            dataclasses.replace(RUN, name=name, seed=k, gamma=g, ratio=g / best_known, best_known=best_known)
            for k, g in enumerate(gammas)
        ]

    nine = system("NINE", 9 * [2.0019] + [2.5], 2.0)
    eight = system("EIGHT", 8 * [2.0] + 2 * [2.5], 2.0)
    new = system("NEW", 10 * [1.9], 2.0)
    vanishing = system("VANISHING", 10 * [1e-6], 1e-5)
    first, records, worse = compleib_section(nine + eight + new + vanishing)[:3]
    assert "3 of 4" in first
    assert "NEW 1.9 (known 2)" in records
    assert "NINE" not in records
    assert "VANISHING" not in records
    assert worse.endswith("NINE, EIGHT.")


def test_sizes_are_told_apart_by_what_varies() -> None:
    runs = [
        ScalingRun(
            n_x=size.n_x, n_models=size.n_models, n_parameters=size.n_parameters, order=1, n_u=1, n_y=4, gamma=1.0,
            lower_bound=np.nan, optimality=0.0, slicot=1.0, trials=1, exact=1, every_model=1, saving=1.0, jobs=1,
            wall=7.0, cpu=1.0, status="",
        )
        for size in scaling.SIZES
    ]  # fmt: skip
    lines = scaling_section(runs)
    assert f"- {LARGE.n_x} states, 20 plants, 40 parameters: 7 s" in lines[0]
    counts = dict.fromkeys(("States", "Plants", "Parameters", "Others"), 0)
    name = ""
    for line in lines:
        name = line.removeprefix("### ") if line.startswith("### ") else name
        if name and line.startswith("| ") and not line.startswith("| states"):
            counts[name] += 1
    assert counts == {"States": 4, "Plants": 3, "Parameters": 3, "Others": 1}


def test_the_report_comes_from_the_files_alone(tmp_path: Path) -> None:
    append(files(tmp_path)["compleib"], RUN, {"numpy": "1"})
    append(files(tmp_path)["compleib"], dataclasses.replace(RUN, seed=1), {"numpy": "2"})
    page = write_report(tmp_path).read_text("utf-8")
    assert "numpy 1 or 2" in page
    assert "| ONE | 0 | 2 | 2 |" in page
