"""The sections of the report, each a list of Markdown lines from the runs of one part."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import median
from typing import Protocol

import numpy as np

from benchmarks.hinfstruct.actuator import ActuatorRun
from benchmarks.hinfstruct.compleib import CompleibRun
from benchmarks.hinfstruct.scaling import LARGE, MIDDLE, ScalingRun

#: A run counts as a success up to this multiple of the best known norm, or below this norm.
WITHIN, VANISHING = 1.001, 1e-3
#: A record lies below this multiple of the best known norm.
RECORD = 0.999
#: How far SLICOT's norm may lie from the one reported, relatively or absolutely.
RELATIVE, ABSOLUTE = 1e-6, 1e-9
#: What a co-design promises: a position of P is worse than its active set by at most this part.
EXCHANGE = 0.01
#: Times to keep [s]: CPU of one system of COMPleib; wall of a 6-axis co-design and of the large synthetic problem.
SECONDS_SYSTEM, SECONDS_ACTUATOR, SECONDS_LARGE = 10.0, 90.0, 180.0


class Checked(Protocol):
    """A run whose norm was computed by SLICOT, too."""

    @property
    def gamma(self) -> float:
        """The norm reported."""

    @property
    def slicot(self) -> float:
        """SLICOT's norm over it."""


def success(run: CompleibRun) -> bool:
    """Reached the best known norm."""
    return run.gamma <= max(WITHIN * run.best_known, VANISHING if run.best_known < VANISHING else 0.0)


def compleib_section(runs: Iterable[CompleibRun]) -> list[str]:
    """Static output feedback against the best known norms and HIFOO, and a table of all systems."""
    groups: dict[tuple[str, int], list[CompleibRun]] = {}
    for run in runs:
        groups.setdefault((run.name, run.order), []).append(run)
    static = [g for (_, order), g in groups.items() if order == 0]
    everything = [r for g in groups.values() for r in g]
    records = [g for g in static if _best(g).ratio < RECORD and g[0].best_known >= VANISHING]
    compared = [g for g in static if np.isfinite(g[0].hifoo_cpu)]
    worse = [g[0].name for g in static if max(r.gamma for r in g) > WITHIN * g[0].hifoo and not all(map(success, g))]
    slow = sorted({r.name for g in static for r in g if r.cpu > SECONDS_SYSTEM})
    lines = [
        f"- Systems within {WITHIN} of the best known norm for at least nine of ten seeds: "
        f"{sum(sum(map(success, g)) >= 0.9 * len(g) for g in static)} of {len(static)} "
        f"(seeds a system: {_counts(len(g) for g in static)}).",
        f"- New smallest norms (ratio below {RECORD}): "
        + (
            "; ".join(f"{g[0].name} {_best(g).gamma:.6g} (known {g[0].best_known:.6g})" for g in records)
            if records
            else "none"
        )
        + ".",
        f"- Systems with a seed that ends more than 0.1 % above HIFOO's norm: {_names(worse)}.",
        f"- CPU of a seed over the systems that HIFOO solved: {_total(compared):.0f} s (HIFOO "
        f"{sum(g[0].hifoo_cpu for g in compared):.0f} s); over all {_total(static):.0f} s; most for a run "
        f"{max((r.cpu for g in static for r in g), default=np.nan):.1f} s. Above {SECONDS_SYSTEM:.0f} s: "
        f"{_names(slow)}.",
        _agreement(everything),
        "",
        "| system | order | seeds | reached | gamma, best | median | worst | best known | HIFOO | ratio, worst "
        "| CPU [s] | HIFOO [s] | evaluations |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for (system, order), g in groups.items():
        gammas = [r.gamma for r in g]
        known = np.isfinite(g[0].best_known)
        lines.append(
            f"| {system} | {order} | {len(g)} | {sum(map(success, g)) if known else '-'} | {min(gammas):.6g} "
            f"| {median(gammas):.6g} | {max(gammas):.6g} | {number(g[0].best_known)} | {number(g[0].hifoo)} "
            f"| {number(max(r.ratio for r in g), '.4f')} | {median(r.cpu for r in g):.1f} | {number(g[0].hifoo_cpu)} "
            f"| {median(r.trials for r in g):.0f} |"
        )
    return lines


def actuator_section(runs: Sequence[ActuatorRun]) -> list[str]:
    """Co-designs of the planar actuator."""
    whole = [r for r in runs if r.axes == 6]
    kept = sum(r.wall <= SECONDS_ACTUATOR for r in whole)
    lines = [
        f"- 6-axis co-designs within {SECONDS_ACTUATOR:.0f} s of wall time: {kept} of {len(whole)}; longest "
        f"{max((r.wall for r in whole), default=np.nan):.0f} s.",
        f"- No position of P found to be worse than the active set by more than {100.0 * EXCHANGE:.0f} %: "
        f"{sum(r.gamma_worst <= (1.0 + EXCHANGE) * r.gamma < np.inf for r in runs)} of {len(runs)} co-designs.",
        _agreement(runs),
        "",
        "| axes | preserved | architecture | modes | field | states | with filters | parameters | positions | gamma "
        "| gamma over P | exact norms | every model / exact | wall [s] | CPU [s] | jobs | fit [s] "
        "| observer's fit [s] |",
        "|---:|---:|---|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {r.axes} | {r.n_flex} | {r.architecture} | {r.modes} | {r.magnetics} | {r.states} | {r.states_weighted} "
        f"| {r.parameters} | {r.positions} | {r.gamma:.4f} | {r.gamma_worst:.4f} | {r.exact} "
        f"| {r.saving:.1f} | {r.wall:.1f} | {r.cpu:.1f} | {r.jobs} | {r.fit:.1f} | {r.fit_observer:.1f} |"
        for r in runs
    ]
    return lines


def scaling_section(runs: Sequence[ScalingRun]) -> list[str]:
    """Synthetic problems: the one with a time to keep, then a table for each size that varies."""
    large = [r for r in runs if r.key == LARGE.key]
    lines = [
        f"- {r.n_x} states, {r.n_models} plants, {r.n_parameters} parameters: {r.wall:.0f} s of wall time, wanted at "
        f"most {SECONDS_LARGE:.0f} s."
        for r in large
    ]
    lines.append(_agreement(runs))
    series: dict[str, list[ScalingRun]] = {"States": [], "Plants": [], "Parameters": [], "Others": []}
    for r in sorted(runs, key=lambda r: (r.n_x, r.n_models, r.n_parameters)):
        same = (r.n_x == MIDDLE.n_x, r.n_models == MIDDLE.n_models, r.n_parameters == MIDDLE.n_parameters)
        varied = [name for name, k in (("States", 0), ("Plants", 1), ("Parameters", 2)) if all(np.delete(same, k))]
        for name in varied or ["Others"]:
            series[name].append(r)
    for name, rows in series.items():
        if not rows:
            continue
        lines += [
            "",
            f"### {name}",
            "",
            "| states | plants | parameters | gamma | lower bound | SLICOT - 1 | trials | exact norms | every model "
            "| every model / exact | wall [s] | CPU [s] | jobs |",
            "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
        ]
        lines += [
            f"| {r.n_x} | {r.n_models} | {r.n_parameters} | {r.gamma:.6g} | {number(r.lower_bound)} "
            f"| {r.slicot - 1.0:.1e} | {r.trials} | {r.exact} | {r.every_model} | {r.saving:.2f} | {r.wall:.1f} "
            f"| {r.cpu:.1f} | {r.jobs} |"
            for r in rows
        ]
    return lines


def number(value: float, form: str = ".6g") -> str:
    """A number, or a dash where there is none."""
    return format(value, form) if np.isfinite(value) else "-"


def _agreement(runs: Sequence[Checked]) -> str:
    """How far the norms reported are from SLICOT's."""
    solved = [r for r in runs if np.isfinite(r.gamma)]
    far = [abs(r.slicot - 1.0) for r in solved]
    good = sum(d <= RELATIVE or d * r.gamma <= ABSOLUTE for d, r in zip(far, solved, strict=True))
    return (
        f"- Solved: {len(solved)} of {len(runs)} runs. Within {RELATIVE:g} (relative) or {ABSOLUTE:g} (absolute) of "
        f"SLICOT's norm: {good} of these; largest relative difference {max(far, default=0.0):.1e}."
    )


def _best(group: list[CompleibRun]) -> CompleibRun:
    return min(group, key=lambda r: r.gamma)


def _total(groups: list[list[CompleibRun]]) -> float:
    return float(sum(median(r.cpu for r in g) for g in groups))


def _names(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "none"


def _counts(sizes: Iterable[int]) -> str:
    found = sorted(set(sizes))
    return " to ".join(str(n) for n in dict.fromkeys((found[0], found[-1]))) if found else "none"
