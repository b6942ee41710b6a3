r"""Which flexible mode an unstable loop owes its instability to, and the damping that the mode would need.

The part of mode i in a pole with right and left eigenvectors v and w, :math:`w^T v = 1`, is the sum of
:math:`|v_k w_k|` over the two states of the mode, divided by that over all states of the loop.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.robustness import Samples
from lpvhinf.robustness.outcomes import BATCH, Analysis

CONTINUOUS, SAMPLED = LOOPS = ("continuous", "sampled")
FIGURE = {CONTINUOUS: "abscissa", SAMPLED: "spectral_radius"}
LIMIT = {CONTINUOUS: 0.0, SAMPLED: 1.0}  # of the figure, from which on a loop is unstable
MOST_DAMPED = 0.05  # a mode that would need more than this is not short of damping
HALVINGS = 10


@dataclass(frozen=True, kw_only=True, eq=False)
class Involved:
    """The least stable pole of N loops.

    Attributes
    ----------
    mode : (N,) int
        The flexible mode that takes the largest part in it; the first one is 0.
    part : (N,)
        That part, of all states of the loop.
    frequency : (N,) [Hz]
        Of the pole.
    damping : (N,)
        Damping ratio of that mode in the perturbed plant without control.
    """

    mode: NDArray[np.intp]
    part: Array
    frequency: Array
    damping: Array


def involved(analysis: Analysis, samples: Samples, loop: str) -> Involved:
    """The mode that takes the largest part in the least stable pole of every loop."""
    n_rb, n_modes = analysis.n_rb, samples.zeta.shape[1]
    N = len(samples)
    mode, part, frequency = np.zeros(N, dtype=np.intp), np.zeros(N), np.zeros(N)
    flexible = slice(2 * n_rb, 2 * (n_rb + n_modes))
    T = analysis.uncertainty.sample_time
    for start in range(0, N, BATCH):
        some = samples.take(slice(start, start + BATCH))
        loops = analysis.continuous(some) if loop == CONTINUOUS else analysis.sampled(some)
        for k, A in enumerate(loops.A, start):
            poles, left, right = scipy.linalg.eig(A, left=True, right=True)
            which = int(np.argmax(poles.real if loop == CONTINUOUS else np.abs(poles)))
            each = np.abs(left[:, which] * right[:, which])
            own = each[flexible].reshape(n_modes, 2).sum(axis=1)
            mode[k] = int(np.argmax(own))
            part[k] = own[mode[k]] / np.sum(each)
            s = poles[which] if loop == CONTINUOUS else np.log(poles[which]) / T
            frequency[k] = abs(s) / (2 * np.pi)
    return Involved(mode=mode, part=part, frequency=frequency, damping=samples.zeta[np.arange(N), mode])


def needed_damping(analysis: Analysis, samples: Samples, mode: NDArray[np.intp], loop: str) -> Array:
    """Damping ratio (N,) of the mode of each unstable loop from which on it is stable, all else as it is.

    By bisection in the logarithm, good to 1 %; infinity where 5 % is not enough.
    """
    rows = np.arange(len(samples))

    def unstable(damping: Array) -> Array:
        zeta = samples.zeta.copy()
        zeta[rows, mode] = damping
        changed = dataclasses.replace(samples, zeta=zeta)
        return np.asarray(analysis.measure(changed, [FIGURE[loop]]).figure(FIGURE[loop]) >= LIMIT[loop])

    low, high = samples.zeta[rows, mode], np.full(len(samples), MOST_DAMPED)
    if len(samples) == 0:
        return high
    hopeless = unstable(high)
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        still = unstable(middle)
        low, high = np.where(still, middle, low), np.where(still, high, middle)
    return np.where(hopeless, np.inf, high)
