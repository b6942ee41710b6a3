"""Settings of a study: a preset in TOML, loaded into a frozen dataclass."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from lpvhinf.checks import known_options
from lpvhinf.errors import DomainError

PRESETS = Path(__file__).parent / "presets"
T = TypeVar("T")


def load_settings(cls: type[T], study: str, preset: str, **overrides: Any) -> T:
    """The settings of a preset, or of a TOML file given by its path; overrides that are not None win.

    Raises
    ------
    DomainError
        If there is no such preset, the file is not TOML, or a setting is unknown or missing.
    """
    path = Path(preset) if preset.endswith(".toml") else PRESETS / f"{study}_{preset}.toml"
    if not path.is_file():
        known = sorted(p.stem.removeprefix(f"{study}_") for p in PRESETS.glob(f"{study}_*.toml"))
        raise DomainError(f"preset is {preset!r}, wanted one of {', '.join(known)} or the path of a .toml file.")
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # not TOML, or not UTF-8
        raise DomainError(f"{path} is not valid TOML: {error}.") from error
    return from_mapping(cls, values | {key: value for key, value in overrides.items() if value is not None})


def from_mapping(cls: type[T], values: dict[str, Any]) -> T:
    """Settings from a mapping; unknown and missing ones are errors that name them."""
    fields = {field.name: field for field in dataclasses.fields(cls)}  # type: ignore[arg-type]
    known_options(cls.__name__, values, fields)
    missing = [name for name, field in fields.items() if name not in values and field.default is dataclasses.MISSING]
    if missing:
        raise DomainError(f"the settings lack {', '.join(missing)}. Take a preset as an example.")
    return cls(**{key: tuple(value) if isinstance(value, list) else value for key, value in values.items()})


def fingerprint(*parts: Any) -> str:
    """A key of everything that a stored result depends on."""
    text = json.dumps([dataclasses.asdict(p) if dataclasses.is_dataclass(p) else p for p in parts], sort_keys=True)  # type: ignore[arg-type]
    return hashlib.sha256(text.encode()).hexdigest()[:16]
