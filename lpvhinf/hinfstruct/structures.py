"""The protocol of a structured controller, and a check of user-written ones."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import AssumptionError, DimensionError

Realization = tuple[Array, Array, Array, Array]


@runtime_checkable
class ControllerStructure(Protocol):
    r"""A controller u = K(theta) y whose matrices depend smoothly on parameters.

    .. math:: \dot x_K = A(\theta, p) x_K + B(\theta, p) y, \quad u = C(\theta, p) x_K + D(\theta, p) y

    Any object with these members can be tuned by `hinfstruct`. With jobs > 1 it
    must also be picklable, so define its class in a module.

    Attributes
    ----------
    n_u, n_y, n_x : int
        Numbers of control inputs u, of measurements y and of controller states.
    n_parameters : int
        Length of theta. The solver works on theta as it is: choose parameters of
        similar size, logarithms for positive ones.
    names : sequence of str, optional
        Names of the parameters; not needed by the solver.
    """

    @property
    def n_u(self) -> int:
        """Number of control inputs."""

    @property
    def n_y(self) -> int:
        """Number of measurements."""

    @property
    def n_x(self) -> int:
        """Number of controller states."""

    @property
    def n_parameters(self) -> int:
        """Number of free parameters."""

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D) at the parameters `theta` and, where it is scheduled, the position `p`."""

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        r"""The adjoint of the derivative of `realize`.

        Entry k is :math:`\langle G_A, \partial A/\partial\theta_k\rangle + \dots + \langle G_D, \partial
        D/\partial\theta_k\rangle`, with the entrywise product summed: (n_parameters,).
        """

    def initial(self, rng: np.random.Generator) -> Array:
        """A random start (n_parameters,), of a size that may plausibly stabilise."""


def realize_checked(structure: ControllerStructure, theta: Array, p: Array | None = None) -> Realization:
    """The controller at theta, its sizes and entries checked.

    Raises
    ------
    DimensionError
        If a matrix has another shape than `n_x`, `n_u` and `n_y` say.
    DomainError
        If an entry is NaN or infinite.
    """
    A, B, C, D = structure.realize(theta, p)
    n_x, n_u, n_y = structure.n_x, structure.n_u, structure.n_y
    return (
        finite_array("A of the controller structure", A, (n_x, n_x)),
        finite_array("B of the controller structure", B, (n_x, n_y)),
        finite_array("C of the controller structure", C, (n_u, n_x)),
        finite_array("D of the controller structure", D, (n_u, n_y)),
    )


def check_structure(
    structure: ControllerStructure,
    theta: ArrayLike,
    p: Array | None = None,
    *,
    seed: int = 0,
    tolerance: float = 1e-6,
) -> float:
    r"""Compare `pullback` with central differences of `realize`; return the largest relative error.

    With random weights :math:`G`, entry k of the pullback is compared with
    :math:`\langle G, (K(\theta + h e_k) - K(\theta - h e_k)) / 2h \rangle`.

    Raises
    ------
    DimensionError
        If a matrix or the pullback has a wrong shape.
    AssumptionError
        If an entry differs by more than `tolerance`, relative to the largest.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> check_structure(StaticGain(2, 1), [0.3, -0.2]) < 1e-6
    True
    """
    x = finite_array("theta", theta, (structure.n_parameters,))
    matrices = realize_checked(structure, x, p)
    rng = np.random.default_rng(seed)
    G = [rng.standard_normal(matrix.shape) for matrix in matrices]
    claimed = np.asarray(structure.pullback(x, G[0], G[1], G[2], G[3], p), dtype=float)
    if claimed.shape != x.shape:
        raise DimensionError(f"pullback returned shape {claimed.shape}, wanted {x.shape}, one entry a parameter.")
    numeric = np.empty_like(x)
    for k in range(x.size):
        h = 1e-5 * max(1.0, abs(x[k]))
        step = np.zeros_like(x)
        step[k] = h
        above, below = structure.realize(x + step, p), structure.realize(x - step, p)
        numeric[k] = sum(float(np.sum(g * (a - b))) for g, a, b in zip(G, above, below, strict=True)) / (2.0 * h)
    scale = max(float(np.max(np.abs(numeric), initial=0.0)), 1e-12)
    error = np.abs(claimed - numeric) / scale
    worst = float(np.max(error, initial=0.0))
    if not worst <= tolerance:
        k = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
        raise AssumptionError(
            f"pullback[{k}] is {claimed[k]:.6g}, wanted {numeric[k]:.6g} by central differences. "
            "It must be the adjoint of the derivative of realize; check the formula of that parameter."
        )
    return worst
