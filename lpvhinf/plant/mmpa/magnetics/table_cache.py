"""The tables of single magnets: built over processes, and kept on disk."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.errors import StorageError
from lpvhinf.jobs import run_jobs
from lpvhinf.plant.mmpa.magnetics import single_magnet
from lpvhinf.plant.mmpa.magnetics.single_magnet import MagnetKind, Winding, single_magnet_wrench
from lpvhinf.plant.mmpa.magnetics.superposition import OffsetGrid
from lpvhinf.plant.mmpa.magnets import TURN
from lpvhinf.progress import Progress
from lpvhinf.storage import one_at_a_time, read_arrays, write_arrays

KIND = "lpvhinf.MagnetTables"
FORMAT = 1  # of what the tables mean; another number makes every cached file stale
Task = tuple[MagnetKind, Winding, OffsetGrid]


def cache_folder() -> Path:
    """Where tables are kept: `LPVHINF_CACHE`, else the user's cache folder.

    A file holds the tables of one magnet array and stator, about 30 MB; any of them may be deleted at any time.
    """
    own = os.environ.get("LPVHINF_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lpvhinf"


def single_magnet_tables(
    tasks: list[Task], *, cache: bool | str | os.PathLike[str], jobs: int, progress: Progress
) -> list[Array]:
    """The table (n_x, n_y, 6) of every task, from the cache if it is there.

    A missing, damaged or stale file is built anew and replaced, which the progress's log says. Where the folder
    cannot be written the tables are built and used all the same.
    """
    description = _description(tasks)
    path = _path(cache, description)
    if path is None:
        return _build_all(tasks, jobs, progress)
    with one_at_a_time(path):  # jobs that start together build the tables once
        if path.is_file():
            try:
                return _read(path, description, tasks)
            except StorageError as error:
                progress.log(f"the cached magnetic tables are not usable and are built anew: {error}")
        tables = _build_all(tasks, jobs, progress)
        try:
            arrays: dict[str, Any] = {f"table_{k}": table for k, table in enumerate(tables)}
            write_arrays(path, KIND, {"description": np.array(description), **arrays})
        except OSError as error:
            progress.log(f"the magnetic tables cannot be kept in {path}: {error}. Set LPVHINF_CACHE to a folder.")
    return tables


def _build_all(tasks: list[Task], jobs: int, progress: Progress) -> list[Array]:
    progress.log(f"building {len(tasks)} magnetic tables, once: about half a minute")
    progress.stage("magnetic tables", len(tasks))
    named = [(f"magnetic table {k + 1} of {len(tasks)}", task) for k, task in enumerate(tasks)]
    return [np.asarray(read_only(table)) for table in run_jobs(_build, named, jobs=jobs, progress=progress)]


def _build(kind: MagnetKind, winding: Winding, grid: OffsetGrid, progress: Progress) -> Array:
    table = single_magnet_wrench(kind, winding, grid.x, grid.y)
    progress.update()
    return table


def _description(tasks: list[Task]) -> str:
    """Everything that the tables depend on, as text."""
    from importlib.metadata import version

    parts = [
        {
            "size": kind.size,
            "direction": kind.direction,
            "height": kind.height,
            "winding": [np.asarray(part).tolist() for part in winding],
            "grid": [grid.step, grid.n_x, grid.n_y],
        }
        for kind, winding, grid in tasks
    ]
    numerics = [FORMAT, single_magnet.FIELD_SPACING, single_magnet.DEGREE, TURN, version("magpylib")]
    return json.dumps([numerics, parts])


def _path(cache: bool | str | os.PathLike[str], description: str) -> Path | None:
    if cache is False:
        return None
    folder = cache_folder() if cache is True else Path(cache)
    return folder / f"magnets-{hashlib.sha256(description.encode()).hexdigest()[:16]}.npz"


def _read(path: Path, description: str, tasks: list[Task]) -> list[Array]:
    found = read_arrays(path, KIND)
    if str(found.get("description")) != description:
        raise StorageError(f"{path} was made from other parameters. It is replaced.")
    tables = []
    for k, (_, _, grid) in enumerate(tasks):
        table = found.get(f"table_{k}")
        shape = (2 * grid.n_x + 1, 2 * grid.n_y + 1, 6)
        if table is None or table.shape != shape or not np.all(np.isfinite(table)):
            raise StorageError(f"{path} lacks a finite table of shape {shape}. It is replaced.")
        tables.append(np.asarray(read_only(table)))
    return tables
