r"""Scheduled controllers at a sampling rate: exact at frozen p, trapezoidal for moving p, with the error measured.

Exact: the input is held over each period T (zero-order hold) and p stands still meanwhile,

.. math:: x_{k+1} = e^{A(p_k) T} x_k + \int_0^T e^{A(p_k) s} ds\; B(p_k) u_k .

For moving p the error of x is of first order in T. The trapezoidal rule takes A and B at both ends of a period,

.. math:: (I - \tfrac T2 A_{k+1}) x_{k+1} = (I + \tfrac T2 A_k) x_k + \tfrac T2 (B_k u_k + B_{k+1} u_{k+1}),

of second order for moving p and for an input that is not held. With :math:`\xi_k = (I - \tfrac T2 A_k) x_k - \tfrac T2
B_k u_k` each step needs the matrices at the present p only:

.. math::

    \xi_{k+1} = (I + \tfrac T2 A_k) x_k + \tfrac T2 B_k u_k, \quad x_k = (I - \tfrac T2 A_k)^{-1}
    (\xi_k + \tfrac T2 B_k u_k), \quad y_k = C_k x_k + D_k u_k .

Source: R. Toth, M. Lovera, P. Heuberger, M. Corno and P. Van den Hof, On the discretization of linear fractional
representations of LPV systems, IEEE Transactions on Control Systems Technology 20 (2012) 1473-1489.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.lpv.controller import ScheduledController
from lpvhinf.statespace.lpv import LPVStateSpace

if TYPE_CHECKING:
    import control

METHODS = ("exact", "trapezoidal")

Matrices = tuple[Array, Array, Array, Array]
MatrixFunction = Callable[[Array], Matrices]


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscreteController:
    """A scheduled controller in discrete time, with matrices that depend on the present p only.

    Attributes
    ----------
    continuous : callable
        positions (N, n_p) -> (A, B, C, D) in continuous time, each (N, ., .).
    period : float
        Sampling period T [s].
    method : str
        "exact" (the state is x) or "trapezoidal" (the state is xi, see the head of this module).
    """

    continuous: MatrixFunction
    period: float
    method: str

    def matrices(self, p: ArrayLike) -> Matrices:
        """(A, B, C, D) of one step at p."""
        A, B, C, D = (m[0] for m in self.continuous(np.asarray(p, dtype=float).reshape(1, -1)))
        return self._step(A, B, C, D)

    def _step(self, A: Array, B: Array, C: Array, D: Array) -> Matrices:
        return (_held if self.method == "exact" else _trapezoidal)(A, B, C, D, self.period)

    def at(self, p: ArrayLike) -> control.StateSpace:
        """One frozen step as a `control.StateSpace` with the sampling time."""
        import control

        return control.ss(*self.matrices(p), self.period, remove_useless_states=False)

    def simulate(self, p: ArrayLike, u: ArrayLike) -> Array:
        """Outputs (N, n_y) along samples of position (N, n_p) and input (N, n_u), from rest.

        Raises
        ------
        DimensionError
            If the numbers of samples or inputs disagree.
        """
        positions, inputs = _signals(p, u)
        stacks = self.continuous(positions)
        n_u, n_y = stacks[1].shape[2], stacks[2].shape[1]
        if n_u != inputs.shape[1]:
            raise DimensionError(f"u has {inputs.shape[1]} columns, the controller has {n_u} inputs.")
        # at rest x = 0, which is another state of the trapezoidal rule
        x = np.zeros(stacks[0].shape[1])
        if self.method == "trapezoidal":
            x = -0.5 * self.period * (stacks[1][0] @ inputs[0])
        out = np.zeros((len(inputs), n_y))
        for k, (a, b, c, d, value) in enumerate(zip(*stacks, inputs, strict=True)):
            A, B, C, D = self._step(a, b, c, d)
            out[k] = C @ x + D @ value
            x = A @ x + B @ value
        return out


@dataclass(frozen=True, kw_only=True)
class DiscretisationError:
    r"""How far a discretised controller is from the continuous one.

    Attributes
    ----------
    frozen : float
        Largest :math:`\bar\sigma(K_d - K) / \max\bar\sigma(K)` over the positions and frequencies looked at; for
        "exact" the delay of the hold, half a period, is taken out.
    frozen_omega : float
        Where it is largest [rad/s].
    moving : float
        Largest deviation of the output along the trajectory, relative to the largest output; NaN without one.
    """

    frozen: float
    frozen_omega: float
    moving: float


def discretise(
    controller: ScheduledController | LPVStateSpace, *, period: float = 1e-4, method: str = "trapezoidal"
) -> DiscreteController:
    """A scheduled controller at a sampling rate, 10 kHz if not said otherwise.

    Parameters
    ----------
    controller : ScheduledController or LPVStateSpace
        In continuous time; one that depends on dp/dt is refused.
    period : float
        [s]
    method : "trapezoidal" or "exact"

    Raises
    ------
    DomainError
        If the method is unknown, the period is not positive or `controller` is of another kind.
    AssumptionError
        If the controller depends on dp/dt.

    Examples
    --------
    >>> K = LPVStateSpace.from_coefficients([[[-100.0]], [[-50.0]]], [[1.0]], [[100.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> discretise(K, method="exact").matrices([0.0])[0]
    array([[0.99005]])
    """
    if method not in METHODS:
        raise DomainError(f"method is {method!r}, wanted one of {', '.join(METHODS)}.")
    return DiscreteController(continuous=_function(controller), period=positive("period", period, "s"), method=method)


def discretisation_error(
    controller: ScheduledController | LPVStateSpace,
    discrete: DiscreteController,
    points: ArrayLike,
    *,
    omega_max: float | None = None,
    trajectory: Callable[[Array], tuple[ArrayLike, ArrayLike]] | None = None,
    duration: float = 0.1,
    refinement: int = 16,
) -> DiscretisationError:
    """Measure the error at frozen positions by frequency responses, and along a trajectory by simulation.

    Parameters
    ----------
    controller : ScheduledController or LPVStateSpace
        The continuous one.
    discrete : DiscreteController
    points : (N, n_p)
        Frozen positions.
    omega_max : float, optional
        Highest frequency [rad/s]; a tenth of the sampling frequency if left out.
    trajectory : callable, optional
        times (N,) -> positions (N, n_p), inputs (N, n_u), smooth.
    duration : float
        Of the simulation [s].
    refinement : int
        The reference is simulated by the trapezoidal rule with a period shorter by this factor, and by half of it,
        and extrapolated; with "exact" the reference's input is held as the controller's is.
    """
    where = finite_array("points", points, (None, None))
    T = discrete.period
    top = 0.1 * 2.0 * np.pi / T if omega_max is None else positive("omega_max", omega_max, "rad/s")
    omega = np.geomspace(1e-4 * top, top, 80)
    delay = np.exp(-0.5j * omega * T) * np.sinc(omega * T / (2.0 * np.pi)) if discrete.method == "exact" else 1.0
    function = _function(controller)
    worst, at = 0.0, float(omega[0])
    for p in where:
        ours = _response(discrete.matrices(p), np.exp(1j * omega * T))
        A, B, C, D = (m[0] for m in function(p[None, :]))
        truth = _response((A, B, C, D), 1j * omega) * np.reshape(delay, (-1, 1, 1))
        size = max(float(np.max(np.linalg.norm(truth, 2, axis=(1, 2)))), 1e-300)
        error = np.linalg.norm(ours - truth, 2, axis=(1, 2)) / size
        if error.max() > worst:
            worst, at = float(error.max()), float(omega[np.argmax(error)])
    moving = np.nan
    if trajectory is not None:
        factor = whole_number("refinement", refinement, 2)
        moving = _moving_error(function, discrete, trajectory, positive("duration", duration, "s"), factor)
    return DiscretisationError(frozen=worst, frozen_omega=at, moving=moving)


def _moving_error(
    function: MatrixFunction,
    discrete: DiscreteController,
    trajectory: Callable[[Array], tuple[ArrayLike, ArrayLike]],
    duration: float,
    refinement: int,
) -> float:
    n = int(np.ceil(duration / discrete.period)) + 1
    times = np.asarray(discrete.period * np.arange(n), dtype=float)
    p, u = _signals(*trajectory(times))
    ours = discrete.simulate(p, u)
    fine = [
        _reference(function, trajectory, discrete, n, refinement * k, held=discrete.method == "exact") for k in (1, 2)
    ]
    truth = (4.0 * fine[1] - fine[0]) / 3.0
    return float(np.max(np.abs(ours - truth)) / max(float(np.max(np.abs(truth))), 1e-300))


def _reference(
    function: MatrixFunction,
    trajectory: Callable[[Array], tuple[ArrayLike, ArrayLike]],
    discrete: DiscreteController,
    n: int,
    factor: int,
    *,
    held: bool,
) -> Array:
    """Outputs at the samples by the trapezoidal rule with `factor` steps a period."""
    h = discrete.period / factor
    times = np.asarray(h * np.arange((n - 1) * factor + 1), dtype=float)
    p, u = _signals(*trajectory(times))
    inputs = np.repeat(u[::factor], factor, axis=0)[: len(times)] if held else u
    a, b, c, d = function(p)
    x, identity = np.zeros(a.shape[1]), np.eye(a.shape[1])
    out = [c[0] @ x + d[0] @ inputs[0]]
    for k in range(1, len(times)):
        # a held input keeps its value up to the end of the step
        ahead = inputs[k - 1] if held else inputs[k]
        right = x + 0.5 * h * (a[k - 1] @ x + b[k - 1] @ inputs[k - 1] + b[k] @ ahead)
        x = np.linalg.solve(identity - 0.5 * h * a[k], right)
        if k % factor == 0:
            out.append(c[k] @ x + d[k] @ inputs[k])
    return np.array(out)


def _held(A: Array, B: Array, C: Array, D: Array, T: float) -> Matrices:
    n, m = B.shape
    both = scipy.linalg.expm(T * np.block([[A, B], [np.zeros((m, n + m))]]))
    return both[:n, :n], both[:n, n:], C, D


def _trapezoidal(A: Array, B: Array, C: Array, D: Array, T: float) -> Matrices:
    n = len(A)
    left = np.eye(n) - 0.5 * T * A
    if n and np.linalg.cond(left, 1) > 1e14:
        raise AssumptionError(
            f"I - (T/2) A is singular: the controller has a pole at 2/T = {2 / T:.4g} rad/s. Take a shorter period."
        )
    F, G = np.asarray(np.linalg.inv(left)), np.asarray(np.linalg.solve(left, 0.5 * T * B))
    right = np.eye(n) + 0.5 * T * A
    return right @ F, right @ G + 0.5 * T * B, C @ F, D + C @ G


def _response(matrices: Matrices, points: np.ndarray) -> np.ndarray:
    A, B, C, D = matrices
    if A.shape[0] == 0:
        return np.broadcast_to(D.astype(complex), (len(points), *D.shape))
    shifted = points[:, None, None] * np.eye(len(A)) - A
    return np.asarray(C @ np.linalg.solve(shifted, np.broadcast_to(B.astype(complex), (len(points), *B.shape))) + D)


def _function(controller: ScheduledController | LPVStateSpace) -> MatrixFunction:
    if isinstance(controller, ScheduledController):
        if controller.needs_rate:
            raise AssumptionError(
                "the controller depends on dp/dt. Design with constant='R' or constant='S', whose controllers do not."
            )
        scheduled = controller

        def each(points: Array) -> Matrices:
            rows = [scheduled.matrices(p) for p in points]
            A, B, C, D = (np.stack([row[k] for row in rows]) for k in range(4))
            return A, B, C, D

        return each
    if not isinstance(controller, LPVStateSpace):
        raise DomainError(f"controller is {type(controller).__name__}, wanted a ScheduledController or LPVStateSpace.")
    return controller.sample


def _signals(p: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
    positions, inputs = finite_array("p", p), finite_array("u", u)
    positions = positions[:, None] if positions.ndim == 1 else positions
    inputs = inputs[:, None] if inputs.ndim == 1 else inputs
    if positions.ndim != 2 or inputs.ndim != 2 or len(positions) != len(inputs) or len(inputs) == 0:
        raise DimensionError(f"p has shape {positions.shape} and u {inputs.shape}, wanted (N, n_p) and (N, n_u).")
    return positions, inputs
