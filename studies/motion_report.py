"""The report of the study of motion, from its results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.storage import read_json, write_json, write_text
from studies.error_observer_tables import table
from studies.results import summaries

AXES = ("x", "y", "z", "rx", "ry", "rz")
HEIGHT = 2
NOTHING = 1e-12  # m or rad: less than it is no error
KINDS = ("whole", "flexible", "controlled")


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    settings, stored = read_json(out / "settings.json"), summaries(out, "part")
    # JSON sorts its keys; the first design of the settings is the one to compare with
    parts = dict(sorted(stored.items(), key=lambda item: settings["designs"].index(item[1]["design"])))
    report = {
        "settings": settings,
        "run": read_json(out / "run.json"),
        "parts": parts,
        "factors": factors(parts),
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def factors(parts: dict[str, Any]) -> list[dict[str, Any]]:
    """MSD of the first design over that of every other one, per scenario and position; above 1 is better."""
    first, *others = parts.values()
    found = []
    for part in others:
        for ours, theirs in zip(part["rows"], first["rows"], strict=True):
            row = {"design": part["design"], "centre": ours["centre"], "scenario": ours["scenario"]}
            if "whole" in ours and "whole" in theirs:
                for kind in KINDS:
                    pairs = zip(theirs[kind]["MSD"], ours[kind]["MSD"], strict=True)
                    # plates do not bend in their plane, and what is not there has no factor
                    row[kind] = [a / b if min(a, b) > NOTHING else None for a, b in pairs]
            found.append(row)
    return found


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    settings, run, parts = report["settings"], report["run"], list(report["parts"].values())
    lines = [
        "# Scans with moving p",
        "",
        f"{settings['lines']} lines of {1e3 * settings['length']:g} mm along y at {settings['velocity']:g} m/s about "
        f"{len(parts[0]['rows']) // 2} positions, {parts[0]['duration']:.3f} s each; sampled at "
        f"{1e-3 / settings['period']:g} kHz with a delay of {1e6 * settings['delay']:g} µs; p is the set-point's "
        f"position. MA and MSD over {1e3 * settings['slit'] / settings['velocity']:g} ms within the lines, at the "
        "point of control.",
    ]
    for scenario, what in (
        ("tracking", "The set-point alone."),
        (
            "disturbed",
            f"Sensors with {1e9 * settings['noise']:g} nm of noise and steps of {1e9 * settings['quantisation']:g} nm, "
            f"{1e3 * settings['current_noise']:g} mA of noise in every coil, a floor of "
            f"{1e6 * settings['floor_velocity']:g} µm/s within {settings['floor_band'][0]:g} to "
            f"{settings['floor_band'][1]:g} Hz.",
        ),
    ):
        lines += ["", f"## {scenario.capitalize()}", "", what, "", *worst_table(parts, scenario)]
        lines += ["", *factor_table(report["factors"], parts[0]["design"], scenario)]
    lines += ["", "## Effort", "", *effort_table(parts), "", "## Notes", "", *notes(), "", "## Run", ""]
    versions = ", ".join(f"{name} {value}" for name, value in run["versions"].items())
    lines += [f"{run['wall_time_s']:.0f} s of wall time in this call, finished {run['finished']}; {versions}.", ""]
    return "\n".join(lines)


def of(part: dict[str, Any], scenario: str) -> list[dict[str, Any]]:
    """The finished scans of a design."""
    return [row for row in part["rows"] if row["scenario"] == scenario and "whole" in row]


def worst_table(parts: list[dict[str, Any]], scenario: str) -> list[str]:
    """Largest values over the positions."""
    body = []
    for part in parts:
        rows = of(part, scenario)
        cells = [part["design"]]
        if not rows:
            body.append([*cells, *["stopped"] * 8])
            continue
        for kind, measure in (("whole", "MA"), ("whole", "MSD")):
            worst = np.max([row[kind][measure] for row in rows], axis=0)
            cells += [nanometres(value) for value in worst[:3]]
        cells += [nanometres(max(row[kind]["MSD"][HEIGHT] for row in rows)) for kind in KINDS[1:]]
        body.append(cells)
    head = [f"{name} {axis} nm" for name in ("MA", "MSD") for axis in AXES[:3]]
    return table(["design", *head, *(f"{kind} MSD z nm" for kind in KINDS[1:])], body)


def factor_table(found: list[dict[str, Any]], first: str, scenario: str) -> list[str]:
    """Factors of the height per position."""
    rows = [row for row in found if row["scenario"] == scenario]
    centres = list(dict.fromkeys(tuple(row["centre"]) for row in rows))
    designs = list(dict.fromkeys(row["design"] for row in rows))
    if not designs:
        return ["One design only: nothing to compare."]
    body = []
    for x, y in centres:
        cells = [f"{1e3 * x:g}, {1e3 * y:g}"]
        for design in designs:
            (row,) = (r for r in rows if r["design"] == design and tuple(r["centre"]) == (x, y))
            heights = [row[kind][HEIGHT] for kind in KINDS] if "whole" in row else []
            cells.append(", ".join("-" if x is None else f"{x:.2f}" for x in heights) or "stopped")
        body.append(cells)
    return [
        *table(["centre mm", *designs], body),
        "",
        f"MSD of the height with {first} over that with the design: of the whole error, of its flexible part, of what "
        "the controlled mode adds. Above 1 the design is better.",
    ]


def effort_table(parts: list[dict[str, Any]]) -> list[str]:
    """Settling, currents, limits, time of the computer."""
    body = []
    for part in parts:
        quiet, loud = of(part, "tracking"), of(part, "disturbed")
        never = any(row["settling"] is None for row in quiet)  # infinity, in JSON
        settling = np.inf if never else max((1e3 * float(row["settling"]) for row in quiet), default=np.nan)
        peak = max((row["current_peak"] for row in quiet + loud), default=np.nan)
        modal = [max(row["feedback_rms"][6:], default=0.0) for row in loud]
        other = [row["status"] for row in part["rows"] if row["status"] != "completed"]
        seconds = float(np.mean([row["cpu_seconds"] for row in part["rows"]])) / part["duration"]
        body.append(
            [
                part["design"], f"{settling:.1f}", f"{peak:.2f}", f"{max(modal, default=0.0):.2g}",
                f"{len(part['rows']) - len(other)} of {len(part['rows'])}", f"{seconds:.1f}",
            ]
        )  # fmt: skip
    head = [
        "design",
        "settling ms",
        "peak current A",
        "modal force N/sqrt(kg)",
        "scans without an event",
        "CPU s per s",
    ]
    return table(head, body)


def nanometres(value: float) -> str:
    """Three digits."""
    return f"{1e9 * value:.3g}"


def notes() -> list[str]:
    """What the figures mean, and what they leave out."""
    return [
        "* Flexible: what flexible modes move the point of control by; controlled: what the controlled modes do; the "
        "rest is rigid motion about it. The "
        "compliance of truncated modes acts on the sensors only.",
        "* Settling: of the height at the point of control, from the begin of constant velocity in the first line, "
        "with the set-point alone; infinite if the tolerance is not kept until the end of the line.",
        "* Modal force: largest root mean square of u_FM. Peak current: any coil, levitation included, asked for "
        "before limits. CPU seconds per second of motion include the commutation of all coils.",
        "* p is exogenous, and the commutation knows it where its currents act. The motor's field enters as the gains "
        "of the decoupled plant, polynomials of p; the feedforward is that of a rigid body.",
    ]
