"""The output-based modal observer O: its model, and the Riccati gain that starts its tuning."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import AssumptionError
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.lpv import LPVStateSpace

# Process noise on the flexible states relative to the rigid ones, from the largest that is tried: the output
# gains of the modes change sign over P, so that a fast constant observer is unstable at many positions.
NOISE_RATIOS = (1.0, 0.1, 1e-2, 1e-3, 1e-4)


def observer_model(plant: LPVStateSpace, n_preserved: int, correction: ChebyshevMatrix) -> LPVStateSpace:
    r"""The truncated model for observer design, :math:`\hat G` of eq. 9.

    .. math:: \dot x = A_o x + B_o u, \quad y = C_o(p) x + D_o(p) u

    Parameters
    ----------
    plant : LPVStateSpace
        The decoupled plant, modes grouped, rigid-body and preserved ones first.
    n_preserved : int
        Number of rigid-body and preserved flexible modes.
    correction : ChebyshevMatrix
        D_o(p): the static compliance of everything left out.
    """
    kept = slice(0, 2 * n_preserved)
    every = slice(None)
    parts = (plant.A[kept, kept], plant.B[kept, every], plant.C[every, kept], correction)
    # with exact decoupling the kept rows of B(p) are constant
    return LPVStateSpace(*(part.trimmed() for part in parts))


def riccati_gain(model: LPVStateSpace, p: ArrayLike, process_noise: Array, measurement_noise: Array) -> Array:
    r"""Observer gain :math:`L = X C_o^\top R^{-1}` from the algebraic Riccati equation at one position.

    .. math:: A_o X + X A_o^\top - X C_o^\top R^{-1} C_o X + Q = 0

    Parameters
    ----------
    process_noise : (n_x,)
        Diagonal of Q; it must reach the rigid-body states, whose observer poles would else stay at zero.
    measurement_noise : (n_y,)
        Diagonal of R, above zero.

    Raises
    ------
    DimensionError
        If a diagonal has another length.
    AssumptionError
        If the equation has no stabilising solution there: a preserved mode is not observable.
    """
    A, _, C, _ = (m[0] for m in model.sample(np.reshape(p, (1, -1))))
    Q = np.diag(finite_array("process_noise", process_noise, (model.n_x,)))
    R = np.diag(finite_array("measurement_noise", measurement_noise, (model.n_y,)))
    try:
        X = scipy.linalg.solve_continuous_are(A.T, C.T, Q, R)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise AssumptionError(
            f"the observer's Riccati equation has no stabilising solution at p = {np.ravel(p).tolist()}: {error}. "
            "A preserved mode is not observable there; lower n_flex or move a sensor."
        ) from error
    return np.asarray(X @ C.T / measurement_noise)


def process_noise(omega_bw: Array, omega_flex: Array, ratio: float) -> Array:
    """Diagonal of Q for scaled states (eta, eta'/omega): noise on all velocities, `ratio` of it on flexible ones.

    With measurement noise 1/omega_bw the rigid-body part of the observer gets the bandwidth of the loop.
    """
    noise = np.zeros(2 * (len(omega_bw) + len(omega_flex)))
    noise[1::2] = np.concatenate([omega_bw, ratio * omega_flex])
    return noise


def initial_gain(
    model: LPVStateSpace, points: Array, *, omega_bw: Array, omega_flex: Array, measurement_noise: Array
) -> tuple[Array, float]:
    r"""A constant L from the Riccati equation for which :math:`A_o - L C_o(p)` is Hurwitz at all `points`.

    The equation is solved at the centre of the box and then at each of the `points`, with ever smaller
    process noise on the flexible states, until one gain serves all positions.

    Returns
    -------
    L : (n_o, n_y)
    ratio : float
        The process-noise ratio that was needed.

    Raises
    ------
    AssumptionError
        If none is found.
    """
    centre = np.mean(model.box, axis=1)
    tries = [centre, *points]
    _, _, C, _ = model.sample(points)
    A = model.A.sample(centre[None])[0]
    for ratio in NOISE_RATIOS:
        for p in tries:
            L = riccati_gain(model, p, process_noise(omega_bw, omega_flex, ratio), measurement_noise)
            if np.max(np.linalg.eigvals(A - L @ C).real) < 0.0:
                return L, ratio
    raise AssumptionError(
        f"no constant observer gain from the Riccati equation is stable at all {len(points)} positions. "
        "Lower n_flex, shrink P, or schedule L."
    )
