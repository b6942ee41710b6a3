"""The report of the LPV study, from its results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lpvhinf.storage import read_json, write_json, write_text
from studies.error_observer_tables import table
from studies.results import summaries


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    report = {
        "settings": read_json(out / "settings.json"),
        "run": read_json(out / "run.json"),
        "designs": summaries(out, "design"),
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def title(design: dict[str, Any]) -> str:
    """What a row or a curve is called."""
    n, degree, speed = design["n_grid"] ** 2, design["degree"], design["speed"]
    if design["kind"] == "gridded" and not degree:
        return f"gridded, {n} points, constant R and S, any rate"
    if design["kind"] == "gridded":
        return f"gridded, {n} points, R(p) of degree {degree}, {speed:g} m/s"
    return {
        "pointwise": f"at rest, each of {n} points alone (bound)",
        "state-feedback": f"state feedback, {n} points, {speed or 0.0:g} m/s (bound)",
        "polytopic": "polytopic, 4 vertices, any rate",
        "rigid-body": f"co-design, K_RB alone, {n} points",
        "output-observer": f"co-design, K_RB, L and xi, {n} points",
    }[design["kind"]]


def number(value: Any, digits: int = 3) -> str:
    """A figure; a dash where there is none, "unstable" where it is infinite."""
    return "-" if value is None else f"{value:.{digits}f}"


ORDER = ("pointwise", "state-feedback", "gridded", "polytopic", "rigid-body", "output-observer")


def ordered(designs: dict[str, Any]) -> list[dict[str, Any]]:
    """Bounds first, then scheduled designs, then those of constant gains."""
    rank = {kind: k for k, kind in enumerate(ORDER)}
    return sorted(designs.values(), key=lambda d: (rank[d["kind"]], d["degree"], d["n_grid"], d["speed"] or 0.0))


def design_table(designs: dict[str, Any]) -> list[str]:
    """One row a design."""
    head = ("design", "gamma", "achieved", "order", "fastest pole [rad/s]", "fit error", "design plant")
    rows = []
    for d in ordered(designs):
        judged = "n_positions" in d
        near = number(d.get("near_worst")) if judged and d["near_stable"] == d["n_positions"] else "-"
        if judged and d["near_stable"] < d["n_positions"]:
            near = f"unstable at {d['n_positions'] - d['near_stable']}"
        whole = judged and d["true_stable"] == d["n_positions"]
        rows.append(
            [
                title(d),
                "none found" if d["gamma"] is None else number(d["gamma"]),
                number(d.get("gamma_achieved")),
                str(d.get("order", "-")),
                "-" if d.get("fastest_pole") is None else f"{d['fastest_pole']:.2g}",
                "-" if d.get("fit_error") is None else f"{d['fit_error']:.0e}",
                near,
                f"{d['true_stable']} of {d['n_positions']}" if judged else "-",
                number(d["true_worst"]) if whole else "-",
                number(d["true_median"]) if whole else "-",
                f"{d['cpu_s']:.1f}",
            ]
        )
    return table((*head, "stable in truth", "worst in truth", "median in truth", "CPU s"), rows)


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    designs, settings, run = report["designs"], report["settings"], report["run"]
    failed = {name: d["status"] for name, d in designs.items() if d["gamma"] is None}
    lines = [
        "# Scheduled controllers of full order on the out-of-plane axes",
        "",
        f"z, rx and ry at {settings['f_bw']:g} Hz, {settings['n_flex']} preserved of {settings['n_plant_modes']} "
        f"flexible modes; {next(iter(designs.values()))['n_full']} states of the generalized plant. In every design "
        f"u_FM is weighted by {settings['u_FM_weight']:g}, the redundant reading has noise {settings['noise']:g}, the "
        f"integrator leaks at {settings['leak']:g} of 2 pi f_I, and "
        f"{settings['uncertainty']:g} s/(s + 2 pi {settings['f_uncertainty']:g} Hz) on u stands for the discarded "
        "modes.",
        "",
        "*Design plant*: largest norm at positions between the grid points, at rest, of the polynomial fit of the "
        "controller. *In truth*: the same with all modes of the plant model, without the outputs of the uncertainty "
        "weight.",
        "",
        *design_table(designs),
        "",
        *[f"- {name}: {status}" for name, status in failed.items()],
        "",
        "## Findings",
        "",
        *[f"- {text}" for text in findings(designs)],
        "",
        "## Limitations",
        "",
        "- gamma of a gridded design is proved at its grid points only, gamma of a co-design is what its run reached "
        "at its points at rest, and bounds nothing for moving p.",
        "- One choice of weights; noise and uncertainty weight of the paper preset were chosen from four trial "
        "settings on a coarser plant, with the stability of the full plant in view.",
        f"- The co-designs are one start of at most {settings['max_iterations']} iterations.",
        "- Where r_max is active (bound_activity in report.json near 1) a larger one may lower gamma.",
        "- S is constant in all gridded designs, so that the controller needs no dp/dt.",
        "- Truth is looked at for frozen p, at spread positions: no certificate.",
        "- State feedback has no observer here: it is a bound on what measuring everything is worth.",
        "- The polytopic design leaves the compliance out, because B2 and D12 would depend on p, has lags of "
        f"{settings['f_lag']:g} Hz on y, and 2 scheduling variables; it is judged with the compliance, without lags.",
        "",
        f"Wall time of the last call {run['wall_time_s']:.0f} s.",
    ]
    return "\n".join(lines) + "\n"


def findings(designs: dict[str, Any]) -> list[str]:
    """What the table says, in words that follow from its figures."""
    lines = []
    bound = max((d["gamma"] for d in designs.values() if d["kind"] == "pointwise"), default=None)
    gridded = [d for d in designs.values() if d["kind"] == "gridded" and d["degree"] and d["gamma"] is not None]
    constant = [d for d in designs.values() if d["kind"] == "gridded" and not d["degree"] and d["gamma"] is not None]
    lti = designs.get("output-observer")
    if gridded and constant:
        best = min(gridded, key=lambda d: float(d["gamma"]))
        same = next((d for d in constant if d["n_grid"] == best["n_grid"]), constant[0])
        lines.append(
            f"R(p) is worth {100 * (1 - best['gamma'] / same['gamma']):.1f} % of gamma against constant R and S "
            f"({best['gamma']:.3f} and {same['gamma']:.3f})."
        )
        if bound is not None:
            lines.append(
                f"It is {100 * (best['gamma'] / bound - 1):.1f} % above the largest optimum of a single point at rest, "
                f"{bound:.3f}."
            )
    rows: dict[tuple[int, int], list[dict[str, Any]]] = {}
    for d in gridded:
        rows.setdefault((d["n_grid"], d["degree"]), []).append(d)
    for (n, degree), row in rows.items():
        low, high = min(row, key=lambda d: float(d["speed"])), max(row, key=lambda d: float(d["speed"]))
        change = 100 * (high["gamma"] / low["gamma"] - 1)
        lines.append(
            f"From {low['speed']:g} to {high['speed']:g} m/s gamma changes by {change:.2f} % ({n * n} points, degree "
            f"{degree})."
        )
    if lti and lti["gamma"] is not None and gridded:
        best = min(gridded, key=lambda d: float(d["gamma"]))
        word = "below" if best["gamma"] < lti["gamma"] else "above"
        lines.append(
            f"The best scheduled gamma, {best['gamma']:.3f}, is {word} that of the structured co-design at rest, "
            f"{lti['gamma']:.3f}. The former holds for moving p, the latter does not."
        )
        if all(d.get("true_stable") == d.get("n_positions") for d in (best, lti)):
            lines.append(
                f"In truth, at rest, their largest norms are {best['true_worst']:.3f} and {lti['true_worst']:.3f}, "
                f"with {best['order']} and {lti['order']} states."
            )
        else:
            lines.append("In truth one of the two is not stable at some position: see the table.")
    return lines
