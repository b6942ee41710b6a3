"""The figures of a Monte Carlo run that reports quote."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import betaincinv

from lpvhinf.checks import Array, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.robustness.monte_carlo import MonteCarlo
from lpvhinf.robustness.outcomes import BETTER, FIGURES, Outcomes
from lpvhinf.robustness.samples import Samples
from lpvhinf.robustness.worst_case import WorstCase

LEVELS = (0.0, 0.001, 0.01, 0.05, 0.5, 0.95, 0.99, 0.999, 1.0)


def share_bounds(count: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    r"""Clopper-Pearson bounds of a probability from `count` of `n` independent trials.

    The interval holds the probability in at least `confidence` of all experiments. Its ends are quantiles of beta
    distributions, :math:`\mathrm{B}(\alpha/2;\, k,\, n - k + 1)` and
    :math:`\mathrm{B}(1 - \alpha/2;\, k + 1,\, n - k)`.

    Raises
    ------
    DomainError
        If `count` is not one of 0 to n, or the confidence not between 0 and 1.

    References
    ----------
    Clopper and Pearson (1934), Biometrika 26, 404-413.

    Examples
    --------
    >>> low, high = share_bounds(0, 10_000)
    >>> low, round(high, 6)
    (0.0, 0.000369)
    """
    whole_number("n", n, 1)
    if whole_number("count", count, 0) > n:
        raise DomainError(f"count is {count}, wanted at most n = {n}.")
    if not 0.0 < confidence < 1.0:
        raise DomainError(f"confidence is {confidence!r}, wanted a number between 0 and 1, such as 0.95.")
    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if count == 0 else float(betaincinv(count, n - count + 1, tail))
    high = 1.0 if count == n else float(betaincinv(count + 1, n - count, 1.0 - tail))
    return low, high


def robustness_report(
    result: MonteCarlo, worst_cases: Sequence[WorstCase] = (), *, confidence: float = 0.95
) -> dict[str, Any]:
    """Quantiles, shares of unstable plants and worst plants, for JSON: SI units, norms in scaled units.

    Quantiles are values that were found, without interpolation: infinite norms are those of unstable loops.
    """
    outcomes = result.outcomes
    n_flex = outcomes.damping.shape[1]
    names = [name for name in FIGURES if n_flex or name not in ("damping", "flexible_peak")]
    quantiles = {name: _quantiles(outcomes.figure(name)) for name in names}
    sampled = {}
    for name in names:
        which = int(result.worst(name)[0])
        sampled[name] = {"plant": which, **_described(result.samples.take(which), _row(outcomes, which))}
    searched = {
        case.figure: {
            "value": case.value,
            "sampled_value": case.sampled_value,
            "tries": case.tries,
            "evaluations": case.evaluations,
            **_described(case.sample, case.outcomes),
        }
        for case in worst_cases
    }
    return {
        "n": len(result),
        "seed": result.seed,
        "uncertainty": dataclasses.asdict(result.uncertainty),
        "unstable": _share(outcomes.unstable, confidence),
        "unstable_sampled": _share(outcomes.unstable_sampled, confidence),
        "quantiles": quantiles,
        "worst_sampled": sampled,
        "worst_searched": searched,
        "better": {name: "more" if BETTER[name] > 0 else "less" for name in names},
        "recomputed_norms": len(result.recomputed),
        "largest_correction": result.largest_correction,
    }


def _share(unstable: Array, confidence: float) -> dict[str, Any]:
    count, n = int(np.sum(unstable)), len(unstable)
    low, high = share_bounds(count, n, confidence)
    return {"count": count, "share": count / n, "confidence": confidence, "lower": low, "upper": high}


def _quantiles(values: Array) -> dict[str, float]:
    ordered = np.sort(values)
    return {f"{level:g}": float(ordered[max(0, int(np.ceil(level * len(ordered))) - 1)]) for level in LEVELS}


def _row(outcomes: Outcomes, which: int) -> Outcomes:
    return Outcomes(**{name: values[[which]] for name, values in outcomes.arrays().items()})


def _described(sample: Samples, outcomes: Outcomes) -> dict[str, Any]:
    """One plant and its figures."""
    return {
        "sample": {name: values[0] for name, values in sample.arrays().items()},
        "figures": {name: values[0] for name, values in outcomes.arrays().items()},
    }
