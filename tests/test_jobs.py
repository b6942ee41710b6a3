"""Guards the jobs of a study: results in order, progress under its job's name, and errors that end the others."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from lpvhinf.errors import SynthesisError
from lpvhinf.jobs import run_jobs
from lpvhinf.progress import Progress


class Recorder(Progress):
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.stages, self.messages, self.steps = list[str](), list[str](), 0

    def stage(self, name: str, total: int | None = None) -> None:
        self.stages.append(name)

    def update(self, advance: int = 1, **values: float) -> None:
        self.steps += advance

    def log(self, message: str) -> None:
        self.messages.append(message)


def work(value: int, progress: Progress) -> tuple[int, int]:
    """The square, and the process that computed it."""
    progress.stage("squaring", 1)
    progress.update()
    progress.log(f"{value} squared")
    return value**2, os.getpid()


def fail(value: int, progress: Progress) -> int:
    """An error for one value."""
    if value == 3:
        raise SynthesisError("three cannot be stabilised")
    return value


def fail_or_take_long(value: int, ended: Path, progress: Progress) -> int:
    """An error at once, or a file after a long time."""
    if value == 0:
        raise SynthesisError("zero cannot be stabilised")
    time.sleep(15.0)
    ended.touch()
    return value


TASKS = [(f"job {value}", (value,)) for value in (2, 3, 5)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_order_and_progress_is_named(jobs: int) -> None:
    listener = Recorder()
    results = run_jobs(work, TASKS, jobs=jobs, progress=listener)
    assert [square for square, _ in results] == [4, 9, 25]
    assert all((process == os.getpid()) == (jobs == 1) for _, process in results)
    assert sorted(listener.stages) == ["job 2: squaring", "job 3: squaring", "job 5: squaring"]
    assert sorted(listener.messages) == ["job 2: 2 squared", "job 3: 3 squared", "job 5: 5 squared"]
    assert listener.steps == (3 if jobs == 1 else 0)  # single steps would flood the channel


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_of_a_job_is_the_runs(jobs: int) -> None:
    with pytest.raises(SynthesisError, match="three cannot be stabilised"):
        run_jobs(fail, TASKS, jobs=jobs, progress=Recorder())


def test_an_error_ends_the_other_jobs(tmp_path: Path) -> None:
    tasks = [(f"job {value}", (value, tmp_path / f"{value}")) for value in (0, 1, 2)]
    with pytest.raises(SynthesisError, match="zero cannot be stabilised"):
        run_jobs(fail_or_take_long, tasks, jobs=2, progress=Recorder())
    assert not list(tmp_path.iterdir())


def test_one_job_needs_no_process() -> None:
    assert run_jobs(work, TASKS[:1], jobs=4, progress=Recorder()) == [(4, os.getpid())]


def test_no_job() -> None:
    assert run_jobs(work, [], jobs=2, progress=Recorder()) == []
