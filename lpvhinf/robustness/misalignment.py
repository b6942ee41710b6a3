r"""A decoupled plant whose commutation believes the mover at p + d, for every d at once.

The misalignment d becomes further coordinates of the position: over (p, d) the known input map and the weights of the
actuators are those at p + d, everything else is that at p. The result is a `DecoupledPlant` like any other, so that all
kinds of decoupling keep their one implementation.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.plant.maps import PositionMap, project_left, project_right
from lpvhinf.plant.mmpa import MMPA, coil_weights
from lpvhinf.plant.modal import ModalModel, Residual

NARROWEST = 1e-9  # half width [m] of a box of misalignments that are all zero


@dataclass(frozen=True, kw_only=True, eq=False)
class AtPosition:
    """A map of p as one of (p, d)."""

    inner: PositionMap

    def __call__(self, points: Array) -> Array:
        """The map at p."""
        return np.asarray(self.inner(points[:, : points.shape[1] // 2]))

    def left_project(self, V: Array) -> AtPosition:
        """The map of V.T @ Phi."""
        return dataclasses.replace(self, inner=project_left(self.inner, V))

    def right_project(self, V: Array) -> AtPosition:
        """The map of Phi @ V."""
        return dataclasses.replace(self, inner=project_right(self.inner, V))


@dataclass(frozen=True, kw_only=True, eq=False)
class AtBelieved:
    """A map of p as one of (p, d), at p + d, which may lie outside of the box."""

    inner: PositionMap

    def __call__(self, points: Array) -> Array:
        """The map at p + d."""
        n_p = points.shape[1] // 2
        return np.asarray(self.inner(points[:, :n_p] + points[:, n_p:]))

    def left_project(self, V: Array) -> AtBelieved:
        """The map of V.T @ Phi."""
        return dataclasses.replace(self, inner=project_left(self.inner, V))


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilWeights:
    """The weights of the planar actuator's coils, outside of the box as well, where `MMPA.coil_weights` is an error."""

    actuator: MMPA

    def __call__(self, points: Array) -> Array:
        """Weights where the actuator's own misalignment adds to the given position."""
        believed = points + np.array(self.actuator.effects.commutation_misalignment)
        return coil_weights(believed, self.actuator.layers, self.actuator.parameters)


def misaligned(plant: DecoupledPlant, largest: float) -> DecoupledPlant:
    """The plant over the positions (p, d), every coordinate of d within +-`largest` [m]."""
    half = max(float(largest), NARROWEST)
    box = np.vstack([plant.box, np.tile([-half, half], (len(plant.box), 1))])
    modal, known = plant.modal, plant.known_modal
    residual = modal.residual
    if residual is not None and not isinstance(residual, Residual):
        residual = AtPosition(inner=residual)
    true = dataclasses.replace(
        modal,
        box=box,
        input_map=AtPosition(inner=modal.input_map),
        output_map=AtPosition(inner=modal.output_map),
        residual=residual,
    )
    believed: ModalModel = dataclasses.replace(
        known,
        box=box,
        input_map=AtBelieved(inner=known.input_map),
        output_map=AtPosition(inner=known.output_map),
        residual=None,  # T_y and T_u do not ask for it
    )
    weight = plant.weight
    if weight is not None:
        owner = getattr(weight, "__self__", None)
        if isinstance(owner, MMPA) and weight == owner.coil_weights:
            weight = CoilWeights(actuator=owner)
        weight = AtBelieved(inner=weight)
    return dataclasses.replace(plant, modal=true, known_modal=believed, weight=weight)
