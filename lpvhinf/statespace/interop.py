"""To and from the objects that control engineers already have."""

from __future__ import annotations

from typing import Any

import numpy as np

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import DimensionError, DomainError


def state_space_matrices(system: Any) -> tuple[Array, Array, Array, Array]:
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
    if isinstance(system, tuple) and len(system) == 4:
        matrices: Any = system
    elif hasattr(system, "A") and hasattr(system, "D"):
        _continuous(system)
        matrices = (system.A, system.B, system.C, system.D)
    elif hasattr(system, "to_ss"):  # scipy.signal.lti in another form
        _continuous(system)
        try:
            converted = system.to_ss()
        except TypeError as error:  # control.FRD
            raise DomainError(f"system is a {type(system).__name__}: {error} Fit a model to it first.") from error
        matrices = (converted.A, converted.B, converted.C, converted.D)
    elif hasattr(system, "num") and hasattr(system, "den"):
        import control

        _continuous(system)
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


def _continuous(system: Any) -> None:
    dt = getattr(system, "dt", None)
    if dt not in (None, 0):
        raise DimensionError(f"the system has the sampling time {dt}, wanted continuous time. Convert it first.")
