"""K_RB of a chosen order: one stable state space per rigid axis, free but for its order."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only, whole_number
from lpvhinf.controllers.rigid_body import RigidBodyGains, RigidBodyStructure, rule_of_thumb
from lpvhinf.controllers.rigid_body_state_space import RigidBodyStateSpace
from lpvhinf.controllers.start_frequencies import start_frequencies
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct import FixedOrder

LEAST_ORDER = 2  # of the PID with its low-pass, which it starts from
DECAY = 1e-6  # smallest decay rate of its poles, relative to the unit of time
EXTRA_DAMPING = 0.5  # damping ratio of the states that are added to those of the start


class FreeRigidBodyStructure:
    r"""K_RB of free order as a tunable structure, for `hinfstruct`.

    As in `RigidBodyStructure` the integrator lives in the generalized plant. Each axis is strictly proper, from the
    scaled (e, x_I) to u, in the stable tridiagonal form of `FixedOrder` and in time units of :math:`1/\omega_u`,
    :math:`\omega_u^2` = `gain_unit`:

    .. math:: \dot x = \omega_u \big((S - L L^\top - \epsilon I)\, x + B \begin{bmatrix} e \\ x_I \end{bmatrix}\big),
              \quad u = C x,

    S skew and tridiagonal, L diagonal: stable for all parameters, which are the entries of L, S, B and C. Almost
    every stable transfer function of that order is reached. Given gains are those of a PID, whose two states
    come first. Further states start with C = 0: they do nothing yet, but their gradient is not zero.

    Parameters
    ----------
    f_I : (n_rb,) [Hz]
        Cut-off frequencies of W_z1.
    gain_unit : (n_rb,) [1/s^2]
        Physical gain of u = e, the square of a typical frequency of the loop [rad/s].
    order : int
        States per axis, at least 2; the integrator is not counted.
    f_states : (n,) or (n_rb, n), optional [Hz]
        Frequencies of the n = ceil(order/2) - 1 pairs of further states; 8, 16, ... f_I if left out.

    Raises
    ------
    DimensionError
        If sizes disagree.
    DomainError
        If a frequency or a unit is not finite and above zero, or the order is no whole number of at least 2.

    Examples
    --------
    >>> K = FreeRigidBodyStructure([10.0, 10.0], [1.0, 1.0], 4)
    >>> K.n_x, K.n_parameters
    (8, 38)
    """

    def __init__(self, f_I: ArrayLike, gain_unit: ArrayLike, order: int, f_states: ArrayLike | None = None) -> None:
        self._pid = RigidBodyStructure(f_I, gain_unit)
        self.f_I, self.gain_unit = self._pid.f_I, self._pid.gain_unit
        self.order = whole_number("order", order, LEAST_ORDER)
        self.f_states = start_frequencies("f_states", f_states, (self.order - 1) // 2, self.f_I)
        self.omega_unit = read_only(np.sqrt(self.gain_unit))
        n = len(self.f_I)
        self._axis = FixedOrder(self.order, 1, 2, form="tridiagonal", strictly_proper=True, stable=True, decay=DECAY)
        self.n_u, self.n_y, self.n_x, self.n_parameters = n, 2 * n, n * self.order, n * self._axis.n_parameters
        self.names = tuple(f"K_RB[{i}].{name}" for i in range(n) for name in self._axis.names)

    def gains(self, theta: ArrayLike) -> RigidBodyStateSpace:
        """The state spaces of K_RB at theta, in physical units."""
        axes = [self._axis.realize(row) for row in np.reshape(np.asarray(theta, dtype=float), (len(self.f_I), -1))]
        w = self.omega_unit[:, None, None]
        integral = np.stack([np.ones_like(self.f_I), 2 * np.pi * self.f_I], axis=1)[:, None, :]  # x_I' = 2 pi f_I e
        return RigidBodyStateSpace(
            A=w * [A for A, _, _, _ in axes],
            B=w * integral * [B for _, B, _, _ in axes],
            C=self.gain_unit[:, None] * [C[0] for _, _, C, _ in axes],
        )

    def parameters(self, gains: RigidBodyGains | RigidBodyStateSpace) -> Array:
        """The parameters theta of a PID, or of state spaces that `gains` gave; missing states are added.

        Raises
        ------
        DomainError
            If the PID has notches, the order is above that of this structure, or a state space is in other
            coordinates.
        """
        if isinstance(gains, RigidBodyGains):
            parts = self._of_pid(gains)
        else:
            parts = self._of_state_space(gains)
        return np.concatenate([self._filled(i, *part) for i, part in enumerate(parts)])

    def rule_of_thumb(self, f_bw: ArrayLike) -> RigidBodyGains:
        """The usual start, a PID: see `RigidBodyStructure.rule_of_thumb`."""
        return rule_of_thumb(finite_array("f_bw", f_bw, (len(self.f_I),)))

    def realize(self, theta: Array, p: Array | None = None) -> tuple[Array, Array, Array, Array]:
        """(A, B, C, D) from (e, x_I) to u, axis by axis."""
        n, m = len(self.f_I), self.order
        A, B, C = np.zeros((n * m, n * m)), np.zeros((n * m, 2 * n)), np.zeros((n, n * m))
        for i, (row, w) in enumerate(zip(theta.reshape(n, -1), self.omega_unit, strict=True)):
            own = slice(i * m, (i + 1) * m)
            a, b, c, _ = self._axis.realize(row)
            A[own, own], B[own, i::n], C[i, own] = w * a, w * b, c[0]
        return A, B, C, np.zeros((n, 2 * n))

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The axes' own parts of the gradients, pulled back."""
        n, m = len(self.f_I), self.order
        out = []
        for i, (row, w) in enumerate(zip(theta.reshape(n, -1), self.omega_unit, strict=True)):
            own = slice(i * m, (i + 1) * m)
            parts = (w * GA[own, own], w * GB[own, i::n], GC[i : i + 1, own], GD[i : i + 1, i::n])
            out.append(self._axis.pullback(row, *parts))
        return np.concatenate(out)

    def initial(self, rng: np.random.Generator) -> Array:
        """A random start around the rule of thumb for f_bw = 4 f_I."""
        centre = self.parameters(self.rule_of_thumb(4 * self.f_I))
        return centre + 0.1 * rng.standard_normal(self.n_parameters)

    def _of_pid(self, gains: RigidBodyGains) -> list[tuple[Array, Array, Array]]:
        """Every axis of a PID as (A, B, C) in units of time, the symmetric part of A diagonal and below -epsilon."""
        if gains.n_notches:
            raise DomainError(
                f"K_RB has {gains.n_notches} notches an axis, wanted a PID without to start a free order from. "
                "Start from a design with n_notches = 0, or without a design."
            )
        A, B, C, _ = self._pid.realize(self._pid.parameters(gains))
        n, out = len(self.f_I), []
        for i, w in enumerate(self.omega_unit):
            own = slice(2 * i, 2 * i + 2)
            a, b, c = A[own, own] / w, B[own, i::n] / w, C[i, own]
            X = scipy.linalg.solve_continuous_lyapunov((a + DECAY * np.eye(2)).T, -np.eye(2))
            T = np.linalg.cholesky(X).T
            balanced = T @ a @ np.linalg.inv(T)
            _, V = np.linalg.eigh(balanced + balanced.T)
            T = V.T @ T
            Ti = np.linalg.inv(T)
            out.append((T @ a @ Ti, T @ b, c @ Ti))
        return out

    def _of_state_space(self, gains: RigidBodyStateSpace) -> list[tuple[Array, Array, Array]]:
        """Every axis as (A, B, C) in units of time."""
        if gains.order > self.order:
            raise DomainError(f"K_RB is of order {gains.order}, wanted at most {self.order}. Raise order_K_RB.")
        symmetric, rest = gains.A + np.swapaxes(gains.A, 1, 2), np.abs(gains.A)
        near = np.abs(np.subtract.outer(np.arange(gains.order), np.arange(gains.order)))
        outside = max(np.max(np.abs(symmetric[:, near > 0]), initial=0.0), np.max(rest[:, near > 1], initial=0.0))
        if outside > 1e-9 * np.max(rest) or np.any(np.diagonal(gains.A, axis1=1, axis2=2) > 0.0):
            raise DomainError(
                f"A of K_RB has an entry {outside:.3g} that is not of the form S - L L', wanted a tridiagonal skew "
                "matrix minus a diagonal one. Take the state spaces from `gains` of this structure."
            )
        w, integral = self.omega_unit, 2 * np.pi * self.f_I
        B = gains.B / np.stack([np.ones_like(w), integral], axis=1)[:, None, :]
        C = gains.C / self.gain_unit[:, None]
        return [(gains.A[i] / w[i], B[i] / w[i], C[i]) for i in range(len(w))]

    def _filled(self, i: int, A: Array, B: Array, C: Array) -> Array:
        """The parameters of axis i from (A, B, C) of some of its states; the others read e and drive nothing."""
        known, m = len(A), self.order
        diagonal, below = np.zeros(m), np.zeros(m - 1)
        inputs, outputs = np.zeros((m, 2)), np.zeros(m)
        diagonal[:known], below[: known - 1] = -np.diagonal(A), np.diagonal(A, -1)
        inputs[:known], outputs[:known] = B, C
        # from the last states backwards, so that the frequencies left over are the highest
        pairs = [(first, min(first + 2, m)) for first in range(known, m, 2)]
        for (first, end), f in zip(pairs, self.f_states[i, self.f_states.shape[1] - len(pairs) :], strict=True):
            w = 2 * np.pi * f / self.omega_unit[i]
            diagonal[first:end] = w if end - first == 1 else EXTRA_DAMPING * w
            below[first : end - 1] = -w * np.sqrt(1.0 - EXTRA_DAMPING**2)
            inputs[end - 1, 0] = w
        roots = np.sqrt(np.maximum(diagonal - DECAY, 0.0))
        return np.concatenate([roots, below, inputs.ravel(), outputs])
