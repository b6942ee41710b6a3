r"""Feedforward of snap and of position-dependent compliance: the flexible modes, taken as quasi-static springs.

A flexible mode far above the set-point's frequencies follows its force at once, :math:`\eta_i = b_i(p) u /
\omega_i^2`, so that the rigid axes read :math:`y = \eta_{RB} + \delta(p) u` with the compliance

.. math:: \delta(p) = \sum_{i\,\text{flexible}} \frac{c_i(p)\, b_i(p)}{\omega_i^2} + D(p).

The set-point is then read as it is wanted if the rigid body is early by what the springs give, :math:`\eta_{RB} = r -
\delta(p) \ddot r`:

.. math:: u = \ddot r - \frac{d^2}{dt^2} \big( \delta(p(t))\, \ddot r(t) \big)

up to :math:`\delta^2` times the sixth derivative of r. For a constant compliance this is the snap feedforward
:math:`\ddot r - \delta\, r^{(4)}` [lambrechts2005trajectory]; where p moves the derivatives of delta along p(t) count.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box
from lpvhinf.errors import DomainError
from lpvhinf.simulation.plant_steps import ModalPlant
from lpvhinf.simulation.trajectory import Trajectory

FEEDFORWARDS = ("none", "rigid-body", "snap", "compliance")
CHUNK = 1000  # positions whose gains are held at a time

Compliance = Callable[[Array], Array]


def compliance_of(plant: ModalPlant, points: ArrayLike) -> Array:
    """The quasi-static compliance delta (N, n_rb, n_rb) of the flexible modes at positions (N, n_p).

    From forces per mass at the rigid inputs [m/s^2, rad/s^2] to the rigid outputs [m, rad].

    Examples
    --------
    >>> from lpvhinf.statespace import LPVStateSpace
    >>> A = [[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -100.0, -0.2]]
    >>> body = LPVStateSpace.from_coefficients(
    ...     A, [[0.0], [1.0], [0.0], [1.0]], [[1.0, 0.0, 2.0, 0.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> compliance_of(ModalPlant.of(body), [[0.0]]).item()
    0.02
    """
    where, n = points_in_box(points, plant.box), plant.n_rb
    out = np.empty((len(where), n, n))
    for first in range(0, len(where), CHUNK):
        part = slice(first, first + CHUNK)
        B, C, D = (matrix.sample(where[part]) for matrix in (plant.B, plant.C, plant.D))
        out[part] = (C[:, :n, n:] / plant.omega[n:] ** 2) @ B[:, n:, :n] + D[:, :n, :n]
    return out


def feedforward_inputs(
    kind: str, plant: ModalPlant, trajectory: Trajectory, times: Array, period: float, compliance: Compliance | None
) -> Array:
    """Accelerations (N - 1, n_rb) at the rigid inputs: means over the samples between `times` (N,).

    What the set-point does before the first time is made up for in the first sample.

    Parameters
    ----------
    kind : "none", "rigid-body", "snap" or "compliance"
        With "snap" the compliance is that of the centre of P.
    compliance : callable (N, n_p) -> (N, n_rb, n_rb), optional
        In place of the plant's own at the rigid outputs, for instance at the point of control.

    Raises
    ------
    DomainError
        If there is no such kind.
    """
    if kind not in FEEDFORWARDS:
        raise DomainError(f"feedforward is {kind!r}, wanted one of {', '.join(FEEDFORWARDS)}, or true or false.")
    n = trajectory.n_axes
    if kind == "none":
        return np.zeros((len(times) - 1, n))
    impulse = trajectory.velocity(times)
    if kind != "rigid-body":
        box, n_p = plant.box, len(plant.box)

        def delta(at: Array) -> Array:
            points = np.clip(trajectory.position(at)[:, :n_p], box[:, 0], box[:, 1])
            found = compliance_of(plant, points) if compliance is None else compliance(points)
            return finite_array("compliance(points)", found, (len(points), n, n))

        if kind == "snap":
            centre = np.mean(box, axis=1)[None]
            own = compliance_of(plant, centre) if compliance is None else compliance(centre)
            here = np.broadcast_to(finite_array("compliance(points)", own, (1, n, n)), (len(times), n, n))
        else:
            here, step = delta(times), 0.25 * period
            change = (delta(times + step) - delta(times - step)) / (2.0 * step)
            impulse = impulse - np.einsum("nij,nj->ni", change, trajectory.acceleration(times))
        impulse = impulse - np.einsum("nij,nj->ni", here, trajectory.jerk(times))
    impulse[0] = 0.0
    return np.asarray(np.diff(impulse, axis=0) / period)
