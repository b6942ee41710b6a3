"""Certificates that lie beside the designs of a page, with their cells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.storage import read_arrays, read_json
from lpvhinf.stored_design import StoredDesign
from lpvhinf.viewer.packing import packed

CELLS = "lpvhinf.Cells"  # beside a design, by the command line
STUDY = "lpvhinf.PlantStudy"  # in the results folder of the study certify
MOST_CELLS = 4000


def certificates_of(design: StoredDesign, study: Path | None) -> list[dict[str, Any]]:
    """Claims about a design with cells over P, the design's own first.

    Parameters
    ----------
    study : path, optional
        Results folder of the study certify; by default one beside the design's results folder, if there is one.
    """
    return [*own(design), *of_the_study(design, study)]


def own(design: StoredDesign) -> list[dict[str, Any]]:
    """Those in the design's folder `certificates`."""
    found = []
    for path in sorted((design.folder / "certificates").glob("*-cells.npz")):
        summary = path.with_name(f"{path.name.removesuffix('-cells.npz')}.json")
        if summary.is_file():
            arrays, said = read_arrays(path, CELLS), read_json(summary)
            found.append(described(design, said["claim"], said["outcome"], arrays))
    return found


def of_the_study(design: StoredDesign, study: Path | None) -> list[dict[str, Any]]:
    """Those that the study certify has of a design of another study."""
    results = design.folder.resolve().parent.parent
    folder = results.parent / "certify" if study is None else study
    claims = folder / "claims" / results.name / design.name
    if not claims.is_dir():
        if study is not None and not (study / "claims").is_dir():
            raise StorageError(
                f"certificates is {study}, which has no folder claims. Give results of the study certify."
            )
        return []
    found = []
    for path in sorted(claims.glob("*/arrays.npz")):
        said = read_json(path.with_name("summary.json"))
        arrays = read_arrays(path, STUDY)
        if "cells" in arrays:
            claim = str(said.get("claim", path.parent.name))
            found.append(described(design, claim, str(said.get("outcome", "")), arrays))
    return found


def described(design: StoredDesign, claim: str, outcome: str, arrays: dict[str, Any]) -> dict[str, Any]:
    """A claim for the page: its words, and its cells with their margins (NaN where not known)."""
    cells = np.asarray(arrays["cells"], dtype=float)
    margins = np.asarray(arrays.get("margins", np.full(len(cells), np.nan)), dtype=float)
    remaining = np.asarray(arrays.get("remaining", np.zeros((0, *cells.shape[1:]))), dtype=float)
    shown: Array = np.concatenate([cells, remaining])
    proved = np.append(np.ones(len(cells)), np.zeros(len(remaining)))
    values = np.append(margins, np.full(len(remaining), np.nan))
    kept = slice(0, MOST_CELLS)
    return {
        "design": design.name,
        "claim": claim,
        "outcome": outcome,
        "n_cells": len(cells),
        "n_remaining": len(remaining),
        "margin": None if not np.any(np.isfinite(margins)) else float(np.nanmin(margins)),
        "cells": packed(shown[kept], "float32"),
        "proved": packed(proved[kept], "int8"),
        "margins": packed(values[kept], "float32"),
        "left_out": max(0, len(shown) - MOST_CELLS),
    }
