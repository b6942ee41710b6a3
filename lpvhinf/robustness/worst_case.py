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
GAIN = 1e-4  # relative improvement that is worth another start


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
    """Search perturbations and position together for the worst value of a figure.

    From each of the worst plants of a Monte Carlo run, a quasi-Newton method with bounds (L-BFGS-B) climbs in the unit
    cube, with slopes by differences, and is started anew where it stops as long as that helps. Figures are a
    maximum over poles, modes or frequencies: where two of them meet, they have a kink that points away from a maximum,
    and most maxima lie at bounds, so that the method does well without smoothness. (The pole that counts for
    `damping` may change: a jump.) The value is a lower bound of the worst case, not a certificate.

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


class _Enough(Exception):
    """The evaluations are used up, or the value is infinite."""


class _Objective:
    """A figure over the unit cube, with the sign that makes more of it worse; it keeps the worst point seen."""

    def __init__(self, result: MonteCarlo, figure: str) -> None:
        self.analysis = Analysis(result.subject, result.uncertainty)
        self.figure, self.evaluations, self.limit = figure, 0, 0
        self.scale = 1.0

    def samples(self, unit: Array) -> Samples:
        """The plants of points (N, dimension)."""
        return self.analysis.uncertainty.samples(self.analysis.subject.plant, unit)

    def start(self, x: Array, max_evaluations: int) -> None:
        """Begin an ascent at a point."""
        self.limit = self.evaluations + max_evaluations
        self.point, self.value = x, -np.inf
        self.value = float(self._values(x[None])[0])
        self.scale = max(abs(self.value), np.finfo(float).tiny) if np.isfinite(self.value) else 1.0

    def falling(self, x: Array) -> tuple[float, Array]:
        """What a minimiser wants: minus the value and its slope, by one-sided differences into the cube."""
        if not np.isfinite(self.value):
            raise _Enough
        sign = np.where(x + DIFFERENCE <= 1.0, 1.0, -1.0)
        values = self._values(np.vstack([x, x + DIFFERENCE * np.diag(sign)]))
        if not np.all(np.isfinite(values)):
            raise _Enough
        slope = sign * (values[1:] - values[0]) / DIFFERENCE
        return -float(values[0]) / self.scale, -slope / self.scale

    def _values(self, unit: Array) -> Array:
        if self.evaluations + len(unit) > self.limit:
            raise _Enough
        self.evaluations += len(unit)
        values = -BETTER[self.figure] * self.analysis.measure(self.samples(unit), [self.figure]).figure(self.figure)
        best = int(np.argmax(values))
        if values[best] > self.value:
            self.point, self.value = unit[best], float(values[best])
        return np.asarray(values)


def _ascend(objective: _Objective, start: Array, max_evaluations: int) -> tuple[Array, float]:
    """The worst point that ascents from `start` find, and its value; infinity ends the search."""
    from scipy.optimize import minimize

    objective.start(start, max_evaluations)
    before = -np.inf
    try:
        while objective.value > before + GAIN * objective.scale:
            before = objective.value
            minimize(objective.falling, objective.point, jac=True, method="L-BFGS-B", bounds=[(0.0, 1.0)] * len(start))
    except _Enough:
        pass
    return objective.point, objective.value
