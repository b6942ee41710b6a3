"""Timing both ways of every case in turns, so that load on the machine meets both alike."""

from __future__ import annotations

import csv
import gc
import io
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any, Final

from benchmarks.benchmark import Benchmark, Case
from lpvhinf.errors import LpvHinfError
from lpvhinf.storage import write_text

PACKAGES: Final = ("lpvhinf", "numpy", "scipy", "slycot", "control", "cvxpy", "clarabel")
SHORTEST: Final = 0.02  # s: a sample repeats a call until it takes at least this long


@dataclass(frozen=True, kw_only=True)
class Timing:
    """The outcome of one case; times in seconds are medians, a ratio above 1 means that ours is faster."""

    benchmark: str
    size: str
    seconds_ours: float
    seconds_baseline: float
    ratio: float
    ratio_lowest: float
    ratio_highest: float
    difference: float
    samples: int


def measure(benchmark: Benchmark, case: Case, *, samples: int) -> Timing:
    """Check that both ways agree, then time them in turns.

    Raises
    ------
    LpvHinfError
        If the answers differ by more than the case accepts.
    """
    difference = case.difference(case.ours(), case.baseline())
    low, high = case.accepted
    if not low <= difference <= high:
        raise LpvHinfError(
            f"benchmark {benchmark.name} ({case.size}): the two ways differ by {difference:.2e}, wanted {low:g} to "
            f"{high:g}. Find out which one is wrong before their times are compared."
        )
    calls_ours, calls_baseline = _calls(case.ours), _calls(case.baseline)
    pairs = [(_sample(case.ours, calls_ours), _sample(case.baseline, calls_baseline)) for _ in range(samples)]
    ratios = [theirs / ours for ours, theirs in pairs]
    return Timing(
        benchmark=benchmark.name,
        size=case.size,
        seconds_ours=median(ours for ours, _ in pairs),
        seconds_baseline=median(theirs for _, theirs in pairs),
        ratio=median(ratios),
        ratio_lowest=min(ratios),
        ratio_highest=max(ratios),
        difference=difference,
        samples=samples,
    )


def run(benchmarks: Iterable[Benchmark], *, samples: int) -> Iterator[Timing]:
    """All cases of `benchmarks`, one after the other."""
    for benchmark in benchmarks:
        for case in benchmark.cases():
            yield measure(benchmark, case, samples=samples)


def _sample(call: Callable[[], Any], calls: int) -> float:
    """Seconds a call, over `calls` of them with the garbage collector at rest."""
    gc.collect()
    enabled = gc.isenabled()
    gc.disable()
    try:
        start = time.perf_counter()
        for _ in range(calls):
            call()
        return (time.perf_counter() - start) / calls
    finally:
        if enabled:
            gc.enable()


def _calls(call: Callable[[], Any]) -> int:
    """How many calls make up one sample."""
    return max(1, round(SHORTEST / max(_sample(call, 1), 1e-9)))


def environment() -> dict[str, str]:
    """What the times depend on: processor, threads, Python and packages."""
    found = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "threads": os.environ.get("OPENBLAS_NUM_THREADS", "not limited"),
        "python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def write_results(
    folder: Path, benchmarks: Iterable[Benchmark], timings: list[Timing], where: Mapping[str, str]
) -> None:
    """Write results.csv, one row a case with the environment in every row, and report.md."""
    buffer = io.StringIO()
    rows = [asdict(timing) | dict(where) for timing in timings]
    writer = csv.DictWriter(buffer, fieldnames=list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(folder / "results.csv", buffer.getvalue())
    write_text(folder / "report.md", report(benchmarks, timings, where))


def report(benchmarks: Iterable[Benchmark], timings: list[Timing], where: Mapping[str, str]) -> str:
    """The results as a page of Markdown."""
    chosen = list(benchmarks)
    lines = ["# Benchmarks", "", "A ratio above 1 means that the way of this package is faster.", ""]
    for benchmark in chosen:
        lines += [f"## {benchmark.name}", "", benchmark.question, ""]
        lines += [f"- Ours: {benchmark.ours}.", f"- Baseline: {benchmark.baseline}.", ""]
        lines += ["| size | ours [ms] | baseline [ms] | ratio | range of ratios | difference |"]
        lines += ["|---|---:|---:|---:|---:|---:|"]
        lines += [
            f"| {t.size} | {1e3 * t.seconds_ours:.3g} | {1e3 * t.seconds_baseline:.3g} | {t.ratio:.3g} "
            f"| {t.ratio_lowest:.3g} to {t.ratio_highest:.3g} | {t.difference:.1e} |"
            for t in timings
            if t.benchmark == benchmark.name
        ]
        lines += ["", f"Difference: {benchmark.difference}.", ""]
    lines += ["## Machine and versions", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in where.items()]
    lines += ["", "## Limitations", ""]
    lines += [
        "- Ratios are measured in turns within one run on one machine; another processor or BLAS gives other ratios.",
        "- Times are medians over a few samples, on a machine that may have had other work; read the range of ratios.",
        "- One thread. Building the problems is not timed.",
    ]
    lines += [f"- {benchmark.name}: {benchmark.limitation}" for benchmark in chosen]
    return "\n".join(lines) + "\n"
