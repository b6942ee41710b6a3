"""The report of the study of robustness, from its results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lpvhinf.storage import read_json, write_json, write_text
from studies.error_observer_tables import digits, table
from studies.error_observer_trade import number_or_inf
from studies.results import summaries

OBSERVERS = {"rigid-body": "no observer", "output-observer": "output-based", "error-observer": "error-based"}
KINDS = ("spread", "held")


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    settings = read_json(out / "settings.json")
    parts = in_order(summaries(out, "part"), settings)
    # for the claims table, which names the plant of every study
    one = next(iter(parts.values()))
    settings |= {name: one[name] for name in ("n_plant_modes", "magnetics")}
    report = {
        "settings": settings,
        "run": read_json(out / "run.json"),
        "missing": read_json(out / "missing.json"),
        "parts": parts,
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def in_order(parts: dict[str, Any], settings: dict[str, Any]) -> dict[str, Any]:
    """The parts in the order of the settings' designs, with the damping spread and then held."""
    places = {name: k for k, name in enumerate(settings["designs"])}
    kinds = list(KINDS)
    ranked = sorted(parts.items(), key=lambda item: (places[item[1]["design"]], kinds.index(item[1]["kind"])))
    return dict(ranked)


def title(part: dict[str, Any]) -> str:
    """A design's name in tables and figures."""
    study, design = part["design"].split("/")
    problem = {"output_observer": "6-block", "error_observer": "2x2"}.get(study, study)
    if part["architecture"] == "rigid-body":
        return f"{OBSERVERS['rigid-body']}, {design}"
    return f"{OBSERVERS[part['architecture']]}, {problem}, epsilon {part['epsilon']:g}"


def share(found: dict[str, Any]) -> str:
    """A share in percent with its interval."""
    return f"{100 * found['share']:.2f} ({100 * found['lower']:.2f}-{100 * found['upper']:.2f})"


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    settings, parts, run = report["settings"], report["parts"], report["run"]
    spread, held = settings["damping"], settings["held_damping"]
    lines = [
        "# Robustness of the designs",
        "",
        f"{settings['n_plants']} perturbed plants for each row, each at a random position: eigenfrequencies "
        f"{_range(settings['frequency'])}, masses, inertias and modal masses {_range(settings['mass'])}, commutation "
        f"misaligned by {1e6 * settings['misalignment'][0]:g}-{1e6 * settings['misalignment'][1]:g} um in x and y. "
        f"Damping spread: {100 * spread[0]:g}-{100 * spread[1]:g} % for every mode by itself, uniform in its "
        f"logarithm; held: {100 * held:g} %, as in the designs, which were made without delay. "
        f"Delay {1e6 * settings['delay']:g} us: Padé filter in continuous time, and exact at "
        f"{1e-3 / settings['sample_time']:g} kHz, where the hold comes on top of it.",
        "",
        "## Shares",
        "",
        *share_table(parts),
        "",
        "Shares of unstable plants with their 95 % intervals (Clopper and Pearson).",
        "",
        "## Worst plants",
        "",
        *worst_table(parts, settings["searched"]),
        "",
        "Found: by sampling, then by search. A search gives a lower bound of the worst case.",
        "",
        "## Modes",
        "",
        *mode_table(parts),
        "",
        f"Of the first {settings['n_followed']} unstable plants of each kind: the flexible mode that takes the largest "
        "part in the least stable pole. Its damping: that of the perturbed plant without control; needed: the damping "
        "ratio from which on the same plant is stable, all else as it is.",
        "",
        "## Notes",
        "",
        *(f"* {note}" for note in notes(report)),
        "",
        "## Run",
        "",
        f"{sum(p['cpu_s'] for p in parts.values()):.0f} s of processor time of the main process for all parts, "
        f"finished {run['finished']}; " + ", ".join(f"{name} {value}" for name, value in run["versions"].items()) + ".",
        "",
    ]
    return "\n".join(lines)


def share_table(parts: dict[str, Any]) -> list[str]:
    """One row a part: shares of unstable plants and quantiles."""
    rows = []
    for p in parts.values():
        damped, S, peak = (p["quantiles"].get(name, {}) for name in ("damping", "sensitivity", "flexible_peak"))
        rows.append(
            [
                title(p),
                p["kind"],
                share(p["unstable"]),
                share(p["unstable_sampled"]),
                _figure(damped.get("0.01"), 2, 100.0),
                _figure(damped.get("0.5"), 2, 100.0),
                _figure(p["nominal"]["sensitivity"], 2),
                _figure(S["0.5"], 2),
                _figure(S["0.95"], 2),
                _figure(peak.get("0.5"), 2),
                _figure(peak.get("0.95"), 2),
            ]
        )
    head = (
        "design|damping|unstable % (continuous)|unstable % (sampled)|controlled mode's damping %: 1 % of plants below"
        "|median|norm of S: known plant|median|95 %|peak of the controlled mode: median|95 %"
    )
    return table(head.split("|"), rows)


def worst_table(parts: dict[str, Any], searched: list[str]) -> list[str]:
    """One row a part: the known plant, the worst sampled one and the worst one found by search."""
    wanted = [(name, n) for name, n in (("abscissa", 2), ("spectral_radius", 6)) if name in searched]
    rows = []
    for p in parts.values():
        row = [title(p), p["kind"], bearable(p)]
        for name, n in wanted:
            case = p["worst_searched"][name]
            values = (p["nominal"][name], case["sampled_value"], case["value"])
            row += [_figure(value, n) for value in values]
        rows.append(row)
    names = {"abscissa": "largest real part rad/s", "spectral_radius": "spectral radius"}
    head = ["design", "damping", "delay that the known plant bears us"]
    for name, _ in wanted:
        head += [f"{names[name]}: known plant", "sampled", "searched"]
    return table(head, rows)


def bearable(p: dict[str, Any]) -> str:
    """The delay from which on the known plant is unstable [us]."""
    margin = p["nominal"]["delay_margin"]
    return "more than 2000" if margin is None else f"{1e6 * margin:.0f}"


def mode_table(parts: dict[str, Any]) -> list[str]:
    """One row for each part, kind of loop and mode."""
    rows = [
        [
            title(p),
            p["kind"],
            loop,
            f"{row['mode']} ({p['frequency_Hz'][row['mode'] - 1]:.0f} Hz)",
            f"{row['count']} of {found['followed']}",
            f"{row['pole_Hz']:.1f}",
            f"{row['part']:.2f}",
            f"{100 * row['damping_median']:.2f}, {100 * row['damping_max']:.2f}",
            f"{needed(row['needed_median'])}, {needed(row['needed_max'])}",
        ]
        for p in parts.values()
        for loop, found in p["culprits"].items()
        for row in found["modes"]
    ]
    head = (
        "design|damping|loop|mode|plants|pole Hz (median)|part (median)|its damping %: median, most"
        "|needed %: median, most"
    )
    return table(head.split("|"), rows) if rows else ["No plant was unstable."]


def needed(value: float | None) -> str:
    """A damping ratio in percent that would make a loop stable."""
    return "above 5" if value is None else f"{100 * value:.2f}"


def notes(report: dict[str, Any]) -> list[str]:
    """What the tables say, in sentences."""
    settings, parts = report["settings"], report["parts"]
    out = [
        note(
            p, next(q for q in parts.values() if q["design"] == p["design"] and q["kind"] == "held"), settings["delay"]
        )
        for p in parts.values()
        if p["kind"] == "spread"
    ]
    corrected = max(p["largest_correction"] for p in parts.values())
    out.append(
        f"Norms by tracked peaks; those of the {settings['n_exact']} largest, computed exactly, changed by "
        f"{100 * corrected:.2g} % at most."
    )
    if report["missing"]:
        out.append(f"Left out, as they were not finished: {', '.join(report['missing'])}.")
    return out


def note(p: dict[str, Any], held: dict[str, Any], delay: float) -> str:
    """What became of one design."""
    shares = [f"{100 * q['unstable']['share']:.1f} % ({100 * q['unstable_sampled']['share']:.1f} %)" for q in (p, held)]
    text = f"{title(p)}: {shares[0]} unstable (sampled) with the damping spread, {shares[1]} with it held. "
    margin = number_or_inf(held["nominal"]["delay_margin"])
    if margin <= delay:
        return text + f"The known plant bears less than {1e6 * margin:.0f} us of delay, and is unstable with it."
    found = p["culprits"]["continuous"]
    if not found["modes"]:
        return text + "No plant was unstable in continuous time."
    each = ", ".join(f"{row['mode']} ({row['count']})" for row in found["modes"])
    own = [row for row in found["modes"] if row["mode"] > p["n_controlled"]]
    text += f"Modes behind {found['followed']} of the unstable plants: {each}. "
    if len(own) < len(found["modes"]):
        return text + "A controlled mode is among them."
    return text + (
        f"They are modes without control, with damping ratios up to {100 * max(r['damping_max'] for r in own):.2f} %; "
        f"{needed(_largest([r['needed_max'] for r in own]))} % would have been enough for all of them."
    )


def _largest(values: list[float | None]) -> float | None:
    return None if any(v is None for v in values) else max(v for v in values if v is not None)


def _range(values: list[float]) -> str:
    low, high = 100 * values[0], 100 * values[1]
    return f"+-{high:g} %" if low == -high else f"{low:g} to {high:g} %"


def _figure(value: Any, n: int, factor: float = 1.0) -> str:
    return digits(factor * number_or_inf(value), n)
