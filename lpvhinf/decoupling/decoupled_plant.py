"""The decoupled plant: rigid axes that are 1/s^2 for every p, preserved and discarded flexible modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box, read_only
from lpvhinf.decoupling.partition import compliance_correction, mode_dynamics
from lpvhinf.decoupling.transformations import input_decoupling, output_decoupling
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.fitting import MatrixFit, interpolate, spread_points
from lpvhinf.plant.modal import ModalModel
from lpvhinf.polynomial import ChebyshevMatrix, block
from lpvhinf.statespace.lpv import LPVStateSpace

Weight = Callable[[Array], Array]
STRUCTURE_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class StructureReport:
    """How exactly the decoupling holds, over `n_points` positions.

    Attributes
    ----------
    rigid_body : float
        Largest deviation of the rigid-body input and output matrices from the identity.
    preserved_excitation : float
        Largest force of a rigid-body input on a preserved flexible mode, relative to the largest
        force of the same input on any mode, mass-normalised.
    """

    rigid_body: float
    preserved_excitation: float
    n_points: int


@dataclass(frozen=True, eq=False)
class DecoupledGains:
    """Input, output and feed-through gains of all modes at N positions, from the plant model itself.

    Attributes
    ----------
    B : (N, n_modes, n_rb + n_flex)
        Modal accelerations per unit input.
    C : (N, n_out, n_modes)
        Outputs per unit of every mode.
    D : (N, n_out, n_rb + n_flex)
        Static compliance of the truncated modes.
    """

    B: Array
    C: Array
    D: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class DecoupledPlant:
    r"""The plant between decoupled inputs and outputs, :math:`\tilde G = T_y G T_u` (eq. 6-8).

    Inputs are the rigid-body accelerations [m/s^2, rad/s^2] and then one mass-normalised modal force
    for each preserved flexible mode; outputs are the rigid-body coordinates about the centre of gravity
    [m, rad] and then, if `sensing` is "all", what redundant sensors read beyond rigid-body motion [m]: an
    orthonormal basis of the readings that no rigid-body motion explains. Modes are mass-normalised inside;
    with :math:`q = S \eta_{RB}` the rescaling to these units leaves every rigid axis exactly :math:`1/s^2`
    for every p.

    Make one with `decouple`.
    """

    modal: ModalModel
    n_flex: int
    input_decoupling: str
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
        rigid = self.modal.output_gains(centre)[0][:, : self.n_rb]
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

    def matrices(self, points: ArrayLike) -> tuple[Array, Array]:
        """T_y (N, n_out, n_y) and T_u (N, n_u, n_rb + n_flex) at N positions, in the physical units."""
        T_y, T_u, _ = self._transform(points_in_box(points, self.box))
        return T_y, T_u

    def sample(self, points: ArrayLike) -> DecoupledGains:
        """The gains at positions (N, n_p), computed from the plant model, not from a polynomial fit."""
        return self._transform(points_in_box(points, self.box))[2]

    def _transform(self, points: Array) -> tuple[Array, Array, DecoupledGains]:
        gains = self.modal.gains(points)
        inputs, outputs, compliance = gains.input_gains, gains.output_gains, gains.compliance
        weights = (
            None if self.weight is None else finite_array("weight(points)", self.weight(points), inputs.shape[::2])
        )
        n_rb, n_ctrl = self.n_rb, self.n_rb + self.n_flex
        S = self.modal.rigid_body_scaling
        rigid = outputs[:, :, :n_rb]
        T_rb = output_decoupling(rigid)
        # with frame-fixed sensors the readings of rigid-body motion span the same space at every p; the
        # projection keeps the redundant rows free of it where they do not
        redundant = self.redundancy - (self.redundancy @ rigid) @ T_rb
        T_y = np.concatenate([S @ T_rb, redundant], axis=1)
        T_u = input_decoupling(inputs[:, :n_ctrl], weights)
        if self.input_decoupling == "rigid-body":
            # the conventional rigid inputs know nothing of flexible modes; the modal inputs stay the extended ones
            T_u = np.concatenate([input_decoupling(inputs[:, :n_rb], weights), T_u[:, :, n_rb:]], axis=2)
        T_u = np.concatenate([T_u[:, :, :n_rb] @ np.linalg.inv(S), T_u[:, :, n_rb:]], axis=2)
        B, C = inputs @ T_u, T_y @ outputs
        B[:, :n_rb] = S @ B[:, :n_rb]
        C[:, :, :n_rb] = C[:, :, :n_rb] @ np.linalg.inv(S)
        return T_y, T_u, DecoupledGains(B, C, T_y @ compliance @ T_u)

    def verify(self, points: ArrayLike) -> StructureReport:
        """How exactly the structure that the design relies on holds at positions (N, n_p)."""
        gains, n_rb, n_ctrl = self.sample(points), self.n_rb, self.n_rb + self.n_flex
        identity = np.eye(n_rb)
        from_modal_inputs = np.max(np.abs(gains.B[:, :n_rb, n_rb:]), initial=0.0)
        rigid = max(
            float(np.max(np.abs(gains.B[:, :n_rb, :n_rb] - identity))),
            float(np.max(np.abs(gains.C[:, :, :n_rb] - np.eye(self.n_out, n_rb)))),
            float(from_modal_inputs / max(1.0, np.max(np.abs(gains.B[:, :, n_rb:]), initial=0.0))),
        )
        flexible = np.abs(gains.B[:, n_rb:, :n_rb])
        on_rigid = np.max(np.abs(np.linalg.inv(self.modal.rigid_body_scaling)), axis=0)
        largest = np.maximum(np.max(flexible, axis=(0, 1), initial=0.0), on_rigid)
        excited = float(np.max(flexible[:, : n_ctrl - n_rb] / largest, initial=0.0))
        return StructureReport(rigid, excited, len(gains.B))

    @cached_property
    def fit(self) -> dict[str, MatrixFit]:
        """Chebyshev fits of the gains of all flexible modes: "B", "C" and "D", with measured errors."""
        shapes: list[tuple[int, ...]] = []

        def flat(points: Array) -> Array:
            gains = self.sample(points)
            parts = [gains.B[:, self.n_rb :], gains.C[:, :, self.n_rb :], gains.D]
            shapes[:] = [part.shape[1:] for part in parts]
            return np.concatenate([part.reshape(len(points), 1, -1) for part in parts], axis=2)

        joined = interpolate(flat, box=self.box, degree=self.degree)
        fits, start = {}, 0
        for name, (rows, cols) in zip("BCD", shapes, strict=True):
            cut = slice(start, start + rows * cols)
            c = joined.matrix.coefficients[..., 0, cut].reshape(*joined.matrix.coefficients.shape[:-2], rows, cols)
            matrix = ChebyshevMatrix(c, self.box).trimmed(1e-13 * float(np.max(np.abs(c), initial=0.0)))
            scale = float(np.max(np.abs(matrix.sample(spread_points(self.box, joined.n_test))), initial=0.0))
            fits[name] = MatrixFit(matrix, joined.error[0, cut].reshape(rows, cols), scale, joined.n_test)
            start += rows * cols
        return fits

    @cached_property
    def system(self) -> LPVStateSpace:
        """The decoupled plant as a polynomial LPV state space; its structural zeros and ones are exact."""
        fits = self.fit
        return self._assemble(fits["B"].matrix, fits["C"].matrix, fits["D"].matrix)

    def frozen(self, points: ArrayLike) -> list[LPVStateSpace]:
        """The plant model itself at positions (N, n_p), each as a constant system over the box."""
        gains = self.sample(points)
        box, n_rb = self.box, self.n_rb
        return [
            self._assemble(ChebyshevMatrix(B[n_rb:], box), ChebyshevMatrix(C[:, n_rb:], box), ChebyshevMatrix(D, box))
            for B, C, D in zip(gains.B, gains.C, gains.D, strict=True)
        ]

    def _assemble(self, B: ChebyshevMatrix, C: ChebyshevMatrix, D: ChebyshevMatrix) -> LPVStateSpace:
        """The state space from the gains of the flexible modes."""
        n_rb, n_modes, n_in, box = self.n_rb, self.n_modes, self.n_rb + self.n_flex, self.box
        # rows of B: the decoupled modes have exact unit gains, each from its own input
        keep = self.n_flex if self.input_decoupling == "extended" else 0
        top = np.eye(n_rb + keep, n_in)
        B_modes = block([[top], [B[keep:, :]]], box)
        if self.input_decoupling == "rigid-body" and self.n_flex:
            exact = B_modes.coefficients.copy()
            own = slice(n_rb, n_in)
            exact[..., own, own] = 0.0
            exact[(0,) * len(box)][own, own] = np.eye(self.n_flex)
            B_modes = ChebyshevMatrix(exact, box)
        C_modes = block([[np.eye(self.n_out, n_rb), C]], box)
        velocities, positions = np.zeros((2 * n_modes, n_modes)), np.zeros((n_modes, 2 * n_modes))
        velocities[np.arange(1, 2 * n_modes, 2), np.arange(n_modes)] = 1.0
        positions[np.arange(n_modes), np.arange(0, 2 * n_modes, 2)] = 1.0
        return LPVStateSpace(
            ChebyshevMatrix(mode_dynamics(self.omega, self.zeta), box), velocities @ B_modes, C_modes @ positions, D
        )

    def static_correction(self, points: ArrayLike) -> Array:
        """Compliance of everything that the observer leaves out, (N, n_out, n_rb + n_flex): D_o of eq. 9."""
        gains, d = self.sample(points), self.discarded
        return compliance_correction(gains.C[:, :, d], gains.B[:, d], self.omega[d]) + gains.D


def decouple(
    plant: Any,
    *,
    n_flex: int = 1,
    actuation: str = "over",
    input_decoupling: str = "extended",
    sensing: str = "all",
    weight: Weight | None = None,
    degree: int = 40,
) -> DecoupledPlant:
    r"""Decouple a plant into rigid-body axes and `n_flex` preserved flexible modes (eq. 6-8).

    Parameters
    ----------
    plant : ModalModel, or an object with `.modal` and `.coil_weights` such as the planar actuator
    n_flex : int
        Number of flexible modes that the actuators drive one by one and the observer preserves.
    actuation : "over"
        More actuators than decoupled modes, so that the decoupling is exact.
    input_decoupling : "extended" or "rigid-body"
        Whether the rigid-body inputs also avoid the preserved flexible modes (eq. 7), or are those of the
        conventional decoupling (eq. 6), which excites them.
    sensing : "all" or "rigid-body"
        Whether redundant sensors stay available to an observer. T_y of eq. 6 alone ("rigid-body") throws away
        what they read beyond rigid-body motion, which may be the only output that sees a flexible mode with
        the same sign at every position.
    weight : callable (N, n_p) -> (N, n_u), optional
        Weights of the actuators in the pseudo-inverse; default those of the plant, else ones.
    degree : int
        Chebyshev degree of the polynomial model along every axis of p.

    Raises
    ------
    DomainError
        If an option or `n_flex` is unknown.
    AssumptionError
        If there are too few actuators or sensors, a preserved mode is not observable at any position, or
        the decoupling does not hold to 1e-10.
    """
    modal = plant if isinstance(plant, ModalModel) else getattr(plant, "modal", None)
    if not isinstance(modal, ModalModel):
        raise DomainError(
            f"plant is a {type(plant).__name__}, wanted a ModalModel or an object with one as `.modal`. "
            "Use modal_form on a MechanicalModel first."
        )
    if weight is None:
        weight = getattr(plant, "coil_weights", None)
    if actuation != "over":
        raise DomainError(f"actuation is {actuation!r}, wanted 'over': more actuators than decoupled modes.")
    if input_decoupling not in ("extended", "rigid-body"):
        raise DomainError(f"input_decoupling is {input_decoupling!r}, wanted 'extended' or 'rigid-body'.")
    if sensing not in ("all", "rigid-body"):
        raise DomainError(f"sensing is {sensing!r}, wanted 'all' or 'rigid-body'.")
    if n_flex not in range(modal.n_modes - modal.n_rb + 1):
        raise DomainError(f"n_flex is {n_flex}, wanted 0 to {modal.n_modes - modal.n_rb} flexible modes.")
    decoupled = DecoupledPlant(
        modal=modal,
        n_flex=n_flex,
        input_decoupling=input_decoupling,
        sensing=sensing,
        weight=weight,
        degree=degree,
    )
    points = read_only(np.vstack([np.mean(modal.box, axis=1)[None], spread_points(modal.box, 32)]))
    _check_observable(decoupled.sample(points), decoupled)
    report = decoupled.verify(points)
    wrong = max(report.rigid_body, report.preserved_excitation if input_decoupling == "extended" else 0.0)
    if wrong > STRUCTURE_TOLERANCE:
        raise AssumptionError(
            f"the decoupling holds to {wrong:.2g} only, wanted {STRUCTURE_TOLERANCE:.0g}: the actuators or sensors "
            "are nearly dependent. Change their places or the weights."
        )
    return decoupled


def _check_observable(gains: DecoupledGains, plant: DecoupledPlant) -> None:
    sizes = np.max(np.linalg.norm(gains.C, axis=1), axis=0)
    flexible = sizes[plant.n_rb :]
    for k in range(plant.n_flex):
        if flexible[k] <= 1e-9 * np.max(flexible):
            hertz = plant.omega[plant.n_rb + k] / (2 * np.pi)
            raise AssumptionError(
                f"preserved mode {k + 1} ({hertz:.1f} Hz) is not observable at any position: its largest output gain "
                f"is {flexible[k]:.2g}. Add or move a sensor, or lower n_flex."
            )
