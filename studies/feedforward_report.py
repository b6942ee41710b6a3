"""The report of the study of feedforward, from its results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lpvhinf.storage import read_json, write_json, write_text
from studies.results import summaries

AXES = ("x", "y", "z", "rx", "ry", "rz")
LIMIT = 1e-10  # of a relative force that counts as none
ROUND_OFF = 1e-12


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    parts = summaries(out, "part")
    report = {
        "settings": read_json(out / "settings.json"),
        "run": read_json(out / "run.json"),
        "parts": parts,
        "claims": claims(parts["excitation"]),
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def claims(part: dict[str, Any]) -> list[dict[str, Any]]:
    """The paper's claim on feedforward."""
    extended, plain = (part["plants"][name]["relative"] for name in ("extended", "rigid-body"))
    worst, without = (max(max(row) for row in rows) for rows in (extended, plain))
    return [
        {
            "claim": "decoupled flexible modes are no longer excited by the feedforward signal",
            "quantity": "largest force on a preserved mode over P, relative to the force that accelerates the axis",
            "value": f"{worst:.1e} with the extended decoupling, {without:.2f} without",
            "holds": worst <= LIMIT,
        }
    ]


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    parts, settings, run = report["parts"], report["settings"], report["run"]
    fields = {"exact": "the field of all magnets", "first-harmonic": "the first harmonic of the field"}
    stepped = [part for name, part in parts.items() if name.startswith("steps-")]
    stepped.sort(key=lambda part: int(part["n_flex"]))
    sections = {
        "Claims": claims_table(report["claims"]),
        "Excitation": excitation_table(parts["excitation"]),
        "Other plants": plants_table(parts["excitation"], settings),
        "Steps": [line for part in stepped for line in steps_table(part, settings)],
        "What it buys": gains_table(stepped, settings),
        "Notes": notes(settings),
        "Run": [
            f"{run['wall_time_s']:.0f} s of wall time in this call, finished {run['finished']}; "
            + ", ".join(f"{name} {value}" for name, value in run["versions"].items())
            + "."
        ],
    }
    lines = [
        "# Rigid-body feedforward with and without the extended decoupling",
        "",
        f"{settings['n_plant_modes']} flexible modes, {fields[settings['magnetics']]}; every figure comes from the "
        "plant model itself, frozen at each position.",
    ]
    for title, body in sections.items():
        lines += ["", f"## {title}", "", *body]
    return "\n".join([*lines, ""])


def claims_table(found: list[dict[str, Any]]) -> list[str]:
    """One row a claim."""
    rows = [f"{c['claim']} | {c['quantity']} | {c['value']} | {'yes' if c['holds'] else 'no'}" for c in found]
    return table("claim | quantity | value | holds", rows)


def excitation_table(part: dict[str, Any]) -> list[str]:
    """Worst force on each preserved mode by each axis, with both decouplings."""
    rows = []
    for kind in ("rigid-body", "extended"):
        found = part["plants"][kind]
        for k, hertz in enumerate(part["mode_hertz"]):
            rows.append(f"{kind} | {k + 1}, {hertz:.1f} Hz | " + " | ".join(small(x) for x in found["relative"][k]))
    where = part["plants"]["rigid-body"]["position_mm"]
    places = [
        f"mode {k + 1}: " + ", ".join(f"{a} ({p[0]:.0f}, {p[1]:.0f})" for a, p in zip(AXES, row, strict=True))
        for k, row in enumerate(where)
    ]
    return [
        *table("decoupling | mode | " + " | ".join(AXES), rows),
        "",
        "Largest force on the mode over P, by search, per force that accelerates the axis, both mass-normalised: 1 "
        "excites the mode as much as it moves the axis. Reached without the extension at (mm): "
        + "; ".join(places)
        + ".",
    ]


def plants_table(part: dict[str, Any], settings: dict[str, Any]) -> list[str]:
    """The largest excitation of preserved and discarded modes, and the rigid motion that is not cancelled."""
    rows = []
    for name, found in part["plants"].items():
        preserved = max(max(row) for row in found["relative"])
        rows.append(f"{name} | {small(preserved)} | {small(max(found['discarded']))} | {small(found['not_cancelled'])}")
    shift = ", ".join(f"{1e6 * x:.0f}" for x in settings["misalignment"])
    return [
        *table("plant | preserved modes | discarded modes | rigid motion not cancelled", rows),
        "",
        "full-rho: six virtual forces shared with mode weight rho. misaligned: the commutation believes the mover "
        f"({shift}) um beside its place. Discarded modes and the last column: on a grid of {part['n_points']} "
        "positions.",
    ]


def steps_table(part: dict[str, Any], settings: dict[str, Any]) -> list[str]:
    """Errors of one step, the longest, along the axis that moves."""
    longest = max(settings["snap_times"])
    rows = []
    for row in part["rows"]:
        if row["snap_time"] == longest:
            for key in ("during", "after"):
                figures = " | ".join(nano(x) for x in row[key])
                rows.append(f"{row['decoupling']} | {row['place']} | {key} | {figures}")
    head = "decoupling | place | when | " + " | ".join(f"{a} [{unit(a)}]" for a in AXES)
    return [
        f"{part['n_flex']} preserved, steps of {step_sizes(settings)} in {8e3 * longest:g} ms, {part['n_points']} "
        "positions:",
        "",
        *table(head, rows),
        "",
    ]


def gains_table(parts: list[dict[str, Any]], settings: dict[str, Any]) -> list[str]:
    """Error without the extension over error with it."""
    rows = []
    for part in parts:
        for place in ("sensors", "point of control"):
            for snap_time in settings["snap_times"]:
                plain, extended = (
                    next(
                        row
                        for row in part["rows"]
                        if (row["decoupling"], row["place"], row["snap_time"]) == (kind, place, snap_time)
                    )
                    for kind in ("rigid-body", "extended")
                )
                for key in ("during", "after"):
                    ratios = [ratio(a, b) for a, b in zip(plain[key], extended[key], strict=True)]
                    rows.append(f"{part['n_flex']} | {place} | {8e3 * snap_time:g} ms | {key} | " + " | ".join(ratios))
    return table("preserved | place | step | when | " + " | ".join(AXES), rows)


def notes(settings: dict[str, Any]) -> list[str]:
    """How the figures are meant."""
    return [
        "* Steps: fourth-order setpoint of eight equal pieces, one axis at a time, feedforward alone, no feedback. "
        "Errors are those along the axis that moves, largest over positions and time: during the step, and in the "
        f"{1e3 * settings['settle']:g} ms after it. The response is exact; instants are twenty for a period of the "
        "fastest mode.",
        "* During the step the error is mostly the quasi-static deformation by the acceleration, which modes above the "
        "preserved ones share; after it, vibration.",
        "* What it buys: error without the extended decoupling over error with it, each at its own worst position; a "
        "dash where both are round-off.",
        "* The point of control is seen through the modes of the model alone: the compliance of truncated ones is "
        "known at the sensors only. Its rz is not moved by bending at all.",
    ]


def step_sizes(settings: dict[str, Any]) -> str:
    """The distances, as text."""
    return ", ".join(
        f"{1e6 * d:g} {'urad' if a.startswith('r') else 'um'}" for a, d in zip(AXES, settings["distances"], strict=True)
    )


def unit(axis: str) -> str:
    """Unit of a small error."""
    return "nrad" if axis.startswith("r") else "nm"


def table(head: str, rows: list[str]) -> list[str]:
    """Lines of a table."""
    return [f"| {head} |", "|" + "---|" * (head.count("|") + 1), *(f"| {row} |" for row in rows)]


def ratio(plain: float, extended: float) -> str:
    """How many times smaller; neither if both are round-off."""
    if max(plain, extended) < ROUND_OFF:
        return "-"
    return "unbounded" if extended < ROUND_OFF else f"{plain / extended:.1f}"


def nano(value: float) -> str:
    """In nm or nrad."""
    return "0" if value < ROUND_OFF else f"{1e9 * value:.2f}"


def small(value: float) -> str:
    """A figure of any size; round-off is zero."""
    if value < LIMIT:
        return "0"
    return f"{value:.1e}" if value < 1e-2 else f"{value:.2f}"
