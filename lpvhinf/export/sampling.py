"""From continuous-time controllers to sampled ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, positive
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.export.controller import FORMS, Matrices, SampledController, tustin
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.interop import sampled_matrices
from lpvhinf.statespace.lpv import LPVStateSpace

NO_BOX = [[-1.0, 1.0]]  # of matrices that do not depend on p


def sampled(
    system: Any,
    *,
    period: float = 1e-4,
    form: str = "trapezoidal",
    degree: int | Sequence[int] | None = None,
    name: str = "controller",
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> SampledController:
    """A controller at a sampling rate, 10 kHz if not said otherwise, by Tustin's transformation at frozen p.

    Parameters
    ----------
    system : LPVStateSpace, or control.StateSpace, TransferFunction, scipy.signal, (A, B, C, D), gain
        A discrete-time system of the same period is taken as it is.
    period : float
        [s]
    form : "trapezoidal" or "discrete"
        Where A depends on p: "trapezoidal" solves a linear system each step and is exact at frozen p; "discrete"
        has the transformed matrices, interpolated in p. Where A is constant both are the same, and exact.
    degree : int or (n_p,), optional
        In p, of the interpolated matrices.
    name, inputs, outputs
        See `SampledController`.

    Raises
    ------
    DomainError
        If the period is another one than that of a discrete-time system, `degree` is missing, or an option is unknown.
    AssumptionError
        If the controller has a pole at 2/T.

    Examples
    --------
    >>> K = LPVStateSpace.from_coefficients([[[-100.0]], [[-50.0]]], [[1.0]], [[100.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> exact, fitted = sampled(K), sampled(K, form="discrete", degree=4)
    >>> exact.step_matrices([0.3])[0], fitted.fit_error < 1e-9
    (array([[0.988566]]), True)
    """
    names: dict[str, Any] = {"name": name, "inputs": tuple(inputs), "outputs": tuple(outputs)}
    T = positive("period", period, "s")
    if form not in FORMS:
        raise DomainError(f"form is {form!r}, wanted one of {', '.join(FORMS)}.")
    if not isinstance(system, LPVStateSpace):
        matrices, dt = sampled_matrices(system)
        if dt and abs(dt - T) > 1e-9 * T:
            raise DomainError(f"period is {T}, and the system has the sampling time {dt}. Pass period={dt}.")
        if not dt:
            matrices = _one(*matrices, T)
        A, B, C, D = (ChebyshevMatrix(matrix, NO_BOX) for matrix in matrices)
        return SampledController(A=A, B=B, C=C, D=D, period=T, **names)
    A, B, C, D = (matrix.trimmed() for matrix in system.matrices)
    if A.is_constant:
        # the inverse does not depend on p, so that the products are polynomials
        Ad, unit, _, _ = _one(A.coefficients[(0,) * A.n_p], np.eye(system.n_x), np.eye(system.n_x), 0.0, T)
        F = unit / T
        Bd, Cd = unit @ B, C @ F
        Dd = D + (C @ (0.5 * unit)) @ B
        return SampledController(
            A=ChebyshevMatrix(Ad, system.box), B=Bd.trimmed(), C=Cd.trimmed(), D=Dd.trimmed(), period=T, **names
        )
    if form == "trapezoidal":
        return SampledController(A=A, B=B, C=C, D=D, period=T, form=form, **names)
    if degree is None:
        raise DomainError("degree is None, wanted a degree in p: A depends on p, so that A in discrete time is fitted.")

    def transformed(points: Array) -> Matrices:
        a, b, c, d = system.sample(points)
        return tustin(a, b, c, d, T)

    return sampled_from_function(
        transformed,
        box=system.box,
        degree=degree,
        period=T,
        **names,
    )


def sampled_from_function(
    function: Callable[[Array], tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]],
    *,
    box: ArrayLike,
    degree: int | Sequence[int],
    period: float = 1e-4,
    name: str = "controller",
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> SampledController:
    """A controller whose discrete-time matrices are given as a function, interpolated in p over the box.

    Parameters
    ----------
    function : callable
        Positions (N, n_p) -> (A, B, C, D) of x+ = A x + B u, y = C x + D u, each (N, ., .).
    box : (n_p, 2)
    degree : int or (n_p,)
        The error that it leaves is measured at other positions: `fit_error` of the result.

    Examples
    --------
    >>> def matrices(p):
    ...     return 0.5 + 0.1 * p[:, :, None] ** 2, *(np.ones((3, len(p), 1, 1)))
    >>> sampled_from_function(matrices, box=[[-1.0, 1.0]], degree=2).at([0.5]).A
    array([[0.525]])
    """

    def given(points: Array) -> tuple[Array, Array, Array, Array]:
        A, B, C, D = (np.asarray(matrix, dtype=float) for matrix in function(points))
        if any(matrix.ndim != 3 or len(matrix) != len(points) for matrix in (A, B, C, D)):
            raise DimensionError("function returns matrices of other shapes than (N, rows, cols).")
        return A, B, C, D

    fit = LPVStateSpace.interpolate(given, box=box, degree=degree)
    worst = 0.0
    for label, matrix in zip("ABCD", fit.system.matrices, strict=True):
        size = float(np.max(np.abs(matrix.sample(np.mean(matrix.box, axis=1)[None])), initial=0.0))
        error = float(np.max(fit.errors[label], initial=0.0))
        worst = max(worst, error / size if size > 0.0 else error)
    A, B, C, D = fit.system.matrices
    return SampledController(
        A=A, B=B, C=C, D=D, period=period, name=name, inputs=tuple(inputs), outputs=tuple(outputs), fit_error=worst
    )


def _one(A: Array, B: Array, C: Array, D: ArrayLike, period: float) -> Matrices:
    a, b, c, d = tustin(A[None], B[None], C[None], np.asarray(D, dtype=float)[None], period)
    return a[0], b[0], c[0], d[0]
