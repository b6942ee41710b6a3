"""Guards files against half-written, damaged and foreign content."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path

import numpy as np
import pytest

from lpvhinf.errors import LpvHinfError, StorageError
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import atomic, plain, read_arrays, read_json, write_arrays, write_json, write_text

KIND = "tests.kind"


def failing_write(path: Path) -> None:
    with atomic(path) as temporary:
        temporary.write_text("half a fi")
        raise RuntimeError("stopped")


@pytest.mark.parametrize("exists", [True, False])
def test_an_exception_leaves_the_old_file_and_no_litter(tmp_path: Path, exists: bool) -> None:
    path = tmp_path / "result.txt"
    if exists:
        write_text(path, "old")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(RuntimeError, match="stopped"):
        failing_write(path)
    assert sorted(tmp_path.iterdir()) == before
    assert not exists or path.read_text() == "old"


def test_arrays_that_cannot_be_written_leave_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    write_arrays(path, KIND, {"x": np.arange(3)})
    with pytest.raises(ValueError):
        write_arrays(path, KIND, {"x": [[1.0], [1.0, 2.0]]})
    assert read_arrays(path, KIND)["x"].tolist() == [0, 1, 2]
    assert list(tmp_path.iterdir()) == [path]


def test_written_files_are_whole_and_readable(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "a.txt"
    write_text(path, "first")
    write_text(path, "Ω second")
    assert path.read_text(encoding="utf-8") == "Ω second"
    assert stat.S_IMODE(os.stat(path).st_mode) == 0o644
    assert list(path.parent.iterdir()) == [path]


def test_json_round_trip(tmp_path: Path) -> None:
    value = {
        "b": np.float64(1.5),
        "a": [np.int64(3), np.nan, -np.inf, (1, 2)],
        "c": np.array([[1.0, np.nan]]),
        4: np.bool_(True),
    }
    path = tmp_path / "a.json"
    write_json(path, value)
    assert read_json(path) == {"b": 1.5, "a": [3, None, None, [1, 2]], "c": [[1.0, None]], "4": True}
    text = path.read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    assert [line[2:5] for line in text.splitlines() if line.startswith('  "')] == ['"4"', '"a"', '"b"', '"c"']


def test_plain_keeps_what_json_knows() -> None:
    value = {"x": [1, 2.5, "text", None, True, {"y": []}]}
    assert plain(value) == value
    json.dumps(plain({"x": np.linspace(0, 1, 3), "y": np.float32(0.5)}), allow_nan=False)


@pytest.mark.parametrize("content", ["", '{"a": 1', "\x00\xff"])
def test_damaged_json(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(StorageError, match="Delete it and run again"):
        read_json(path)


@pytest.mark.parametrize("read", [read_json, lambda path: read_arrays(path, KIND)])
def test_missing_files(tmp_path: Path, read: object) -> None:
    assert callable(read)
    with pytest.raises(StorageError, match="nowhere"):
        read(tmp_path / "nowhere")


def test_every_truncation_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    write_arrays(path, KIND, {"x": np.random.default_rng(0).standard_normal((10, 3)), "y": np.arange(4)})
    whole = path.read_bytes()
    for length in [0, 1, 30, len(whole) // 3, len(whole) // 2, len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(StorageError, match=r"data\.npz cannot be read"):
            read_arrays(path, KIND)


def test_flipped_bytes_are_never_taken_for_data(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    x = np.random.default_rng(0).standard_normal(300)
    write_arrays(path, KIND, {"x": x})
    whole = path.read_bytes()
    noticed = 0
    for k in range(0, len(whole), 7):
        path.write_bytes(whole[:k] + bytes([whole[k] ^ 0xFF]) + whole[k + 1 :])
        try:
            found = read_arrays(path, KIND)
        except StorageError:
            noticed += 1
        else:  # a byte that carries no data, such as a date
            assert np.array_equal(found.get("x", x), x)
    assert noticed > 0.8 * len(range(0, len(whole), 7))


def test_foreign_files(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    write_arrays(path, "another.kind", {"x": np.zeros(2)})
    with pytest.raises(StorageError, match=r"not a file of kind 'tests\.kind'"):
        read_arrays(path, KIND)
    np.savez(path, x=np.zeros(2))
    with pytest.raises(StorageError, match="not a file of kind"):
        read_arrays(path, KIND)
    np.savez(path, __kind__=np.array(KIND), __format__=np.array(99))
    with pytest.raises(StorageError, match="format 1"):
        read_arrays(path, KIND)
    np.save(tmp_path / "single.npy", np.zeros(2))
    with pytest.raises(StorageError, match="cannot be read"):
        read_arrays(tmp_path / "single.npy", KIND)
    path.write_text("not an archive")
    with pytest.raises(StorageError, match="cannot be read"):
        read_arrays(path, KIND)


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    np.savez(path, __kind__=np.array(KIND), __format__=np.array(1), x=np.array([{"a": 1}], dtype=object))
    with pytest.raises(StorageError, match="cannot be read"):
        read_arrays(path, KIND)


def test_storage_errors_are_ours_and_the_systems() -> None:
    assert issubclass(StorageError, LpvHinfError)
    assert issubclass(StorageError, OSError)


def test_lpv_state_space_round_trip(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    box = [[-0.1, 0.3], [1.0, 2.0]]
    shapes = [(3, 2, 4, 4), (1, 1, 4, 2), (2, 5, 3, 4), (3, 2)]
    system = LPVStateSpace.from_coefficients(*(rng.standard_normal(shape) for shape in shapes), box=box)
    path = tmp_path / "system.npz"
    system.save(path)
    loaded = LPVStateSpace.load(path)
    assert np.array_equal(loaded.box, system.box)
    for ours, theirs in zip(loaded.matrices, system.matrices, strict=True):
        assert np.array_equal(ours.coefficients, theirs.coefficients)
    write_arrays(path, "another.kind", {})
    with pytest.raises(StorageError, match="LPVStateSpace"):
        LPVStateSpace.load(path)
