"""Several plants closed with one structured controller."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.loop import LoopFactory, augmented_gain
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant


class ClosedLoops:
    """The plants, closed with a structured controller.

    Parameters
    ----------
    plants : sequence of GeneralizedPlant
    structure : ControllerStructure
    points : sequence of positions or None, one a plant
    """

    def __init__(
        self, plants: Sequence[GeneralizedPlant], structure: ControllerStructure, points: Sequence[Array | None]
    ) -> None:
        self.structure, self.points = structure, points
        self.factories = [LoopFactory(plant, structure.n_x) for plant in plants]
        self.n_states = structure.n_x + max(P.n_x for P in plants)
        self.scale = max(float(np.max(np.abs(np.linalg.eigvals(P.A)), initial=1e-3)) for P in plants)
        self._scheduled = any(p is not None for p in points)
        self._slopes: dict[int, tuple[Array, NDArray[np.intp]]] = {}
        self._latest: dict[int, tuple[Array, Array]] = {}

    def gains(self, theta: Array) -> list[Array]:
        """The augmented gain of every plant."""
        if not self._scheduled:
            return [augmented_gain(*self.structure.realize(theta, None))] * len(self.factories)
        return [augmented_gain(*self.structure.realize(theta, p)) for p in self.points]

    def _constant(self, plant: int) -> tuple[Array, NDArray[np.intp]]:
        """Derivatives of the augmented gain at random parameters, and the parameters for which they change (n_c,).

        The matrices are affine in the other parameters, whose derivatives are the same everywhere and whose second
        derivatives vanish. It only decides what is computed for the models of the minimisers.
        """
        key = plant if self._scheduled else 0
        if key not in self._slopes:
            rng = np.random.default_rng(0)
            n = self.structure.n_parameters
            with np.errstate(over="ignore", invalid="ignore"):
                slopes = [self._differences(rng.standard_normal(n), plant, range(n)) for _ in range(3)]
            size = float(np.max(np.abs(slopes[0]), initial=1e-300))
            change = np.max([np.max(np.abs(s - slopes[0]), axis=(1, 2), initial=0.0) for s in slopes[1:]], axis=0)
            curved = np.flatnonzero(~(change <= 1e-7 * size))  # also where a number is not finite
            self._slopes[key] = np.mean(slopes, axis=0), curved
        return self._slopes[key]

    def directions(self, theta: Array, plant: int) -> Array:
        """Derivatives of the augmented gain, (n_parameters, n_K + n_u, n_K + n_y)."""
        slopes, curved = self._constant(plant)
        if curved.size == 0:
            return slopes
        key = plant if self._scheduled else 0
        if key not in self._latest or not np.array_equal(self._latest[key][0], theta):
            slopes = slopes.copy()
            slopes[curved] = self._differences(theta, plant, curved)
            self._latest[key] = theta.copy(), slopes
        return self._latest[key][1]

    def _differences(self, theta: Array, plant: int, which: Iterable[int]) -> Array:
        p = self.points[plant]
        out = []
        for k in which:
            step = np.zeros_like(theta)
            step[k] = 1e-5 * max(1.0, abs(theta[k]))
            above = augmented_gain(*self.structure.realize(theta + step, p))
            out.append((above - augmented_gain(*self.structure.realize(theta - step, p))) / (2.0 * step[k]))
        return np.array(out)

    def bend(self, theta: Array, plant: int, G: Array) -> Array:
        """Second derivative of the inner product of G with the augmented gain, by differences of the pullback."""
        _, curved = self._constant(plant)
        H = np.zeros((theta.size, theta.size))
        for k in curved:
            step = np.zeros_like(theta)
            step[k] = 1e-5 * max(1.0, abs(theta[k]))
            above, below = self.pullback(theta + step, plant, G), self.pullback(theta - step, plant, G)
            H[k] = (above - below) / (2.0 * step[k])
        H[:, np.setdiff1d(np.arange(theta.size), curved)] = 0.0  # round-off of the differences
        return np.asarray(0.5 * (H + H.T))

    def pullback(self, theta: Array, plant: int, G: Array) -> Array:
        """Gradient in theta of a function with the gradient `G` in the augmented gain of a plant."""
        n = self.structure.n_x
        return np.asarray(
            self.structure.pullback(theta, G[:n, :n], G[:n, n:], G[n:, :n], G[n:, n:], self.points[plant]), dtype=float
        )
