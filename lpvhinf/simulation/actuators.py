"""Actuators with limits: what the decoupled inputs ask of each, and what is left of them at a limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array, finite_array, positive
from lpvhinf.errors import DimensionError, DomainError

Map = Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class Actuators:
    """Currents i = bias(p) + T(p) u of the actuators for decoupled inputs u.

    Parameters
    ----------
    matrix : callable (N, n_p) -> (N, n_u, n_in)
        T, for instance ``lambda p: decoupled.matrices(p)[1]``.
    limit : float
        Largest current of either sign [A, N].
    bias : callable (N, n_p) -> (N, n_u), optional
        What acts all the time, as `MMPA.levitation_current`.
    every : int
        T and bias are computed at every so many samples, and linear in time between them.

    Raises
    ------
    DomainError
        If the limit or `every` is not above zero.
    """

    matrix: Map
    limit: float
    bias: Map | None = None
    every: int = 10

    def __post_init__(self) -> None:
        positive("limit", self.limit, "A")
        if isinstance(self.every, bool) or not isinstance(self.every, int) or self.every < 1:
            raise DomainError(f"every is {self.every!r}, wanted a whole number of at least 1.")

    def along(self, points: Array, n_in: int) -> ActuatorPath:
        """The actuators along positions (N, n_p), one a sample.

        Raises
        ------
        DimensionError
            If the maps return other shapes.
        DomainError
            If the bias alone exceeds the limit; the message says where.
        """
        chosen = points[np.unique(np.append(np.arange(0, len(points), self.every), len(points) - 1))]
        distinct, place = np.unique(chosen, axis=0, return_inverse=True)
        T = finite_array("matrix(points)", self.matrix(distinct), (len(distinct), None, None))
        if T.shape[2] < n_in:
            raise DimensionError(f"matrix has {T.shape[2]} columns, wanted at least the {n_in} inputs in use.")
        bias = np.zeros(T.shape[:2])
        if self.bias is not None:
            bias = finite_array("bias(points)", self.bias(distinct), T.shape[:2])
        if np.max(np.abs(bias), initial=0.0) >= self.limit:
            worst = int(np.argmax(np.max(np.abs(bias), axis=1)))
            raise DomainError(
                f"limit is {self.limit}, and the bias alone takes {np.max(np.abs(bias[worst])):.4g} at "
                f"p = {distinct[worst].tolist()}. Raise the limit, or lower the bias."
            )
        return ActuatorPath(T=T[:, :, :n_in], bias=bias, place=place.ravel(), every=self.every, limit=self.limit)


@dataclass(frozen=True, kw_only=True, eq=False)
class ActuatorPath:
    """`Actuators` along the samples of a motion: distinct maps, and which of them each interval begins with."""

    T: Array
    bias: Array
    place: NDArray[np.intp]
    every: int
    limit: float

    def currents(self, k: int, u: Array) -> tuple[Array, Array]:
        """Bias and T u (n_u,) of sample k."""
        i, left = divmod(k, self.every)
        i = min(i, len(self.place) - 1)
        a, b = self.place[i], self.place[min(i + 1, len(self.place) - 1)]
        if left == 0 or a == b:
            return self.bias[a], self.T[a] @ u
        share = left / self.every
        return (1.0 - share) * self.bias[a] + share * self.bias[b], (1.0 - share) * (self.T[a] @ u) + share * (
            self.T[b] @ u
        )

    def limited(self, k: int, u: Array) -> tuple[Array, float]:
        """The largest share of u, up to all of it, that keeps every current within its limit, and the peak current.

        The direction is kept: clipping currents one by one would couple the axes.
        """
        bias, asked = self.currents(k, u)
        peak = float(np.max(np.abs(bias + asked)))
        if peak <= self.limit:
            return u, peak
        room = np.where(asked > 0.0, self.limit - bias, self.limit + bias)
        with np.errstate(divide="ignore"):
            share = float(np.min(np.where(asked != 0.0, room / np.abs(asked), np.inf)))
        return share * u, peak
