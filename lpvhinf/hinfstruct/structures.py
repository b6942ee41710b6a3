"""The protocol of a structured controller, and a check of user-written ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only, whole_number
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


def parameter_names(structure: ControllerStructure) -> tuple[str, ...]:
    """The names a structure gives to its parameters, or theta[0], theta[1], ..."""
    return tuple(getattr(structure, "names", [f"theta[{k}]" for k in range(structure.n_parameters)]))


@dataclass(frozen=True, kw_only=True, eq=False)
class StructureReport:
    """What a comparison of `pullback` with differences of `realize` showed.

    Attributes
    ----------
    names : (n_parameters,) of str
    errors : (n_points, n_parameters)
        Deviation of every entry, relative to the largest entry at that point.
    claimed, numeric : (n_points, n_parameters)
        The entries of the pullback, and what central differences give.
    tolerance : float
        Largest error that passes.
    """

    names: tuple[str, ...]
    errors: Array
    claimed: Array
    numeric: Array
    tolerance: float

    @property
    def worst(self) -> float:
        """Largest error; infinite where an entry is not finite."""
        return float(np.max(np.where(np.isfinite(self.errors), self.errors, np.inf), initial=0.0))

    @property
    def passed(self) -> bool:
        """True if no entry deviates by more than the tolerance."""
        return self.worst <= self.tolerance

    def table(self) -> str:
        """One line for every parameter that fails: its worst point, the value seen and the value wanted."""
        lines = []
        for k, name in enumerate(self.names):
            column = np.where(np.isfinite(self.errors[:, k]), self.errors[:, k], np.inf)
            i = int(np.argmax(column)) if column.size else 0
            if column.size and column[i] > self.tolerance:
                lines.append(
                    f"pullback[{k}] ({name}) is {self.claimed[i, k]:.6g}, wanted {self.numeric[i, k]:.6g} "
                    f"by central differences (point {i}, error {column[i]:.2g})"
                )
        return "\n".join(lines)


def report_structure(
    structure: ControllerStructure,
    theta: ArrayLike | None = None,
    p: Array | None = None,
    *,
    points: int = 3,
    seed: int = 0,
    tolerance: float = 1e-6,
) -> StructureReport:
    r"""Compare `pullback` with central differences of `realize`; nothing is raised for a wrong entry.

    With random weights :math:`G`, entry k of the pullback is compared with
    :math:`\langle G, (K(\theta + h e_k) - K(\theta - h e_k)) / 2h \rangle`.

    Parameters
    ----------
    structure : ControllerStructure
    theta : (n_parameters,) or (n_points, n_parameters), optional
        Where to compare. Left out: `points` random starts of the structure.
    p : (n_p,), optional
        Position, for a scheduled structure.
    points : int
        Number of random starts.
    seed : int
    tolerance : float

    Raises
    ------
    DimensionError
        If theta, a matrix or the pullback has a wrong shape.
    DomainError
        If an entry of theta or of a matrix is NaN or infinite.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import FixedOrder
    >>> report_structure(FixedOrder(2, 1, 1)).passed
    True
    """
    rng = np.random.default_rng(seed)
    n = structure.n_parameters
    if theta is None:
        wanted = whole_number("points", points, 1)
        where = np.reshape([structure.initial(rng) for _ in range(wanted)], (wanted, n))
    else:
        given = finite_array("theta", theta)
        where = finite_array("theta", given[None] if given.ndim == 1 else given, (None, n))
    claimed, numeric = np.empty(where.shape), np.empty(where.shape)
    for i, x in enumerate(where):
        matrices = realize_checked(structure, x, p)
        G = [rng.standard_normal(matrix.shape) for matrix in matrices]
        entries = np.asarray(structure.pullback(x, G[0], G[1], G[2], G[3], p), dtype=float)
        if entries.shape != x.shape:
            raise DimensionError(f"pullback returned shape {entries.shape}, wanted {x.shape}, one entry a parameter.")
        claimed[i] = entries
        for k in range(n):
            step = np.zeros(n)
            step[k] = 1e-5 * max(1.0, abs(x[k]))
            above, below = structure.realize(x + step, p), structure.realize(x - step, p)
            change = sum(float(np.sum(g * (a - b))) for g, a, b in zip(G, above, below, strict=True))
            numeric[i, k] = change / (2.0 * step[k])
    scale = np.maximum(np.max(np.abs(numeric), axis=1, initial=0.0), 1e-12)
    return StructureReport(
        names=parameter_names(structure),
        errors=read_only(np.abs(claimed - numeric) / scale[:, None]),
        claimed=read_only(claimed),
        numeric=read_only(numeric),
        tolerance=float(tolerance),
    )


def check_structure(
    structure: ControllerStructure,
    theta: ArrayLike | None = None,
    p: Array | None = None,
    *,
    points: int = 3,
    seed: int = 0,
    tolerance: float = 1e-6,
) -> float:
    r"""`report_structure` that raises for a wrong entry; returns the largest relative error.

    Raises
    ------
    DimensionError
        If a matrix or the pullback has a wrong shape.
    DomainError
        If an entry of theta or of a matrix is NaN or infinite.
    AssumptionError
        If an entry differs by more than `tolerance`, relative to the largest. The message lists
        every parameter that fails.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> check_structure(StaticGain(2, 1), [0.3, -0.2]) < 1e-6
    True
    """
    report = report_structure(structure, theta, p, points=points, seed=seed, tolerance=tolerance)
    if not report.passed:
        raise AssumptionError(
            f"{type(structure).__name__}: {report.table()}. The pullback must be the adjoint of the derivative of "
            "realize; check the formulas of these parameters, and that realize is smooth."
        )
    return report.worst
