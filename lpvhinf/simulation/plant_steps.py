"""A plant of independent modes whose gains depend on p, stepped exactly from sample to sample along p(t)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, points_in_box, positive, read_only, whole_number
from lpvhinf.decoupling.partition import mode_dynamics
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.robustness.perturbed_plant import ModalStack
from lpvhinf.robustness.sampled_loop import transition
from lpvhinf.statespace.lpv import LPVStateSpace


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalPlant:
    r"""Independent modes with gains that are polynomials of p.

    .. math:: \ddot\eta_i + 2\zeta_i\omega_i\dot\eta_i + \omega_i^2\eta_i = b_i(p)\, u, \quad y = C(p)\,\eta + D(p)\,u

    Attributes
    ----------
    omega, zeta : (n_modes,)
        [rad/s], [-]; rigid-body modes first, with omega = 0.
    B, C, D : ChebyshevMatrix
        (n_modes, n_in), (n_out, n_modes), (n_out, n_in).
    """

    omega: Array
    zeta: Array
    B: ChebyshevMatrix
    C: ChebyshevMatrix
    D: ChebyshevMatrix

    @classmethod
    def of(cls, system: LPVStateSpace) -> ModalPlant:
        """The modes of a state space that is grouped per mode, such as `DecoupledPlant.system` or one read from a file.

        Raises
        ------
        AssumptionError
            If the states are not pairs (eta, eta') of independent modes with a constant A, inputs act on displacements,
            outputs see velocities, or a rigid-body mode follows a flexible one.

        Examples
        --------
        >>> mode = LPVStateSpace.from_coefficients(
        ...     [[0.0, 1.0], [-100.0, -2.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], box=[[-1.0, 1.0]])
        >>> plant = ModalPlant.of(mode)
        >>> plant.omega.item(), plant.zeta.item()
        (10.0, 0.1)
        """
        A, B, C, D = (matrix.trimmed() for matrix in system.matrices)
        n = system.n_x
        a = A.coefficients[(0,) * A.n_p]
        squares, twice = -a[1::2, 0::2].diagonal(), -a[1::2, 1::2].diagonal()
        fitting = A.is_constant and n > 0 and n % 2 == 0 and bool(np.all(squares >= 0.0))
        if fitting:
            omega = np.sqrt(squares)
            zeta = np.where(omega > 0.0, twice / (2.0 * np.where(omega > 0.0, omega, 1.0)), 0.0)
            fitting = np.allclose(a, mode_dynamics(omega, zeta), rtol=1e-12, atol=0.0) and bool(np.all(zeta < 1.0))
            fitting = fitting and not np.any(np.diff((omega > 0.0).astype(int)) < 0)
            fitting = fitting and not np.any(B.coefficients[..., 0::2, :]) and not np.any(C.coefficients[..., 1::2])
        if not fitting:
            raise AssumptionError(
                f"the system with {n} states is not grouped in pairs (eta, eta') of independent modes, rigid-body "
                "modes first. Pass DecoupledPlant.system, or bring yours to modal form."
            )
        velocity, position = slice(1, None, 2), slice(0, None, 2)
        everything = slice(None)
        return cls(
            omega=read_only(omega),
            zeta=read_only(zeta),
            B=B[velocity, everything].trimmed(),
            C=C[everything, position].trimmed(),
            D=D,
        )

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2) [m]."""
        return self.D.box

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.omega)

    @property
    def n_rb(self) -> int:
        """Number of rigid-body modes."""
        return int(np.count_nonzero(self.omega == 0.0))

    @property
    def n_in(self) -> int:
        """Number of inputs."""
        return self.D.shape[1]

    @property
    def n_out(self) -> int:
        """Number of outputs."""
        return self.D.shape[0]

    def transition(self, t: float) -> tuple[Array, Array]:
        """Phi(t) (2 n, 2 n), and what a constant modal force does meanwhile, (2 n, n); states (eta, eta') per mode."""
        n = self.n_modes
        empty = np.zeros((1, 0, 0))
        modes = ModalStack(
            omega=self.omega[None], zeta=self.zeta[None], B=np.eye(n)[None], C=empty, D=empty, rate=np.ones(n)
        )
        blocks, forced = transition(modes, t)
        Phi, at = np.zeros((2 * n, 2 * n)), 2 * np.arange(n)
        for i in range(2):
            for j in range(2):
                Phi[at + i, at + j] = blocks[0, :, i, j]
        return Phi, forced[0]

    def energy(self, states: Array) -> Array:
        r"""Energies :math:`\tfrac12 (\dot\eta^2 + \omega^2 \eta^2)` of the modes (N, n) in states (N, 2 n).

        In J where eta is mass-normalised, as flexible modes are.
        """
        return np.asarray(0.5 * (states[:, 1::2] ** 2 + (self.omega * states[:, 0::2]) ** 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantSteps:
    r"""What a modal plant does from each of N samples to the next, with a delayed zero-order hold at its inputs.

    With a delay :math:`\tau = (l - m) T`, whole l and 0 <= m < 1,

    .. math:: x[k+1] = \Phi x[k] + \Gamma_{old}[k]\, u[k-l] + \Gamma_{new}[k]\, u[k-l+1] + \Gamma_w w[k], \quad
              y[k] = C[k]\, \eta[k] + D[k]\, u[k-l].

    The transition is exact. Between samples p moves: a sample is cut into `substeps` pieces, on which the gains B(p)
    are those of the middle.

    Attributes
    ----------
    Phi : (2 n, 2 n)
    Gamma : (N, 2 n, 2 n_in)
        Gamma_old and Gamma_new side by side.
    Gamma_w : (2 n, n)
        Of modal accelerations w that are held over a sample.
    C, D : (N, n_out, n), (N, n_out, n_in)
    """

    Phi: Array
    Gamma: Array
    Gamma_w: Array
    C: Array
    D: Array


def whole_delay(delay: float, period: float) -> tuple[int, float]:
    """The numbers l and m T of a delay (l - m) T; within round-off of a whole number of samples, m is zero."""
    whole = int(np.ceil(delay / period - 1e-9))
    return whole, max(0.0, whole * period - delay)


def plant_steps(
    plant: ModalPlant,
    points: ArrayLike,
    following: ArrayLike,
    *,
    period: float,
    delay: float,
    substeps: int = 1,
    inputs: int | None = None,
) -> PlantSteps:
    """The steps from positions (N, n_p) to the following ones (N, n_p); p moves on a straight line within a sample.

    Parameters
    ----------
    period, delay : [s]
    substeps : int
    inputs : int, optional
        Only the first of the plant's inputs.
    """
    T, n_in = positive("period", period, "s"), plant.n_in if inputs is None else inputs
    if not 0 < n_in <= plant.n_in:
        raise DimensionError(f"inputs is {inputs}, wanted 1 to {plant.n_in}.")
    if positive("delay", delay, "s") > 1e3 * T:
        raise DomainError(f"delay is {delay} s, wanted at most 1000 samples of {T} s.")
    whole_number("substeps", substeps, 1)
    p, q = points_in_box(points, plant.box), points_in_box(following, plant.box)
    _, late = whole_delay(delay, T)
    Phi, forced = plant.transition(T)
    Gamma = np.zeros((len(p), 2 * plant.n_modes, 2 * n_in))
    change = T - late  # of the input, within a sample
    for i in range(substeps):
        piece = T * np.array([i, i + 1]) / substeps
        B = plant.B.sample(p + (i + 0.5) / substeps * (q - p))[:, :, :n_in]
        for begin, end, columns in (
            (piece[0], min(piece[1], change), slice(0, n_in)),
            (max(piece[0], change), piece[1], slice(n_in, None)),
        ):
            if end > begin:
                carry, push = plant.transition(T - end)[0], plant.transition(end - begin)[1]
                # modes are independent, so that two numbers a mode say where its force leads
                reach = (carry @ push).reshape(plant.n_modes, 2, plant.n_modes).diagonal(axis1=0, axis2=2)
                for j in range(2):
                    Gamma[:, j::2, columns] += reach[j][:, None] * B
    C, D = plant.C.sample(p), plant.D.sample(p)[:, :, :n_in]
    return PlantSteps(Phi=Phi, Gamma=Gamma, Gamma_w=forced, C=C, D=D)
