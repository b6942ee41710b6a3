"""The trade-off between damping and rigid-body performance, from the summaries of the designs."""

from __future__ import annotations

from typing import Any

import numpy as np

TWO_BY_TWO = "two-by-two"
WORTH_SAYING = 0.02  # relative difference below which two designs count as equal: the optimiser's own scatter

Summary = dict[str, Any]


def left(summary: Summary) -> float:
    """Largest norm of the rigid-body column of the 2x2 problem over P; infinite where it is not bounded."""
    return number_or_inf(summary["columns"][TWO_BY_TWO]["rigid"])


def right(summary: Summary) -> float:
    """The same of the flexible column."""
    return number_or_inf(summary["columns"][TWO_BY_TWO]["flexible"])


def whole(summary: Summary) -> float:
    """The same of the whole M."""
    return number_or_inf(summary["columns"][TWO_BY_TWO]["whole"])


def peak(summary: Summary) -> float:
    """Largest process sensitivity near the controlled modes over the positions [dB]."""
    return number_or_inf(summary["mode_peak_dB"])


def crossover(summary: Summary) -> float:
    """Mean crossover over positions and axes [Hz]; NaN if an axis has none somewhere."""
    return float(np.mean([np.nan if f is None else f for f in summary["crossover_mean_Hz"]]))


def damping(summary: Summary) -> float:
    """Least damping ratio of a controlled mode over the positions."""
    return float(min(summary["damping_min"]))


def stable(summary: Summary) -> bool:
    """Whether the loop is stable at every position that was looked at."""
    return bool(summary["largest_real_part"] < 0.0) and summary["gamma_over_P"] is not None


def number_or_inf(value: float | None) -> float:
    """What JSON could not hold was infinite."""
    return float("inf") if value is None else float(value)


def curve(designs: dict[str, Summary], architecture: str) -> list[Summary]:
    """The stable designs of one observer in the trade-off, the least damped first, by the peak of the mode."""
    chosen = [d for d in designs.values() if d["group"] == "trade-off" and d["architecture"] == architecture]
    return sorted((d for d in chosen if stable(d) and np.isfinite(peak(d))), key=peak, reverse=True)


def cost(points: list[Summary]) -> dict[str, float] | None:
    """What the most damped design has lost against the least damped one; None without two designs."""
    if len(points) < 2:
        return None
    first, last = points[0], points[-1]
    return {
        "peak_first_dB": peak(first),
        "peak_last_dB": peak(last),
        "left_first": left(first),
        "left_last": left(last),
        "left_rise": left(last) / left(first) - 1.0,
        "crossover_first_Hz": crossover(first),
        "crossover_last_Hz": crossover(last),
        "crossover_loss": 1.0 - crossover(last) / crossover(first),
    }


def front(points: list[Summary]) -> list[Summary]:
    """The designs that no other one beats in both the peak and the left column, the most damped first."""
    kept: list[Summary] = []
    for one in sorted(points, key=peak):
        if not kept or left(one) < left(kept[-1]):
            kept.append(one)
    return kept


def at_equal_damping(error: list[Summary], output: list[Summary]) -> list[dict[str, float]]:
    """Every error-based design beside what the output-based observer needs for the same peak of the mode.

    Linear in dB between neighbours on the output-based front; beyond its least damped design, that design. An
    error-based design that is damped more than every output-based one has no row.
    """
    others = front(output)
    if not others:
        return []
    peaks = [peak(d) for d in others]
    rows = []
    for one in error:
        if peak(one) >= peaks[0]:
            needs = float(np.interp(peak(one), peaks, [left(d) for d in others]))
            rows.append(
                {
                    "epsilon": float(one["epsilon"]),
                    "peak_dB": peak(one),
                    "left_error": left(one),
                    "left_output": needs,
                    "crossover_error_Hz": crossover(one),
                    "crossover_output_Hz": float(np.interp(peak(one), peaks, [crossover(d) for d in others])),
                    "excess": left(one) / needs - 1.0,
                }
            )
    return rows


def at_equal_epsilon(error: list[Summary], output: list[Summary]) -> list[dict[str, float]]:
    """Norms over P, gamma, of both observers for the same problem and the same epsilon."""
    others = {d["epsilon"]: d for d in output}
    return [
        {
            "epsilon": d["epsilon"],
            "error": float(d["gamma_over_P"]),
            "output": float(others[d["epsilon"]]["gamma_over_P"]),
            "excess": float(d["gamma_over_P"] / others[d["epsilon"]]["gamma_over_P"]) - 1.0,
        }
        for d in sorted(error, key=lambda d: float(d["epsilon"]))
        if d["epsilon"] in others
    ]
