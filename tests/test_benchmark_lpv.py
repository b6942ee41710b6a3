"""The benchmark of LPV synthesis: both ways agree, runs are kept, a solver that fails is told. No time is tested."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.hinfstruct.store import read_rows
from benchmarks.lpv.__main__ import main
from benchmarks.lpv.cases import OURS, SIZES, TINY, inequalities, plant
from benchmarks.lpv.report import FILE, LPVRun
from benchmarks.lpv.worker import in_a_process, solved


@pytest.mark.slow
def test_runs_resumes_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wanted = ["--tiny", "--limit", "60", "--solver", OURS, "--solver", "clarabel", "--out", str(tmp_path)]
    assert main(wanted) == 0
    rows = read_rows(tmp_path / FILE, LPVRun)
    assert len(rows) == 2 * len(TINY)
    for ours, theirs in zip(rows[: len(TINY)], rows[len(TINY) :], strict=True):
        assert ours.run.gamma_lower <= ours.run.gamma == pytest.approx(theirs.run.gamma, rel=1e-4)
        assert ours.run.margin > 0.0
    capsys.readouterr()
    assert main(wanted) == 0
    assert "gamma" not in capsys.readouterr().out
    assert read_rows(tmp_path / FILE, LPVRun) == rows
    assert "## Limitations" in (tmp_path / "lpv.md").read_text("utf-8")


def test_a_worker_agrees_with_a_solve_here() -> None:
    here, there = solved(TINY[0], OURS, 1e-4, 60.0), in_a_process(TINY[0], OURS, 1e-4, 60.0)
    assert here["status"] == there["status"]
    assert here["gamma"] == pytest.approx(there["gamma"], rel=1e-9)


def test_a_solver_that_is_not_there_is_told() -> None:
    assert "wanted one" in solved(TINY[0], "nothing", 1e-4, 60.0)["status"]


def test_sizes_are_what_they_say() -> None:
    assert {size.n_x for size in SIZES} == {10, 20, 40, 60, 80}
    for size in (*TINY, SIZES[1]):
        lmis = inequalities(size)
        unknowns = {u.name: u for u in lmis.problem.unknowns}
        assert unknowns["R"].count == size.n_basis
        assert unknowns["R"].size == size.n_x


def test_the_bar_has_one_rigid_mode_and_sensors_that_move() -> None:
    one, other = plant(10, 0.0), plant(10, 1.0)
    assert np.sum(np.abs(np.linalg.eigvals(one.A)) < 1e-6) == 2
    np.testing.assert_array_equal(one.A, other.A)
    assert not np.allclose(one.C2, other.C2)


@pytest.mark.parametrize("option", ["--limit", "--gap", "--largest"])
def test_wrong_options(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([option, "0"])
    assert "above 0" in capsys.readouterr().err
