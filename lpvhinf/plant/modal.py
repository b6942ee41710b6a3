"""The modal model: decoupled oscillators with position-dependent gains (paper eq. 2-4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array, finite_array, points_in_box, read_only
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.plant.maps import PositionMap, as_map, batches, evaluate, project_left, project_right
from lpvhinf.plant.mechanical import names, one_point

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class Residual:
    r"""Static compliance of truncated modes, :math:`\Phi_s(p)\, R\, \Phi_a(p)` with a fixed matrix R (n_q, n_q)."""

    matrix: Array


@dataclass(frozen=True, eq=False)
class ModalGains:
    """Gains of a modal model at N positions, from one computation.

    Attributes
    ----------
    input_gains : (N, n_modes, n_u)
        Modal force per unit input [N/sqrt(kg) per unit of u].
    output_gains : (N, n_y, n_modes)
        Output per unit of modal coordinate [unit of y per m sqrt(kg)].
    compliance : (N, n_y, n_u)
        Static compliance of the truncated modes [unit of y per unit of u].
    """

    input_gains: Array
    output_gains: Array
    compliance: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalModel:
    r"""Oscillators in mass-normalised modal coordinates eta, driven and seen in a position-dependent way.

    .. math::

        \ddot\eta + 2 Z \Omega \dot\eta + \Omega^2 \eta = B_m(p)\, u, \qquad y = C_m(p)\, \eta + D_r(p)\, u

    This is paper eq. 2-4 with :math:`B_m = V^\top \Phi_a`, :math:`C_m = \Phi_s V`, plus the static compliance
    :math:`D_r` of the modes that were left out. Build it with `modal_form` from a mechanical model, or with
    `ModalModel.from_modal_data` from identified or measured modes.

    Parameters
    ----------
    omega : (n_modes,)
        Undamped eigenfrequencies [rad/s]; the rigid-body modes come first, with exact zeros.
    zeta : (n_modes,)
        Modal damping [-]; zero for rigid-body modes.
    n_rb : int
        Number of rigid-body modes.
    input_map, output_map : callable
        Physical maps (N, n_q, n_u) and (N, n_y, n_q), or modal gains if `V` is None.
    box : (n_p, 2)
        Box of the positions p.
    V : (n_q, n_modes) or None
        Mass-normalised mode shapes, q = V eta; None if the maps are modal gains already.
    residual : Residual, callable or None
        Static compliance of truncated modes: the fixed matrix R of :math:`\Phi_s R \Phi_a`, or a map to (N, n_y, n_u).
    mass_matrix_rb : (n_rb, n_rb)
        Mass matrix of the physical rigid-body coordinates; identity if these are the modal ones.
    rigid_body_scaling : (n_rb, n_rb)
        S with q_phys = S eta_rb; for a basis E it is :math:`M_{rb}^{-1/2}`, the symmetric root.
    input_names, output_names : tuple of str
        Labels of u and y.

    Raises
    ------
    DimensionError
        If sizes disagree.
    AssumptionError
        If a rigid-body mode has a frequency or damping, a flexible mode has no frequency, or damping is negative.
    DomainError
        If a number is not finite.
    """

    omega: Array
    zeta: Array
    n_rb: int
    input_map: PositionMap
    output_map: PositionMap
    box: Array
    V: Array | None = None
    residual: Residual | PositionMap | None = None
    mass_matrix_rb: Array
    rigid_body_scaling: Array
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()
    _modal_input: PositionMap = field(init=False, repr=False)
    _modal_output: PositionMap = field(init=False, repr=False)

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        omega = finite_array("omega", self.omega, (None,))
        zeta = finite_array("zeta", self.zeta, (len(omega),))
        n_rb = int(self.n_rb)
        if not 0 <= n_rb <= len(omega) or len(omega) == 0:
            raise DimensionError(f"n_rb is {self.n_rb} of {len(omega)} modes, wanted 0 <= n_rb <= n_modes >= 1.")
        if np.any(omega[:n_rb] != 0.0) or np.any(zeta[:n_rb] != 0.0):
            raise AssumptionError(
                f"omega and zeta of the {n_rb} rigid-body modes are {omega[:n_rb].tolist()} and "
                f"{zeta[:n_rb].tolist()}, wanted zeros. Put the rigid-body modes first, or lower n_rb."
            )
        if np.any(omega[n_rb:] <= 0.0):
            raise AssumptionError(
                f"omega of flexible mode {int(np.argmax(omega[n_rb:] <= 0.0))} is {omega[n_rb:].min():.6g} rad/s, "
                "wanted a frequency above 0. Count modes at zero frequency in n_rb and put them first."
            )
        if np.any(zeta < 0.0):
            raise AssumptionError(f"zeta has the entry {zeta.min():.6g}, wanted damping of at least 0.")
        put("omega", read_only(omega))
        put("zeta", read_only(zeta))
        put("n_rb", n_rb)
        put("box", box_array(self.box))
        if self.V is not None:
            put("V", read_only(finite_array("V", self.V, (None, len(omega)))))
        put("mass_matrix_rb", read_only(finite_array("mass_matrix_rb", self.mass_matrix_rb, (n_rb, n_rb))))
        put("rigid_body_scaling", read_only(finite_array("rigid_body_scaling", self.rigid_body_scaling, (n_rb, n_rb))))
        put("_modal_input", self.input_map if self.V is None else project_left(self.input_map, self.V))
        put("_modal_output", self.output_map if self.V is None else project_right(self.output_map, self.V))
        centre = self.box.mean(axis=1)[None, :]
        n_u = evaluate("input gains", self._modal_input, centre, len(omega), None).shape[2]
        n_y = evaluate("output gains", self._modal_output, centre, None, len(omega)).shape[1]
        put("input_names", names("input_names", self.input_names, n_u, "u"))
        put("output_names", names("output_names", self.output_names, n_y, "y"))
        if isinstance(self.residual, Residual):
            if self.V is None:
                raise DimensionError("residual holds a matrix R but V is None. Pass a map of the compliance instead.")
            n_q = self.V.shape[0]
            put("residual", Residual(read_only(finite_array("residual", self.residual.matrix, (n_q, n_q)))))

    @classmethod
    def from_modal_data(
        cls,
        *,
        omega: ArrayLike,
        zeta: ArrayLike | float,
        input_gains: Any,
        output_gains: Any,
        box: ArrayLike,
        n_rb: int | None = None,
        compliance: Any = None,
        mass_matrix_rb: ArrayLike | None = None,
        rigid_body_scaling: ArrayLike | None = None,
        input_names: Sequence[str] = (),
        output_names: Sequence[str] = (),
    ) -> ModalModel:
        """A modal model from modes that were identified or measured, without M and K.

        Parameters
        ----------
        omega : (n_modes,)
            Eigenfrequencies [rad/s], rigid-body modes (exact zeros) first.
        zeta : (n_modes,) or float
            Modal damping [-]; a number holds for every flexible mode.
        input_gains : (n_modes, n_u) array or callable (N, n_p) -> (N, n_modes, n_u)
            Mass-normalised modal input gains.
        output_gains : (n_y, n_modes) array or callable (N, n_p) -> (N, n_y, n_modes)
            Mass-normalised mode shapes at the sensors.
        box : (n_p, 2)
            Box of the positions p.
        n_rb : int, optional
            Number of rigid-body modes; the number of leading zeros of `omega` if left out.
        compliance : (n_y, n_u) array or callable (N, n_p) -> (N, n_y, n_u), optional
            Static compliance of the modes that are not in the model; zero if left out.
        mass_matrix_rb, rigid_body_scaling : (n_rb, n_rb), optional
            Physical rigid-body mass matrix and scaling S, q_phys = S eta_rb; identity if left out.
        input_names, output_names : sequence of str, optional
            Labels of u and y.

        Raises
        ------
        DimensionError, DomainError, AssumptionError
            As the constructor.

        Examples
        --------
        >>> model = ModalModel.from_modal_data(
        ...     omega=[0.0, 100.0], zeta=0.01, box=[[-1.0, 1.0]],
        ...     input_gains=[[1.0], [0.5]], output_gains=[[1.0, -0.5]])
        >>> model.n_rb, model.n_flex, model.zeta.tolist()
        (1, 1, [0.0, 0.01])
        """
        frequencies = finite_array("omega", omega, (None,))
        if n_rb is None:
            flexible = np.flatnonzero(frequencies != 0.0)
            n_rb = int(flexible[0]) if len(flexible) else len(frequencies)
        damping = np.asarray(zeta, dtype=float)
        if damping.ndim == 0:
            damping = np.where(np.arange(len(frequencies)) < n_rb, 0.0, damping)
        mass = np.eye(n_rb) if mass_matrix_rb is None else finite_array("mass_matrix_rb", mass_matrix_rb)
        scaling = np.eye(n_rb) if rigid_body_scaling is None else finite_array("rigid_body_scaling", rigid_body_scaling)
        return cls(
            omega=frequencies,
            zeta=damping,
            n_rb=n_rb,
            input_map=as_map("input_gains", input_gains),
            output_map=as_map("output_gains", output_gains),
            box=box_array(box),
            residual=None if compliance is None else as_map("compliance", compliance),
            mass_matrix_rb=mass,
            rigid_body_scaling=scaling,
            input_names=tuple(input_names),
            output_names=tuple(output_names),
        )

    @property
    def n_modes(self) -> int:
        """Number of modes, rigid and flexible."""
        return int(self.omega.shape[0])

    @property
    def n_flex(self) -> int:
        """Number of flexible modes."""
        return self.n_modes - self.n_rb

    @property
    def n_u(self) -> int:
        """Number of inputs u."""
        return len(self.input_names)

    @property
    def n_y(self) -> int:
        """Number of outputs y."""
        return len(self.output_names)

    @property
    def n_p(self) -> int:
        """Number of position coordinates p."""
        return int(self.box.shape[0])

    def __repr__(self) -> str:
        return (
            f"ModalModel(n_rb={self.n_rb}, n_flex={self.n_flex}, n_u={self.n_u}, n_y={self.n_y}, "
            f"box={self.box.tolist()})"
        )

    def input_gains(self, points: ArrayLike) -> Array:
        r""":math:`B_m(p) = V^\top \Phi_a(p)` at `points` (N, n_p), as (N, n_modes, n_u), in batches of bounded memory.

        Raises
        ------
        DomainError
            If a position is outside the box.
        """
        p = points_in_box(points, self.box)
        out = np.empty((len(p), self.n_modes, self.n_u))
        for part in batches(len(p), self._batch_numbers(self.n_u)):
            out[part] = evaluate("input gains", self._modal_input, p[part], self.n_modes, self.n_u)
        return out

    def output_gains(self, points: ArrayLike) -> Array:
        r""":math:`C_m(p) = \Phi_s(p) V` at `points` (N, n_p), as (N, n_y, n_modes); raises as `input_gains`."""
        p = points_in_box(points, self.box)
        out = np.empty((len(p), self.n_y, self.n_modes))
        for part in batches(len(p), self._batch_numbers(self.n_y)):
            out[part] = evaluate("output gains", self._modal_output, p[part], self.n_y, self.n_modes)
        return out

    def compliance(self, points: ArrayLike) -> Array:
        """Static compliance of the truncated modes at `points` (N, n_p), as (N, n_y, n_u); zero if there is none."""
        p = points_in_box(points, self.box)
        if isinstance(self.residual, Residual):
            return self.gains(p).compliance
        out = np.zeros((len(p), self.n_y, self.n_u))
        if self.residual is not None:
            for part in batches(len(p), self.n_y * self.n_u):
                out[part] = evaluate("compliance", self.residual, p[part], self.n_y, self.n_u)
        return out

    def gains(self, points: ArrayLike) -> ModalGains:
        """Input gains, output gains and compliance at `points` (N, n_p), sharing the physical maps.

        Raises
        ------
        DomainError
            If a position is outside the box.
        """
        p = points_in_box(points, self.box)
        if not isinstance(self.residual, Residual) or self.V is None:
            return ModalGains(self.input_gains(p), self.output_gains(p), self.compliance(p))
        n_q = self.V.shape[0]
        B = np.empty((len(p), self.n_modes, self.n_u))
        C = np.empty((len(p), self.n_y, self.n_modes))
        D = np.empty((len(p), self.n_y, self.n_u))
        V, R = self.V, self.residual.matrix
        for part in batches(len(p), self._batch_numbers(self.n_u + self.n_y)):
            phi_a = evaluate("input_map", self.input_map, p[part], n_q, self.n_u)
            phi_s = evaluate("output_map", self.output_map, p[part], self.n_y, n_q)
            # one product for modal and residual rows reads the large Phi_a only once
            rows = np.concatenate([np.broadcast_to(V.T, (len(phi_s), *V.T.shape)), phi_s @ R], axis=1)
            product = rows @ phi_a
            B[part], D[part] = product[:, : self.n_modes], product[:, self.n_modes :]
            C[part] = phi_s @ V
        return ModalGains(B, C, D)

    def _batch_numbers(self, columns: int) -> int:
        return 2 * columns * (self.n_modes if self.V is None else self.V.shape[0])

    def grouping(self) -> Array:
        r"""The permutation T of paper eq. 3, (2 n_modes, 2 n_modes).

        .. math:: T = [\, I \otimes (1, 0)^\top \quad I \otimes (0, 1)^\top \,]

        maps (eta, eta') to the states grouped per mode, (eta_1, eta_1', eta_2, eta_2', ...).
        """
        eye = np.eye(self.n_modes)
        return np.hstack([np.kron(eye, [[1.0], [0.0]]), np.kron(eye, [[0.0], [1.0]])])

    def local_model(self, p: ArrayLike, *, compliance: bool = True) -> control.StateSpace:
        """The model at the frozen position `p` (n_p,), states grouped per mode (paper eq. 3 and 4).

        Parameters
        ----------
        p : (n_p,)
            Position in the box.
        compliance : bool
            Whether the static compliance of the truncated modes is the feed-through D; without it D = 0 as in eq. 4.

        Raises
        ------
        DimensionError
            If `p` is not one position.
        DomainError
            If `p` is outside the box.
        """
        import control

        at = self.gains(one_point(p, self.box))
        B_m, C_m = at.input_gains[0], at.output_gains[0]
        blocks = [np.array([[0.0, 1.0], [-(w**2), -2.0 * z * w]]) for w, z in zip(self.omega, self.zeta, strict=True)]
        return control.ss(
            scipy.linalg.block_diag(*blocks),
            np.kron(B_m, [[0.0], [1.0]]),
            np.kron(C_m, [[1.0, 0.0]]),
            at.compliance[0] if compliance else np.zeros((self.n_y, self.n_u)),
            inputs=list(self.input_names),
            outputs=list(self.output_names),
        )
