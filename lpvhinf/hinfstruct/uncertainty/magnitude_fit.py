r"""Stable minimum-phase filters above a given magnitude, as low as their order allows.

The filter is a chain of biproper sections with unit gain at infinity,

.. math:: W(s) = k\, \frac{s + a_0}{s + b_0} \prod_i \frac{s^2 + 2 \zeta_i a_i s + a_i^2}{s^2 + 2 \xi_i b_i s + b_i^2},

with the logarithms of all corner frequencies and damping ratios as parameters: stable and minimum-phase wherever
they are. What is minimised is the largest excess over the wanted magnitude in decibels, plus a share of the mean one,
by sequential linear programming; k is what puts the filter above. An order starts from the best filter of two orders
less, with a section of equal zeros and poles inserted at several frequencies, so that a higher order is never worse.
The minimum is a local one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from lpvhinf.checks import Array

#: Share of the mean excess in what is minimised.
MEAN_SHARE = 0.1
#: Damping ratios stay within these bounds,
DAMPING = (3e-3, 100.0)
#: and corner frequencies within the frequencies of the fit, widened by this factor.
BEYOND = 3.0
#: Frequencies at which a new section is tried, and steps of each trial.
INSERTS = 5
TRIAL_STEPS = 12
#: Resonances and notches that are tried, and trials that are followed to their end.
TOPS = 4
FINALISTS = 3
#: Steps of these, first bound on the change of a logarithm, smallest one, and decrease that is worth a step.
STEPS = 80
FIRST_STEP = 0.3
SMALLEST_STEP = 1e-3
WORTH = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class Sections:
    """A chain of biproper sections.

    Attributes
    ----------
    first : (2,) or (0,)
        log a_0, log b_0 of the first-order section, if there is one.
    second : (k, 4)
        log a, log zeta, log b, log xi of each second-order section.
    gain : float
        k.
    """

    first: Array
    second: Array
    gain: float = 1.0

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.first) // 2 + 2 * len(self.second)

    @property
    def parameters(self) -> Array:
        """All logarithms in one vector."""
        return np.concatenate([self.first, self.second.ravel()])

    def moved(self, parameters: Array) -> Sections:
        """The sections with other logarithms, and unit gain."""
        n = len(self.first)
        return Sections(first=parameters[:n], second=parameters[n:].reshape(-1, 4))

    def magnitude(self, omega: Array) -> Array:
        """|W(j omega)|, (n_omega,)."""
        return np.asarray(self.gain * np.exp(self.logarithm(omega)[0]))

    def logarithm(self, omega: Array) -> tuple[Array, Array]:
        """log|W / k| and its derivatives to the parameters: (n_omega,), (n_omega, n_parameters)."""
        total, columns = np.zeros(len(omega)), []
        for sign, corner in zip((1.0, -1.0), np.exp(self.first), strict=False):
            size = omega**2 + corner**2
            total += sign * 0.5 * np.log(size)
            columns.append(sign * corner**2 / size)
        for row in np.exp(self.second):
            for sign, corner, damping in ((1.0, row[0], row[1]), (-1.0, row[2], row[3])):
                gap, part = corner**2 - omega**2, 2.0 * damping * corner * omega
                size = gap**2 + part**2
                total += sign * 0.5 * np.log(size)
                columns += [sign * (2.0 * gap * corner**2 + part**2) / size, sign * part**2 / size]
        return total, np.array(columns).reshape(-1, len(omega)).T


def fit_above(omega: Array, wanted: Array, order: int) -> Sections:
    """A filter of the given order that lies above `wanted` with a small largest ratio.

    Parameters
    ----------
    omega : (n,) rad/s, ascending, above zero
    wanted : (n,) above zero
    order : int
    """
    target = np.log(wanted)
    middle = float(np.mean(np.log(omega[[0, -1]])))
    sections = Sections(first=np.full(2 * (order % 2), middle), second=np.zeros((0, 4)))
    if order % 2:
        tries = [sections.moved(np.full(2, place)) for place in _places(omega)]
        sections = _best(tries, omega, target)
    for _ in range(order // 2):
        start = sections
        rows = _rows(omega, target - start.logarithm(omega)[0])
        tries = [Sections(first=start.first, second=np.vstack([start.second, row[None]])) for row in rows]
        sections = _best(tries, omega, target)
    low = float(np.max(target - sections.logarithm(omega)[0]))
    return Sections(first=sections.first, second=sections.second, gain=float(np.exp(low)))


def _places(omega: Array) -> Array:
    """Logarithms of the frequencies where a section is tried: quantiles of the grid, which is dense at resonances."""
    return np.asarray(np.log(np.quantile(omega, np.linspace(0.05, 0.95, INSERTS))))


def _rows(omega: Array, missing: Array) -> list[Array]:
    """Second-order sections to try: without effect anywhere, and resonances and notches where a filter lacks them."""
    broad, light = np.log(0.5), np.log(0.05)
    rows = [np.array([place, broad, place, broad]) for place in _places(omega)]
    inner = np.arange(1, len(omega) - 1)
    for sign, damping in ((1.0, (broad, light)), (-1.0, (light, broad))):
        y = sign * missing
        tops = inner[(y[inner] >= y[inner - 1]) & (y[inner] > y[inner + 1])]
        for k in tops[np.argsort(-y[tops])][:TOPS]:
            w = np.log(omega[k])
            rows.append(np.array([w, damping[0], w, damping[1]]))
    return rows


def _best(tries: list[Sections], omega: Array, target: Array) -> Sections:
    def value(sections: Sections) -> float:
        return _excess(sections.logarithm(omega)[0] - target)

    reached = sorted((_improve(sections, omega, target, TRIAL_STEPS) for sections in tries), key=value)
    return min((_improve(sections, omega, target, STEPS) for sections in reached[:FINALISTS]), key=value)


def _excess(ratio: Array) -> float:
    """What is minimised, from the logarithms of the ratio of an unscaled filter to what is wanted."""
    low = float(np.min(ratio))
    return float(np.max(ratio)) - low + MEAN_SHARE * (float(np.mean(ratio)) - low)


def _improve(sections: Sections, omega: Array, target: Array, steps: int) -> Sections:
    """Sequential linear programming with a bound on every change, halved where a step does not pay."""
    x, radius = sections.parameters, FIRST_STEP
    lower, upper = _bounds(sections, omega)
    values, slopes = sections.logarithm(omega)
    value = _excess(values - target)
    n, N = len(x), len(omega)
    for _ in range(steps):
        # variables: step, gain, largest excess t;  0 <= ratio + slopes step + gain <= t
        ratio = values - target
        one, none = np.ones((N, 1)), np.zeros((N, 1))
        rows = np.vstack([np.hstack([-slopes, -one, none]), np.hstack([slopes, one, -one])])
        cost = np.concatenate([MEAN_SHARE * np.mean(slopes, axis=0), [MEAN_SHARE, 1.0]])
        box = [
            *zip(np.maximum(lower - x, -radius), np.minimum(upper - x, radius), strict=True),
            (None, None),
            (0.0, None),
        ]
        run = scipy.optimize.linprog(cost, A_ub=rows, b_ub=np.concatenate([ratio, -ratio]), bounds=box, method="highs")
        if run.status != 0:
            break
        trial = sections.moved(np.clip(x + run.x[:n], lower, upper))
        new_values, new_slopes = trial.logarithm(omega)
        reached = _excess(new_values - target)
        if reached < value:
            small = value - reached < WORTH * value
            x, values, slopes, value = trial.parameters, new_values, new_slopes, reached
            radius = min(2.0 * radius, 1.0)
            if small:
                break
        else:
            radius *= 0.25
            if radius < SMALLEST_STEP:
                break
    return sections.moved(x)


def _bounds(sections: Sections, omega: Array) -> tuple[Array, Array]:
    low, high = np.log(omega[0] / BEYOND), np.log(omega[-1] * BEYOND)
    light, heavy = np.log(DAMPING)
    n = len(sections.second)
    return (
        np.concatenate([np.full(len(sections.first), low), np.tile([low, light], 2 * n)]),
        np.concatenate([np.full(len(sections.first), high), np.tile([high, heavy], 2 * n)]),
    )


def realize(sections: Sections) -> tuple[Array, Array, Array, Array]:
    """(A, B, C, D) of the chain, one or two states a section."""
    A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    for a_, b_, c_, d_ in _realized(sections):
        A, B, C, D = (
            np.block([[A, np.zeros((len(A), len(a_)))], [b_ @ C, a_]]),
            np.vstack([B, b_ @ D]),
            np.hstack([d_ @ C, c_]),
            d_ @ D,
        )
    return A, B, sections.gain * C, sections.gain * D


def _realized(sections: Sections) -> list[tuple[Array, Array, Array, Array]]:
    """Each section with states of similar size."""
    one, out = np.ones((1, 1)), []
    if len(sections.first):
        a, b = np.exp(sections.first)
        out.append((np.array([[-b]]), np.array([[b]]), np.array([[(a - b) / b]]), one))
    for a, zeta, b, xi in np.exp(sections.second):
        matrix = np.array([[0.0, b], [-b, -2.0 * xi * b]])
        C = np.array([[(a**2 - b**2) / b**2, 2.0 * (zeta * a - xi * b) / b]])
        out.append((matrix, np.array([[0.0], [b]]), C, one))
    return out
