"""Modal data as CSV files in one folder, with the unit of every number in its column's name.

- ``modes.csv``, one row a mode: ``frequency_hz``, ``damping``, perhaps ``modal_mass_kg``.
- ``shapes.csv``, one row a node: ``x_m``, ``y_m``, perhaps ``z_m`` and ``mass_kg``, then the displacements ``w1``,
  ``w2``, ... or ``u1``, ``v1``, ``w1``, ``u2``, ..., numbered as the rows of ``modes.csv``.
- ``polynomials.csv`` instead of ``shapes.csv``, one row a term: ``power_x``, ``power_y`` and the coefficients ``w1``,
  ``w2``, ... or ``u1``, ``v1``, ``w1``, ``u2``, ...
- ``body.csv``, rows ``quantity,value``: ``mass_kg``; ``cog_x_m``, ``cog_y_m``, ``cog_z_m``; ``ixx_kgm2``, ``iyy_kgm2``,
  ``izz_kgm2``, ``ixy_kgm2``, ``ixz_kgm2``, ``iyz_kgm2`` (``cog_z_m`` and products of inertia are 0 if left out); with
  polynomials also ``x_min_m``, ``x_max_m``, ``y_min_m``, ``y_max_m``.

Comma between columns, point in numbers, UTF-8. Columns may come in any order; empty lines, lines that begin with ``#``,
and columns ``node``, ``mode`` and ``name`` are skipped.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.storage import make_folder, write_text

Table = dict[str, Array]
SKIPPED = ("node", "mode", "name")
INERTIA = ("ixx_kgm2", "iyy_kgm2", "izz_kgm2", "ixy_kgm2", "ixz_kgm2", "iyz_kgm2")
COG = ("cog_x_m", "cog_y_m", "cog_z_m")
AREA = ("x_min_m", "x_max_m", "y_min_m", "y_max_m")
BODY = ("mass_kg", *COG, *INERTIA, *AREA)
OPTIONAL = ("cog_z_m", *INERTIA[3:], *AREA)
PLACES = ("x_m", "y_m", "z_m")
POWERS = ("power_x", "power_y")
MAX_POWER = 30


def read_csv(folder: str | os.PathLike[str]) -> Table:
    """The arrays of a folder, named as the arguments of `ModeData` and `RigidBody`.

    Raises
    ------
    StorageError
        If a file or column is missing, a column is unknown, or an entry is no number.
    """
    where = Path(folder)
    modes = _table(where / "modes.csv", ("frequency_hz", "damping"), ("modal_mass_kg",))
    body = _quantities(where / "body.csv")
    xx, yy, zz, xy, xz, yz = (body.get(name, 0.0) for name in INERTIA)
    arrays = {
        "frequency_hz": modes["frequency_hz"],
        "damping": modes["damping"],
        "mass": np.array(body["mass_kg"]),
        "centre_of_gravity": np.array([body.get(name, 0.0) for name in COG]),
        "inertia": np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
    }
    if "modal_mass_kg" in modes:
        arrays["modal_mass"] = modes["modal_mass_kg"]
    nodal, series = where / "shapes.csv", where / "polynomials.csv"
    if nodal.exists() == series.exists():
        state = "has both shapes.csv and polynomials.csv" if nodal.exists() else "has no shapes.csv"
        raise StorageError(f"{where} {state}, wanted one of shapes.csv and polynomials.csv.")
    if nodal.exists():
        table = _table(nodal, PLACES[:2], ("z_m", "mass_kg"), displacements=True)
        arrays["points"] = np.column_stack([table[name] for name in PLACES if name in table])
        arrays["shapes"] = _displacements(table, nodal)
        if "mass_kg" in table:
            arrays["node_mass"] = table["mass_kg"]
        return arrays
    missing = [name for name in AREA if name not in body]
    if missing:
        raise StorageError(f"{where / 'body.csv'} has no {', '.join(missing)}, which go with polynomials.csv.")
    table = _table(series, POWERS, (), displacements=True)
    powers = np.column_stack([table[name] for name in POWERS])
    if np.any(powers != np.round(powers)) or np.any(powers < 0) or np.any(powers > MAX_POWER):
        raise StorageError(f"{series}: power_x and power_y have to be whole numbers from 0 to {MAX_POWER}.")
    terms = powers.astype(int)
    if len(np.unique(terms, axis=0)) < len(terms):
        raise StorageError(f"{series}: a pair of power_x and power_y comes twice. Add the rows up.")
    values = _displacements(table, series)
    coefficients = np.zeros((*(terms.max(axis=0) + 1), *values.shape[1:]))
    coefficients[terms[:, 0], terms[:, 1]] = values
    arrays["polynomials"] = coefficients
    arrays["area"] = np.array([body[name] for name in AREA]).reshape(2, 2)
    return arrays


def write_csv(folder: str | os.PathLike[str], arrays: Table) -> None:
    """Write what `read_csv` reads; files of the other description of the shapes are removed."""
    where = make_folder(folder)
    inertia = arrays["inertia"]
    body = [("mass_kg", arrays["mass"]), *zip(COG, arrays["centre_of_gravity"], strict=True)]
    body += [(name, inertia["xyz".index(name[1]), "xyz".index(name[2])]) for name in INERTIA]
    body += zip(AREA, arrays["area"].ravel(), strict=True) if "area" in arrays else []
    _write(where / "body.csv", ("quantity", "value"), [[name, _digits(value)] for name, value in body])
    modes = {"frequency_hz": arrays["frequency_hz"], "damping": arrays["damping"]}
    if "modal_mass" in arrays:
        modes["modal_mass_kg"] = arrays["modal_mass"]
    _write_columns(where / "modes.csv", modes)
    if "shapes" in arrays:
        points, values = arrays["points"], arrays["shapes"]
        columns = {name: points[:, k] for k, name in enumerate(PLACES[: points.shape[1]])}
        if "node_mass" in arrays:
            columns["mass_kg"] = arrays["node_mass"]
        name, other = "shapes.csv", "polynomials.csv"
    else:
        coefficients = arrays["polynomials"]
        i, j = (index.ravel().astype(float) for index in np.indices(coefficients.shape[:2]))
        columns, values = dict(zip(POWERS, (i, j), strict=True)), coefficients.reshape(len(i), *coefficients.shape[2:])
        name, other = "polynomials.csv", "shapes.csv"
    letters = "w" if values.ndim == 2 else "uvw"
    by_mode = values[:, None] if values.ndim == 2 else values
    for k in range(values.shape[-1]):
        columns |= {f"{letter}{k + 1}": by_mode[:, c, k] for c, letter in enumerate(letters)}
    _write_columns(where / name, columns)
    (where / other).unlink(missing_ok=True)


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """Rows of a file with their line numbers, header first."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise StorageError(f"{path} cannot be read: {error}. Wanted a CSV file in UTF-8.") from error
    numbered = enumerate(text.splitlines(), start=1)
    kept = [(n, line) for n, line in numbered if line.strip(" \t,") and not line.lstrip().startswith("#")]
    if len(kept) < 2:
        raise StorageError(f"{path} has {len(kept)} lines, wanted a line of column names and rows of numbers.")
    if "," not in kept[0][1] and re.search(r"[;\t]", kept[0][1]):
        raise StorageError(f"{path} separates columns by semicolon or tab, wanted commas, and points in numbers.")
    return [(n, [cell.strip() for cell in next(csv.reader([line]))]) for n, line in kept]


def _table(path: Path, needed: Sequence[str], optional: Sequence[str], *, displacements: bool = False) -> Table:
    """Columns of a file by name."""
    (_, header), *rows = _lines(path)
    names = [name.lower() for name in header]
    known = (*needed, *optional)
    for name in names:
        if name in SKIPPED or name in known or (displacements and re.fullmatch(r"[uvw][1-9]\d*", name)):
            continue
        more = " and displacements w1, w2, ... or u1, v1, w1, ..." if displacements else ""
        raise StorageError(
            f"{path} has the column {name!r}, wanted {', '.join(known)}{more}. The name states the unit: convert, then "
            "rename."
        )
    missing = [name for name in needed if name not in names]
    if missing or len(set(names)) < len(names):
        what = f"has no column {', '.join(missing)}" if missing else "has a column twice"
        raise StorageError(f"{path} {what}: its columns are {', '.join(names)}.")
    columns: dict[str, list[float]] = {name: [] for name in names if name not in SKIPPED}
    for number, row in rows:
        if len(row) != len(names):
            raise StorageError(f"{path}, line {number}: {len(row)} entries, wanted {len(names)} as in the first line.")
        for name, cell in zip(names, row, strict=True):
            if name in columns:
                columns[name].append(_number(cell, path, number, name))
    return {name: np.array(column) for name, column in columns.items()}


def _quantities(path: Path) -> dict[str, float]:
    """The rows quantity, value of ``body.csv``."""
    (_, header), *rows = _lines(path)
    if [name.lower() for name in header[:2]] != ["quantity", "value"]:
        raise StorageError(f"{path} has the columns {', '.join(header)}, wanted quantity,value.")
    found: dict[str, float] = {}
    for number, row in rows:
        name = row[0].lower()
        if name not in BODY or name in found or len(row) < 2:
            what = "comes twice or has no value" if name in BODY else "is not known"
            raise StorageError(f"{path}, line {number}: {row[0]!r} {what}. Wanted one row each of {', '.join(BODY)}.")
        found[name] = _number(row[1], path, number, name)
    missing = [name for name in BODY if name not in found and name not in OPTIONAL]
    if missing:
        raise StorageError(f"{path} has no {', '.join(missing)}. Add a row for each.")
    return found


def _displacements(table: Table, path: Path) -> Array:
    """Shapes (rows, n_modes) or (rows, 3, n_modes) from columns w1, ... or u1, v1, w1, ..."""
    found = {name for name in table if re.fullmatch(r"[uvw][1-9]\d*", name)}
    letters = "uvw" if {name for name in found if name[0] != "w"} else "w"
    n_modes = max((int(name[1:]) for name in found), default=0)
    missing = [f"{a}{k + 1}" for k in range(n_modes) for a in letters if f"{a}{k + 1}" not in found]
    if missing or n_modes == 0:
        raise StorageError(
            f"{path} has no column {', '.join(missing[:6]) or 'w1'}: wanted w1, w2, ... or u1, v1, w1, u2, ... with no "
            "gap."
        )
    stacked = np.stack(
        [np.column_stack([table[f"{a}{k + 1}"] for k in range(n_modes)]) for a in letters],
        axis=1,
    )
    return stacked[:, 0] if letters == "w" else stacked


def _number(cell: str, path: Path, line: int, name: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise StorageError(
            f"{path}, line {line}: {name} is {cell!r}, wanted a number with a point, no comma and no unit."
        ) from None


def _digits(value: float) -> str:
    return repr(float(value))  # the shortest text that reads back as the same number


def _write_columns(path: Path, columns: Table) -> None:
    _write(path, tuple(columns), [[_digits(v) for v in row] for row in zip(*columns.values(), strict=True)])


def _write(path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows([header, *rows])
    write_text(path, stream.getvalue())
