"""The benchmarks run, refuse to compare different answers, and report what the times depend on. No time is tested."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.__main__ import REGISTERED, main
from benchmarks.runner import environment, measure, write_results
from lpvhinf.errors import LpvHinfError


@pytest.mark.parametrize("name", REGISTERED)
def test_smallest_case(name: str, tmp_path: Path) -> None:
    benchmark = REGISTERED[name]
    timing = measure(benchmark, next(iter(benchmark.cases())), samples=2)
    assert timing.ratio_lowest <= timing.ratio <= timing.ratio_highest
    write_results(tmp_path, [benchmark], [timing], environment())
    with (tmp_path / "results.csv").open(encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert row["benchmark"] == name
    assert row["processor"]
    assert row["numpy"]
    report = (tmp_path / "report.md").read_text("utf-8")
    assert timing.size in report
    assert "## Limitations" in report
    assert benchmark.limitation in report


@pytest.mark.parametrize("name", REGISTERED)
def test_a_wrong_answer_is_not_timed(name: str) -> None:
    benchmark = REGISTERED[name]
    case = next(iter(benchmark.cases()))
    wrong = replace(case, ours=lambda: 0.5 * case.ours())
    with pytest.raises(LpvHinfError, match="differ"):
        measure(benchmark, wrong, samples=1)


def test_unknown_benchmark_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["nothing"])
    assert "known: sampling, hinf-norm" in capsys.readouterr().err
