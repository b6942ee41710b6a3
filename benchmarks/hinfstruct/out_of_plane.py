"""The out-of-plane axes of the planar actuator as a plant of its own: z, rx, ry, seen by the vertical beams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.plant import ModalModel
from lpvhinf.plant.mmpa import MMPA

#: Names of the three axes among the rigid-body modes, and the first letter of the vertical beams.
AXES, BEAMS = ("z", "rx", "ry"), "z"


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """Gains of some modes and sensors of a modal model, at positions (N, 2)."""

    modal: ModalModel
    kind: str
    modes: Array
    sensors: Array

    def __call__(self, points: Array) -> Array:
        """Input gains (N, m, n_u), output gains (N, k, m) or compliance (N, k, n_u)."""
        gains = self.modal.gains(points)
        if self.kind == "input":
            return gains.input_gains[:, self.modes]
        if self.kind == "output":
            return gains.output_gains[:, self.sensors][:, :, self.modes]
        return gains.compliance[:, self.sensors]


def out_of_plane(plant: MMPA) -> ModalModel:
    """Height, two tilts and all flexible modes, on all coils; the in-plane axes are held by something else.

    The mass matrix couples no in-plane with out-of-plane motion here, so that the modes are those of the whole plant.
    """
    modal = plant.modal
    rigid = np.array([plant.rigid_body_names.index(axis) for axis in AXES])
    modes = np.concatenate([rigid, np.arange(modal.n_rb, modal.n_modes)])
    sensors = np.array([k for k, name in enumerate(modal.output_names) if name.startswith(BEAMS)])

    def chosen(kind: str) -> Chosen:
        return Chosen(modal=modal, kind=kind, modes=modes, sensors=sensors)

    return ModalModel.from_modal_data(
        omega=modal.omega[modes],
        zeta=modal.zeta[modes],
        n_rb=len(rigid),
        input_gains=chosen("input"),
        output_gains=chosen("output"),
        box=modal.box,
        compliance=chosen("compliance"),
        mass_matrix_rb=modal.mass_matrix_rb[np.ix_(rigid, rigid)],
        rigid_body_scaling=modal.rigid_body_scaling[np.ix_(rigid, rigid)],
        input_names=modal.input_names,
        output_names=[modal.output_names[k] for k in sensors],
    )
