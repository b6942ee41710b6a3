"""Finished runs as rows of a CSV, each with the machine and versions that it was measured with."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Generic, TypeVar

from lpvhinf.errors import StorageError
from lpvhinf.storage import write_text

R = TypeVar("R")
KINDS: Mapping[str, type] = {"str": str, "int": int, "float": float}


@dataclass(frozen=True, kw_only=True)
class Row(Generic[R]):
    """A run, and where it was measured."""

    run: R
    where: dict[str, str]


def append(path: Path, run: Any, where: Mapping[str, str]) -> None:
    """Add a run, a frozen dataclass of str, int and float, to the file; the file is whole at any time.

    Raises
    ------
    StorageError
        If the file has other columns.
    """
    columns = [f.name for f in fields(run)] + list(where)
    text = _text(path) or _line(columns)
    _check(path, _header(text), columns)
    write_text(path, text + _line([*asdict(run).values(), *where.values()]))


def read_rows(path: Path, kind: type[R]) -> list[Row[R]]:
    """Runs of earlier, perhaps unfinished, calls; none if there is no file.

    Raises
    ------
    StorageError
        If the file lacks a column of `kind`.
    """
    text = _text(path)
    if not text:
        return []
    kinds = {f.name: KINDS[str(f.type)] for f in fields(kind)}  # type: ignore[arg-type]
    _check(path, _header(text)[: len(kinds)], list(kinds))
    out = []
    for row in csv.DictReader(io.StringIO(text, newline="")):
        values = {name: make(row.pop(name)) for name, make in kinds.items()}
        out.append(Row(run=kind(**values), where=row))
    return out


def _text(path: Path) -> str:
    return path.read_text("utf-8") if path.exists() else ""


def _header(text: str) -> list[str]:
    return next(csv.reader(io.StringIO(text)))


def _line(values: list[Any]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerow(values)
    return buffer.getvalue()


def _check(path: Path, found: list[str], wanted: list[str]) -> None:
    if found != wanted:
        raise StorageError(
            f"{path} has the columns {', '.join(found)}, wanted {', '.join(wanted)}: another version wrote it. "
            "Move it away, or name another folder by --out."
        )
