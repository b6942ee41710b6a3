"""Scaling of the plant's channels, and the shaping filters W_z1, W_z2, W_w1, W_w2, W_w3 (eq. 12-18)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.lpv import LPVStateSpace

Filter = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class Scaling:
    r"""Diagonal scalings of outputs, inputs and states of a decoupled plant.

    .. math:: \tilde G_{sc} = W_z^{sc}\, \tilde G\, \mathrm{diag}(W_{w1}^{sc}, W_{w2}^{sc})

    * :math:`W_z^{sc}`: reciprocals of the expected tracking errors.
    * :math:`W_{w1}^{sc} = \mathrm{diag}|G_{nom}(2\pi j f_{bw})|^{-1} (W_z^{sc})^{-1}` (eq. 13) with the
      rigid-body nominal plant, so that every scaled rigid axis is :math:`(\omega_{bw}/s)^2`.
    * :math:`W_{w2}^{sc} = I` in the paper, for modal forces in the unit that gives a static scaled rigid-body output
      of norm one at the position where the mode is best seen (the paper leaves this unit open, and
      epsilon has a meaning only with it).

    States (eta, eta') become (eta, eta'/omega) in the same units: a similarity, for the numerics only.

    Attributes
    ----------
    output : (n_out,) [1/m, 1/rad]
        Redundant sensor readings are scaled like the axis with the smallest expected error.
    input : (n_rb + n_flex,) [m/s^2, rad/s^2, N/sqrt(kg)]
        Physical input per unit of scaled input.
    state : (2 n_modes,)
        Physical state per unit of scaled state.
    f_bw : (n_rb,) [Hz]
    """

    output: Array
    input: Array
    state: Array
    f_bw: Array

    def apply(self, system: LPVStateSpace) -> LPVStateSpace:
        """The scaled decoupled plant."""
        inverse = np.diag(1.0 / self.state)
        state, inputs, outputs = np.diag(self.state), np.diag(self.input), np.diag(self.output)
        return LPVStateSpace(
            inverse @ system.A @ state,
            inverse @ system.B @ inputs,
            outputs @ system.C @ state,
            outputs @ system.D @ inputs,
        )

    def correction(self, matrix: ChebyshevMatrix) -> ChebyshevMatrix:
        """A feed-through matrix in scaled units."""
        return np.diag(self.output) @ matrix @ np.diag(self.input)


def scaling(plant: DecoupledPlant, f_bw: Array, expected_error: Array, *, n_points: int = 256) -> Scaling:
    """The scaling of a decoupled plant for target bandwidths f_bw [Hz] and expected errors [m, rad].

    Raises
    ------
    DomainError
        If a bandwidth or an expected error is not above zero.
    """
    n_rb, n_in = plant.n_rb, plant.n_rb + plant.n_flex
    f = finite_array("f_bw", f_bw, (n_rb,))
    error = finite_array("expected_error", expected_error, (n_rb,))
    for name, values in (("f_bw", f), ("expected_error", error)):
        if np.any(values <= 0.0):
            raise DomainError(f"{name} is {values.tolist()}, wanted entries above 0.")
    w = 2 * np.pi * f
    output = np.concatenate([1.0 / error, np.full(plant.n_out - n_rb, 1.0 / np.min(error))])
    gains = plant.sample(spread_points(plant.box, n_points)).C[:, :n_rb, n_rb:]
    size = np.max(np.linalg.norm(gains / error[:, None], axis=1), axis=0)
    size[size == 0.0] = 1.0
    omega = plant.omega[n_rb:]
    state = np.empty(2 * plant.n_modes)
    state[0 : 2 * n_rb : 2], state[1 : 2 * n_rb : 2] = error, error * w
    state[2 * n_rb :: 2], state[2 * n_rb + 1 :: 2] = 1.0 / size, omega / size
    modal_unit = (omega**2 / size)[: n_in - n_rb]
    return Scaling(
        output=read_only(output),
        input=read_only(np.concatenate([w**2 * error, modal_unit])),
        state=read_only(state),
        f_bw=read_only(f),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapingFilters:
    r"""The filters of the 4-block and the 6-block problem.

    .. math:: W_{z1} = K_s \frac{s + 2\pi f_I}{s}, \quad
              W_{z2} = K_r \frac{s + 2\pi f_r}{s/\alpha + 2\pi f_r}, \quad
              W_{w3} = \epsilon \frac{s^2/\omega^2 + 2\beta_1 s/\omega + 1}{s^2/\omega^2 + 2\beta_2 s/\omega + 1},
              \quad W_{w1} = W_{w2} = I

    Attributes
    ----------
    f_I, f_r : (n_rb,) [Hz]
    alpha, K_s, K_r, beta_1, beta_2 : float
        With beta_1 > beta_2.
    epsilon : (n_flex,)
    omega_flex : (n_flex,) [rad/s]
        Eigenfrequencies of the controlled modes.
    """

    f_I: Array
    f_r: Array
    alpha: float
    K_s: float
    K_r: float
    epsilon: Array
    beta_1: float
    beta_2: float
    omega_flex: Array

    def __post_init__(self) -> None:
        for name in ("alpha", "K_s", "K_r", "beta_1", "beta_2"):
            positive(name, getattr(self, name))
        if self.beta_1 <= self.beta_2:
            raise DomainError(f"beta_1 = {self.beta_1}, beta_2 = {self.beta_2}; wanted beta_1 > beta_2.")
        if np.shape(self.epsilon) != np.shape(self.omega_flex) or np.shape(self.f_I) != np.shape(self.f_r):
            raise DimensionError("epsilon and omega_flex, or f_I and f_r, have different lengths.")
        for name in ("f_I", "f_r", "epsilon", "omega_flex"):
            values = finite_array(name, getattr(self, name), (None,))
            if np.any(values <= 0.0):
                raise DomainError(f"{name} is {values.tolist()}, wanted entries above 0.")
            object.__setattr__(self, name, read_only(values))

    def W_z1(self, omega: Array) -> Array:
        """Frequency response of the diagonal, (n_omega, n_rb)."""
        s = 1j * omega[:, None]
        return np.asarray(self.K_s * (s + 2 * np.pi * self.f_I) / s)

    def W_z2(self, omega: Array) -> Array:
        """Frequency response of the diagonal, (n_omega, n_rb)."""
        s, w = 1j * omega[:, None], 2 * np.pi * self.f_r
        return np.asarray(self.K_r * (s + w) / (s / self.alpha + w))

    def W_w3(self, omega: Array) -> Array:
        """Frequency response of the diagonal, (n_omega, n_flex)."""
        x = 1j * omega[:, None] / self.omega_flex
        return np.asarray(self.epsilon * (x**2 + 2 * self.beta_1 * x + 1) / (x**2 + 2 * self.beta_2 * x + 1))

    def realize_W_z2(self) -> Filter:
        """(A, B, C, D), one state per axis."""
        pole = self.alpha * 2 * np.pi * self.f_r
        n = len(pole)
        return (
            -np.diag(pole),
            np.diag(pole),
            self.K_r * (1.0 - self.alpha) * np.eye(n),
            self.K_r * self.alpha * np.eye(n),
        )

    def realize_W_w3(self) -> Filter:
        """(A, B, C, D), two states per controlled mode."""
        w, n = self.omega_flex, len(self.omega_flex)
        first, second, mode = 2 * np.arange(n), 2 * np.arange(n) + 1, np.arange(n)
        A, B, C = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n)), np.zeros((n, 2 * n))
        A[first, first], A[first, second], A[second, first] = -2 * self.beta_2 * w, -w, w
        B[first, mode] = w
        C[mode, first] = 2 * (self.beta_1 - self.beta_2) * self.epsilon
        return A, B, C, np.diag(self.epsilon)


def pade_delay(delay: float, order: int, n: int) -> Filter:
    r"""A Padé approximation of :math:`e^{-s\tau}` for `n` channels, balanced in the units of the delay.

    Parameters
    ----------
    delay : float [s]
    order : int
        States per channel, at least 1.
    """
    import control
    import scipy.linalg

    positive("delay", delay, "s")
    if order < 1:
        raise DomainError(f"order is {order}, wanted a whole number of at least 1.")
    numerator, denominator = control.pade(1.0, order)  # for unit delay, then time-scaled: well conditioned
    unit = control.ss(control.tf(numerator, denominator))
    blocks = [np.asarray(m, dtype=float) for m in (unit.A / delay, unit.B / delay, unit.C, unit.D)]
    a, b, c, d = (scipy.linalg.block_diag(*[m] * n) for m in blocks)
    return a, b, c, d
