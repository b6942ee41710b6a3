"""PID controllers with a filtered derivative, one on every channel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array, positive
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct.ranges import LogRange, as_range
from lpvhinf.hinfstruct.sections import Bounds, PhysicalParameters
from lpvhinf.hinfstruct.structures import Realization

Index = NDArray[np.signedinteger]

TERMS = ("P", "I", "D", "PI", "PD", "ID", "PID")


class PID(PhysicalParameters):
    r"""One PID a channel, the derivative with a first-order filter.

    .. math:: K(s) = k_P + k_I \frac{\omega_u}{s} + k_D \frac{s/\omega_u}{1 + s/\omega_d}, \quad
              \omega_d = 2\pi f_d, \quad \omega_u = 2\pi f_u

    The unit frequency :math:`f_u` is fixed; at the crossover it makes the three gains of similar size. Integrators
    are states of the controller and lie on the stability limit until the loop is closed.

    Parameters
    ----------
    n : int
        Channels.
    terms : str
        The terms that are present, such as "PI" or "PD".
    sign : +1 or -1, optional
        Fixes the sign of all gains, whose magnitudes then lie in `gain`. Left out: free gains.
    gain : (low, high), optional
        Bounds of |k_P|, |k_I| and |k_D|; only with `sign`.
    f_d : (low, high) [Hz], optional
        Bounds of the filter frequency; only with the term D.
    f_unit : float [Hz]
        1/(2 pi) if left out: then :math:`K = k_P + k_I/s + k_D s/(1 + s/\omega_d)`.

    Raises
    ------
    DomainError
        If `terms` or `sign` is another one, bounds are not 0 <= low < high, or an option does not apply.

    Examples
    --------
    >>> pid = PID(1, sign=-1, f_d=(10.0, 1000.0))
    >>> theta = pid.parameters(k_P=2.0, k_I=1.0, k_D=0.1, f_d=100.0)
    >>> A, B, C, D = pid.realize(theta)
    >>> complex(np.round((C @ np.linalg.inv(1j * np.eye(2) - A) @ B + D)[0, 0], 4))  # -(2 + 1/j + 0.1 j)
    (-2.0002+0.9j)
    """

    def __init__(
        self,
        n: int = 1,
        *,
        terms: str = "PID",
        sign: int | None = None,
        gain: Bounds = None,
        f_d: Bounds = None,
        f_unit: float = 1.0 / (2.0 * np.pi),
    ) -> None:
        if terms not in TERMS:
            raise DomainError(f"terms is {terms!r}, wanted one of {', '.join(TERMS)}.")
        if sign not in (None, 1, -1):
            raise DomainError(f"sign is {sign!r}, wanted +1, -1 or None.")
        if gain is not None and sign is None:
            raise DomainError(f"gain is {gain!r} without sign. Set sign to +1 or -1, or leave gain out.")
        if f_d is not None and "D" not in terms:
            raise DomainError(f"f_d is {f_d!r} for terms={terms!r}, wanted None without the term D.")
        magnitude = None if sign is None else as_range("gain", gain)
        ranges: dict[str, LogRange | None] = {f"k_{term}": magnitude for term in terms}
        if "D" in terms:
            ranges["f_d"] = as_range("f_d", f_d)
        super().__init__(n, ranges)
        self.terms, self.sign = terms, 1.0 if sign is None else float(sign)
        self.omega_unit = 2.0 * np.pi * positive("f_unit", f_unit, "Hz")
        self.n_x = n * sum(term in terms for term in "ID")

    def _places(self) -> tuple[Index, Index, Index]:
        """Channels, and the states of their integrators and filters."""
        channel = np.arange(self.n_channels)
        per = self.n_x // self.n_channels
        return channel, per * channel, per * channel + per - 1

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D); states of a channel: the integral, then the filtered error."""
        values = self.physical(theta)
        n, w = self.n_channels, self.omega_unit
        channel, integral, lag = self._places()
        A, B = np.zeros((self.n_x, self.n_x)), np.zeros((self.n_x, n))
        C, D = np.zeros((n, self.n_x)), np.zeros((n, n))
        if "P" in self.terms:
            D[channel, channel] = self.sign * values["k_P"]
        if "I" in self.terms:
            B[integral, channel] = w
            C[channel, integral] = self.sign * values["k_I"]
        if "D" in self.terms:
            w_d = 2.0 * np.pi * values["f_d"]
            high = self.sign * values["k_D"] * w_d / w
            A[lag, lag], B[lag, channel] = -w_d, w_d
            C[channel, lag] = -high
            D[channel, channel] += high
        return A, B, C, D

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """Gradients in the gains and in f_d, then in theta."""
        values = self.physical(theta)
        w = self.omega_unit
        channel, integral, lag = self._places()
        direct = np.diagonal(GD)
        out: dict[str, Array] = {}
        if "P" in self.terms:
            out["k_P"] = self.sign * direct
        if "I" in self.terms:
            out["k_I"] = self.sign * GC[channel, integral]
        if "D" in self.terms:
            w_d = 2.0 * np.pi * values["f_d"]
            high = self.sign * (direct - GC[channel, lag])
            out["k_D"] = high * w_d / w
            out["f_d"] = 2.0 * np.pi * (GB[lag, channel] - GA[lag, lag] + high * values["k_D"] / w)
        return self._to_theta(theta, out)
