"""The report of the certificates, from their results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lpvhinf.storage import read_json, write_json, write_text
from studies.results import summaries

TITLES = {
    "frozen": "Stable at every frozen position",
    "rate": "Stable while moving",
    "fastest": "Largest proved speed",
    "quadratic": "One Lyapunov matrix, for arbitrarily fast motion",
    "gain": "Bound of the weighted loop's H-infinity norm at every frozen position",
}
HEADS = {
    "rate": "speed [m/s]",
    "fastest": "proved speed [m/s] | not proved",
    "quadratic": "proved share of the width of P | not proved",
    "gain": "found norm | proved bound | gap | not proved",
}


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    report = {
        "settings": read_json(out / "settings.json"),
        "run": read_json(out / "run.json"),
        "claims": summaries(out, "claim"),
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    claims: list[dict[str, Any]] = list(report["claims"].values())
    counts = {word: sum(c["outcome"] == word for c in claims) for word in ("proved", "refuted", "undecided")}
    lines = [
        "# Certificates of the designs",
        "",
        f"{len(claims)} claims: {counts['proved']} proved, saved, and proved again from the file by the independent "
        f"checker; {counts['refuted']} refuted; {counts['undecided']} undecided.",
        "",
        *(f"**{name}: the checker did not confirm it.** {c['reason']}\n" for name, c in unconfirmed(report["claims"])),
        *condition(claims),
    ]
    for kind, title in TITLES.items():
        ours = [c for c in claims if c["kind"] == kind]
        if ours:
            lines += ["", f"## {title}", "", *table(kind, ours), *open_ends(ours)]
    run = report["run"]
    lines += [
        "",
        "## Run",
        "",
        "CPU seconds of one process, including the search; re-check: the checker alone, reading the file and the "
        "loop's file, in floating point with bounds of its rounding.",
        "",
        *([f"Not finished when this ran, and left out: {', '.join(run['unfinished'])}.", ""] * bool(run["unfinished"])),
        f"{run['wall_time_s']:.0f} s of wall time in this call, finished {run['finished']}; "
        + ", ".join(f"{name} {value}" for name, value in run["versions"].items())
        + ".",
        "",
    ]
    return "\n".join(lines)


def unconfirmed(claims: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Claims whose certificate the checker did not accept."""
    return [(name, c) for name, c in claims.items() if c["outcome"] == "not confirmed"]


def condition(claims: list[dict[str, Any]]) -> list[str]:
    """What the claims are about, and how far that is from the plant model."""
    lines = [
        "Conditional on the plant's polynomial fit: every claim is about the closed loop whose matrices are the stored "
        "polynomials in p, for every p of the box and not for a grid. It says nothing about what the polynomials leave "
        "out of the plant model. The design's study measured that error at sampled positions, relative to the largest "
        "entry of each matrix, which is no bound; beside it, for comparison, the least stable pole that it found with "
        "the plant model itself. A pole as close to zero as the error is proved for the polynomials alone.",
        "",
    ]
    rows = {}
    for c in claims:
        errors = ", ".join(f"{name} {value:.1e}" for name, value in (c["fit_error"] or {}).items())
        pole = "-" if c["largest_real_part"] is None else f"{c['largest_real_part']:.3g}"
        rows[design(c)] = [design(c), errors or "not stated by its study", pole]
    return lines + _table(["design", "error of the fit", "largest Re found [1/s]"], list(rows.values()))


def design(claim: dict[str, Any]) -> str:
    """Study and design."""
    return f"{Path(claim['source']).name}/{claim['design']}"


def table(kind: str, claims: list[dict[str, Any]]) -> list[str]:
    """One row a design."""
    head = ["design", "states", "outcome", *(HEADS[kind].split(" | ") if kind in HEADS else [])]
    head += ["cells", "CPU s", "file MB", "re-check s"]
    rows = []
    for c in claims:
        certificate = c["certificate"]
        figures = ["-"] * 3
        if certificate is not None:
            figures = [
                f"{certificate['cells']}",
                f"{certificate['bytes'] / 1e6:.1f}",
                f"{certificate['check_cpu_s']:.1f}",
            ]
        numbers = [figures[0], f"{c['cpu_s']:.1f}", *figures[1:]]
        rows.append([design(c), str(c["n_x"]), outcome(c), *_middle(kind, c), *numbers])
    return _table(head, rows)


def outcome(claim: dict[str, Any]) -> str:
    """In words, with the proved share where it is open."""
    if claim["outcome"] == "undecided" and claim.get("proved_share"):
        return f"undecided, {100 * claim['proved_share']:.1f} % of P proved"
    return str(claim["outcome"]) if claim["outcome"] == "proved" else f"**{claim['outcome']}**"


def _middle(kind: str, c: dict[str, Any]) -> list[str]:
    """Columns of one kind of claim."""
    if kind == "rate":
        return [f"{c['rate']:g}"]
    if kind not in HEADS:
        return []
    value, failed = c.get("value"), c.get("failed_value")
    beyond = "-" if failed is None else f"{failed:.4g} ({c.get('beyond', c['outcome'])})"
    if kind != "gain":
        return ["none" if value is None else f"{value:.4g}", beyond]
    found = c["found"]
    shown = ["infinite" if found is None else f"{found:.4f}", "none" if value is None else f"{value:.4f}"]
    gap = "-" if value is None or found is None else f"{100 * (value / found - 1):.2f} %"
    return [*shown, gap, beyond]


def open_ends(claims: list[dict[str, Any]]) -> list[str]:
    """Why the claims that are not proved are not, and the first that follow those that are."""
    ends = [f"* {design(c)}: {c.get('beyond', c['outcome'])}: {c['reason']}" for c in claims if c["reason"]]
    return ["", *ends] if ends else []


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    return [
        f"| {' | '.join(head)} |",
        "|" + "---|" * len(head),
        *(f"| {' | '.join(row)} |" for row in rows),
    ]
