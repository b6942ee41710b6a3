"""Guards that a study can be interrupted, damaged or changed, and then does no more and no less than it must."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.progress import SILENT, Progress
from lpvhinf.storage import read_arrays, read_json, write_arrays, write_json
from studies import codesign_folder, output_observer
from studies.output_observer import Job, Settings, jobs_of, key_of, run, run_design
from studies.output_observer_report import write_report

SMALLEST = Settings(
    f_bw=40.0,
    n_flex=1,
    n_plant_modes=2,
    epsilon=0.1,
    epsilons=(0.1,),
    degree=6,
    n_positions=4,
    exchange_rounds=0,
    n_search=1,
    starts=1,
    max_iterations=1,
    stability_grid=2,
    measure_grid=2,
    response_grid=1,
    with_Ty=False,
    magnetics="first-harmonic",
)
CONVENTIONAL: Job = jobs_of(SMALLEST)[0][0]
OBSERVER: Job = jobs_of(SMALLEST)[1][0]


class Recorder(Progress):
    """Keeps what it hears, and interrupts when a message contains `stop`."""

    def __init__(self, stop: str | None = None) -> None:
        self.stop, self.stages, self.messages = stop, list[str](), list[str]()

    def stage(self, name: str, total: int | None = None) -> None:
        if self.stop is not None and self.stop in name:
            raise KeyboardInterrupt
        self.stages.append(name)

    def log(self, message: str) -> None:
        self.messages.append(message)


class Reached(Exception):
    """`codesign` was called: the design is made anew."""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What `codesign` is asked for, without doing it."""
    options: dict[str, Any] = {}

    def stop(*_: Any, **given: Any) -> None:
        options.update(given)
        raise Reached

    monkeypatch.setattr(output_observer, "codesign", stop)
    return options


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the finished conventional design, after an interrupt in the second design."""
    folder = tmp_path_factory.mktemp("finished")
    listener = Recorder("conventional-rigid: rigid-body")
    with pytest.raises(KeyboardInterrupt):
        run(SMALLEST, folder, listener)
    assert any(name.startswith("conventional: ") for name in listener.stages)
    return folder


@pytest.fixture
def folder(finished: Path, tmp_path: Path) -> Path:
    """A copy that a test may damage."""
    return Path(shutil.copytree(finished, tmp_path / "copy"))


def stamps(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}


def save_always(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(codesign_folder, "SAVE_EVERY", 0.0)


def test_an_interrupt_leaves_finished_designs_and_no_report(finished: Path) -> None:
    assert (finished / "designs/conventional/summary.json").is_file()
    assert not (finished / "designs/conventional-rigid/summary.json").exists()
    assert not (finished / "report.json").exists()


def test_a_run_goes_on_after_an_interrupt(folder: Path) -> None:
    before = stamps(folder / "designs/conventional")
    listener = Recorder()
    run(SMALLEST, folder, listener)
    assert "conventional: taken from the results folder" in listener.messages
    assert not [name for name in listener.stages if name.startswith("conventional: ")]
    assert any(name.startswith("observer: ") for name in listener.stages)
    assert stamps(folder / "designs/conventional") == before
    assert set(read_json(folder / "report.json")["designs"]) == {"conventional", "conventional-rigid", "observer"}
    assert not list(folder.rglob("checkpoint.npz"))
    assert not [path for path in folder.rglob(".*") if path.is_file()]

    again = Recorder()
    run(SMALLEST, folder, again)
    assert len([message for message in again.messages if message.endswith("taken from the results folder")]) == 3
    assert again.stages == []


def test_a_checkpoint_is_gone_on_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_always(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        run_design(SMALLEST, CONVENTIONAL, tmp_path, Recorder("worst position"))
    folder = tmp_path / "designs" / CONVENTIONAL.name
    left = read_arrays(folder / "checkpoint.npz", codesign_folder.CHECKPOINT)
    assert not (folder / "summary.json").exists()
    listener = Recorder()
    run_design(SMALLEST, CONVENTIONAL, tmp_path, listener)
    assert listener.messages[0] == f"going on from a checkpoint at gamma {float(left['gamma']):.4f}"
    assert read_json(folder / "summary.json")["gamma"] <= float(left["gamma"]) * (1.0 + 1e-6)
    assert not (folder / "checkpoint.npz").exists()


def checkpoint(folder: Path, settings: Settings, job: Job, theta: Array) -> Path:
    """Write the checkpoint that an interrupted run of `job` leaves, by interrupting one."""
    path = folder / "designs" / job.name / "checkpoint.npz"

    def interrupted(*_: Any, checkpoint: Callable[[Array, float], None], **__: Any) -> None:
        checkpoint(theta, 3.0)
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        save_always(patch)
        patch.setattr(output_observer, "codesign", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run_design(settings, job, folder, SILENT)
    assert path.is_file()
    return path


def test_the_checkpoint_of_other_settings_is_not_used(tmp_path: Path, asked: dict[str, Any]) -> None:
    theta = np.arange(30.0)
    checkpoint(tmp_path, SMALLEST, CONVENTIONAL, theta)
    with pytest.raises(Reached):
        run_design(SMALLEST, CONVENTIONAL, tmp_path, SILENT)
    assert np.array_equal(asked["warm_start"], theta)
    with pytest.raises(Reached):
        run_design(dataclasses.replace(SMALLEST, f_bw=35.0), CONVENTIONAL, tmp_path, SILENT)
    assert asked["warm_start"] is None


@pytest.mark.parametrize("damage", [b"", b"not an archive", b"PK\x03\x04 cut off"])
def test_a_damaged_checkpoint_is_reported_and_not_used(tmp_path: Path, asked: dict[str, Any], damage: bytes) -> None:
    path = checkpoint(tmp_path, SMALLEST, CONVENTIONAL, np.zeros(30))
    path.write_bytes(damage)
    listener = Recorder()
    with pytest.raises(Reached):
        run_design(SMALLEST, CONVENTIONAL, tmp_path, listener)
    assert asked["warm_start"] is None
    assert [m for m in listener.messages if m.startswith("checkpoint not usable, starting anew: ")]


def test_a_file_of_another_kind_is_no_checkpoint(tmp_path: Path, asked: dict[str, Any]) -> None:
    path = checkpoint(tmp_path, SMALLEST, CONVENTIONAL, np.zeros(30))
    write_arrays(path, "lpvhinf.Design", {"theta": np.zeros(30), "gamma": 1.0, "key": np.array("other")})
    with pytest.raises(Reached):
        run_design(SMALLEST, CONVENTIONAL, tmp_path, SILENT)
    assert asked["warm_start"] is None


@pytest.mark.parametrize("damage", ["", '{"fingerprint": ', '{"gamma": 1.0}', '{"fingerprint": "other"}'])
@pytest.mark.usefixtures("asked")
def test_a_damaged_summary_means_a_new_design(folder: Path, damage: str) -> None:
    (folder / "designs/conventional/summary.json").write_text(damage, encoding="utf-8")
    with pytest.raises(Reached):
        run_design(SMALLEST, CONVENTIONAL, folder, SILENT)


@pytest.mark.parametrize(
    "changes",
    [
        {"f_bw": 41.0},
        {"n_plant_modes": 3},
        {"degree": 7},
        {"n_positions": 5},
        {"exchange_rounds": 1},
        {"max_iterations": 2},
        {"stability_grid": 3},
        {"seed": 1},
    ],
    ids=str,
)
@pytest.mark.usefixtures("asked")
def test_changed_settings_mean_a_new_design(folder: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(Reached):
        run_design(dataclasses.replace(SMALLEST, **changes), CONVENTIONAL, folder, SILENT)


@pytest.mark.usefixtures("asked")
def test_a_changed_job_means_a_new_design(folder: Path) -> None:
    with pytest.raises(Reached):
        run_design(SMALLEST, dataclasses.replace(CONVENTIONAL, epsilon=0.2), folder, SILENT)


@pytest.mark.parametrize("changes", [{"jobs": 2}, {"epsilons": (0.1, 0.3)}, {"with_Ty": True}], ids=str)
@pytest.mark.usefixtures("asked")
def test_settings_that_do_not_touch_a_design_keep_it(folder: Path, changes: dict[str, Any]) -> None:
    listener = Recorder()
    run_design(dataclasses.replace(SMALLEST, **changes), CONVENTIONAL, folder, listener)
    assert listener.messages == ["taken from the results folder"]


def test_an_observer_starts_from_the_conventional_design(folder: Path, asked: dict[str, Any]) -> None:
    with pytest.raises(Reached):
        run_design(SMALLEST, OBSERVER, folder, SILENT)
    design = read_arrays(folder / "designs/conventional/design.npz", "lpvhinf.Design")
    assert np.array_equal(asked["rigid_start"], design["parameters"])
    assert np.array_equal(asked["positions"], design["positions"])


@pytest.mark.usefixtures("asked")
def test_without_the_conventional_design_an_observer_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"design\.npz cannot be read as arrays.*run again"):
        run_design(SMALLEST, OBSERVER, tmp_path, SILENT)


def test_a_report_needs_every_design(folder: Path) -> None:
    write_json(folder / "run.json", {})
    keys = {job.name: key_of(SMALLEST, job) for job in (CONVENTIONAL, OBSERVER)}
    write_json(folder / "designs.json", keys)
    with pytest.raises(StorageError, match=r"observer/summary\.json cannot be read"):
        write_report(folder)
    write_json(folder / "designs.json", keys | {"conventional": "other"})
    with pytest.raises(StorageError, match=r"'conventional' in .* comes from other settings"):
        write_report(folder)


@pytest.mark.usefixtures("asked")
@pytest.mark.parametrize("name", ["design", "measures", "closed_loop"])
def test_a_design_with_a_damaged_file_is_made_anew(folder: Path, name: str) -> None:
    path = folder / "designs/conventional" / f"{name}.npz"
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(Reached):
        run_design(SMALLEST, CONVENTIONAL, folder, SILENT)
