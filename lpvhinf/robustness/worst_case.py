"""The worst plant and position, by ascent from the worst ones of a sample: more than sampling alone finds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, known_options, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.progress import SILENT, Progress
from lpvhinf.robustness.monte_carlo import MonteCarlo
from lpvhinf.robustness.outcomes import BETTER, FIGURES, Analysis, Outcomes
from lpvhinf.robustness.samples import Samples

DIFFERENCE = 1e-4  # of a coordinate of the unit cube, for slopes
FIRST_STEP, LAST_STEP = 0.2, 1e-3  # of every coordinate
SHRINKS = np.array([1.0, 0.5, 0.25, 0.1])  # steps that are tried at once


@dataclass(frozen=True, kw_only=True, eq=False)
class WorstCase:
    """What `worst_case` returns.

    Attributes
    ----------
    figure : str
        What was made as bad as possible, one of `Outcomes`.
    value : float
        It at the worst plant; norms are exact.
    sampled_value : float
        The worst value of the sample that the search began from.
    sample : Samples
        The worst plant, with its position: one row.
    unit : (dimension,)
        Its point of the unit cube.
    outcomes : Outcomes
        All its figures, norms computed exactly: one row.
    tries : (n_starts,)
        What every ascent reached.
    evaluations : int
        Plants that were looked at.
    """

    figure: str
    value: float
    sampled_value: float
    sample: Samples
    unit: Array
    outcomes: Outcomes
    tries: Array
    evaluations: int


def worst_case(
    result: MonteCarlo,
    figure: str = "abscissa",
    *,
    n_starts: int = 4,
    max_evaluations: int = 1500,
    progress: Progress = SILENT,
) -> WorstCase:
    r"""Search perturbations and position together for the worst value of a figure.

    From each of the worst plants of a Monte Carlo run, f is linearised by differences in the unit cube, and all
    coordinates go by the same step into the direction that makes f worse, the best answer of

    .. math:: \max_d\ \nabla f^\top d, \quad |d_i| \le \Delta, \quad u + d \in [0, 1]^n,

    or by steps in proportion to the slope. :math:`\Delta` doubles after a success and shrinks after a failure. Figures
    are a maximum over poles, modes or frequencies: where two of them meet, f has a kink that points away from a
    maximum, which a search for one may ignore. The value is a lower bound of the worst case, not a certificate.

    Parameters
    ----------
    result : MonteCarlo
        Where to start, and from what.
    figure : str
        One of `Outcomes`: "abscissa", "spectral_radius", "damping", "least_damping", "sensitivity" or "flexible_peak".
    n_starts : int
        Ascents, from the worst plants of the sample.
    max_evaluations : int
        Plants that each ascent may look at.
    progress : Progress

    Raises
    ------
    DomainError
        If the figure is unknown or that of no mode, or a number is not a whole one above 0.
    """
    known_options("Outcomes", [figure], FIGURES)
    whole_number("n_starts", n_starts, 1)
    whole_number("max_evaluations", max_evaluations, 1)
    if result.outcomes.arrays()[figure].shape[1:] == (0,):
        raise DomainError(f"figure is {figure!r}, but the plant has no controlled mode. Choose another figure.")
    objective = _Objective(result, figure)
    progress.stage(f"worst {figure}", n_starts)
    ends, values = [], []
    for start in result.worst(figure, n_starts):
        end, value = _ascend(objective, result.unit[start], max_evaluations)
        ends.append(end)
        values.append(value)
        progress.update(1, worst=-BETTER[figure] * max(values))
    unit = ends[int(np.argmax(values))]
    sample = objective.samples(unit[None])
    outcomes = objective.analysis.measure(sample, exact=True)
    return WorstCase(
        figure=figure,
        value=float(outcomes.figure(figure)[0]),
        sampled_value=float(result.outcomes.figure(figure)[result.worst(figure)[0]]),
        sample=sample,
        unit=unit,
        outcomes=outcomes,
        tries=-BETTER[figure] * np.array(values),
        evaluations=objective.evaluations,
    )


class _Objective:
    """A figure over the unit cube, with the sign that makes more of it worse."""

    def __init__(self, result: MonteCarlo, figure: str) -> None:
        self.analysis = Analysis(result.subject, result.uncertainty)
        self.figure, self.evaluations = figure, 0

    def samples(self, unit: Array) -> Samples:
        return self.analysis.uncertainty.samples(self.analysis.subject.plant, unit)

    def __call__(self, unit: Array) -> Array:
        self.evaluations += len(unit)
        return -BETTER[self.figure] * self.analysis.measure(self.samples(unit), [self.figure]).figure(self.figure)


def _ascend(objective: _Objective, start: Array, max_evaluations: int) -> tuple[Array, float]:
    """A local maximum over the unit cube, and its value; infinity ends the search."""
    x, limit, step = start, objective.evaluations + max_evaluations, FIRST_STEP
    value = float(objective(x[None])[0])
    while step >= LAST_STEP and np.isfinite(value) and objective.evaluations + len(x) < limit:
        slope = _slope(objective, x, value)
        while step >= LAST_STEP and objective.evaluations < limit:
            # the corner of the trust region, and the gradient, which leaves alone what matters little
            directions = np.stack([np.sign(slope), _gradient(slope)])
            moves = (step * SHRINKS[:, None, None] * directions).reshape(-1, len(x))
            trials = np.clip(x + moves, 0.0, 1.0)
            found = objective(trials)
            best = int(np.argmax(found))
            used = step * SHRINKS[best // len(directions)]
            if found[best] > value:
                x, value, step = trials[best], float(found[best]), min(1.0, 2.0 * used)
                break
            step *= 0.5 * SHRINKS[-1]
    return x, value


def _gradient(slope: Array) -> Array:
    """The slope with the largest entry scaled to one; where some are infinite, only those."""
    if np.any(np.isinf(slope)):
        return np.where(np.isinf(slope), np.sign(slope), 0.0)
    size = float(np.max(np.abs(slope), initial=0.0))
    return slope / size if size > 0.0 else slope


def _slope(objective: _Objective, x: Array, value: float) -> Array:
    """One-sided differences into the cube."""
    sign = np.where(x + DIFFERENCE <= 1.0, 1.0, -1.0)
    points = x + DIFFERENCE * np.diag(sign)
    with np.errstate(invalid="ignore"):
        change = sign * (objective(points) - value)
    return np.nan_to_num(change, nan=0.0, posinf=np.inf, neginf=-np.inf)
