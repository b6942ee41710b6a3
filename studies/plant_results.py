"""The results folder of the study of the plant: each part a folder with figures and arrays, whole or not there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lpvhinf.errors import StorageError
from lpvhinf.storage import read_arrays, read_json, write_arrays, write_json
from studies.results import belongs

ARRAYS = "lpvhinf.PlantStudy"


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a part of the study finds: `values` for the report, and the arrays that they come from."""

    values: Mapping[str, Any]
    arrays: Mapping[str, Any]


def save(folder: Path, key: str, found: Found) -> None:
    """Store a part; the summary comes last, as it says that the part is finished."""
    write_arrays(folder / "arrays.npz", ARRAYS, found.arrays)
    write_json(folder / "summary.json", {"fingerprint": key, **found.values})


def finished(folder: Path, key: str) -> bool:
    """Whether a folder holds a finished part of this key, every file readable."""
    try:
        read_arrays(folder / "arrays.npz", ARRAYS)
        summary = read_json(folder / "summary.json")
    except StorageError:
        return False
    return belongs(summary, key)
