"""The report of the study of fully actuated plants, from its results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.storage import read_json, write_json, write_text
from studies.results import summaries


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    settings, designs = read_json(out / "settings.json"), summaries(out, "design")
    report = {
        "settings": settings,
        "run": read_json(out / "run.json"),
        "designs": designs,
        "findings": findings(designs),
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def tuned(designs: dict[str, Any], plant: str) -> list[dict[str, Any]]:
    """The observer designs of a plant that were tuned for their Q, by Q."""
    rows = [d for name, d in designs.items() if d["plant"] == plant and name.startswith(f"{plant}-Q-")]
    return sorted(rows, key=lambda d: float(d["Q"]))


def plants(designs: dict[str, Any]) -> list[str]:
    """Names of the plants, the over-actuated one first, then by mode weight."""
    found = {d["plant"]: d["mode_weight"] or 0.0 for d in designs.values()}
    return sorted(found, key=lambda name: float(found[name]))


def findings(designs: dict[str, Any]) -> list[dict[str, Any]]:
    """What Q does on each plant, in figures."""
    out = []
    for plant in plants(designs):
        gammas = [d["gamma"] for d in tuned(designs, plant)]
        held = designs[f"{plant}-start"]["held"]
        change = [row["plant_change"] for row in held]
        spread = None if None in gammas else max(gammas) / min(gammas) - 1.0
        out.append(
            {
                "plant": plant,
                "gamma_spread": spread,  # over Q, each tuned
                "change_widest": change[0],  # of the rigid-body plant in its band, gains held
                "change_narrowest": change[-1],
                "Q_widest": held[0]["Q"],
                "Q_narrowest": held[-1]["Q"],
            }
        )
    return out


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    designs, settings, run = report["designs"], report["settings"], report["run"]
    fields = {"exact": "the field of all magnets", "first-harmonic": "the first harmonic of the field"}
    lines = [
        "# Fully actuated plants: coupled channels and the band-pass",
        "",
        f"Target bandwidth {settings['f_bw']:g} Hz on six axes, one controlled of {settings['n_plant_modes']} flexible "
        f"modes, epsilon {settings['epsilon']:g}, {fields[settings['magnetics']]}; equal filters in all designs. Every "
        "figure is computed with the plant model itself.",
        "",
        "## Channels",
        "",
        *channel_table(designs),
        "",
        "## Designs",
        "",
        *design_table(designs),
        "",
        "## Gains held",
        "",
        *held_table(designs),
        "",
        "## Notes",
        "",
        *(f"* {note}" for note in notes(report)),
        "",
        "## Run",
        "",
        f"{sum(d['cpu_s'] for d in designs.values()):.0f} s of processor time for all designs, finished "
        f"{run['finished']}; " + ", ".join(f"{name} {value}" for name, value in run["versions"].items()) + ".",
        "",
    ]
    return "\n".join(lines)


def channel_table(designs: dict[str, Any]) -> list[str]:
    """Coupling of the channels of every plant, which no controller changes."""
    lines = [
        "| plant | rigid-body coupling | excitation left | modal input on rigid body | own gain, least | most |",
        "|---|---|---|---|---|---|",
    ]
    for plant in plants(designs):
        c = designs[f"{plant}-start"]["channels"]
        row = [c["rigid"], c["excitation"][0], c["modal_to_rigid"][0], c["own_gain_min"][0], c["own_gain_max"][0]]
        lines.append(f"| {title(plant)} | " + " | ".join(small(value) for value in row) + " |")
    return lines


def design_table(designs: dict[str, Any]) -> list[str]:
    """One row a design."""
    lines = [
        "| plant | Q | gamma | over P | crossover Hz (min-max) | mode peak dB | damping %: least, median, most "
        "| plant change in band: worst, median | reaction in band |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for plant in plants(designs):
        for d in [designs[f"{plant}-conventional"], *tuned(designs, plant)]:
            zeta = [100.0 * d[f"damping_{which}"][0] for which in ("min", "median", "max")]
            pair = [d[f"crossover_{which}_Hz"] for which in ("min", "max")]
            crossing = [None if None in values else f(values) for f, values in zip((min, max), pair, strict=True)]
            loops = ["", ""]
            if d["Q"] is not None:
                loops = [f"{small(d['plant_change'])}, {small(d['plant_change_median'])}", small(d["reaction"])]
            lines.append(
                f"| {title(plant)} | {'no observer' if d['Q'] is None else format(d['Q'], 'g')} | {number(d['gamma'])} "
                f"| {number(d['gamma_worst'])} | {number(crossing[0], 1)}-{number(crossing[1], 1)} "
                f"| {number(d['mode_peak_dB'], 1)} | {zeta[0]:.2f}, {zeta[1]:.2f}, {zeta[2]:.2f} "
                f"| {loops[0]} | {loops[1]} |"
            )
    return lines


def held_table(designs: dict[str, Any]) -> list[str]:
    """The start of every plant with other Q and the same gains."""
    lines = [
        "| plant | Q | gamma | plant change in band: worst, median | at any frequency | reaction in band "
        "| damping %: least, median |",
        "|---|---|---|---|---|---|---|",
    ]
    for plant in plants(designs):
        lines += [
            f"| {title(plant)} | {row['Q']:g} | {number(row['gamma'])} | {small(row['plant_change'])}, "
            f"{small(row['plant_change_median'])} | {small(row['plant_change_everywhere'])} "
            f"| {small(row['reaction'])} | {100 * row['damping_min']:.2f}, {100 * row['damping_median']:.2f} |"
            for row in designs[f"{plant}-start"]["held"]
        ]
    return lines


def notes(report: dict[str, Any]) -> list[str]:
    """How the figures are meant, and what they say."""
    out = [
        "Channels: mass-normalised, as `DecoupledPlant.coupling`. Plant change: largest singular value of "
        "(G_Delta - G) G^-1, scaled, from a tenth to twice the target bandwidth: what observer and K_FM do to the "
        "plant that K_RB sees. Reaction: u_FM per u_RB in the same band, mass-normalised, K_RB open. Worst and median "
        "are over positions.",
        "Gains held: K_RB, L and xi of the design with the first Q; gamma at its design positions, unbounded where a "
        "loop there is not stable.",
        "Mode peak: 0 dB is the static error of the plant's own modal input; not comparable between plants.",
        "gamma over P comes from a search, not from a proof. The designs stop after few iterations: differences of "
        "some percent are the optimiser's.",
    ]
    for one in report["findings"]:
        spread = "a loop is not stable" if one["gamma_spread"] is None else f"{100 * one['gamma_spread']:.1f} %"
        out.append(
            f"{title(one['plant'])}: gamma over the tuned Q differs by {spread}; with the gains held a Q of "
            f"{one['Q_widest']:g} changes the rigid-body plant in its band by up to {small(one['change_widest'])}, "
            f"one of {one['Q_narrowest']:g} by {small(one['change_narrowest'])}."
        )
    return out


def title(plant: str) -> str:
    """Name of a plant for a reader."""
    return "over-actuated" if plant == "over" else f"fully actuated, rho {plant.removeprefix('full-')}"


def number(value: float | None, digits: int = 3) -> str:
    """A figure; what JSON could not hold was infinite."""
    return "unbounded" if value is None else f"{value:.{digits}f}"


def small(value: float | None) -> str:
    """A figure of any size; round-off is zero."""
    if value is None:
        return "unbounded"
    size = float(np.abs(value))
    if size < 1e-9:
        return "0"
    return f"{value:.1e}" if size < 1e-2 else f"{value:.2f}"
