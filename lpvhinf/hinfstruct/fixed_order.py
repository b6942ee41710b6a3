"""Controllers of fixed order, on request stable for every value of the parameters."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.hinfstruct.structures import Realization

#: Smallest decay rate of a stable parametrisation if none is given [rad/s].
DECAY = 1e-6


class FixedOrder:
    r"""A controller of `order` states with free matrices A, B, C, D.

    With `stable` the state matrix is

    .. math:: A = S - L L^\top - \epsilon I, \quad S = -S^\top,

    so that :math:`A + A^\top \preceq -2 \epsilon I`: every pole lies left of :math:`-\epsilon` whatever the
    parameters are. For the full form (L lower triangular, S any skew matrix) every A with that decay rate is reached,
    up to a change of the controller's coordinates; there are as many parameters as entries of A. For the tridiagonal
    form L is diagonal and S tridiagonal, which reaches every characteristic polynomial (Schwarz form).

    Parameters
    ----------
    order, n_u, n_y : int
    form : "full" or "tridiagonal"
        Entries of A that are free. A tridiagonal A still reaches almost every
        transfer function, with fewer parameters.
    strictly_proper : bool
        True: D = 0.
    stable : bool
        True: A is Hurwitz by construction.
    decay : float, optional
        epsilon [rad/s]; only with `stable`, 1e-6 if left out.

    Raises
    ------
    DomainError
        If `form` is unknown, a size is too small, or `decay` is not positive or is given without `stable`.

    Examples
    --------
    >>> FixedOrder(2, 1, 1).n_parameters, FixedOrder(4, 1, 1, form="tridiagonal").n_parameters
    (9, 19)
    >>> K = FixedOrder(3, 1, 1, stable=True, decay=0.5)
    >>> A = K.realize(np.linspace(-9.0, 9.0, K.n_parameters))[0]
    >>> bool(np.max(np.linalg.eigvals(A).real) <= -0.5)
    True
    """

    def __init__(
        self,
        order: int,
        n_u: int,
        n_y: int,
        *,
        form: str = "full",
        strictly_proper: bool = False,
        stable: bool = False,
        decay: float | None = None,
    ) -> None:
        self.n_x, self.n_u, self.n_y = (
            whole_number("order", order, 0),
            whole_number("n_u", n_u, 1),
            whole_number("n_y", n_y, 1),
        )
        if form not in ("full", "tridiagonal"):
            raise DomainError(f"form is {form!r}, wanted 'full' or 'tridiagonal'.")
        if decay is not None and not stable:
            raise DomainError(f"decay is {decay!r} without stable=True. Set stable, or leave decay out.")
        self.form, self.stable = form, bool(stable)
        self.decay = DECAY if decay is None else positive("decay", decay, "rad/s")
        i, j = np.indices((order, order))
        near = np.ones((order, order), dtype=bool) if form == "full" else np.abs(i - j) <= 1
        self._lower = near & ((i >= j) if form == "full" else (i == j))
        self._skew = near & (i > j)
        free_A = [self._lower, self._skew] if stable else [near]
        free_D = np.full((n_u, n_y), not strictly_proper)
        self._masks = [*free_A, np.ones((order, n_y), dtype=bool), np.ones((n_u, order), dtype=bool), free_D]
        counts = [int(np.sum(mask)) for mask in self._masks]
        ends = [int(end) for end in np.cumsum(counts)]
        self._parts = [slice(end - count, end) for end, count in zip(ends, counts, strict=True)]
        self.n_parameters = sum(counts)
        self.names = tuple(
            f"{name}[{i},{j}]"
            for name, mask in zip("LSBCD" if stable else "ABCD", self._masks, strict=True)
            for i, j in np.argwhere(mask)
        )

    def _placed(self, theta: Array) -> list[Array]:
        out = []
        for mask, part in zip(self._masks, self._parts, strict=True):
            matrix = np.zeros(mask.shape)
            matrix[mask] = theta[part]
            out.append(matrix)
        return out

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D) with the parameters placed row by row: A (or L, then S) first."""
        *state, B, C, D = self._placed(np.asarray(theta, dtype=float))
        if not self.stable:
            return state[0], B, C, D
        L, S = state
        return S - S.T - L @ L.T - self.decay * np.eye(self.n_x), B, C, D

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The free entries of the four gradients; through L and S where A is stable."""
        state = [GA]
        if self.stable:
            L = self._placed(theta)[0]
            state = [-(GA + GA.T) @ L, GA - GA.T]
        return np.concatenate([G[mask] for G, mask in zip([*state, GB, GC, GD], self._masks, strict=True)])

    def parameters(self, A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike) -> Array:
        r"""The theta of a given controller, for a warm start; with `stable` in other coordinates.

        For the stable form the Lyapunov equation :math:`(A + \epsilon I)^\top P + P (A + \epsilon I) = -I` gives
        coordinates in which :math:`A + A^\top \prec -2 \epsilon I`.

        Raises
        ------
        DimensionError, DomainError
            If sizes disagree or entries are not finite.
        AssumptionError
            If the controller is not of this form: an entry that is not free is not zero, or A is not
            stable enough.
        """
        n = self.n_x
        a, b = finite_array("A", A, (n, n)), finite_array("B", B, (n, self.n_y))
        c, d = finite_array("C", C, (self.n_u, n)), finite_array("D", D, (self.n_u, self.n_y))
        if not self.stable:
            state = [a]
        else:
            shifted = a + self.decay * np.eye(n)
            if n and np.max(np.linalg.eigvals(shifted).real) >= 0.0:
                raise AssumptionError(
                    f"A has a pole right of -{self.decay:g} rad/s, wanted all left of it. Lower decay, or use "
                    "stable=False."
                )
            T = np.linalg.cholesky(scipy.linalg.solve_continuous_lyapunov(shifted.T, -np.eye(n))).T
            Ti = np.linalg.inv(T)
            a, b, c = T @ a @ Ti, T @ b, c @ Ti
            damping = -0.5 * (a + a.T) - self.decay * np.eye(n)
            state = [np.asarray(np.linalg.cholesky(damping), dtype=float), np.tril(0.5 * (a - a.T), -1)]
        matrices = [*state, b, c, d]
        for name, matrix, mask in zip("LSBCD" if self.stable else "ABCD", matrices, self._masks, strict=True):
            outside = float(np.max(np.abs(matrix[~mask]), initial=0.0))
            if outside > 1e-12 * max(1.0, float(np.max(np.abs(matrix), initial=0.0))):
                raise AssumptionError(
                    f"{name} has an entry {outside:.3g} that is not free in the form {self.form!r}, wanted 0. "
                    "Bring the controller into this form, or use form='full' and strictly_proper=False."
                )
        return np.concatenate([matrix[mask] for matrix, mask in zip(matrices, self._masks, strict=True)])

    def initial(self, rng: np.random.Generator) -> Array:
        """Normal matrices of random size, with A shifted to be stable."""
        size = 10.0 ** rng.uniform(-1.0, 1.0)
        out = [np.where(mask, rng.standard_normal(mask.shape), 0.0) for mask in self._masks]
        if self.stable:
            out[0] *= np.sqrt(size)
            out[1] *= size
        elif self.n_x:
            out[0] = size * (out[0] - (np.max(np.linalg.eigvals(out[0]).real) + 1.0) * np.eye(self.n_x))
        out[-1] *= size
        return np.concatenate([matrix[mask] for matrix, mask in zip(out, self._masks, strict=True)])
