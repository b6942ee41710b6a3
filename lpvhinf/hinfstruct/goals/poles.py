"""Regions for the closed-loop poles: decay, damping, largest natural frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.goals.descriptions import ClosedLoopPoles
from lpvhinf.hinfstruct.goals.state import GoalValue, LoopState, Measure, RawCut
from lpvhinf.hinfstruct.response import Complex

#: Poles whose sensitivity is below this share of the size of the channels are moved by no controller.
FIXED = 1e-9
#: Most poles that become cuts, a kind.
MOST = 8
#: Poles closer than this share of the largest one count as so far apart in second derivatives.
CLOSE = 1e-6


class PolesEvaluator:
    r"""Levels of every pole that the controller moves.

    ======== =========================================================================
    decay    :math:`(\mathrm{Re}\,\lambda + decay) / decay`
    damping  :math:`damping + \mathrm{Re}\,\lambda / |\lambda|`
    fastest  :math:`\log(|\lambda| / fastest)`
    ======== =========================================================================

    Parameters
    ----------
    goal : ClosedLoopPoles
    """

    def __init__(self, goal: ClosedLoopPoles) -> None:
        self.limits = {
            kind: float(limit) for kind in ("decay", "damping", "fastest") if (limit := getattr(goal, kind)) is not None
        }

    def _levels(self, kind: str, poles: Complex) -> Array:
        limit, size = self.limits[kind], np.maximum(np.abs(poles), 1e-150)
        if kind == "decay":
            return np.asarray((poles.real + limit) / limit)
        if kind == "damping":
            return np.asarray(limit + poles.real / size)
        return np.asarray(np.log(size / limit))

    def _slopes(self, kind: str, pole: complex) -> tuple[float, float, Array]:
        """Derivatives of a level in x and y of the pole x + jy, first and second."""
        limit, x, y = self.limits[kind], pole.real, pole.imag
        r = max(abs(pole), 1e-150)
        if kind == "decay":
            return 1.0 / limit, 0.0, np.zeros((2, 2))
        if kind == "damping":
            second = np.array([[-3.0 * x * y**2, 2.0 * x**2 * y - y**3], [0.0, 2.0 * x * y**2 - x**3]]) / r**5
            second[1, 0] = second[0, 1]
            return y**2 / r**3, -x * y / r**3, second
        second = np.array([[y**2 - x**2, -2.0 * x * y], [-2.0 * x * y, x**2 - y**2]]) / r**4
        return x / r**2, y / r**2, second

    @staticmethod
    def _movable(state: LoopState) -> NDArray[np.signedinteger]:
        """Numbers of the poles of the upper half plane that the controller moves."""
        poles, left, right = state.modes()
        inward = np.linalg.norm(left @ state.loop.Bi, axis=1) / np.maximum(np.linalg.norm(left, axis=1), 1e-300)
        outward = np.linalg.norm(state.loop.Ci @ right, axis=0) / np.maximum(np.linalg.norm(right, axis=0), 1e-300)
        moved = (inward > FIXED * np.linalg.norm(state.loop.Bi)) & (outward > FIXED * np.linalg.norm(state.loop.Ci))
        return np.flatnonzero(moved & (poles.imag >= 0.0))

    def measure(self, state: LoopState) -> Measure:
        """The largest level, with the poles in the order of their levels for every kind."""
        poles = state.modes()[0]
        movable = self._movable(state)
        data: list[tuple[float, str, complex]] = []
        for kind in self.limits:
            levels = self._levels(kind, poles[movable])
            data += [(float(levels[i]), kind, complex(poles[movable[i]])) for i in np.argsort(-levels)[:MOST]]
        data.sort(key=lambda item: -item[0])
        return Measure(data[0][0] if data else -np.inf, data)

    def confirm(self, state: LoopState, measure: Measure) -> Measure:
        """The measure: it is exact already."""
        return measure

    def cuts(self, state: LoopState, measure: Measure, lowest: float) -> list[RawCut]:
        """The poles with a level above the lowest."""
        return [self._cut(state, kind, pole) for level, kind, pole in measure.data if level >= lowest]

    def again(self, state: LoopState, key: tuple[Any, ...]) -> list[RawCut]:
        """The nearest pole."""
        return [self._cut(state, key[0], key[1])] if self._movable(state).size else []

    def keys(self, measure: Measure) -> list[tuple[Any, ...]]:
        """The poles with the largest levels."""
        return [(kind, pole) for _, kind, pole in measure.data[:3]]

    def _nearest(self, state: LoopState, pole: complex) -> int:
        movable = self._movable(state)
        return int(movable[np.argmin(np.abs(state.modes()[0][movable] - pole))])

    def _sensitivity(self, state: LoopState, k: int) -> Complex:
        """Derivative of a pole in the augmented gain."""
        _, left, right = state.modes()
        return np.asarray(np.outer(left[k] @ state.loop.Bi, state.loop.Ci @ right[:, k]))

    def _cut(self, state: LoopState, kind: str, pole: complex) -> RawCut:
        k = self._nearest(state, pole)
        here = complex(state.modes()[0][k])
        along, across, _ = self._slopes(kind, here)
        G = self._sensitivity(state, k)
        return RawCut(float(self._levels(kind, np.array([here]))[0]), along * G.real + across * G.imag, (kind, here))

    def curvature(self, state: LoopState, key: tuple[Any, ...], dK: Array) -> tuple[Array, Array]:
        r"""Hessian of a level, by second derivatives of the pole.

        .. math:: \lambda'' = 2 \sum_{m \ne k} \frac{(w_k \Delta v_m)(w_m \Delta v_k)}{\lambda_k - \lambda_m}
                  + 2 w_k B_i \Delta N \Delta C_i v_k
        """
        kind, pole = key
        poles, left, right = state.modes()
        loop, k = state.loop, self._nearest(state, pole)
        inward, outward = left @ loop.Bi, loop.Ci @ right
        from_k = (inward[k] @ dK) @ outward
        to_k = (dK @ outward[:, k]) @ inward.T
        gaps = poles[k] - poles
        least = CLOSE * float(np.max(np.abs(poles)))
        gaps = np.where(np.abs(gaps) < least, least, gaps)
        share = 1.0 / gaps
        share[k] = 0.0
        second = (from_k * share) @ to_k.T
        second = second + (inward[k] @ dK) @ loop.D22i @ (dK @ outward[:, k]).T
        second = second + second.T
        first = from_k[:, k]
        along, across, bend = self._slopes(kind, complex(poles[k]))
        parts = np.stack([first.real, first.imag])
        G = self._sensitivity(state, k)
        hessian = along * second.real + across * second.imag + parts.T @ bend @ parts
        return np.asarray(hessian), along * G.real + across * G.imag

    def exact(self, state: LoopState, plant: int) -> GoalValue:
        """The largest level and its pole."""
        measure = self.measure(state)
        where = measure.data[0][2] if measure.data else complex(np.nan)
        return GoalValue(value=measure.level, where=where, plant=plant, level=measure.level)
