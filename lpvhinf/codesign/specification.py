"""What is wanted of a design: everything that is fixed before tuning."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lpvhinf.checks import Array, finite_array, known_options, positive, whole_number
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DomainError, LpvHinfWarning
from lpvhinf.shaping import ShapingFilters

Number = float | Sequence[float]
TUNED = ("K_RB", "L", "xi")


@dataclass(frozen=True, kw_only=True)
class Specification:
    r"""Bandwidths, shaping filters, scaling, band-pass and delay of a co-design.

    A value that is given once serves every axis, or every controlled mode.

    Parameters
    ----------
    f_bw : [Hz]
        Target bandwidths of the rigid axes.
    expected_error : [m, rad], optional
        Expected tracking errors, :math:`W_z^{sc} = \mathrm{diag}(1/e_i)`; default 1 um and 10 urad for six
        axes (x, y, z, rx, ry, rz), else 1e-6.
    integral_ratio, roll_off_ratio : float
        f_I and f_r over f_bw; the paper takes 1/4 and 4.
    alpha, K_s, K_r : float
        Of W_z1 and W_z2; the paper takes 20, 0.5, 0.5.
    epsilon, beta_1, beta_2 : float
        Of W_w3; the paper gives no values. Larger epsilon asks for more damping.
    Q : float
        Of the band-pass in K_FM.
    delay : [s]
        Loop delay, as a Padé filter of order `delay_order` at the plant's outputs; 0 for none, as in the paper.
    n_notches : int
        Notches in series with each PID of K_RB; 0 as in the paper.
    order_K_RB : int, optional
        States per axis of a K_RB of free order, its integrator not counted, in place of the paper's PID.
    schedule : mapping of str to int
        Tuned parts, of "K_RB", "L" and "xi", that are polynomials of p, with their total degrees: {"L": 1}. None as
        in the paper. K_RB's polynomials are those of the logarithms of a PID's parameters.

    Raises
    ------
    DomainError
        If a value is not finite and above zero (delay: not below zero), an option is unknown, n_notches is below 0,
        order_K_RB below 2, or both are given, or the schedule names another part or a degree below 1.

    Examples
    --------
    >>> Specification(f_bw=40.0).filters(np.array([2 * np.pi * 139.4]), n_rb=6).f_I.tolist()
    [10.0, 10.0, 10.0, 10.0, 10.0, 10.0]
    """

    f_bw: Number = 40.0
    expected_error: Number | None = None
    integral_ratio: float = 0.25
    roll_off_ratio: float = 4.0
    alpha: float = 20.0
    K_s: float = 0.5
    K_r: float = 0.5
    epsilon: Number = 0.1
    beta_1: float = 0.5
    beta_2: float = 0.05
    Q: float = 1.0
    delay: float = 0.0
    delay_order: int = 2
    n_notches: int = 0
    order_K_RB: int | None = None
    schedule: Mapping[str, int] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in ("integral_ratio", "roll_off_ratio", "alpha", "K_s", "K_r", "beta_1", "beta_2", "Q"):
            positive(name, getattr(self, name))
        for name in ("f_bw", "epsilon", "expected_error"):
            value = getattr(self, name)
            if value is not None and (np.size(value) == 0 or np.any(finite_array(name, value) <= 0.0)):
                raise DomainError(f"{name} is {value}, wanted values above 0.")
        if finite_array("delay", self.delay, ()) < 0.0:
            raise DomainError(f"delay is {self.delay}, wanted 0 or more seconds.")
        if not isinstance(self.delay_order, int) or self.delay_order < 1:
            raise DomainError(f"delay_order is {self.delay_order!r}, wanted a whole number of at least 1.")
        if self.beta_1 <= self.beta_2:
            raise DomainError(f"beta_1 = {self.beta_1}, beta_2 = {self.beta_2}; wanted beta_1 > beta_2.")
        whole_number("n_notches", self.n_notches, 0)
        if self.order_K_RB is not None:
            whole_number("order_K_RB", self.order_K_RB, 2)
            if self.n_notches:
                raise DomainError(
                    f"n_notches is {self.n_notches} and order_K_RB is {self.order_K_RB}, wanted only one of them. "
                    "A notch is worth two states of a free order: leave n_notches out."
                )

        known_options("Specification(schedule)", self.schedule, TUNED)
        for name, degree in self.schedule.items():
            whole_number(f"schedule[{name!r}]", degree, 1)
        if "K_RB" in self.schedule and self.order_K_RB is not None:
            raise DomainError(
                f"schedule has K_RB and order_K_RB is {self.order_K_RB}, wanted only one of them: matrices of free "
                "order are no logarithms. Schedule the PID."
            )

    @classmethod
    def from_mapping(cls, settings: dict[str, Any]) -> Specification:
        """From settings as read from a file; an unknown one is an error that lists the known ones."""
        known_options("Specification", settings, (field.name for field in dataclasses.fields(cls)))
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in settings.items()}
        return cls(**values)

    def bandwidths(self, n_rb: int) -> Array:
        """f_bw of every axis, (n_rb,) [Hz]."""
        return _each("f_bw", self.f_bw, n_rb)

    def errors(self, n_rb: int) -> Array:
        """Expected errors of every axis, (n_rb,) [m, rad]."""
        if self.expected_error is None:
            return np.array([1e-6] * 3 + [1e-5] * 3) if n_rb == 6 else np.full(n_rb, 1e-6)
        return _each("expected_error", self.expected_error, n_rb)

    def filters(self, omega_flex: Array, n_rb: int) -> ShapingFilters:
        """The shaping filters for controlled modes at omega_flex [rad/s]."""
        f_bw = self.bandwidths(n_rb)
        return ShapingFilters(
            f_I=self.integral_ratio * f_bw,
            f_r=self.roll_off_ratio * f_bw,
            alpha=self.alpha,
            K_s=self.K_s,
            K_r=self.K_r,
            epsilon=_each("epsilon", self.epsilon, len(omega_flex)),
            beta_1=self.beta_1,
            beta_2=self.beta_2,
            omega_flex=omega_flex,
        )

    def warn_if_demanding(self, plant: DecoupledPlant) -> None:
        """Warn if a bandwidth is above the first discarded mode, which nobody then controls."""
        discarded = plant.omega[plant.discarded] / (2 * np.pi)
        highest = float(np.max(self.bandwidths(plant.n_rb)))
        if len(discarded) and highest >= np.min(discarded):
            warnings.warn(
                f"f_bw = {highest:.1f} Hz is above the first discarded mode at {np.min(discarded):.1f} Hz, which lies "
                "in the control band then: expect gamma well above 1, or no stabilising controller at all. "
                "Raise n_flex or lower f_bw.",
                LpvHinfWarning,
                stacklevel=3,
            )


def _each(name: str, value: Number, n: int) -> Array:
    array = finite_array(name, value)
    if array.ndim == 0 or array.shape == (1,):
        return np.full(n, float(array.ravel()[0]))
    if array.shape != (n,):
        raise DomainError(f"{name} has {array.size} values, wanted 1 or {n}.")
    return array
