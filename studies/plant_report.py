"""The report of the study of the plant, from its results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lpvhinf.storage import read_arrays, read_json, write_json, write_text
from studies import plant_tables
from studies.plant_results import ARRAYS
from studies.results import summaries


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    settings, parts = read_json(out / "settings.json"), summaries(out, "part")
    plate = read_arrays(out / "parts" / "validation" / "arrays.npz", ARRAYS)
    report = {
        "settings": settings,
        "run": read_json(out / "run.json"),
        "parts": parts,
        "plate": {"found": plate["plate"].tolist(), "published": plate["plate_published"].tolist()},
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    parts, settings, run = report["parts"], report["settings"], report["run"]
    fitted = sorted(
        (part for name, part in parts.items() if name.startswith("polynomial-")), key=lambda part: part["n_flex"]
    )
    fields = {"exact": "the field of all magnets", "first-harmonic": "the first harmonic of the field"}
    plate = report["plate"]
    sections = {
        "Summary": plant_tables.summary_table(parts["summary"]),
        "Modes": plant_tables.modes_table(parts["summary"]),
        "Validation": plant_tables.validation_tables(parts["validation"], plate["found"], plate["published"]),
        "Polynomial model": plant_tables.polynomial_table(fitted),
        "Windows": plant_tables.windows_table(parts["windows"]),
        "Effects": plant_tables.effects_tables(parts["effects"]),
        "Fully actuated": plant_tables.full_actuation_table(parts["full-actuation"]),
        "Run": [
            f"{run['wall_time_s']:.0f} s of wall time in this call, finished {run['finished']}; "
            + ", ".join(f"{name} {value}" for name, value in run["versions"].items())
            + "."
        ],
    }
    lines = [
        "# The planar actuator benchmark",
        "",
        f"{settings['n_plant_modes']} flexible modes, {fields[settings['magnetics']]}. Every figure comes from the "
        f"plant model; random choices have the seed {settings['seed']}.",
    ]
    for title, body in sections.items():
        lines += ["", f"## {title}", "", *body]
    return "\n".join([*lines, ""])
