"""Several plants closed with one structured controller."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
        self._constant: dict[int, Array] | None = None
        self._looked = False

    def gains(self, theta: Array) -> list[Array]:
        """The augmented gain of every plant."""
        if not self._scheduled:
            return [augmented_gain(*self.structure.realize(theta, None))] * len(self.factories)
        return [augmented_gain(*self.structure.realize(theta, p)) for p in self.points]

    @property
    def affine(self) -> bool:
        """True if the controller's matrices look affine in theta: their derivatives agree at random parameters.

        It only decides whether second derivatives of the structure are computed for the models of the minimisers.
        """
        if not self._looked:
            self._looked = True
            rng = np.random.default_rng(0)
            n = self.structure.n_parameters
            samples = [rng.standard_normal(n) for _ in range(3)]
            constant: dict[int, Array] = {}
            for plant in range(len(self.factories) if self._scheduled else 1):
                with np.errstate(over="ignore", invalid="ignore"):
                    slopes = [self._differences(theta, plant) for theta in samples]
                size = float(np.max(np.abs(slopes[0]), initial=1e-300))
                if not all(np.max(np.abs(s - slopes[0]), initial=0.0) <= 1e-7 * size for s in slopes[1:]):
                    return False
                constant[plant] = np.mean(slopes, axis=0)
            self._constant = constant
        return self._constant is not None

    def directions(self, theta: Array, plant: int) -> Array:
        """Derivatives of the augmented gain, (n_parameters, n_K + n_u, n_K + n_y)."""
        if self.affine:
            assert self._constant is not None
            return self._constant[plant if self._scheduled else 0]
        return self._differences(theta, plant)

    def _differences(self, theta: Array, plant: int) -> Array:
        p = self.points[plant]
        out = []
        for k in range(theta.size):
            step = np.zeros_like(theta)
            step[k] = 1e-5 * max(1.0, abs(theta[k]))
            above = augmented_gain(*self.structure.realize(theta + step, p))
            out.append((above - augmented_gain(*self.structure.realize(theta - step, p))) / (2.0 * step[k]))
        return np.array(out)

    def bend(self, theta: Array, plant: int, G: Array) -> Array:
        """Second derivative of the inner product of G with the augmented gain, by differences of the pullback."""
        if self.affine:
            return np.zeros((theta.size, theta.size))
        rows = []
        for k in range(theta.size):
            step = np.zeros_like(theta)
            step[k] = 1e-5 * max(1.0, abs(theta[k]))
            above, below = self.pullback(theta + step, plant, G), self.pullback(theta - step, plant, G)
            rows.append((above - below) / (2.0 * step[k]))
        H = np.array(rows)
        return np.asarray(0.5 * (H + H.T))

    def pullback(self, theta: Array, plant: int, G: Array) -> Array:
        """Gradient in theta of a function with the gradient `G` in the augmented gain of a plant."""
        n = self.structure.n_x
        return np.asarray(
            self.structure.pullback(theta, G[:n, :n], G[:n, n:], G[n:, :n], G[n:, n:], self.points[plant]), dtype=float
        )
