"""K_RB: one PID with a second-order low-pass per rigid axis, and notches, in parameters that an engineer reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only, whole_number
from lpvhinf.controllers.rigid_body_state_space import RigidBodyStateSpace
from lpvhinf.controllers.start_frequencies import start_frequencies
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct import Notch, Series

PARAMETERS = ("gain", "f_i", "f_d", "f_lp", "zeta_lp")
N_PARAMETERS = len(PARAMETERS)
NOTCH_PARAMETERS = ("f_n", "zeta_num", "zeta_den")
# Damping ratio, above and below the line, of a notch that does nothing yet: wide enough to feel a mode near by.
NEUTRAL_DAMPING = 0.5


def _no_notches() -> Array:
    return np.zeros((0, 0))


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBodyGains:
    r"""The parameters of K_RB, one entry per rigid axis (requirement R3: physically readable).

    .. math:: K_i(s) = k_i \Big(1 + \frac{2\pi f_{i}}{s}\Big)\Big(1 + \frac{s}{2\pi f_{d}}\Big)
              \frac{1}{s^2/\omega_{lp}^2 + 2\zeta_{lp}s/\omega_{lp} + 1}
              \prod_j \frac{s^2 + 2\zeta_{num,j}\omega_{n,j}s + \omega_{n,j}^2}
                          {s^2 + 2\zeta_{den,j}\omega_{n,j}s + \omega_{n,j}^2}, \quad \omega = 2\pi f

    Attributes
    ----------
    gain : (n_rb,) [1/s^2]
        Acceleration per unit of error; times the mass [kg] or inertia [kg m^2] it is a stiffness.
    f_i, f_d, f_lp : (n_rb,) [Hz]
        Integrator, differentiator and low-pass frequency.
    zeta_lp : (n_rb,)
        Damping ratio of the low-pass.
    f_n : (n_rb, n_notches) [Hz]
        Frequencies of the notches; none if left out.
    zeta_num, zeta_den : (n_rb, n_notches)
        Damping ratios of their zeros and poles; the gain at f_n is zeta_num / zeta_den.

    Raises
    ------
    DimensionError
        If sizes disagree.
    DomainError
        If a value is not finite and above zero.
    """

    gain: Array
    f_i: Array
    f_d: Array
    f_lp: Array
    zeta_lp: Array
    f_n: Array = field(default_factory=_no_notches)
    zeta_num: Array = field(default_factory=_no_notches)
    zeta_den: Array = field(default_factory=_no_notches)

    def __post_init__(self) -> None:
        n = np.size(self.gain)
        given = np.asarray(self.f_n)
        k = given.shape[1] if given.ndim == 2 and given.size else 0
        for name in (*PARAMETERS, *NOTCH_PARAMETERS):
            value = getattr(self, name)
            if name in NOTCH_PARAMETERS and k == 0 and np.size(value) == 0:
                value = np.zeros((n, 0))
            value = finite_array(name, value, (n,) if name in PARAMETERS else (n, k))
            if np.any(value <= 0.0):
                raise DomainError(f"{name} is {value.tolist()}, wanted entries above 0.")
            object.__setattr__(self, name, read_only(value))

    @property
    def n_rb(self) -> int:
        """Number of axes."""
        return len(self.gain)

    @property
    def n_notches(self) -> int:
        """Number of notches per axis."""
        return int(self.f_n.shape[1])

    def stiffness(self, mass: ArrayLike) -> Array:
        """Proportional stiffness, mass times gain [N/m, Nm/rad]."""
        return np.asarray(mass, dtype=float) * self.gain

    def response(self, omega: ArrayLike) -> Array:
        """K_i(j omega) of every axis, (n_omega, n_rb), straight from the formula."""
        s = 1j * np.asarray(omega, dtype=float)[:, None]
        w_i, w_d, w_lp = 2 * np.pi * self.f_i, 2 * np.pi * self.f_d, 2 * np.pi * self.f_lp
        K = self.gain * (1 + w_i / s) * (1 + s / w_d) / ((s / w_lp) ** 2 + 2 * self.zeta_lp * s / w_lp + 1)
        for f, num, den in zip(self.f_n.T, self.zeta_num.T, self.zeta_den.T, strict=True):
            x = s / (2 * np.pi * f)
            K = K * (x**2 + 2 * num * x + 1) / (x**2 + 2 * den * x + 1)
        return np.asarray(K)

    def arrays(self) -> dict[str, Array]:
        """The parameters by name, for files and reports; those of notches only where there are some."""
        names = (*PARAMETERS, *NOTCH_PARAMETERS) if self.n_notches else PARAMETERS
        return {name: getattr(self, name) for name in names}

    def table(self, names: Sequence[str]) -> list[str]:
        """One line an axis, and one for its notches."""
        lines = ["  axis   gain 1/s2   f_i Hz   f_d Hz  f_lp Hz  zeta_lp"]
        for i, name in enumerate(names):
            lines.append(
                f"  {name:6s} {self.gain[i]:9.0f} {self.f_i[i]:8.2f} {self.f_d[i]:8.2f} {self.f_lp[i]:8.1f} "
                f"{self.zeta_lp[i]:8.2f}"
            )
        if self.n_notches:
            lines.append("  axis   notches: f_n Hz (zeta_num / zeta_den)")
            for i, name in enumerate(names):
                rows = zip(self.f_n[i], self.zeta_num[i], self.zeta_den[i], strict=True)
                lines.append(f"  {name:6s} " + ", ".join(f"{f:.1f} ({num:.3f} / {den:.3f})" for f, num, den in rows))
        return lines


def rule_of_thumb(f_bw: Array) -> RigidBodyGains:
    """The usual start: |K G| = 1 at f_bw for G = 1/s^2, f_i = f_bw/5, f_d = f_bw/3, f_lp = 4 f_bw; no notches."""
    f = f_bw
    start = RigidBodyGains(gain=np.ones_like(f), f_i=f / 5, f_d=f / 3, f_lp=4 * f, zeta_lp=np.full_like(f, 0.7))
    at_crossover = np.abs(np.diagonal(start.response(2 * np.pi * f)))
    gain = (2 * np.pi * f) ** 2 / at_crossover
    return RigidBodyGains(gain=gain, f_i=start.f_i, f_d=start.f_d, f_lp=start.f_lp, zeta_lp=start.zeta_lp)


class RigidBodyStructure:
    r"""K_RB as a tunable structure, for `hinfstruct`.

    The integrator lives in the generalized plant, shared with that of W_z1 and so absorbed exactly: the
    measurements are the scaled errors e and their integrals :math:`x_I`, :math:`\dot x_I = 2\pi f_I e`.
    With :math:`v = e + (f_i/f_I) x_I` each axis has two states,

    .. math:: \dot x_1 = \omega_{lp} x_2, \quad \dot x_2 = \omega_{lp}(v - x_1 - 2\zeta x_2), \quad
              u = k\,(x_1 + (f_{lp}/f_d)\, x_2).

    Parameters are the logarithms of (k, f_i, f_d, f_lp, zeta_lp) axis by axis, k in scaled units. Notches follow,
    in series at u, with two more states each and the logarithms of (f_n, zeta_num, zeta_den). They start neutral,
    with zeta_num = zeta_den: the same loop as without them.

    Parameters
    ----------
    f_I : (n_rb,) [Hz]
        Cut-off frequencies of W_z1.
    gain_unit : (n_rb,) [1/s^2]
        Physical gain of k = 1.
    n_notches : int
        Notches per axis.
    f_notches : (n_notches,) or (n_rb, n_notches), optional [Hz]
        Where they start, for instance at the first eigenfrequencies that u excites; 8, 16, ... f_I if left out.

    Raises
    ------
    DimensionError
        If sizes disagree.
    DomainError
        If a frequency or a unit is not finite and above zero, or n_notches is no whole number of at least 0.

    Examples
    --------
    >>> K = RigidBodyStructure([10.0], [1.0], n_notches=2, f_notches=[140.0, 210.0])
    >>> K.n_x, K.n_parameters
    (6, 11)
    >>> K.gains(K.parameters(K.rule_of_thumb([40.0]))).f_n
    array([[140., 210.]])
    """

    def __init__(
        self, f_I: ArrayLike, gain_unit: ArrayLike, n_notches: int = 0, f_notches: ArrayLike | None = None
    ) -> None:
        self.f_I = read_only(finite_array("f_I", f_I, (None,)))
        n = len(self.f_I)
        self.gain_unit = read_only(finite_array("gain_unit", gain_unit, (n,)))
        for name, values in (("f_I", self.f_I), ("gain_unit", self.gain_unit)):
            if np.any(values <= 0.0):
                raise DomainError(f"{name} is {values.tolist()}, wanted entries above 0.")
        k = self.n_notches = whole_number("n_notches", n_notches, 0)
        self.f_notches = start_frequencies("f_notches", f_notches, k, self.f_I)
        self.n_u, self.n_y, self.n_x = n, 2 * n, 2 * n * (1 + k)
        self.n_parameters = n * (N_PARAMETERS + len(NOTCH_PARAMETERS) * k)
        each = [*PARAMETERS, *(f"{name}[{j}]" for j in range(k) for name in NOTCH_PARAMETERS)]
        self.names = tuple(f"K_RB[{i}].{name}" for i in range(n) for name in each)
        notches = [Notch(n, zeta=None, depth=None) for _ in range(k)]
        self._chain = Series(RigidBodyStructure(self.f_I, self.gain_unit), *notches) if k else None

    def gains(self, theta: ArrayLike) -> RigidBodyGains:
        """The physical parameters of K_RB at theta."""
        values = np.exp(np.reshape(np.asarray(theta, dtype=float), (len(self.f_I), -1)))
        k, f_i, f_d, f_lp, zeta = values[:, :N_PARAMETERS].T
        f_n, num, den = (values[:, N_PARAMETERS + i :: len(NOTCH_PARAMETERS)] for i in range(len(NOTCH_PARAMETERS)))
        return RigidBodyGains(
            gain=k * self.gain_unit, f_i=f_i, f_d=f_d, f_lp=f_lp, zeta_lp=zeta, f_n=f_n, zeta_num=num, zeta_den=den
        )

    def parameters(self, gains: RigidBodyGains | RigidBodyStateSpace) -> Array:
        """The parameters theta of given physical ones; notches that they lack are added, neutral.

        Raises
        ------
        DomainError
            If the gains are not those of a PID, or have more notches than this structure.
        """
        if not isinstance(gains, RigidBodyGains):
            raise DomainError(
                f"K_RB is of free order {gains.order}, wanted a PID with notches. Set order_K_RB, or start without it."
            )
        known = gains.n_notches
        if known > self.n_notches:
            raise DomainError(f"K_RB has {known} notches an axis, wanted at most {self.n_notches}. Raise n_notches.")
        columns = [gains.gain / self.gain_unit, gains.f_i, gains.f_d, gains.f_lp, gains.zeta_lp]
        for j in range(self.n_notches):
            if j < known:
                columns += [gains.f_n[:, j], gains.zeta_num[:, j], gains.zeta_den[:, j]]
            else:
                columns += [self.f_notches[:, j], *2 * [np.full(len(self.f_I), NEUTRAL_DAMPING)]]
        return np.asarray(np.log(np.stack(columns, axis=1))).ravel()

    def rule_of_thumb(self, f_bw: ArrayLike) -> RigidBodyGains:
        """The usual start: |K G| = 1 at f_bw for G = 1/s^2, f_i = f_bw/5, f_d = f_bw/3, f_lp = 4 f_bw."""
        return rule_of_thumb(finite_array("f_bw", f_bw, (len(self.f_I),)))

    def realize(self, theta: Array, p: Array | None = None) -> tuple[Array, Array, Array, Array]:
        """(A, B, C, D) from (e, x_I) to u: the states of the PIDs axis by axis, then those of every notch."""
        if self._chain is not None:
            return self._chain.realize(self._in_series(theta))
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
        if self._chain is not None:
            return self._apart(self._chain.pullback(self._in_series(theta), GA, GB, GC, GD))
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

    def _in_series(self, theta: Array) -> Array:
        """theta, axis by axis, as the parameters of the PIDs and then of every notch with its depth."""
        columns = np.reshape(theta, (len(self.f_I), -1))
        parts = [columns[:, :N_PARAMETERS].ravel()]
        for j in range(self.n_notches):
            f, num, den = columns[:, N_PARAMETERS + 3 * j : N_PARAMETERS + 3 * j + 3].T
            parts.append(np.stack([f, den, num - den], axis=1).ravel())
        return np.concatenate(parts)

    def _apart(self, gradient: Array) -> Array:
        """The adjoint of `_in_series`."""
        n = len(self.f_I)
        columns = [gradient[: N_PARAMETERS * n].reshape(n, -1)]
        for notch in gradient[N_PARAMETERS * n :].reshape(self.n_notches, n, 3):
            f, pole, depth = notch.T
            columns.append(np.stack([f, depth, pole - depth], axis=1))
        return np.hstack(columns).ravel()

    def initial(self, rng: np.random.Generator) -> Array:
        """A random start around the rule of thumb for f_bw = 4 f_I."""
        centre = self.parameters(self.rule_of_thumb(4 * self.f_I))
        return centre + 0.3 * rng.standard_normal(self.n_parameters)
