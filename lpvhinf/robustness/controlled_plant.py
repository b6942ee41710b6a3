"""A plant and the controller that it is robust with, or not: what an analysis takes in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.codesign import Design
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.shaping import Scaling
from lpvhinf.statespace.lpv import LPVStateSpace


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlledPlant:
    """A decoupled plant with any controller that is scheduled by p.

    Parameters
    ----------
    plant : DecoupledPlant
        The plant before it is perturbed; T_y and T_u come from what is known of it.
    controller : LPVStateSpace
        From (e, y), e = r - y_RB, to (u_RB, u_FM) or to u_RB alone, in physical units
        [m, rad] -> [m/s^2, rad/s^2, N/sqrt(kg)].
    scaling : Scaling
        Of the channels in which norms are measured: only `output`, `input` and `f_bw` are used.

    Raises
    ------
    DimensionError
        If inputs or outputs of the controller, or sizes of the scaling, do not fit the plant.
    DomainError
        If the controller's box does not hold all positions of the plant.
    """

    plant: DecoupledPlant
    controller: LPVStateSpace
    scaling: Scaling

    def __post_init__(self) -> None:
        n_rb, n_out, n_in = self.plant.n_rb, self.plant.n_out, self.plant.n_rb + self.plant.n_flex
        if self.controller.n_u != n_rb + n_out:
            raise DimensionError(
                f"controller has {self.controller.n_u} inputs, wanted {n_rb + n_out}: e ({n_rb}) and y ({n_out})."
            )
        if self.controller.n_y not in (n_rb, n_in):
            raise DimensionError(
                f"controller has {self.controller.n_y} outputs, wanted {n_rb} (u_RB) or {n_in} (u_RB and u_FM)."
            )
        if len(self.scaling.output) != n_out or len(self.scaling.input) != n_in:
            raise DimensionError(
                f"scaling has {len(self.scaling.output)} outputs and {len(self.scaling.input)} inputs, wanted {n_out} "
                f"and {n_in}. Make it for this plant."
            )
        box, plant_box = self.controller.box, self.plant.box
        if len(box) != len(plant_box) or np.any(plant_box[:, 0] < box[:, 0]) or np.any(plant_box[:, 1] > box[:, 1]):
            raise DomainError(
                f"controller has the box {box.tolist()}, wanted all of the plant's, {plant_box.tolist()}. "
                "Schedule it over the whole box."
            )

    @classmethod
    def of(cls, design: Design | ControlledPlant) -> ControlledPlant:
        """What a design controls, with its controller; a `ControlledPlant` is returned as it is.

        Raises
        ------
        DomainError
            If `design` is neither.
        """
        if isinstance(design, ControlledPlant):
            return design
        if not isinstance(design, Design):
            raise DomainError(
                f"design is a {type(design).__name__}, wanted a Design or a ControlledPlant(plant=..., controller=..., "
                "scaling=...)."
            )
        return cls(plant=design.assembly.plant, controller=design.controller, scaling=design.assembly.scaling)
