"""The planar actuator: what is true of it, and what its controller knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box
from lpvhinf.plant.maps import batches, evaluate, project_right
from lpvhinf.plant.mechanical import MechanicalModel
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.commutation import coil_weights, weighted_pseudo_inverse
from lpvhinf.plant.mmpa.effects import Effects
from lpvhinf.plant.mmpa.mover import Mover
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.plate import RitzPlate
from lpvhinf.plant.mmpa.point_of_control import PointOfControl
from lpvhinf.plant.modal import ModalModel
from lpvhinf.plant.rigid_motion import AXES


@dataclass(frozen=True, kw_only=True, eq=False)
class MMPA:
    """The benchmark: parameters, mechanical model, modal models and commutation. Make one with `benchmark`.

    Attributes
    ----------
    parameters : MMPAParameters
        What it was built from.
    effects : Effects
        The deviations that are switched on.
    mechanical : MechanicalModel
        The truth: q = (x, y, rz in-plane at the place of the centre of gravity, 225 Ritz coefficients of w); u 160
        coil currents [A]; y nine interferometers [m].
    modal : ModalModel
        The truth: rigid-body modes x, y, z, rx, ry, rz about the centre of gravity, then the flexible modes in order
        of frequency, with the signs of the known ones.
    known : ModalModel
        What commutation and sensor transformation believe: nominal mover, coils, magnets and beams, the field that
        the commutation knows, evaluated where it believes the mover. It is `modal` itself if nothing deviates.
    mover, known_mover : Mover
        The true and the known mover; mass, centre of gravity and inertia.
    layers : tuple of CoilLayer
        The true stator.
    """

    parameters: MMPAParameters
    effects: Effects
    mechanical: MechanicalModel
    modal: ModalModel
    known: ModalModel
    mover: Mover
    known_mover: Mover
    layers: tuple[CoilLayer, ...]

    @property
    def plate(self) -> RitzPlate:
        """The true mover's plate with all lumped masses."""
        return self.mover.plate

    @property
    def mass(self) -> float:
        """True mass of the mover [kg]."""
        return self.mover.mass

    @property
    def centre_of_gravity(self) -> Array:
        """True centre of gravity in the mover frame, the height from the neutral plane, (3,) [m]."""
        return self.mover.centre_of_gravity

    @property
    def inertia(self) -> Array:
        """True inertia about the centre of gravity, for rx, ry, rz, (3, 3) [kg m2]."""
        return self.mover.inertia

    @property
    def box(self) -> Array:
        """The box P of positions of the plate's centre, (2, 2) [m]."""
        return self.mechanical.box

    @property
    def rigid_body_names(self) -> tuple[str, ...]:
        """Order of the rigid-body modes."""
        return AXES

    @property
    def point_of_control(self) -> PointOfControl:
        """The point of control on the true mover."""
        return PointOfControl.of(self.parameters, self.mover)

    @property
    def known_point_of_control(self) -> PointOfControl:
        """The point of control on the known mover, about whose centre of gravity the controller works."""
        return PointOfControl.of(self.parameters, self.known_mover)

    def coil_weights(self, points: ArrayLike) -> Array:
        """Smooth weights of the coils at `points` (N, 2) [m], as (N, 160), where the commutation believes the mover."""
        believed = points_in_box(points, self.box) + np.array(self.effects.commutation_misalignment)
        return coil_weights(believed, self.layers, self.parameters)

    def wrench_matrix(self, points: ArrayLike) -> Array:
        """True wrench (F_x, F_y, F_z, T_x, T_y, T_z) about the true centre of gravity per ampere, (N, 6, 160)."""
        return _wrench(self.modal, points)

    def levitation_current(self, points: ArrayLike, acceleration: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Coil currents (N, 160) [A] that carry the mover and accelerate it by `acceleration` (3,) [m/s2].

        They are what the commutation commands: they act on the known mover in the known field.

        Raises
        ------
        AssumptionError
            If too few coils are active to levitate, or their wrenches are dependent; the message names the position
            and the condition number.
        """
        a = finite_array("acceleration", acceleration, (3,))
        p = points_in_box(points, self.box)
        inverse = weighted_pseudo_inverse(_wrench(self.known, p), self.coil_weights(p), positions=p)
        force = self.known_mover.mass * (a + np.array([0.0, 0.0, self.parameters.gravity]))
        return np.asarray(inverse[:, :, :3] @ force)

    def performance_gains(self, points: ArrayLike) -> Array:
        """Displacement and rotation (x, y, z, rx, ry, rz) of the point of control per modal coordinate.

        Parameters
        ----------
        points : (N, 2)
            Positions in the box [m].

        Returns
        -------
        (N, 6, n_modes)
            The performance output is this matrix times eta of the true modal model [m], [rad].

        Raises
        ------
        DomainError
            If a position is outside the box.
        """
        assert self.modal.V is not None  # it comes from a mechanical model
        p = points_in_box(points, self.box)
        modal = project_right(self.point_of_control, self.modal.V)
        out = np.empty((len(p), 6, self.modal.n_modes))
        for part in batches(len(p), 24 * len(self.modal.V)):
            out[part] = evaluate("performance gains", modal, p[part], 6, self.modal.n_modes)
        return out


def _wrench(modal: ModalModel, points: ArrayLike) -> Array:
    """E.T Phi_a from V_rb = E M_rb^{-1/2}."""
    root = np.linalg.inv(modal.rigid_body_scaling)
    return np.asarray(root @ modal.input_gains(points)[:, :6])
