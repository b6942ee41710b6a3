"""Several plants closed with one structured controller."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.loop import LoopFactory, augmented_gain
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Steps of first and of second differences, relative where a parameter is larger than one.
SLOPE_STEP, BEND_STEP = 1e-5, 1e-4


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
        self._sparse: dict[int, tuple[Array, scipy.sparse.csr_array]] = {}
        self._coupled: dict[int, NDArray[np.intp]] = {}
        self._second: dict[int, tuple[Array, Array]] = {}

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

    def inner_products(self, theta: Array, plant: int, M: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Inner products of the directions with matrices (..., n_K + n_u, n_K + n_y): (n_parameters, ...)."""
        key = plant if self._scheduled else 0
        dK = self.directions(theta, plant)
        if key not in self._sparse or self._sparse[key][0] is not dK:
            # most parameters move few entries
            self._sparse[key] = dK, scipy.sparse.csr_array(dK.reshape(len(dK), -1))
        flat = M.reshape(-1, M.shape[-2] * M.shape[-1])
        return np.asarray(self._sparse[key][1] @ flat.T).reshape(-1, *M.shape[:-2])

    def _differences(self, theta: Array, plant: int, which: Iterable[int]) -> Array:
        p = self.points[plant]
        out = []
        for k in which:
            step = np.zeros_like(theta)
            step[k] = SLOPE_STEP * max(1.0, abs(theta[k]))
            above = augmented_gain(*self.structure.realize(theta + step, p))
            out.append((above - augmented_gain(*self.structure.realize(theta - step, p))) / (2.0 * step[k]))
        return np.array(out)

    def bend(self, theta: Array, plant: int, G: Array) -> Array:
        """Second derivative of the inner product of G with the augmented gain, by differences of `realize`.

        Only the pairs of parameters with a mixed derivative are differenced, once for all functions at a point.
        """
        H = np.zeros((theta.size, theta.size))
        pairs = self._pairs(plant)
        if not pairs.size:
            return H
        key = plant if self._scheduled else 0
        if key not in self._second or not np.array_equal(self._second[key][0], theta):
            self._second[key] = theta.copy(), self._mixed_differences(theta, plant, pairs)
        values = np.tensordot(self._second[key][1], G, axes=2)
        H[pairs[:, 0], pairs[:, 1]] = values
        H[pairs[:, 1], pairs[:, 0]] = values
        return H

    def _pairs(self, plant: int) -> NDArray[np.intp]:
        """Pairs i <= j of parameters with a second derivative that does not vanish everywhere, (n_pairs, 2).

        By differences of the pullback at random parameters. As for `_constant` it only decides what is computed.
        """
        key = plant if self._scheduled else 0
        if key not in self._coupled:
            _, curved = self._constant(plant)
            rng = np.random.default_rng(1)
            n = self.structure.n_parameters
            size = np.zeros((n, n))
            for _ in range(2):
                theta = rng.standard_normal(n)
                G = rng.standard_normal(augmented_gain(*self.structure.realize(theta, self.points[plant])).shape)
                with np.errstate(over="ignore", invalid="ignore"):
                    for k in curved:
                        step = np.zeros(n)
                        step[k] = SLOPE_STEP
                        change = self.pullback(theta + step, plant, G) - self.pullback(theta - step, plant, G)
                        size[k] = np.maximum(size[k], np.abs(change) / (2.0 * SLOPE_STEP))
            size = np.where(np.isfinite(size), size, np.inf)
            size = np.maximum(size, size.T)
            largest = float(np.max(size[np.isfinite(size)], initial=1e-300))
            self._coupled[key] = np.argwhere(np.triu(size > 1e-8 * largest))
        return self._coupled[key]

    def _mixed_differences(self, theta: Array, plant: int, pairs: NDArray[np.intp]) -> Array:
        """Second derivatives of the augmented gain for pairs of parameters, (n_pairs, n_K + n_u, n_K + n_y)."""
        p = self.points[plant]
        steps = BEND_STEP * np.maximum(1.0, np.abs(theta))

        def gain(*moves: tuple[int, float]) -> Array:
            moved = theta.copy()
            for k, sign in moves:
                moved[k] += sign * steps[k]
            return augmented_gain(*self.structure.realize(moved, p))

        middle = gain()
        out = np.empty((len(pairs), *middle.shape))
        for row, (i, j) in enumerate(pairs):
            if i == j:
                out[row] = (gain((i, 1.0)) + gain((i, -1.0)) - 2.0 * middle) / steps[i] ** 2
            else:
                same = gain((i, 1.0), (j, 1.0)) + gain((i, -1.0), (j, -1.0))
                opposite = gain((i, 1.0), (j, -1.0)) + gain((i, -1.0), (j, 1.0))
                out[row] = (same - opposite) / (4.0 * steps[i] * steps[j])
        return out

    def pullback(self, theta: Array, plant: int, G: Array) -> Array:
        """Gradient in theta of a function with the gradient `G` in the augmented gain of a plant."""
        n = self.structure.n_x
        return np.asarray(
            self.structure.pullback(theta, G[:n, :n], G[:n, n:], G[n:, :n], G[n:, n:], self.points[plant]), dtype=float
        )
