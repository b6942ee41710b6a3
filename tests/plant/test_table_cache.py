"""The magnetic tables on disk: built once, kept under a key of all parameters, replaced when damaged or stale."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.plant.mmpa import MMPAParameters, coil_layers
from lpvhinf.plant.mmpa.magnetics import cache_folder, table_cache
from lpvhinf.plant.mmpa.magnetics.single_magnet import MagnetKind, Winding
from lpvhinf.plant.mmpa.magnetics.superposition import OffsetGrid
from lpvhinf.plant.mmpa.magnetics.table_cache import single_magnet_tables
from lpvhinf.progress import SILENT, Progress

P = MMPAParameters(filaments_width=1, filaments_height=1)
KIND = MagnetKind(size=(0.03, 0.03, 0.01), direction=(0.0, 0.0, 1.0), height=-0.009)
GRID = OffsetGrid(step=0.005, n_x=2, n_y=1)
TASKS = [(KIND, Winding.of(layer), GRID) for layer in coil_layers(P)]


class Log(Progress):
    def __init__(self) -> None:
        self.lines: list[str] = []
        self.stages: list[tuple[str, int | None]] = []

    def log(self, message: str) -> None:
        self.lines.append(message)

    def stage(self, name: str, total: int | None = None) -> None:
        self.stages.append((name, total))


def tables(cache: bool | Path, progress: Progress = SILENT, jobs: int = 1, tasks: list = TASKS) -> list[Array]:  # type: ignore[type-arg]
    return single_magnet_tables(tasks, cache=cache, jobs=jobs, progress=progress)


def the_file(folder: Path) -> Path:
    (file,) = folder.glob("*.npz")
    return file


def test_second_time_from_disk(tmp_path: Path):
    first, second = Log(), Log()
    built = tables(tmp_path, first)
    kept = tables(tmp_path, second)
    assert [t.shape for t in built] == [(5, 3, 6)] * 2
    assert all(np.array_equal(a, b) for a, b in zip(built, kept, strict=True))
    assert any("building 2 magnetic tables" in line for line in first.lines)
    assert ("magnetic tables", 2) in first.stages
    assert second.lines == []
    assert not kept[0].flags.writeable


def test_over_processes(tmp_path: Path):
    log = Log()
    together = tables(tmp_path, log, jobs=2)
    assert all(np.array_equal(a, b) for a, b in zip(together, tables(False), strict=True))
    assert log.stages


@pytest.mark.parametrize("damage", ["truncated", "empty", "other file", "wrong shape", "not finite", "stale"])
def test_unusable_file_is_replaced(tmp_path: Path, damage: str, monkeypatch: pytest.MonkeyPatch):
    built = tables(tmp_path)
    file = the_file(tmp_path)
    whole = file.read_bytes()
    if damage == "truncated":
        file.write_bytes(whole[: len(whole) // 2])
    elif damage == "empty":
        file.write_bytes(b"")
    elif damage == "other file":
        np.savez(file, x=np.zeros(3))
    else:
        description = table_cache._description(TASKS)
        arrays = {f"table_{k}": table.copy() for k, table in enumerate(built)}
        if damage == "wrong shape":
            arrays["table_1"] = arrays["table_1"][:2]
        elif damage == "not finite":
            arrays["table_0"][0, 0, 0] = np.nan
        else:
            description = "[0, []]"
        table_cache.write_arrays(file, table_cache.KIND, {"description": np.array(description), **arrays})
    log = Log()
    assert all(np.array_equal(a, b) for a, b in zip(tables(tmp_path, log), built, strict=True))
    assert any("not usable and are built anew" in line for line in log.lines)
    silent = Log()
    tables(tmp_path, silent)
    assert silent.lines == []  # the file was replaced by a good one


@pytest.mark.parametrize("part", ["kind", "winding", "grid", "numerics"])
def test_key_knows_every_parameter(tmp_path: Path, part: str, monkeypatch: pytest.MonkeyPatch):
    tables(tmp_path)
    kind, winding, grid = TASKS[0]
    changed = list(TASKS)
    if part == "kind":
        changed[0] = (replace(kind, size=(0.031, 0.03, 0.01)), winding, grid)
    elif part == "winding":
        changed[0] = (kind, winding._replace(turns=1.01 * winding.turns), grid)
    elif part == "grid":
        changed[0] = (kind, winding, replace(grid, step=0.0051))
    else:
        monkeypatch.setattr(table_cache, "FORMAT", 99)
    log = Log()
    tables(tmp_path, log, tasks=changed)
    assert any("building" in line for line in log.lines)
    assert len(list(tmp_path.glob("*.npz"))) == 2


def test_without_cache_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("LPVHINF_CACHE", str(tmp_path / "here"))
    tables(False)
    assert not (tmp_path / "here").exists()
    tables(True)
    assert the_file(tmp_path / "here")


def test_folder_that_cannot_be_written(tmp_path: Path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    log = Log()
    assert len(tables(blocked / "cache", log)) == 2
    assert any("cannot be kept" in line and "LPVHINF_CACHE" in line for line in log.lines)


def test_places_of_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.delenv("LPVHINF_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "lpvhinf"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    assert cache_folder() == Path.home() / ".cache" / "lpvhinf"
    monkeypatch.setenv("LPVHINF_CACHE", str(tmp_path / "own"))
    assert cache_folder() == tmp_path / "own"
