"""A controller that p schedules, as a computer steps it: the trapezoidal rule along p(t)."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.lpv import LPVStateSpace

ROUND_OFF = 1e-15  # relative: singular values below it are those of round-off
SINGULAR = 1e14  # condition number of I - (T/2) A from which on it counts as singular


class ControllerSteps:
    r"""Matrices (N, n_x + n_y, n_x + n_u) that map (xi, v) to the next xi and the output, at positions (N, n_p).

    With :math:`F = (I - \tfrac T2 A)^{-1}` at the sample's own position, :math:`x = F (\xi + \tfrac T2 B v)`,
    :math:`y = C x + D v`, :math:`\xi^+ = 2x - \xi`. That is the trapezoidal rule for
    :math:`\dot x = A(p(t)) x + B(p(t)) v` whatever p does, and Tustin's transformation where p rests.

    Parameters
    ----------
    controller : LPVStateSpace
    period : float
        [s]

    Examples
    --------
    >>> integrator = LPVStateSpace.from_coefficients([[0.0]], [[1.0]], [[1.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> ControllerSteps(integrator, 0.5).at(np.array([[0.0]]))
    array([[[1.  , 0.5 ],
            [1.  , 0.25]]])
    """

    def __init__(self, controller: LPVStateSpace, period: float) -> None:
        self.controller, self.period = controller, period
        self._A = FewFunctions(controller.A)

    def at(self, points: Array) -> Array:
        """The matrices at positions (N, n_p).

        Raises
        ------
        AssumptionError
            If the controller has a pole at 2/T at one of them.
        """
        K, h = self.controller, 0.5 * self.period
        n, eye = K.n_x, np.eye(K.n_x)
        left = eye - h * self._A.sample(points)
        try:
            F = np.asarray(np.linalg.inv(left), dtype=float)
        except np.linalg.LinAlgError:
            F = np.full(left.shape, np.inf)
        condition = _norm(left) * _norm(F)
        if n and not np.all(condition < SINGULAR):
            raise AssumptionError(
                f"I - (T/2) A is singular at p = {points[np.argmax(condition)].tolist()}: the controller has a pole at "
                f"2/T = {1.0 / h:.4g} rad/s. Take a shorter period."
            )
        FB, C = F @ (h * K.B.sample(points)), K.C.sample(points)
        out = np.empty((len(points), n + K.n_y, n + K.n_u))
        out[:, :n, :n], out[:, :n, n:] = 2.0 * F - eye, 2.0 * FB
        out[:, n:, :n], out[:, n:, n:] = C @ F, C @ FB + K.D.sample(points)
        return out

    @cached_property
    def integrators(self) -> NDArray[np.intp]:
        """Indices of the states that are pure integrals of the inputs: their rows of A vanish for every p."""
        c = self.controller.A.coefficients
        return np.flatnonzero(~np.any(c, axis=(*range(c.ndim - 2), c.ndim - 1)))


class FewFunctions:
    """A matrix whose entries combine few functions of p, evaluated faster: sum of f_i(p) M_i, equal to round-off.

    Where an observer's model depends on p, many entries of the controller's A are combinations of the few in that
    model. Those functions are polynomials themselves, found by a singular value decomposition of the coefficients.
    """

    def __init__(self, matrix: ChebyshevMatrix) -> None:
        self._whole, self.shape = matrix, matrix.shape
        self._factors: tuple[ChebyshevMatrix, Array] | None = None
        if matrix.is_constant or not matrix.coefficients.size:
            return
        trimmed = matrix.trimmed()
        flat = trimmed.coefficients.reshape(-1, self.shape[0] * self.shape[1])
        used = np.flatnonzero(np.any(flat[1:], axis=0))
        if not len(used):
            return
        Q, R = np.linalg.qr(flat[1:, used])
        U, sizes, Vt = np.linalg.svd(R, full_matrices=False)
        rank = int(np.count_nonzero(sizes > ROUND_OFF * sizes[0]))
        if 2 * rank > len(used):
            return
        functions = np.vstack([np.zeros((1, rank)), Q @ (U[:, :rank] * sizes[:rank])])
        degrees = trimmed.coefficients.shape[:-2]
        self._factors = ChebyshevMatrix(functions.reshape(*degrees, 1, rank), matrix.box), Vt[:rank]
        self._constant, self._used = flat[0], used

    def sample(self, points: Array) -> Array:
        """The matrices at positions (N, n_p)."""
        if self._factors is None:
            return self._whole.sample(points)
        functions, parts = self._factors
        out = np.tile(self._constant, (len(points), 1))
        out[:, self._used] += functions.sample(points)[:, 0] @ parts
        return out.reshape(len(points), *self.shape)


def _norm(matrices: Array) -> Array:
    """1-norms of a stack (N, n, n)."""
    return np.asarray(np.max(np.sum(np.abs(matrices), axis=1), axis=1, initial=0.0))
