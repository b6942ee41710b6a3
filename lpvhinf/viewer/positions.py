"""The grid of positions that a page holds, and how it goes between them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """A regular grid over P, its border included; p_x runs slowest.

    Attributes
    ----------
    axes : tuple of (n,)
        Coordinates along every axis of P [m].
    """

    axes: tuple[Array, ...]

    @classmethod
    def over(cls, box: Array, n: int) -> Grid:
        """`n` positions along every axis."""
        return cls(axes=tuple(np.linspace(low, high, n) for low, high in box))

    @property
    def points(self) -> Array:
        """All positions (N, n_p)."""
        return np.array(list(itertools.product(*self.axes)))

    def weights(self, p: Array) -> list[tuple[int, float]]:
        """Indices of the positions around p (n_p,) and their weights, multilinear; as the page does it.

        Examples
        --------
        >>> Grid.over(np.array([[0.0, 1.0]]), 3).weights(np.array([0.625]))
        [(1, 0.75), (2, 0.25)]
        """
        corners = [(0, 1.0)]
        for axis, value in zip(self.axes, p, strict=True):
            n = len(axis)
            at = float(np.clip((value - axis[0]) / (axis[-1] - axis[0]) * (n - 1), 0.0, n - 1))
            low = min(int(at), n - 2)
            share = at - low
            corners = [
                (index * n + low + side, weight * part)
                for index, weight in corners
                for side, part in ((0, 1.0 - share), (1, share))
                if weight * part > 0.0
            ]
        return corners

    def interpolate(self, values: Array, p: Array) -> Array:
        """Values (N, ...) at p (n_p,), multilinear."""
        return np.asarray(sum(weight * values[index] for index, weight in self.weights(p)))
