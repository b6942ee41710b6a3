"""Rigid-body feedforward: the forces that accelerate the mover as the setpoint wants, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.decoupling.structure import rigid_deviation, rigid_gain


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBodyFeedforward:
    r"""Feedforward of the rigid-body acceleration :math:`\ddot r` through the decoupled inputs of a plant.

    The wrench :math:`M_{rb}\, \ddot r` about the centre of gravity is the mass-normalised modal force
    :math:`S^{-1} \ddot r` (:math:`q = S \eta_{RB}`, :math:`S^{-\top} S^{-1} = M_{rb}`), and the decoupled rigid axes
    are scaled back by S,

    .. math:: u_{RB,ff} = S\, S^\top M_{rb}\, \ddot r = \ddot r,

    so that a decoupled axis takes the acceleration itself: it is exactly :math:`1/s^2` for every p. What each actuator
    does is :math:`u = T_u(p)\, [\ddot r;\, 0]`, and T_u decides which flexible modes it excites (`mode_excitation`).
    Gravity is not part of it.

    Parameters
    ----------
    plant : DecoupledPlant
        T_u, M_rb and S come from its known model, which is all that a controller has.

    Examples
    --------
    One force on a mass of 4 kg:

    >>> from lpvhinf.decoupling import decouple
    >>> from lpvhinf.plant import ModalModel
    >>> modal = ModalModel.from_modal_data(
    ...     omega=[0.0, 300.0], zeta=0.01, box=[[-1.0, 1.0]], input_gains=[[0.5], [0.5]], output_gains=[[0.5, 0.5]],
    ...     mass_matrix_rb=[[4.0]], rigid_body_scaling=[[0.5]])
    >>> feedforward = RigidBodyFeedforward(plant=decouple(modal, n_flex=0, degree=0))
    >>> feedforward.wrench([10.0]).tolist(), feedforward.actuators([[0.0]], [10.0]).round(9).tolist()
    ([40.0], [[40.0]])
    """

    plant: DecoupledPlant

    def inputs(self, acceleration: ArrayLike) -> Array:
        """Decoupled inputs (..., n_rb + n_flex) for accelerations (..., n_rb) [m/s^2, rad/s^2]; zero modal forces."""
        a = self._checked(acceleration)
        return np.concatenate([a, np.zeros((*a.shape[:-1], self.plant.n_flex))], axis=-1)

    def wrench(self, acceleration: ArrayLike) -> Array:
        """Forces and torques M_rb r'' about the known centre of gravity (..., n_rb) [N, N m]."""
        return np.asarray(self._checked(acceleration) @ self.plant.known_modal.mass_matrix_rb.T)

    def modal_forces(self, acceleration: ArrayLike) -> Array:
        """Forces S^T M_rb r'' on the mass-normalised rigid-body modes (..., n_rb) [N/sqrt(kg)]."""
        return np.asarray(self.wrench(acceleration) @ self.plant.known_modal.rigid_body_scaling)

    def actuators(self, points: ArrayLike, acceleration: ArrayLike) -> Array:
        """Actuator commands (N, n_u) at positions (N, n_p) for one acceleration (n_rb,), or one for each position."""
        T_u = self.plant.matrices(points)[1][:, :, : self.plant.n_rb]
        a = np.broadcast_to(self._checked(acceleration), (len(T_u), self.plant.n_rb))
        return np.asarray(np.einsum("nui,ni->nu", T_u, a))

    def residual(self, points: ArrayLike) -> Array:
        r"""Share of the rigid-body motion that the feedforward does not cancel from the error, (N,).

        .. math:: \bar\sigma\big( S^{-1} (\tilde C_{RB} \tilde B_{RB} - I)\, S \big)

        Zero to round-off if the plant is what its known model says and has an actuator for every decoupled mode. An
        error-based observer relies on it, as it takes e for the flexible modes alone.
        """
        plant = self.plant
        gains = plant.sample(points_in_box(points, plant.box))
        return rigid_deviation(rigid_gain(gains, plant.n_rb), np.eye(plant.n_rb), plant.known_modal.rigid_body_scaling)

    def _checked(self, acceleration: ArrayLike) -> Array:
        a = finite_array("acceleration", acceleration)
        return finite_array("acceleration", a, (*(None,) * max(0, a.ndim - 1), self.plant.n_rb))
