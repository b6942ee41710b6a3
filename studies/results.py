"""Results folders: which study one comes from, and the parts in it that belong to its settings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from lpvhinf.errors import StorageError
from lpvhinf.storage import read_json

T = TypeVar("T")


def of_the_study(folder: Path, known: Mapping[str, T]) -> T:
    """What `known` has for the study that a results folder comes from.

    Raises
    ------
    StorageError
        If the folder does not say which study, or names none of `known`.
    """
    settings = read_json(folder / "settings.json")
    name: Any = settings.get("study") if isinstance(settings, dict) else None
    if name not in known:
        raise StorageError(
            f"{folder / 'settings.json'} names the study {name!r}, wanted one of {', '.join(known)}. "
            "Run the study again."
        )
    return known[name]


def belongs(summary: Any, key: str) -> bool:
    """Whether a summary was made with the settings that `key` stands for."""
    return isinstance(summary, dict) and summary.get("fingerprint") == key


def summaries(out: Path, kind: str) -> dict[str, Any]:
    """The summaries of all parts of a kind ("part", "design") that belong to a folder's settings, in their order.

    Raises
    ------
    StorageError
        If one is missing, or was made with other settings.
    """
    found = {}
    for name, key in read_json(out / f"{kind}s.json").items():
        summary = read_json(out / f"{kind}s" / name / "summary.json")
        if not belongs(summary, key):
            raise StorageError(f"the {kind} {name!r} in {out} comes from other settings. Run the study again.")
        found[name] = summary
    return found
