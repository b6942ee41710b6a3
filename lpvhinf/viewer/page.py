"""From designs in a folder to one HTML page."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array, whole_number
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.progress import SILENT, Progress
from lpvhinf.storage import plain, write_text
from lpvhinf.stored_design import StoredDesign, designs_in
from lpvhinf.viewer.certificates import certificates_of
from lpvhinf.viewer.machine import machine_view
from lpvhinf.viewer.packing import packed
from lpvhinf.viewer.positions import Grid
from lpvhinf.viewer.responses import CURVES, Responses, frequencies, responses

STEP = 0.01  # dB, of the stored curves
BUDGET = 3.6e6  # bytes of the curves in the page: a finer grid is made coarser until they fit
SMALLEST_GRID = 3
N_CHECKED = 8  # positions at which interpolation is compared with what is computed anew
RESONANCE = 6.0  # dB: curves are compared where they are not far below their peak


@dataclass(frozen=True, kw_only=True)
class Page:
    """What `view` wrote.

    Attributes
    ----------
    path : Path
    designs : names of the designs
    grid : positions along every axis
    n_positions : all of them
    size : bytes
    """

    path: Path
    designs: tuple[str, ...]
    grid: int
    n_positions: int
    size: int


def view(
    results: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    designs: Sequence[str] | None = None,
    grid: int = 13,
    certificates: str | os.PathLike[str] | None = None,
    progress: Progress = SILENT,
) -> Page:
    """Write one self-contained HTML page with the designs of a folder over all positions.

    The page holds singular values and poles on a grid over P. Between the positions of the grid it interpolates the
    singular values, bilinear in dB; poles are those of the nearest position. How far interpolated curves are from
    recomputed ones at other positions stands in the page.

    Parameters
    ----------
    results : path
        Folder of a design (`Design.save`, `lpvhinf design`), of several, or a study's results folder.
    out : path
        The page.
    designs : names, optional
        Only these.
    grid : int
        Positions along every axis; fewer are taken if the page would exceed 5 MB.
    certificates : path, optional
        Results folder of the study certify; certificates in the designs' own folders are found without it.

    Raises
    ------
    StorageError
        If there is no design, or a file is damaged.
    DomainError
        If a name is not among the designs, or the designs have different boxes.
    DimensionError
        If P has other than one or two coordinates.
    """
    chosen = _chosen(designs_in(results), designs)
    box = chosen[0].box
    if len(box) not in (1, 2):
        raise DimensionError(f"P has {len(box)} coordinates, wanted 1 or 2: the page shows a line or a square.")
    for design in chosen:
        if design.box.shape != box.shape or not np.allclose(design.box, box):
            raise DomainError(
                f"{design.name} has the box {design.box.tolist()}, {chosen[0].name} {box.tolist()}. Choose designs "
                "over one box by name."
            )
    hertz = frequencies(chosen)
    n = _affordable(whole_number("grid", grid, 2), len(chosen), len(hertz), len(box))
    if n < grid:
        progress.log(f"{n} positions along every axis instead of {grid}, so that the page stays below 5 MB")
    over = Grid.over(box, n)
    progress.stage("responses over P", len(chosen) * (len(over.points) + N_CHECKED))
    shown = []
    for design in chosen:
        found = responses(design, over.points, hertz, progress)
        shown.append(_design(design, found, _deviation(design, over, hertz, found, progress)))
    study = None if certificates is None else Path(certificates)
    claims = [claim for design in chosen for claim in certificates_of(design, study)] if len(box) == 2 else []
    content = {
        "title": Path(results).resolve().name,
        "box": box,
        "axes": [axis.tolist() for axis in over.axes],
        "hertz": packed(hertz, "float32"),
        "step": STEP,
        "curves": CURVES,
        "designs": shown,
        "certificates": claims,
        "machine": next((it for it in map(machine_view, chosen) if it is not None), None),
    }
    size = write_page(Path(out), content)
    return Page(path=Path(out), designs=tuple(d.name for d in chosen), grid=n, n_positions=len(over.points), size=size)


def _chosen(found: list[StoredDesign], names: Sequence[str] | None) -> list[StoredDesign]:
    if names is None:
        return found
    known = {design.name: design for design in found}
    for name in names:
        if name not in known:
            raise DomainError(f"designs has {name!r}, wanted some of {', '.join(known)}.")
    return [known[name] for name in dict.fromkeys(names)]


def _affordable(wanted: int, n_designs: int, n_f: int, n_p: int) -> int:
    """Positions along an axis whose curves fit into the page."""
    per_position = n_designs * len(CURVES) * n_f * 2 * 4 / 3
    most = int((BUDGET / per_position) ** (1.0 / n_p))
    if most < SMALLEST_GRID:
        raise DomainError(f"designs are {n_designs}, too many for a page of 5 MB. Choose some by name.")
    return min(wanted, most)


def _design(design: StoredDesign, found: Responses, deviation: dict[str, Any]) -> dict[str, Any]:
    counts = [len(poles) for poles in found.poles]
    poles: Array = np.concatenate([np.stack([z.real, z.imag], axis=1) for z in found.poles])
    return {
        "name": design.name,
        "architecture": design.architecture,
        "gamma": round(design.gamma, 4),
        "f_bw": design.f_bw,
        "curves": {
            name: packed(np.round(values / STEP), "int16") for name, values in found.decibels.items() if values.size
        },
        "poles": packed(poles, "float32"),
        "counts": counts,
        "abscissa": packed(found.abscissa, "float32"),
        "deviation": deviation,
    }


def _deviation(design: StoredDesign, grid: Grid, hertz: Array, found: Responses, progress: Progress) -> dict[str, Any]:
    """Largest and typical deviation of interpolated curves from recomputed ones [dB], near their peak."""
    points = spread_points(design.box, N_CHECKED, seed=3)
    true = responses(design, points, hertz, progress)
    out: dict[str, Any] = {}
    for name in ("S", "SG"):
        ours = np.array([grid.interpolate(found.decibels[name], p) for p in points])
        gap = np.abs(ours - true.decibels[name])
        near = true.decibels[name] > np.max(true.decibels[name]) - RESONANCE
        out[name] = {
            "peak": round(float(np.max(gap[near])), 3),
            "median": round(float(np.median(gap)), 3),
            "n": N_CHECKED,
        }
    return out


def write_page(path: Path, content: dict[str, Any]) -> int:
    """Fill the template, write it, and return its size in bytes."""
    here = files("lpvhinf.viewer")
    data = json.dumps(plain(content), separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    text = here.joinpath("page.html").read_text(encoding="utf-8")
    for mark, part in (
        ("/*style*/", here.joinpath("page.css").read_text(encoding="utf-8")),
        ("/*data*/", data),
        ("/*script*/", "\n".join(here.joinpath(f"page_{n}.js").read_text(encoding="utf-8") for n in SCRIPTS)),
    ):
        before, _, after = text.partition(mark)
        text = before + part + after
    write_text(path, text)
    return len(text.encode("utf-8"))


SCRIPTS = ("data", "plots", "maps", "main")
