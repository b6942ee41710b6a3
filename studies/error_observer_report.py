"""The report of the study of the error-based observer, from its results folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.storage import read_json, write_json, write_text
from studies.error_observer_tables import (
    equal_damping_table,
    modes_table,
    seeds_table,
    trade_off_table,
)
from studies.error_observer_trade import (
    WORTH_SAYING,
    at_equal_damping,
    at_equal_epsilon,
    cost,
    curve,
    left,
    peak,
    stable,
)
from studies.results import summaries

ACTIVE_DAMPING_DB = 10.0
N_RB = 6


def write_report(out: Path) -> None:
    """Write report.json and report.md."""
    settings, designs = read_json(out / "settings.json"), summaries(out, "design")
    report = {
        "settings": settings,
        "run": read_json(out / "run.json"),
        "designs": designs,
        "equal_damping": at_equal_damping(curve(designs, "error-observer"), curve(designs, "output-observer")),
        "equal_epsilon": at_equal_epsilon(curve(designs, "error-observer"), curve(designs, "output-observer")),
        "claims": claims(settings, designs),
    }
    write_json(out / "report.json", report)
    write_text(out / "report.md", markdown(report))


def main_designs(settings: dict[str, Any], designs: dict[str, Any]) -> tuple[Any, Any, Any]:
    """Inactive, output-based and error-based design of the main epsilon."""
    epsilon = settings["epsilon"]
    return designs["inactive"], designs[f"output-epsilon-{epsilon:g}"], designs[f"error-epsilon-{epsilon:g}"]


def claims(settings: dict[str, Any], designs: dict[str, Any]) -> list[dict[str, Any]]:
    """The claims of the study, each with its figure and whether it holds."""
    inactive, output, error = main_designs(settings, designs)
    lower = peak(inactive) - peak(error)
    fewer = output["controller_states"] - error["controller_states"]
    work = error["multiplications"] / output["multiplications"] - 1.0
    unstable = [name for name, d in designs.items() if not stable(d)]
    return [
        {
            "claim": f"active damping of at least {ACTIVE_DAMPING_DB:.0f} dB at the worst position",
            "quantity": "process sensitivity from the modal force to e within half an octave of the controlled mode, "
            f"inactive against error-based, epsilon {settings['epsilon']:g}",
            "value": f"{peak(inactive):.1f} dB -> {peak(error):.1f} dB: {lower:.1f} dB lower "
            f"(output-based {peak(inactive) - peak(output):.1f} dB lower)",
            "holds": bool(lower >= ACTIVE_DAMPING_DB),
        },
        {
            "claim": f"2 n_RB = {2 * N_RB} states fewer than the output-based observer",
            "quantity": "states of the whole controller",
            "value": f"{error['controller_states']} against {output['controller_states']}: {fewer} fewer",
            "holds": fewer == 2 * N_RB,
        },
        {
            "claim": "cheaper to compute than the output-based observer",
            "quantity": "multiplications per sample of the whole controller",
            "value": f"{error['multiplications']} against {output['multiplications']}: {-100 * work:.0f} % fewer",
            "holds": bool(work < 0.0),
        },
        trade_off_claim(designs),
        ranking_claim(designs),
        {
            "claim": "all local loops stable over P",
            "quantity": f"largest real part of a pole over {error['n_dense']} positions, plant model itself",
            "value": f"inactive {inactive['largest_real_part']:.2f}, output-based {output['largest_real_part']:.2f}, "
            f"error-based {error['largest_real_part']:.2f} rad/s; "
            + (f"not stable somewhere: {', '.join(unstable)}" if unstable else f"all {len(designs)} designs stable"),
            "holds": not unstable,
        },
    ]


def trade_off_claim(designs: dict[str, Any]) -> dict[str, Any]:
    """Whether the error-based observer pays for damping with its rigid-body loop."""
    own, other = cost(curve(designs, "error-observer")), cost(curve(designs, "output-observer"))
    out = {
        "claim": "error-based: a trade-off between the rigid-body loop and the damping of the mode",
        "quantity": "largest norm of the left column over P, and mean crossover, from the least damped design to the "
        "most damped one",
    }
    if own is None:
        return out | {"value": "fewer than two stable designs", "holds": False}

    def text(name: str, c: dict[str, float]) -> str:
        return (
            f"{name}: left column {c['left_first']:.2f} -> {c['left_last']:.2f}, crossover "
            f"{c['crossover_first_Hz']:.1f} -> {c['crossover_last_Hz']:.1f} Hz, as the peak goes from "
            f"{c['peak_first_dB']:.1f} to {c['peak_last_dB']:.1f} dB"
        )

    value = text("error-based", own) + ("" if other is None else "; " + text("output-based", other))
    holds = own["left_rise"] > WORTH_SAYING and own["crossover_loss"] > WORTH_SAYING
    return out | {"value": value, "holds": bool(holds)}


def ranking_claim(designs: dict[str, Any]) -> dict[str, Any]:
    """Whether the error-based observer pays more than the output-based one for the same damping."""
    rows = at_equal_damping(curve(designs, "error-observer"), curve(designs, "output-observer"))
    out = {
        "claim": "error-based: less rigid-body performance than output-based at equal damping",
        "quantity": "excess of the left column's largest norm over P against what the output-based observer needs for "
        "the same peak",
    }
    if not rows:
        return out | {"value": "no output-based design is as well damped as an error-based one", "holds": False}
    excess = [row["excess"] for row in rows]
    last = rows[-1]
    value = (
        f"{100 * min(excess):+.1f} to {100 * max(excess):+.1f} % over {len(rows)} designs; at the lowest peak "
        f"({last['peak_dB']:.1f} dB) {last['left_error']:.2f} against {last['left_output']:.2f}"
    )
    return out | {"value": value, "holds": bool(last["excess"] > WORTH_SAYING)}


def markdown(report: dict[str, Any]) -> str:
    """The report as a page."""
    designs, settings = report["designs"], report["settings"]
    groups = {d["group"] for d in designs.values()}
    lines = [
        "# Error-based modal observer: the 2x2-block co-design, and what its damping costs",
        "",
        f"Target bandwidth {settings['f_bw']:g} Hz on six axes, {settings['n_flex']} controlled of "
        f"{settings['n_plant_modes']} flexible modes, main epsilon {settings['epsilon']:g}; all filters fixed before "
        "tuning and equal in all designs of a table. Every figure is computed with the plant model itself, not with "
        "its polynomial fit.",
        "",
        "## Summary",
        "",
        "| claim | measured | holds |",
        "|---|---|---|",
        *(f"| {c['claim']} | {c['value']} | {'yes' if c['holds'] else '**no**'} |" for c in report["claims"]),
        "",
        "## Trade-off",
        "",
        *trade_off_table(designs),
        "",
        "## At equal damping",
        "",
        *equal_damping_table(report["equal_damping"]),
        "",
    ]
    if "modes" in groups:
        lines += ["## More modes and bandwidth", "", *modes_table(designs), ""]
    if "seeds" in groups:
        lines += ["## Seeds", "", *seeds_table(settings, designs), ""]
    lines += [
        "## Notes",
        "",
        *(f"* {note}" for note in notes(settings, designs)),
        "",
        "## Run",
        "",
        f"{report['run']['wall_time_s']:.0f} s of wall time in this call, {total_cpu(designs):.0f} s of processor time "
        f"for all designs, finished {report['run']['finished']}; "
        + ", ".join(f"{name} {value}" for name, value in report["run"]["versions"].items())
        + ".",
        "",
    ]
    return "\n".join(lines)


def total_cpu(designs: dict[str, Any]) -> float:
    """Processor time of all designs and their measures [s]."""
    return float(np.sum([d["cpu_seconds"] for d in designs.values()]))


def notes(settings: dict[str, Any], designs: dict[str, Any]) -> list[str]:
    """What a reader should know about the figures, with the figures of this run."""
    _, output, error = main_designs(settings, designs)
    out = [
        "Left, right, M: largest norms over P of the weighted 2x2 problem's columns and of the whole, by a grid and a "
        "search, not by a proof. inactive was tuned on the left column alone; its right column is what nobody damps.",
        "Mode peak: from the flexible-mode input to the error, within half an octave of the controlled mode, 0 dB is "
        "the static error where the mode is best seen. Damping belongs to the pole that takes the largest part in the "
        "mode; where observer and mode share their poles it can say little, and the peak is the safer figure.",
        "At equal damping: linear between the output-based designs that no other one beats in both peak and left "
        f"column. Differences below {100 * WORTH_SAYING:.0f} % are within what the optimiser leaves.",
    ]
    pairs = [(name, d.get("coupling")) for name, d in (("output-based", output), ("error-based", error))]
    text = ", ".join(f"{name} {'unbounded' if c is None else f'{100 * c:.1f} %'}" for name, c in pairs)
    out.append(f"Coupling of the two loops, change of the left column when xi is set to zero at the same K_RB: {text}.")
    if left(error) > 1.0:
        out.append(
            f"gamma is above 1 in every design that keeps {settings['f_bw']:g} Hz: the filters ask for more than "
            "can be had."
        )
    unstable = [name for name, d in designs.items() if not stable(d)]
    if unstable:
        out.append(f"Unstable at some position: {', '.join(unstable)}; they take no part in the trade-off.")
    largest = max(d["fit_error"]["B"] for d in designs.values())
    out.append(f"Largest error of the polynomial plant's input gains, relative to the largest gain: {largest:.1e}.")
    return out
