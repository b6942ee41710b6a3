"""The benchmark of structured synthesis: resumes, reports, and skips where the data are missing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hinfstruct.__main__ import main
from benchmarks.hinfstruct.report import read_runs
from tests.hinfstruct.plants import first_order


def folder_with_one_system(folder: Path) -> Path:
    P = first_order()
    folder.mkdir()
    np.savez(folder / "ONE.npz", A=P.A, B1=P.B1, B=P.B2, C1=P.C1, C=P.C2, D11=P.D11, D12=P.D12, D21=P.D21)
    known = {"best_known_gamma": 1.0 + np.sqrt(3.0), "hifoo": {"gamma": 2.8, "cpu_s": 0.1}}
    (folder / "reference.json").write_text(json.dumps({"systems": {"ONE": known}}))
    return folder


def test_runs_resumes_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data, out = folder_with_one_system(tmp_path / "data"), tmp_path / "out"
    assert main(["--seeds", "1", "--data", str(data), "--out", str(out)]) == 0
    (first,) = read_runs(out / "hinfstruct.csv")
    assert first.ratio == pytest.approx(1.0, abs=1e-6)
    assert first.slicot == pytest.approx(1.0, abs=1e-6)
    assert main(["--seeds", "2", "--data", str(data), "--out", str(out)]) == 0
    again = read_runs(out / "hinfstruct.csv")
    assert [run.seed for run in again] == [0, 1]
    assert again[0] == first
    page = (out / "hinfstruct.md").read_text("utf-8")
    assert "1 of 1" in page
    assert "## Limitations" in page
    assert capsys.readouterr().out.count("seed 0") == 1


def test_missing_data_are_no_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--data", str(tmp_path), "--out", str(tmp_path)]) == 0
    assert "skipped" in capsys.readouterr().out


def test_an_unknown_system_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["TWO", "--data", str(folder_with_one_system(tmp_path / "data"))])
    assert "known: ONE" in capsys.readouterr().err
