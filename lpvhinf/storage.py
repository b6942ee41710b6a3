"""Files that are whole or not there: everything is written beside its place and then moved into it."""

from __future__ import annotations

import fcntl
import json
import os
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.errors import StorageError

FORMAT = 1


@contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; it replaces `path` when the block ends without an error."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def one_at_a_time(path: str | os.PathLike[str]) -> Iterator[None]:
    """Let one process after another into the block, for work whose result they then share at `path`.

    The lock is a file beside `path`. It ends with the process that holds it, however that ends; where the folder
    cannot be written there is nothing to share, and nobody waits.
    """
    lock = Path(path).with_name(f".{Path(path).name}.lock")
    try:
        make_folder(lock.parent)
        stream = lock.open("w")
    except (OSError, StorageError):
        yield
        return
    with stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder, with its parents, if it is not there; a `StorageError` if that cannot be."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"{path} cannot be a folder: {error}. Choose another path.") from error
    return Path(path)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file atomically."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def plain(value: Any) -> Any:
    """`value` with NumPy numbers and arrays turned into what JSON knows; NaN and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def write_json(path: str | os.PathLike[str], value: Any) -> None:
    """Write a JSON file atomically, indented, with a stable order of keys."""
    write_text(path, json.dumps(plain(value), indent=2, sort_keys=True, allow_nan=False) + "\n")


def read_json(path: str | os.PathLike[str]) -> Any:
    """The content of a JSON file; a `StorageError` if it is missing or damaged."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StorageError(f"{path} cannot be read as JSON: {error}. Delete it and run again.") from error


def write_arrays(path: str | os.PathLike[str], kind: str, arrays: Mapping[str, Any]) -> None:
    """Write arrays as .npz, atomically and without pickle; `kind` is checked on reading."""
    with atomic(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, __kind__=np.array(kind), __format__=np.array(FORMAT), **dict(arrays))


def read_arrays(path: str | os.PathLike[str], kind: str) -> dict[str, np.ndarray[Any, Any]]:
    """The arrays of a file of ours; a `StorageError` if it is missing, damaged or of another kind."""
    try:
        # an archive or nothing: NumPy would take other files for a single array or a pickle
        with zipfile.ZipFile(path), np.load(path, allow_pickle=False) as data:
            found = {name: data[name] for name in data.files}
    except (OSError, ValueError, KeyError, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        raise StorageError(f"{path} cannot be read as arrays: {error}. Delete it and run again.") from error
    if str(found.pop("__kind__", "unknown")) != kind or int(found.pop("__format__", -1)) != FORMAT:
        raise StorageError(f"{path} is not a file of kind {kind!r}, format {FORMAT}. Check the path.")
    return found
