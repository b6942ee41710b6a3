"""The tables of the report of the error-based observer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from studies.error_observer_trade import crossover, damping, left, number_or_inf, peak, right, whole
from studies.output_observer_report import number

LABELS = {"rigid-body": "none", "output-observer": "output-based", "error-observer": "error-based"}


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table in Markdown."""
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]


def digits(value: float, n: int) -> str:
    """A figure, or what stands for one that is not finite."""
    return number(value if np.isfinite(value) else None, n)


def percent(values: Sequence[float]) -> str:
    """Damping ratios in percent."""
    low, high = 100.0 * min(values), 100.0 * max(values)
    return f"{low:.1f}" if f"{low:.1f}" == f"{high:.1f}" else f"{low:.1f}-{high:.1f}"


def trade_off_table(designs: dict[str, Any]) -> list[str]:
    """One row a design, by observer and epsilon."""
    chosen = [d for d in designs.values() if d["group"] == "trade-off"]
    order = list(LABELS)
    reference = peak(designs["inactive"])
    rows = []
    for d in sorted(chosen, key=lambda d: (order.index(d["architecture"]), d["epsilon"])):
        alone = d["architecture"] == "rigid-body"
        rows.append(
            [
                LABELS[d["architecture"]],
                "" if alone else f"{d['epsilon']:g}",
                number(d["gamma"], 3),
                number(d["gamma_over_P"], 3),
                digits(left(d), 2),
                digits(right(d), 2),
                digits(crossover(d), 1),
                digits(peak(d), 1),
                "" if alone else f"{reference - peak(d):.1f}",
                percent([*d["damping_min"], *d["damping_max"]]),
                f"{100 * d['discarded_damping_min']:.2f}",
                f"{d['largest_real_part']:.2f}",
                str(d["controller_states"]),
                str(d["multiplications"]),
            ]
        )
    head = (
        "observer, epsilon, gamma, over P, left over P, right over P, crossover Hz (mean), mode peak dB, lower by dB, "
        "damping %, discarded modes least damping %, largest Re rad/s, states, multiplications"
    )
    return table(head.split(", "), rows)


def equal_damping_table(rows: list[dict[str, float]]) -> list[str]:
    """Error-based designs beside what the output-based observer needs for the same peak."""
    if not rows:
        return ["No output-based design damps as well as one of the error-based designs."]
    head = (
        "epsilon of the error-based design, mode peak dB, left over P error-based, output-based, excess %, "
        "crossover Hz (mean) error-based, output-based"
    )
    body = [
        [
            f"{row['epsilon']:g}",
            f"{row['peak_dB']:.1f}",
            f"{row['left_error']:.2f}",
            f"{row['left_output']:.2f}",
            f"{100 * row['excess']:+.1f}",
            digits(row["crossover_error_Hz"], 1),
            digits(row["crossover_output_Hz"], 1),
        ]
        for row in rows
    ]
    return table(head.split(", "), body)


def modes_table(designs: dict[str, Any]) -> list[str]:
    """Controlled modes and bandwidths, each design for its own problem of the paper."""
    order = list(LABELS)
    chosen = [d for d in designs.values() if d["group"] == "modes"]
    rows = [
        [
            f"{d['f_bw']:g}",
            str(d["n_flex"]),
            LABELS[d["architecture"]],
            number(d["gamma"], 3),
            number(d["gamma_over_P"], 3),
            digits(number_or_inf(d["columns"]["six-block"]["rigid"]), 2),
            digits(left(d), 2),
            digits(crossover(d), 1),
            digits(peak(d), 1),
            f"{100 * damping(d):.1f}",
            f"{100 * d['discarded_damping_min']:.2f}",
            f"{d['largest_real_part']:.2f}",
            str(d["controller_states"]),
            str(d["multiplications"]),
        ]
        for d in sorted(chosen, key=lambda d: (d["f_bw"], d["n_flex"], order.index(d["architecture"])))
    ]
    head = (
        "f_bw Hz, n_flex, observer, gamma, over P, rigid-body columns of the 6-block problem over P, left column of "
        "the 2x2 problem over P, crossover Hz (mean), mode peak dB, least damping %, discarded modes least damping %, "
        "largest Re rad/s, states, multiplications"
    )
    return table(head.split(", "), rows)


def seeds_table(settings: dict[str, Any], designs: dict[str, Any]) -> list[str]:
    """Smallest and largest figures of the main designs over the seeds."""
    main = f"epsilon-{settings['epsilon']:g}"
    names = {"rigid-body": "inactive", "output-observer": f"output-{main}", "error-observer": f"error-{main}"}
    rows = []
    for architecture, name in names.items():
        group = [d for d in designs.values() if d["group"] == "seeds" and d["architecture"] == architecture]
        group.insert(0, designs[name])

        def span(values: list[float], n: int) -> str:
            return f"{digits(min(values), n)}-{digits(max(values), n)}"

        rows.append(
            [
                LABELS[architecture],
                str(len(group)),
                span([number_or_inf(d["gamma"]) for d in group], 3),
                span([number_or_inf(d["gamma_over_P"]) for d in group], 3),
                span([left(d) for d in group], 2),
                span([whole(d) for d in group], 2),
                span([crossover(d) for d in group], 1),
                span([peak(d) for d in group], 1),
                span([100 * damping(d) for d in group], 1),
                span([d["largest_real_part"] for d in group], 2),
            ]
        )
    head = (
        "observer, designs, gamma, over P, left over P, M over P, crossover Hz (mean), mode peak dB, least damping %, "
        "largest Re rad/s"
    )
    return table(head.split(", "), rows)
