"""To and from the objects that control engineers already have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import DimensionError, DomainError

if TYPE_CHECKING:
    import control

Matrices = tuple[Array, Array, Array, Array]


def state_space_matrices(system: Any) -> Matrices:
    """(A, B, C, D) of a continuous-time system given as any of the usual objects.

    Parameters
    ----------
    system : control.StateSpace, control.TransferFunction, scipy.signal.lti, (A, B, C, D) or a gain matrix

    Raises
    ------
    DomainError
        If the object is of another kind.
    DimensionError
        If the system is in discrete time or its matrices do not fit together.

    Examples
    --------
    >>> A, B, C, D = state_space_matrices(([[-1.0]], [[1.0]], [[2.0]], [[0.0]]))
    >>> float(C[0, 0])
    2.0
    """
    dt = getattr(system, "dt", None)
    if dt not in (None, 0):
        raise DimensionError(f"the system has the sampling time {dt}, wanted continuous time. Convert it first.")
    return _matrices(system)


def sampled_matrices(system: Any) -> tuple[Matrices, float]:
    """(A, B, C, D) and the sampling time [s] of any of the usual objects; 0 in continuous time.

    Raises
    ------
    DomainError
        If the object is of another kind, or in discrete time without a sampling time.
    DimensionError
        If its matrices do not fit together.

    Examples
    --------
    >>> import scipy.signal
    >>> matrices, dt = sampled_matrices(scipy.signal.dlti([1.0], [1.0, -0.5], dt=0.1))
    >>> matrices[0].tolist(), dt
    ([[0.5]], 0.1)
    """
    dt = getattr(system, "dt", None)
    if dt is True:
        raise DomainError("the system is in discrete time without a sampling time. Give it one: dt=1e-4, say.")
    return _matrices(system), float(dt or 0.0)


def as_control(system: Any) -> control.StateSpace:
    """Any of the usual objects as a `control.StateSpace`, with its sampling time; no state is removed."""
    import control

    matrices, dt = sampled_matrices(system)
    return control.ss(*matrices, dt, remove_useless_states=False)


def as_transfer_function(system: Any) -> control.TransferFunction:
    """Any of the usual objects as a `control.TransferFunction`, with its sampling time.

    Polynomials lose digits from about ten states on; stay with state spaces there.
    """
    import control

    return control.tf(as_control(system))


def as_scipy(system: Any) -> Any:
    """Any of the usual objects as a `scipy.signal.StateSpace`, with its sampling time.

    Examples
    --------
    >>> import control
    >>> as_scipy(control.ss([[-1.0]], [[1.0]], [[2.0]], [[0.0]])).C
    array([[2.]])
    """
    import scipy.signal

    matrices, dt = sampled_matrices(system)
    return scipy.signal.StateSpace(*matrices, **({"dt": dt} if dt else {}))


def _matrices(system: Any) -> Matrices:
    if isinstance(system, tuple) and len(system) == 4:
        matrices: Any = system
    elif hasattr(system, "box"):
        raise DomainError(f"system is a {type(system).__name__}, which depends on p. Freeze it with system.at(p).")
    elif hasattr(system, "A") and hasattr(system, "D"):
        matrices = (system.A, system.B, system.C, system.D)
    elif hasattr(system, "to_ss"):  # scipy.signal.lti in another form
        try:
            converted = system.to_ss()
        except TypeError as error:  # control.FRD
            raise DomainError(f"system is a {type(system).__name__}: {error} Fit a model to it first.") from error
        matrices = (converted.A, converted.B, converted.C, converted.D)
    elif hasattr(system, "num") and hasattr(system, "den"):
        import control

        converted = control.ss(system)
        matrices = (converted.A, converted.B, converted.C, converted.D)
    elif isinstance(system, int | float | np.ndarray):
        D = np.atleast_2d(finite_array("D", system))
        matrices = (np.zeros((0, 0)), np.zeros((0, D.shape[1])), np.zeros((D.shape[0], 0)), D)
    else:
        raise DomainError(
            f"system is a {type(system).__name__}; wanted control.StateSpace, control.TransferFunction, "
            "scipy.signal.lti, (A, B, C, D) or a gain matrix."
        )
    D = finite_array("D", np.atleast_2d(matrices[3]), (None, None))
    n_y, n_u = D.shape
    n_x = np.atleast_2d(matrices[0]).shape[0] if np.size(matrices[0]) else 0
    A = finite_array("A", np.reshape(matrices[0], (0, 0)) if n_x == 0 else matrices[0], (n_x, n_x))
    B = finite_array("B", np.zeros((0, n_u)) if n_x == 0 else matrices[1], (n_x, n_u))
    C = finite_array("C", np.zeros((n_y, 0)) if n_x == 0 else matrices[2], (n_y, n_x))
    return A, B, C, D
