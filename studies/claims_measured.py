"""What the results say of the paper's claims, a function each, from the reports of the studies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.error_observer_report import ACTIVE_DAMPING_DB, N_RB, main_designs
from studies.error_observer_trade import (
    WORTH_SAYING,
    at_equal_damping,
    at_equal_epsilon,
    cost,
    crossover,
    curve,
    damping,
    left,
    number_or_inf,
    peak,
    whole,
)
from studies.output_observer_report import CROSSOVER_TOLERANCE, PEAK_REDUCTION_DB

Reports = dict[str, Any]
OUTPUT, ERROR, FEEDFORWARD = "output_observer", "error_observer", "feedforward"
COUPLED = 0.01  # relative change of the rigid-body columns from which on two loops count as coupled


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What the results say of one claim.

    Attributes
    ----------
    quantity : str
        What we measure for it.
    conventional, output, error : str
        Values of the conventional (or inactive), the output-based and the error-based design.
    holds : bool or None
        None where it is not measured.
    margin : str
        By how much.
    """

    quantity: str = ""
    conventional: str = ""
    output: str = ""
    error: str = ""
    holds: bool | None = None
    margin: str = ""


def dB(value: float) -> str:
    """A level."""
    return f"{value:.1f} dB" if np.isfinite(value) else "unbounded"


def norm(value: float) -> str:
    """A norm."""
    return f"{value:.2f}" if np.isfinite(value) else "unbounded"


def percent(value: float, digits: int = 1) -> str:
    """A ratio."""
    return f"{100 * value:.{digits}f} %" if np.isfinite(value) else "unbounded"


def of_output_study(reports: Reports) -> tuple[Any, Any, Any]:
    """Conventional with rigid-body decoupling, conventional with the extended one, and the observer."""
    designs = reports[OUTPUT]["designs"]
    return designs["conventional-rigid"], designs["conventional"], designs["observer"]


def of_error_study(reports: Reports) -> tuple[Any, Any, Any]:
    """Inactive, output-based and error-based design of the main epsilon."""
    return main_designs(reports[ERROR]["settings"], reports[ERROR]["designs"])


def curves(reports: Reports) -> tuple[list[Any], list[Any]]:
    """The trade-off of the error-based and of the output-based observer."""
    designs = reports[ERROR]["designs"]
    return curve(designs, "error-observer"), curve(designs, "output-observer")


# The abstract


def flexibility_limits(reports: Reports) -> Measured:
    """The mode in the rigid-body loop, and what it takes from gamma."""
    rigid, plain, _ = of_output_study(reports)
    a, b = number_or_inf(rigid["gamma_worst"]), number_or_inf(plain["gamma_worst"])
    level = number_or_inf(rigid["mode_peak_dB"])
    return Measured(
        quantity="rigid-body decoupling (eq. 6): worst peak of the mode in the process sensitivity over its static "
        "value; gamma over P of the 4-block problem, with and without mode 1 in the rigid-body loop",
        conventional=f"{dB(level)}; {norm(a)} with, {norm(b)} without",
        holds=bool(level > ACTIVE_DAMPING_DB and a > (1.0 + WORTH_SAYING) * b),
        margin=f"gamma {100 * (a / b - 1.0):+.1f} % with the mode in the loop",
    )


def both_observers_damp(reports: Reports) -> Measured:
    """Damping ratios of the controlled mode."""
    designs = of_error_study(reports)
    values = [damping(d) for d in designs]
    factors = [v / values[0] for v in values[1:]]
    return Measured(
        quantity="least damping ratio of the controlled mode over P, same problem and filters",
        conventional=percent(values[0]),
        output=percent(values[1]),
        error=percent(values[2]),
        holds=bool(min(factors) > 2.0),
        margin=f"{factors[0]:.0f} and {factors[1]:.0f} times the damping of the inactive loop",
    )


def full_loop_is_shaped(reports: Reports) -> Measured:
    """The norm of the whole 2x2 M."""
    values = [whole(d) for d in of_error_study(reports)]
    ok = bool(np.all(np.isfinite(values[1:])) and max(values[1:]) < values[0])
    return Measured(
        quantity="largest norm of the whole 2x2 M over P (1 would meet every filter)",
        conventional=norm(values[0]),
        output=norm(values[1]),
        error=norm(values[2]),
        holds=ok,
        margin=f"{values[0] / values[1]:.1f} and {values[0] / values[2]:.1f} times lower than inactive; "
        + ("no design reaches 1" if min(values) > 1.0 else "1 is reached"),
    )


def validated(reports: Reports) -> Measured:
    """Poles over the dense grid."""
    plain, output, error = of_error_study(reports)
    values = [d["largest_real_part"] for d in (plain, output, error)]
    n_unstable = sum(d["largest_real_part"] >= 0.0 for d in reports[ERROR]["designs"].values())
    return Measured(
        quantity=f"largest real part of a pole over {error['n_dense']} frozen positions, full plant model [rad/s]",
        conventional=f"{values[0]:.2f}",
        output=f"{values[1]:.2f}",
        error=f"{values[2]:.2f}",
        holds=max(values) < 0.0,
        margin=f"{n_unstable} of {len(reports[ERROR]['designs'])} designs unstable somewhere; moving positions are not "
        "measured here",
    )


# Section V-A


def output_damps(reports: Reports) -> Measured:
    """The peak of the mode in the 6-block problem."""
    _, plain, observer = of_output_study(reports)
    a, b = number_or_inf(plain["mode_peak_dB"]), number_or_inf(observer["mode_peak_dB"])
    return Measured(
        quantity="worst peak of the controlled mode in the third column, 6-block problem",
        conventional=dB(a),
        output=dB(b),
        holds=bool(a - b >= PEAK_REDUCTION_DB),
        margin=f"{a - b:.1f} dB lower",
    )


def similar_bandwidth(reports: Reports) -> Measured:
    """Crossovers of the 4-block and the 6-block design."""
    _, plain, observer = of_output_study(reports)
    change = [np.nan if None in pair else pair[1] / pair[0] - 1.0 for pair in zip_crossovers(plain, observer)]
    worst = float(np.max(np.abs(change)))
    return Measured(
        quantity="mean crossover over P and axes",
        conventional=f"{crossover(plain):.1f} Hz",
        output=f"{crossover(observer):.1f} Hz",
        holds=bool(worst <= CROSSOVER_TOLERANCE),
        margin=f"at most {percent(worst)} apart on any axis",
    )


def zip_crossovers(one: Any, other: Any) -> list[tuple[Any, Any]]:
    """Mean crossovers of every axis of two designs."""
    return list(zip(one["crossover_mean_Hz"], other["crossover_mean_Hz"], strict=True))


def decoupling_hides_modes(reports: Reports) -> Measured:
    """The conventional design with both decouplings."""
    rigid, plain, _ = of_output_study(reports)
    gain = crossover(plain) / crossover(rigid) - 1.0
    a, b = number_or_inf(rigid["gamma_worst"]), number_or_inf(plain["gamma_worst"])
    return Measured(
        quantity="conventional design, rigid-body and extended decoupling: mean crossover; gamma over P",
        conventional=f"{crossover(rigid):.1f} -> {crossover(plain):.1f} Hz; {norm(a)} -> {norm(b)}",
        holds=bool(gain > WORTH_SAYING),
        margin=f"crossover {100 * gain:+.1f} %, gamma {100 * (b / a - 1.0):+.1f} %",
    )


def feedforward_spares_modes(reports: Reports) -> Measured:
    """Force of the feedforward on the modes."""
    (claim,) = reports[FEEDFORWARD]["claims"]
    return Measured(
        quantity=claim["quantity"],
        holds=bool(claim["holds"]),
        margin=claim["value"],
    )


def output_performs_better(reports: Reports) -> Measured:
    """Norms of the whole M and of the columns that all share."""
    plain, output, error = of_error_study(reports)
    norms = [left(d) for d in (plain, output, error)]
    values = [whole(d) for d in (plain, output, error)]
    return Measured(
        quantity="largest norm over P of the whole 2x2 M; of its rigid-body column alone",
        conventional=f"{norm(values[0])}; {norm(norms[0])}",
        output=f"{norm(values[1])}; {norm(norms[1])}",
        error=f"{norm(values[2])}; {norm(norms[2])}",
        holds=bool(values[1] < (1.0 - WORTH_SAYING) * values[0]),
        margin=f"output-based: whole {values[0] / values[1]:.1f} times lower; rigid-body column "
        f"{100 * (norms[1] / norms[0] - 1.0):+.1f} %",
    )


# Section V-B


def loops_are_coupled(reports: Reports) -> Measured:
    """What the observer changes in the rigid-body column."""
    _, output, error = of_error_study(reports)
    a, b = number_or_inf(output["coupling"]), number_or_inf(error["coupling"])
    return Measured(
        quantity="change of the rigid-body column by the observer at the same K_RB, worst position",
        output=percent(a),
        error=percent(b),
        holds=bool(b > COUPLED),
        margin=f"{b / a:.1f} times that of the output-based observer" if np.isfinite(a) and a > 0.0 else "",
    )


def error_damps(reports: Reports) -> Measured:
    """The peak of the mode in the 2x2 problem."""
    plain, output, error = of_error_study(reports)
    values = [peak(d) for d in (plain, output, error)]
    return Measured(
        quantity="worst peak of the controlled mode in the right column, 2x2 problem",
        conventional=dB(values[0]),
        output=dB(values[1]),
        error=dB(values[2]),
        holds=bool(values[0] - values[2] >= ACTIVE_DAMPING_DB),
        margin=f"{values[0] - values[2]:.1f} dB lower than inactive",
    )


def trade_off(reports: Reports) -> Measured:
    """What both observers lose from the least damped design to the most damped one."""
    texts, lost = [], []
    for points in curves(reports):
        c = cost(points)
        lost.append(c)
        texts.append(
            "fewer than two stable designs"
            if c is None
            else f"{c['peak_first_dB']:.1f} -> {c['peak_last_dB']:.1f} dB: left {c['left_first']:.2f} -> "
            f"{c['left_last']:.2f}, crossover {c['crossover_first_Hz']:.1f} -> {c['crossover_last_Hz']:.1f} Hz"
        )
    own = lost[0]
    return Measured(
        quantity="largest norm of the left column over P and mean crossover, from the least to the most damped design",
        output=texts[1],
        error=texts[0],
        holds=own is not None and own["left_rise"] > WORTH_SAYING and own["crossover_loss"] > WORTH_SAYING,
        margin=""
        if own is None
        else f"error-based: left {100 * own['left_rise']:+.0f} %, crossover {-100 * own['crossover_loss']:+.0f} %",
    )


def error_is_limited(reports: Reports) -> Measured:
    """The left column at equal damping."""
    pairs = at_equal_damping(*curves(reports))
    what = "largest norm of the left column over P at equal peak of the mode, at the lowest peak that both reach"
    if not pairs:
        return Measured(
            quantity=what,
            holds=False,
            margin="output-based never damps as much",
        )
    last, excess = pairs[-1], [pair["excess"] for pair in pairs]
    return Measured(
        quantity=what,
        output=norm(last["left_output"]),
        error=norm(last["left_error"]),
        holds=bool(last["excess"] > WORTH_SAYING),
        margin=f"{100 * last['excess']:+.1f} % at {last['peak_dB']:.1f} dB; "
        f"{100 * min(excess):+.1f} to {100 * max(excess):+.1f} % over {len(pairs)} designs",
    )


# The conclusions


def error_is_cheaper(reports: Reports) -> Measured:
    """States and multiplications."""
    plain, output, error = of_error_study(reports)
    fewer = output["controller_states"] - error["controller_states"]
    less = 1.0 - error["multiplications"] / output["multiplications"]
    values = [f"{d['controller_states']}; {d['multiplications']}" for d in (plain, output, error)]
    return Measured(
        quantity="states of the controller; multiplications per sample",
        conventional=values[0],
        output=values[1],
        error=values[2],
        holds=bool(fewer == 2 * N_RB and less > 0.0),
        margin=f"{fewer} states and {percent(less, 0)} of the multiplications fewer",
    )


def complexity_costs_performance(reports: Reports) -> Measured:
    """Gamma over P of the 2x2 problem for every epsilon."""
    pairs = at_equal_epsilon(*curves(reports))
    what = "gamma over P of the same 2x2 problem, every epsilon"
    if not pairs:
        return Measured(quantity=what, margin="no epsilon with two stable designs")
    excess = [pair["excess"] for pair in pairs]
    return Measured(
        quantity=what,
        output=", ".join(f"{pair['output']:.2f}" for pair in pairs),
        error=", ".join(f"{pair['error']:.2f}" for pair in pairs),
        holds=bool(np.mean(excess) > WORTH_SAYING),
        margin=f"{100 * min(excess):+.1f} to {100 * max(excess):+.1f} %, mean {100 * np.mean(excess):+.1f} %, for "
        "epsilon " + ", ".join(f"{pair['epsilon']:g}" for pair in pairs),
    )
