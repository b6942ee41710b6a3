"""Goals of a structured synthesis: what is bounded or minimised, in the user's words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import positive
from lpvhinf.errors import DimensionError, DomainError

Channels = Sequence[int] | int | None


@dataclass(frozen=True, kw_only=True)
class Goal:
    """What all goals have in common.

    Attributes
    ----------
    plants : sequence of int, optional
        Numbers of the plants that the goal holds for. All of them if left out.
    """

    plants: Sequence[int] | None = None

    def __post_init__(self) -> None:
        if self.plants is not None:
            object.__setattr__(self, "plants", _indices("plants", self.plants))

    def used_plants(self, n: int) -> tuple[int, ...]:
        """The numbers of the plants, of n.

        Raises
        ------
        DimensionError
            If there are not so many.
        """
        return _within("plants", self.plants, n, f"{type(self).__name__}")


@dataclass(frozen=True, kw_only=True)
class _ChannelGoal(Goal):
    outputs: Channels = None
    inputs: Channels = None
    at_most: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("outputs", "inputs"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _indices(name, value))
        if self.at_most is not None:
            object.__setattr__(self, "at_most", positive("at_most", self.at_most))

    def channels(self, n_z: int, n_w: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Rows of z and columns of w.

        Raises
        ------
        DimensionError
            If there are not so many.
        """
        name = type(self).__name__
        return _within("outputs", self.outputs, n_z, name), _within("inputs", self.inputs, n_w, name)


@dataclass(frozen=True, kw_only=True)
class ChannelNorm(_ChannelGoal):
    r"""The H-infinity norm of a channel, :math:`\|T_{z_o w_i}\|_\infty \le` at_most.

    Attributes
    ----------
    outputs, inputs : int or sequence of int, optional
        Numbers of the rows of z and of the columns of w. All if left out.
    at_most : float, optional
        The bound; left out where the norm is minimised.
    plants : sequence of int, optional
        Numbers of the plants that the goal holds for. All of them if left out.

    Raises
    ------
    DomainError
        If the bound is not positive, or a number is not a whole number of at least zero.

    Examples
    --------
    >>> ChannelNorm(outputs=1, inputs=[0, 2], at_most=2.0).channels(n_z=2, n_w=3)
    ((1,), (0, 2))
    """


@dataclass(frozen=True, kw_only=True)
class FrequencyBand(_ChannelGoal):
    r"""The largest gain of a channel over a band, :math:`\max_{\omega \in band} \bar\sigma(T(j\omega)) \le` at_most.

    The loop must be stable; outside the band the gain is free.

    Attributes
    ----------
    outputs, inputs, at_most, plants
        As in `ChannelNorm`.
    band : (low, high) [rad/s]
        0 <= low < high; high may be infinity.

    Raises
    ------
    DomainError
        If the band is not such a pair, or another value is not allowed.

    Examples
    --------
    >>> FrequencyBand(outputs=0, inputs=0, band=(10.0, 100.0), at_most=0.1).band
    (10.0, 100.0)
    """

    band: tuple[float, float] = (0.0, np.inf)

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            low, high = (float(edge) for edge in self.band)
        except (TypeError, ValueError) as error:
            raise DomainError(f"band is {self.band!r}, wanted (low, high) in rad/s.") from error
        if not 0.0 <= low < high:
            raise DomainError(f"band is {self.band!r}, wanted 0 <= low < high in rad/s.")
        object.__setattr__(self, "band", (low, high))


@dataclass(frozen=True, kw_only=True)
class H2Norm(_ChannelGoal):
    r"""The H2 norm of a channel, :math:`\|T\|_2^2 = \frac{1}{2\pi}\int \mathrm{tr}\, T T^* d\omega`.

    The root-mean-square response to unit white noise. The channel must have no feed-through, whatever the
    controller is.

    Attributes
    ----------
    outputs, inputs, at_most, plants
        As in `ChannelNorm`.

    Examples
    --------
    >>> H2Norm(outputs=[0, 1], at_most=3.0).at_most
    3.0
    """


@dataclass(frozen=True, kw_only=True)
class ClosedLoopPoles(Goal):
    r"""A region for the closed-loop poles.

    .. math:: \mathrm{Re}\, \lambda \le -decay, \quad -\mathrm{Re}\, \lambda \ge damping\, |\lambda|, \quad
              |\lambda| \le fastest

    Poles that no controller moves, such as those of weights, are left out.

    Attributes
    ----------
    decay : float, optional
        [rad/s], above zero.
    damping : float, optional
        Between 0 and 1.
    fastest : float, optional
        [rad/s], above zero.
    plants : sequence of int, optional
        Numbers of the plants that the goal holds for. All of them if left out.

    Raises
    ------
    DomainError
        If none is given or a value is outside its range.

    Examples
    --------
    >>> ClosedLoopPoles(decay=0.5, damping=0.1)
    ClosedLoopPoles(plants=None, decay=0.5, damping=0.1, fastest=None)
    """

    decay: float | None = None
    damping: float | None = None
    fastest: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.decay is None and self.damping is None and self.fastest is None:
            raise DomainError("ClosedLoopPoles bounds nothing, wanted decay, damping or fastest. Give one of them.")
        for name, unit in (("decay", "rad/s"), ("damping", ""), ("fastest", "rad/s")):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, positive(name, value, unit))
        if self.damping is not None and self.damping >= 1.0:
            raise DomainError(f"damping is {self.damping!r}, wanted a number between 0 and 1.")
        if self.decay is not None and self.fastest is not None and self.decay >= self.fastest:
            raise DomainError(f"decay is {self.decay!r}, wanted less than fastest = {self.fastest!r}.")


def _indices(name: str, value: Channels) -> tuple[int, ...]:
    given = (value,) if isinstance(value, int | np.integer) else tuple(value or ())
    whole = all(isinstance(i, int | np.integer) and not isinstance(i, bool) and i >= 0 for i in given)
    if not given or not whole or len(set(given)) < len(given):
        raise DomainError(f"{name} is {value!r}, wanted whole numbers of at least 0, each once, at least one.")
    return tuple(int(i) for i in given)


def _within(name: str, value: Channels, n: int, goal: str) -> tuple[int, ...]:
    chosen = tuple(range(n)) if value is None else _indices(name, value)
    if not chosen or max(chosen) >= n:
        raise DimensionError(f"{goal}: {name} is {value!r}, wanted numbers below {n}.")
    return chosen
