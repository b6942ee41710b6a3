"""The page of results, from the CSV files alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.hinfstruct.actuator import ActuatorRun
from benchmarks.hinfstruct.compleib import CompleibRun
from benchmarks.hinfstruct.scaling import ScalingRun
from benchmarks.hinfstruct.sections import actuator_section, compleib_section, scaling_section
from benchmarks.hinfstruct.store import Row, read_rows
from lpvhinf.storage import write_text

PAGE = "hinfstruct.md"

LIMITATIONS = (
    "Seconds vary by some 20 % with other work on the machine. CPU seconds are of one thread a process, those of the "
    "processes of a run included; they contain the starting of these processes.",
    "A gamma is an upper bound on the optimum, at best a local minimum.",
    "Where slycot is not installed the package's own norm stands in for SLICOT's: the comparison then proves nothing.",
)
COMPLEIB = (
    "COMPleib: the best known norms are upper bounds on the optimum, reached by any method so far; a ratio of one is "
    "no proof.",
    "COMPleib: HIFOO's figures are of one run of three starts under GNU Octave on another day; its CPU seconds are of "
    "that machine. Systems without a figure are left out of its sums.",
    "COMPleib: where the infimum lies at infinite gain, the largest parameter tells; such a gain is not for practice.",
    "COMPleib: static output feedback, and orders 1 and 2 for a few systems, without a best known norm to compare "
    "with.",
)
ACTUATOR = (
    "Planar actuator: gamma over P is the largest norm that a search found, not a certificate.",
    "Planar actuator: the 3-axis plant is the same actuator with its in-plane axes held by something else: z, rx, ry "
    "and the flexible modes on all coils, seen by the four vertical beams.",
    "Planar actuator: the fit is that of the plant's polynomial model, once for both architectures, before the design "
    "and not in its seconds; the fit of the observer's model is repeated by itself and is part of the design's. Tables "
    "of the exact field are built once and not timed.",
    "Planar actuator: one seed, one bandwidth.",
)
SCALING = (
    "Scaling: synthetic bars with 0.1 to 1 % damping and controllers of free matrices, one seed. Effort is limited by "
    "the solver, so that seconds do not grow freely with the size while the distance to a minimum may: see optimality "
    "in the CSV file and the lower bound, which is of the worst single model.",
    "Scaling: seconds contain the lower bound of every model. `every model` counts one exact norm a model at each "
    "trial of the same run, steps to a stable loop left out; a solver of that kind would take other steps.",
)


def files(folder: Path) -> dict[str, Path]:
    """The CSV file of every part."""
    return {part: folder / f"hinfstruct_{part}.csv" for part in ("compleib", "mmpa", "scaling")}


def write_report(folder: Path) -> Path:
    """Write the page from the CSV files in the folder; return its path."""
    path = files(folder)
    compleib = read_rows(path["compleib"], CompleibRun)
    mmpa = read_rows(path["mmpa"], ActuatorRun)
    scaling = read_rows(path["scaling"], ScalingRun)
    nothing = ["Not run."]
    lines = ["# Structured H-infinity synthesis", "", "## COMPleib", ""]
    lines += compleib_section([row.run for row in compleib]) if compleib else nothing
    lines += ["", "## Planar actuator", ""]
    lines += actuator_section([row.run for row in mmpa]) if mmpa else nothing
    lines += ["", "## Scaling", ""]
    lines += scaling_section([row.run for row in scaling]) if scaling else nothing
    lines += _environments({"COMPleib": compleib, "planar actuator": mmpa, "scaling": scaling})
    notes = [*LIMITATIONS, *(COMPLEIB if compleib else ()), *(ACTUATOR if mmpa else ()), *(SCALING if scaling else ())]
    lines += ["", "## Limitations", "", *[f"- {text}" for text in notes]]
    page = folder / PAGE
    write_text(page, "\n".join(lines) + "\n")
    return page


def _environments(parts: dict[str, Sequence[Row[Any]]]) -> list[str]:
    """What the runs were measured with; every value that occurs, where they differ."""
    lines = ["", "## Machine and versions", "", "| part | runs | measured with |", "|---|---:|---|"]
    for name, rows in parts.items():
        values: dict[str, dict[str, None]] = {}
        for row in rows:
            for key, value in row.where.items():
                values.setdefault(key, {})[value] = None
        with_ = "; ".join(f"{key} {' or '.join(found)}" for key, found in values.items())
        lines.append(f"| {name} | {len(rows)} | {with_ or '-'} |")
    return lines
