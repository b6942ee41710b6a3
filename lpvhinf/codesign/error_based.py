"""What an error-based observer relies on: modes that are seen everywhere, a feedforward that cancels the rigid body."""

from __future__ import annotations

import warnings

import numpy as np

from lpvhinf.codesign.assembly import Assembly
from lpvhinf.controllers import check_observable
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.decoupling.structure import rigid_deviation, rigid_gain
from lpvhinf.errors import LpvHinfWarning
from lpvhinf.fitting import spread_points

# Rigid-body motion left in the error, relative to what is wanted, from which on a design warns.
MAX_RESIDUAL = 0.01
N_CHECKED = 32  # positions, beside the centre of P


def feedforward_residual(plant: DecoupledPlant) -> tuple[float, list[float]]:
    r"""What a feedforward of the known model leaves of the rigid body in the error, and where it is worst.

    The feedforward is the wanted acceleration at u_RB, :math:`\ddot r`. The true plant, behind the decoupling of the
    known model, answers it with :math:`H(p) \ddot r`: the residual is the largest singular value of H(p) - I in
    mass-normalised coordinates, 0 where the feedforward cancels the rigid body.

    Returns
    -------
    residual : float
        Largest one over the centre of P and a spread of 32 positions.
    p : list of n_p floats [m]
    """
    points = np.vstack([np.mean(plant.box, axis=1)[None], spread_points(plant.box, N_CHECKED)])
    gain = rigid_gain(plant.sample(points), plant.n_rb)
    found = rigid_deviation(gain, np.eye(plant.n_rb)[None], plant.known_modal.rigid_body_scaling)
    worst = int(np.argmax(found))
    return float(found[worst]), points[worst].tolist()


def check_error_based(assembly: Assembly) -> None:
    """Check what the error-based observer of an assembly relies on.

    Raises
    ------
    AssumptionError
        If a mode is not observable at some position.

    Warns
    -----
    LpvHinfWarning
        If the feedforward leaves more than one percent of the rigid body in the error.
    """
    assert assembly.observer is not None
    check_observable(assembly.observer.model, assembly.omega_flex)
    residual, p = feedforward_residual(assembly.plant)
    if residual > MAX_RESIDUAL:
        warnings.warn(
            f"feedforward of the known model leaves {100.0 * residual:.1f} % of the rigid-body motion in the error at "
            f"p = {np.round(p, 4).tolist()}, wanted at most {100.0 * MAX_RESIDUAL:.0f} %: the error-based observer "
            "takes it for motion of the modes. Identify mass and actuators better, use an over-actuated plant, or take "
            "architecture='output-observer'.",
            LpvHinfWarning,
            stacklevel=3,
        )
