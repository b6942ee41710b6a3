"""What the figures of the plant read from a results folder of the study plant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lpvhinf.storage import read_arrays

ARRAYS = "lpvhinf.PlantStudy"


def arrays(results: Path, part: str) -> dict[str, Any]:
    """The arrays of one part of the study; a `StorageError` if they are missing or damaged."""
    return dict(read_arrays(results / "parts" / part / "arrays.npz", ARRAYS))
