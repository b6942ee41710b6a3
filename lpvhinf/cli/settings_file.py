"""TOML files with settings, and checks of what stands in them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from lpvhinf.checks import known_options
from lpvhinf.errors import DomainError


def read_settings(path: Path | None) -> dict[str, Any]:
    """The content of a TOML file; empty without one.

    Raises
    ------
    DomainError
        If the file is missing or is not TOML.
    """
    if path is None:
        return {}
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DomainError(f"settings {path} cannot be read as TOML: {error}.") from error


def take_table(settings: dict[str, Any], name: str, known: Iterable[str]) -> dict[str, Any]:
    """Remove the table `name` from `settings` and return it; empty if it is not there.

    Raises
    ------
    DomainError
        If it is no table, or holds a setting that is not known.

    Examples
    --------
    >>> settings = {"f_bw": 40.0, "plant": {"n_flex": 1}}
    >>> take_table(settings, "plant", ["n_flex"]), settings
    ({'n_flex': 1}, {'f_bw': 40.0})
    """
    table = settings.pop(name, {})
    if not isinstance(table, Mapping):
        raise DomainError(f"{name} is {table!r}, wanted a table. Write its settings below a line [{name}].")
    known_options(f"table [{name}]", table, known)
    return dict(table)


def only(settings: Mapping[str, Any], what: str, known: Iterable[str]) -> None:
    """Raise a `DomainError` that lists the tables if `settings` holds another one."""
    known_options(what, settings, known)
