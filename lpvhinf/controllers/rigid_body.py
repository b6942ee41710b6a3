"""K_RB: one PID with a second-order low-pass per rigid axis, in parameters that an engineer reads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DomainError

PARAMETERS = ("gain", "f_i", "f_d", "f_lp", "zeta_lp")
N_PARAMETERS = len(PARAMETERS)


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBodyGains:
    r"""The parameters of K_RB, one entry per rigid axis (requirement R3: physically readable).

    .. math:: K_i(s) = k_i \Big(1 + \frac{2\pi f_{i}}{s}\Big)\Big(1 + \frac{s}{2\pi f_{d}}\Big)
              \frac{1}{s^2/\omega_{lp}^2 + 2\zeta_{lp}s/\omega_{lp} + 1}, \quad \omega_{lp} = 2\pi f_{lp}

    Attributes
    ----------
    gain : (n_rb,) [1/s^2]
        Acceleration per unit of error; times the mass [kg] or inertia [kg m^2] it is a stiffness.
    f_i, f_d, f_lp : (n_rb,) [Hz]
        Integrator, differentiator and low-pass frequency.
    zeta_lp : (n_rb,)
        Damping ratio of the low-pass.

    Raises
    ------
    DomainError
        If a value is not finite and above zero.
    """

    gain: Array
    f_i: Array
    f_d: Array
    f_lp: Array
    zeta_lp: Array

    def __post_init__(self) -> None:
        n = np.size(self.gain)
        for name in PARAMETERS:
            value = finite_array(name, getattr(self, name), (n,))
            if np.any(value <= 0.0):
                raise DomainError(f"{name} is {value.tolist()}, wanted entries above 0.")
            object.__setattr__(self, name, read_only(value))

    @property
    def n_rb(self) -> int:
        """Number of axes."""
        return len(self.gain)

    def stiffness(self, mass: ArrayLike) -> Array:
        """Proportional stiffness, mass times gain [N/m, Nm/rad]."""
        return np.asarray(mass, dtype=float) * self.gain

    def response(self, omega: ArrayLike) -> Array:
        """K_i(j omega) of every axis, (n_omega, n_rb), straight from the formula."""
        s = 1j * np.asarray(omega, dtype=float)[:, None]
        w_i, w_d, w_lp = 2 * np.pi * self.f_i, 2 * np.pi * self.f_d, 2 * np.pi * self.f_lp
        return np.asarray(
            self.gain * (1 + w_i / s) * (1 + s / w_d) / ((s / w_lp) ** 2 + 2 * self.zeta_lp * s / w_lp + 1)
        )


class RigidBodyStructure:
    r"""K_RB as a tunable structure, for `hinfstruct`.

    The integrator lives in the generalized plant, shared with that of W_z1 and so absorbed exactly: the
    measurements are the scaled errors e and their integrals :math:`x_I`, :math:`\dot x_I = 2\pi f_I e`.
    With :math:`v = e + (f_i/f_I) x_I` each axis has two states,

    .. math:: \dot x_1 = \omega_{lp} x_2, \quad \dot x_2 = \omega_{lp}(v - x_1 - 2\zeta x_2), \quad
              u = k\,(x_1 + (f_{lp}/f_d)\, x_2).

    Parameters are the logarithms of (k, f_i, f_d, f_lp, zeta_lp) axis by axis, k in scaled units.

    Parameters
    ----------
    f_I : (n_rb,) [Hz]
        Cut-off frequencies of W_z1.
    gain_unit : (n_rb,) [1/s^2]
        Physical gain of k = 1.
    """

    def __init__(self, f_I: ArrayLike, gain_unit: ArrayLike) -> None:
        self.f_I = read_only(finite_array("f_I", f_I, (None,)))
        n = len(self.f_I)
        self.gain_unit = read_only(finite_array("gain_unit", gain_unit, (n,)))
        for name, values in (("f_I", self.f_I), ("gain_unit", self.gain_unit)):
            if np.any(values <= 0.0):
                raise DomainError(f"{name} is {values.tolist()}, wanted entries above 0.")
        self.n_u, self.n_y, self.n_x, self.n_parameters = n, 2 * n, 2 * n, N_PARAMETERS * n
        self.names = tuple(f"K_RB[{i}].{name}" for i in range(n) for name in PARAMETERS)

    def gains(self, theta: ArrayLike) -> RigidBodyGains:
        """The physical parameters of K_RB at theta."""
        k, f_i, f_d, f_lp, zeta = np.exp(np.reshape(np.asarray(theta, dtype=float), (-1, N_PARAMETERS))).T
        return RigidBodyGains(gain=k * self.gain_unit, f_i=f_i, f_d=f_d, f_lp=f_lp, zeta_lp=zeta)

    def parameters(self, gains: RigidBodyGains) -> Array:
        """The parameters theta of given physical ones."""
        columns = (gains.gain / self.gain_unit, gains.f_i, gains.f_d, gains.f_lp, gains.zeta_lp)
        return np.asarray(np.log(np.stack(columns, axis=1))).ravel()

    def rule_of_thumb(self, f_bw: ArrayLike) -> RigidBodyGains:
        """The usual start: |K G| = 1 at f_bw for G = 1/s^2, f_i = f_bw/5, f_d = f_bw/3, f_lp = 4 f_bw."""
        f = finite_array("f_bw", f_bw, (len(self.f_I),))
        start = RigidBodyGains(gain=np.ones_like(f), f_i=f / 5, f_d=f / 3, f_lp=4 * f, zeta_lp=np.full_like(f, 0.7))
        at_crossover = np.abs(np.diagonal(start.response(2 * np.pi * f)))
        gain = (2 * np.pi * f) ** 2 / at_crossover
        return RigidBodyGains(gain=gain, f_i=start.f_i, f_d=start.f_d, f_lp=start.f_lp, zeta_lp=start.zeta_lp)

    def realize(self, theta: Array, p: Array | None = None) -> tuple[Array, Array, Array, Array]:
        """(A, B, C, D) from (e, x_I) to u, axis by axis."""
        n = len(self.f_I)
        k, f_i, f_d, f_lp, zeta = np.exp(theta.reshape(n, N_PARAMETERS)).T
        w = 2 * np.pi * f_lp
        A, B, C = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n)), np.zeros((n, 2 * n))
        axis = np.arange(n)
        first, second = 2 * axis, 2 * axis + 1
        A[first, second], A[second, first], A[second, second] = w, -w, -2 * zeta * w
        B[second, axis], B[second, n + axis] = w, w * f_i / self.f_I
        C[axis, first], C[axis, second] = k, k * f_lp / f_d
        return A, B, C, np.zeros((n, 2 * n))

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The adjoint of the derivative of `realize` to the logarithms."""
        n = len(self.f_I)
        A, B, C, _ = self.realize(theta)
        axis = np.arange(n)
        first, second = 2 * axis, 2 * axis + 1
        proportional = GC[axis, first] * C[axis, first]
        lead = GC[axis, second] * C[axis, second]
        integral = GB[second, n + axis] * B[second, n + axis]
        damping = GA[second, second] * A[second, second]
        spring = GA[first, second] * A[first, second] + GA[second, first] * A[second, first]
        low_pass = spring + damping + GB[second, axis] * B[second, axis] + integral + lead
        return np.stack([proportional + lead, integral, -lead, low_pass, damping], axis=1).ravel()

    def initial(self, rng: np.random.Generator) -> Array:
        """A random start around the rule of thumb for f_bw = 4 f_I."""
        centre = self.parameters(self.rule_of_thumb(4 * self.f_I))
        return centre + 0.3 * rng.standard_normal(self.n_parameters)
