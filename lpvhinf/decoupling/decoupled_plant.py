"""The decoupled plant: rigid axes that are 1/s^2, preserved and discarded flexible modes, at every p."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box
from lpvhinf.decoupling.coupling import ChannelCoupling, channel_coupling
from lpvhinf.decoupling.fully_actuated import shared_inputs
from lpvhinf.decoupling.gains import DecoupledGains, fit_gains
from lpvhinf.decoupling.partition import compliance_correction
from lpvhinf.decoupling.state_space import modal_state_space, unit_inputs, unit_outputs
from lpvhinf.decoupling.structure import StructureReport, structure_report
from lpvhinf.decoupling.transformations import input_decoupling, output_decoupling
from lpvhinf.fitting import MatrixFit
from lpvhinf.plant.modal import ModalGains, ModalModel
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.lpv import LPVStateSpace

Weight = Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class DecoupledPlant:
    r"""The plant between decoupled inputs and outputs, :math:`\tilde G = T_y G T_u` (eq. 6-8).

    Inputs are the rigid-body accelerations [m/s^2, rad/s^2] and then one mass-normalised modal force
    for each preserved flexible mode; outputs are the rigid-body coordinates about the centre of gravity
    [m, rad] and then, if `sensing` is "all", what redundant sensors read beyond rigid-body motion [m]: an
    orthonormal basis of the readings that no rigid-body motion explains. Modes are mass-normalised inside;
    with :math:`q = S \eta_{RB}` the rescaling to these units leaves every rigid axis exactly :math:`1/s^2`
    for every p.

    T_y and T_u come from `known_modal`, what the machine believes of itself, and act on the plant `modal`.
    Where the two differ, or the plant is fully actuated, the rigid axes and preserved modes are coupled and
    their gains depend on p: the plant then carries the gains of all modes as they are. `known` is what a
    controller may build on.

    Make one with `decouple`.
    """

    modal: ModalModel
    known_modal: ModalModel
    n_flex: int
    actuation: str
    input_decoupling: str
    mode_weight: float
    sensing: str
    weight: Weight | None
    degree: int

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2) [m]."""
        return self.modal.box

    @property
    def n_rb(self) -> int:
        """Number of rigid-body modes."""
        return self.modal.n_rb

    @property
    def n_modes(self) -> int:
        """Number of modes: rigid-body, preserved and discarded."""
        return self.modal.n_modes

    @property
    def n_out(self) -> int:
        """Number of outputs: rigid-body coordinates and redundant readings."""
        return self.n_rb + len(self.redundancy)

    @cached_property
    def redundancy(self) -> Array:
        """Orthonormal rows (n_red, n_y) with no rigid-body content at the centre of P; none for "rigid-body"."""
        centre = np.mean(self.box, axis=1)[None]
        rigid = self.known_modal.output_gains(centre)[0][:, : self.n_rb]
        if self.sensing == "rigid-body":
            return np.zeros((0, len(rigid)))
        return np.asarray(scipy.linalg.null_space(rigid.T).T)

    @property
    def omega(self) -> Array:
        """Eigenfrequencies of all modes [rad/s], zero for the rigid-body ones."""
        return self.modal.omega

    @property
    def zeta(self) -> Array:
        """Modal damping ratios of all modes."""
        return self.modal.zeta

    @property
    def discarded(self) -> slice:
        """Indices of the discarded modes."""
        return slice(self.n_rb + self.n_flex, None)

    @property
    def exact_outputs(self) -> bool:
        """Whether every rigid-body mode is one output and no other: the sensors are what T_y believes."""
        return self.known_modal is self.modal

    @property
    def exact_inputs(self) -> bool:
        """Whether the decoupled modes have unit gains: the actuators are what T_u believes, and are enough."""
        return self.known_modal is self.modal and (self.actuation == "over" or self.n_flex == 0)

    @cached_property
    def known(self) -> DecoupledPlant:
        """The decoupled plant as it is believed to be, which observers are built from; itself if that is true."""
        return self if self.known_modal is self.modal else dataclasses.replace(self, modal=self.known_modal)

    def matrices(self, points: ArrayLike) -> tuple[Array, Array]:
        """T_y (N, n_out, n_y) and T_u (N, n_u, n_rb + n_flex) at N positions, in the physical units."""
        where = points_in_box(points, self.box)
        return self._matrices(where, self.known_modal.gains(where))

    def sample(self, points: ArrayLike) -> DecoupledGains:
        """The gains at positions (N, n_p), computed from the plant model, not from a polynomial fit."""
        where = points_in_box(points, self.box)
        return self._gains(where, *self._models(where))

    def _models(self, points: Array) -> tuple[ModalGains, ModalGains]:
        """Gains of the known and of the true model."""
        known = self.known_modal.gains(points)
        return known, known if self.known_modal is self.modal else self.modal.gains(points)

    def _gains(self, points: Array, known: ModalGains, true: ModalGains) -> DecoupledGains:
        """The true gains behind the transformations that come from the known ones."""
        T_y, T_u = self._matrices(points, known)
        n_rb, S = self.n_rb, self.modal.rigid_body_scaling
        B, C = true.input_gains @ T_u, T_y @ true.output_gains
        B[:, :n_rb] = S @ B[:, :n_rb]
        C[:, :, :n_rb] = C[:, :, :n_rb] @ np.linalg.inv(S)
        return DecoupledGains(B, C, T_y @ true.compliance @ T_u)

    def _matrices(self, points: Array, known: ModalGains) -> tuple[Array, Array]:
        """T_y and T_u from the gains that are believed."""
        inputs, n_rb, n_ctrl = known.input_gains, self.n_rb, self.n_rb + self.n_flex
        weights = self._weights(points, inputs.shape[2])
        S = self.known_modal.rigid_body_scaling
        rigid = known.output_gains[:, :, :n_rb]
        T_rb = output_decoupling(rigid)
        # with frame-fixed sensors the readings of rigid-body motion span the same space at every p; the
        # projection keeps the redundant rows free of it where they do not
        redundant = self.redundancy - (self.redundancy @ rigid) @ T_rb
        T_y = np.concatenate([S @ T_rb, redundant], axis=1)
        if self.actuation == "full":
            forces = input_decoupling(inputs[:, :n_rb], weights, positions=points)
            T_u = forces @ shared_inputs(inputs[:, n_rb:n_ctrl] @ forces, self.mode_weight)
        else:
            T_u = input_decoupling(inputs[:, :n_ctrl], weights, positions=points)
        if self.input_decoupling == "rigid-body":
            # the conventional rigid inputs know nothing of flexible modes; the modal inputs stay the extended ones
            T_u = np.concatenate(
                [input_decoupling(inputs[:, :n_rb], weights, positions=points), T_u[:, :, n_rb:]], axis=2
            )
        return T_y, np.concatenate([T_u[:, :, :n_rb] @ np.linalg.inv(S), T_u[:, :, n_rb:]], axis=2)

    def _weights(self, points: Array, n_u: int) -> Array | None:
        """Weights of the actuators (N, n_u), or None for ones."""
        return None if self.weight is None else finite_array("weight(points)", self.weight(points), (len(points), n_u))

    def verify(self, points: ArrayLike) -> StructureReport:
        """How exactly the structure that a design relies on holds at positions (N, n_p)."""
        where = points_in_box(points, self.box)
        S = self.known_modal.rigid_body_scaling
        return structure_report(where, self.sample(where), n_flex=self.n_flex, rigid_body_scaling=S)

    def coupling(self, points: ArrayLike) -> ChannelCoupling:
        """How much rigid-body and modal channels drive each other at positions (N, n_p)."""
        where = points_in_box(points, self.box)
        known, true = self._models(where)
        n_rb, n_ctrl, S = self.n_rb, self.n_rb + self.n_flex, self.known_modal.rigid_body_scaling
        gains = self._gains(where, known, true)
        B = gains.B[:, :n_ctrl].copy()
        B[:, :n_rb] = np.linalg.inv(S) @ B[:, :n_rb]
        B[:, :, :n_rb] = B[:, :, :n_rb] @ S
        if self.known is not self:
            # the sign of a mode shape is free: take that of the known one, as the sensors see both
            believed = self.known._gains(where, known, known)
            seen = np.sum(gains.C[:, :, n_rb:n_ctrl] * believed.C[:, :, n_rb:n_ctrl], axis=(0, 1))
            B[:, n_rb:] *= np.where(seen < 0.0, -1.0, 1.0)[:, None]
        weights = self._weights(where, known.input_gains.shape[2])
        forces = input_decoupling(known.input_gains[:, :n_rb], weights, positions=where)
        return channel_coupling(where, B, true.input_gains[:, n_rb:n_ctrl] @ forces)

    @cached_property
    def fit(self) -> dict[str, MatrixFit]:
        """Chebyshev fits of the gains, "B", "C" and "D", with measured errors.

        "B" has the rows, "C" the columns of the flexible modes only where those of the rigid-body modes are exact
        (`exact_inputs`, `exact_outputs`), else of all modes.
        """
        return fit_gains(lambda points: self._without_exact(self.sample(points)), box=self.box, degree=self.degree)

    def _without_exact(self, gains: DecoupledGains) -> DecoupledGains:
        """The gains without those of rigid-body modes that are known exactly."""
        first_row = self.n_rb if self.exact_inputs else 0
        first_column = self.n_rb if self.exact_outputs else 0
        return DecoupledGains(gains.B[:, first_row:], gains.C[:, :, first_column:], gains.D)

    @cached_property
    def system(self) -> LPVStateSpace:
        """The decoupled plant as a polynomial LPV state space; structural zeros and ones are exact where they hold."""
        fits = self.fit
        return self._assemble(fits["B"].matrix, fits["C"].matrix, fits["D"].matrix)

    def frozen(self, points: ArrayLike) -> list[LPVStateSpace]:
        """The plant model itself at positions (N, n_p), each as a constant system over the box."""
        gains, box = self._without_exact(self.sample(points)), self.box
        return [
            self._assemble(ChebyshevMatrix(B, box), ChebyshevMatrix(C, box), ChebyshevMatrix(D, box))
            for B, C, D in zip(gains.B, gains.C, gains.D, strict=True)
        ]

    def _assemble(self, B: ChebyshevMatrix, C: ChebyshevMatrix, D: ChebyshevMatrix) -> LPVStateSpace:
        """The state space from gains as `_without_exact` leaves them."""
        if self.exact_inputs:
            B = unit_inputs(B, n_rb=self.n_rb, n_flex=self.n_flex, input_decoupling=self.input_decoupling)
        if self.exact_outputs:
            C = unit_outputs(C, n_rb=self.n_rb)
        return modal_state_space(self.omega, self.zeta, B, C, D)

    def static_correction(self, points: ArrayLike) -> Array:
        """Compliance of everything that the observer leaves out, (N, n_out, n_rb + n_flex): D_o of eq. 9."""
        gains, d = self.sample(points), self.discarded
        return compliance_correction(gains.C[:, :, d], gains.B[:, d], self.omega[d]) + gains.D
