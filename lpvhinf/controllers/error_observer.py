r"""The error-based modal observer O: flexible states only, driven by the error and u_FM (Section IV).

With a feedforward that cancels the rigid body the error holds the flexible modes alone, :math:`e \approx
-y_{flex}`, and with extended modal decoupling u_RB does not reach them:

.. math:: \nu = y_{flex} - C_{FM}(p) x - D_o(p) u_{FM}, \quad
          \dot x = A_{FM} x + B_{FM} u_{FM} + L \nu, \quad u_{FM} = -K_{FM} \Psi x

with :math:`y_{flex} = -e` and, below it, the redundant readings, which hold no rigid-body motion either. The sign is
ours: :math:`\xi > 0` damps. The printed :math:`\Sigma = [I - K_{FM} O_{\hat\eta, u_{FM}}]^{-1} K_{FM}
O_{\hat\eta, e}` with :math:`\hat\eta` the velocity of the modes is positive velocity feedback; here

.. math:: u_{FM} = \Sigma e, \quad \Sigma = -[I + K_{FM} O_{\hat\eta, u_{FM}}]^{-1} K_{FM} O_{\hat\eta, e}.
"""

from __future__ import annotations

import numpy as np
import scipy.optimize

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError
from lpvhinf.fitting import spread_points
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.lpv import LPVStateSpace

# A mode whose output gain falls below this fraction of its largest one is not observable there.
UNOBSERVABLE = 1e-6
# Positions that the search for one looks at, beside the centre of P, and searches that start from the lowest of them.
N_LOOKED, N_STARTS = 256, 4
# Modes whose frequencies differ by less than this fraction are one: two outputs must tell them apart.
SAME_FREQUENCY = 1e-6


def error_observer_model(plant: LPVStateSpace, n_rb: int, n_flex: int, correction: ChebyshevMatrix) -> LPVStateSpace:
    r"""The model of the preserved flexible modes, from u_FM to :math:`y_{flex}`.

    .. math:: \dot x = A_{FM} x + B_{FM} u_{FM}, \quad y_{flex} = C_{FM}(p) x + D_o(p) u_{FM}

    Parameters
    ----------
    plant : LPVStateSpace
        The decoupled plant, modes grouped, rigid-body and preserved ones first; inputs (u_RB, u_FM).
    n_rb, n_flex : int
    correction : ChebyshevMatrix
        The static compliance of everything left out, for all inputs of the plant.
    """
    kept, forces, every = slice(2 * n_rb, 2 * (n_rb + n_flex)), slice(n_rb, n_rb + n_flex), slice(None)
    parts = (plant.A[kept, kept], plant.B[kept, forces], plant.C[every, kept], correction[every, forces])
    return LPVStateSpace(*(part.trimmed() for part in parts))


def check_observable(model: LPVStateSpace, omega: Array, *, seed: int = 0) -> None:
    """Search the box for a position at which a flexible mode is not observable.

    A lightly damped mode that no output sees leaves the Riccati equation solvable, with a gain of zero: nothing else
    would notice.

    Parameters
    ----------
    model : LPVStateSpace
        Of the flexible modes alone, as from `error_observer_model`.
    omega : (n_flex,) [rad/s]
        Eigenfrequencies of the modes.

    Raises
    ------
    AssumptionError
        If the output gain of a mode vanishes, or modes of one frequency are seen with dependent gains; names the
        position and the mode.
    """
    box = model.box
    points = np.vstack([np.mean(box, axis=1)[None], spread_points(box, N_LOOKED, seed)])
    gains = model.C.sample(points)[:, :, 0::2]  # displacements: velocities are not measured
    for k, w in enumerate(omega):
        alike = np.flatnonzero(np.abs(omega - w) <= SAME_FREQUENCY * w)
        largest = float(np.max(np.linalg.norm(gains[:, :, k], axis=1)))
        seen = np.array([_least_gain(C[:, alike]) for C in gains])
        candidates = [(float(seen[i]), points[i]) for i in np.argsort(seen, kind="stable")[:N_STARTS]]
        if len(alike) == 1:  # a sum of squares: its zeros are found to round-off
            candidates += [_least_seen(model, 2 * k, p) for _, p in candidates]
        value, p = min(candidates, key=lambda pair: pair[0])
        if value <= UNOBSERVABLE * largest:
            raise AssumptionError(
                f"flexible mode {k + 1} ({w / (2 * np.pi):.1f} Hz) is not observable at p = {p.round(6).tolist()}: its "
                f"output gain there is {value:.2g}, against {largest:.2g} elsewhere. Keep the redundant sensors "
                "(sensing='all'), add or move a sensor, lower n_flex, or shrink P."
            )


def _least_gain(C: Array) -> float:
    """Smallest singular value: what the least visible combination of modes is seen with."""
    if C.shape[0] < C.shape[1]:
        return 0.0
    return float(np.linalg.svd(C, compute_uv=False)[-1])


def _least_seen(model: LPVStateSpace, column: int, start: Array) -> tuple[float, Array]:
    """The smallest norm of a column of C(p) near a position, and where."""
    seen = model.C[slice(None), [column]]
    middle, half = np.mean(model.box, axis=1), 0.5 * (model.box[:, 1] - model.box[:, 0])

    def gain(x: Array) -> Array:
        return np.asarray(seen.at(np.clip(middle + half * x, model.box[:, 0], model.box[:, 1]))[:, 0])

    x = np.clip((start - middle) / half, -1.0 + 1e-9, 1.0 - 1e-9)
    found = scipy.optimize.least_squares(gain, x, bounds=(-1.0, 1.0), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return float(np.linalg.norm(found.fun)), middle + half * found.x
