"""Equal filter sections on every channel, with physical parameters inside ranges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, whole_number
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct.ranges import LogRange, as_range
from lpvhinf.hinfstruct.structures import Realization

Bounds = tuple[float, float] | LogRange | None


class PhysicalParameters:
    """theta as physical quantities, channel by channel, each a smooth function of one parameter.

    Parameters
    ----------
    n : int
        Channels.
    ranges : dict of LogRange or None
        Range of every quantity by name; None: the parameter is the quantity itself.
    """

    def __init__(self, n: int, ranges: dict[str, LogRange | None]) -> None:
        self.n_u = self.n_y = self.n_channels = whole_number("n", n, 1)
        self._ranges = ranges
        self.n_parameters = n * len(ranges)
        self.names = tuple(f"{type(self).__name__}[{i}].{name}" for i in range(n) for name in ranges)

    def physical(self, theta: ArrayLike) -> dict[str, Array]:
        """The physical quantities at theta, (n,) each."""
        columns = np.reshape(np.asarray(theta, dtype=float), (self.n_channels, -1)).T
        return {
            name: np.asarray(x if unit is None else unit.value(x))
            for (name, unit), x in zip(self._ranges.items(), columns, strict=True)
        }

    def parameters(self, **values: ArrayLike) -> Array:
        """The theta of physical quantities, a number or (n,) each.

        Raises
        ------
        DomainError
            If a quantity is missing, unknown or outside its range.
        DimensionError
            If it has another length.
        """
        if values.keys() != self._ranges.keys():
            raise DomainError(
                f"{type(self).__name__} got {sorted(values)}, wanted exactly {sorted(self._ranges)}. "
                "Name every quantity."
            )
        columns = []
        for name, unit in self._ranges.items():
            value = finite_array(name, values[name])
            if value.shape not in ((), (self.n_channels,)):
                raise DimensionError(f"{name} has shape {value.shape}, wanted a number or ({self.n_channels},).")
            x = value if unit is None else unit.inverse(value, name)
            columns.append(np.broadcast_to(x, (self.n_channels,)))
        return np.stack(columns, axis=1).ravel()

    def _to_theta(self, theta: Array, gradients: dict[str, Array]) -> Array:
        """Gradients in the physical quantities, turned into those in theta."""
        columns = np.reshape(theta, (self.n_channels, -1)).T
        out = [
            gradients[name] * (1.0 if unit is None else unit.slope(x))
            for (name, unit), x in zip(self._ranges.items(), columns, strict=True)
        ]
        return np.stack(out, axis=1).ravel()

    def initial(self, rng: np.random.Generator) -> Array:
        """Normal parameters: the middle of every range, a factor of e or half of the range around it."""
        return np.asarray(rng.standard_normal(self.n_parameters))


class FirstOrderSections(PhysicalParameters):
    r"""One first-order section a channel, :math:`H = (d\, s/\omega + b_0) / (s/\omega + 1)`."""

    def __init__(self, n: int, ranges: dict[str, Bounds]) -> None:
        super().__init__(n, {name: as_range(name, bounds) for name, bounds in ranges.items()})
        self.n_x = n

    def _coefficients(self, values: dict[str, Array]) -> tuple[Array, Array, Array]:
        """omega, b0 and d of every channel."""
        raise NotImplementedError

    def _back(self, values: dict[str, Array], omega: Array, b0: Array, d: Array) -> dict[str, Array]:
        """Gradients in the physical quantities from those in the coefficients."""
        raise NotImplementedError

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """Diagonal (A, B, C, D)."""
        omega, b0, d = self._coefficients(self.physical(theta))
        return np.diag(-omega), np.diag(omega), np.diag(b0 - d), np.diag(d)

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The diagonals of the gradients, through the coefficients to the parameters."""
        a, b, c, d = (np.diagonal(G) for G in (GA, GB, GC, GD))
        return self._to_theta(theta, self._back(self.physical(theta), b - a, c, d - c))


class SecondOrderSections(PhysicalParameters):
    r"""One second-order section a channel, in the normalised :math:`\bar s = s / \omega`.

    .. math:: H = \frac{d \bar s^2 + b_1 \bar s + b_0}{\bar s^2 + a_1 \bar s + 1}, \quad
              \dot x_1 = \omega x_2, \quad \dot x_2 = \omega (y - x_1 - a_1 x_2)
    """

    def __init__(self, n: int, ranges: dict[str, Bounds]) -> None:
        super().__init__(n, {name: as_range(name, bounds) for name, bounds in ranges.items()})
        self.n_x = 2 * n

    def _coefficients(self, values: dict[str, Array]) -> tuple[Array, Array, Array, Array, Array]:
        """omega, a1, b0, b1 and d of every channel."""
        raise NotImplementedError

    def _back(self, values: dict[str, Array], g: tuple[Array, Array, Array, Array, Array]) -> dict[str, Array]:
        """Gradients in the physical quantities from those in the coefficients."""
        raise NotImplementedError

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D), two states a channel."""
        omega, a1, b0, b1, d = self._coefficients(self.physical(theta))
        n = self.n_channels
        channel = np.arange(n)
        first, second = 2 * channel, 2 * channel + 1
        A, B, C = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n)), np.zeros((n, 2 * n))
        A[first, second], A[second, first], A[second, second] = omega, -omega, -a1 * omega
        B[second, channel] = omega
        C[channel, first], C[channel, second] = b0 - d, b1 - d * a1
        return A, B, C, np.diag(d)

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The gradients of every channel's section, through the coefficients to the parameters."""
        values = self.physical(theta)
        omega, a1, _, _, d = self._coefficients(values)
        channel = np.arange(self.n_channels)
        first, second = 2 * channel, 2 * channel + 1
        g1, g2 = GC[channel, first], GC[channel, second]
        along = GA[first, second] - GA[second, first] - a1 * GA[second, second] + GB[second, channel]
        damping = -omega * GA[second, second] - d * g2
        feed = np.diagonal(GD) - g1 - a1 * g2
        return self._to_theta(theta, self._back(values, (along, damping, g1, g2, feed)))
