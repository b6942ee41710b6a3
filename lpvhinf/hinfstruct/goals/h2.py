"""The H2 norm of a channel with gradient and Hessian by Lyapunov equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.goals.state import GoalValue, LoopState, Measure, RawCut, channel_loop
from lpvhinf.hinfstruct.loop import ClosedLoop

#: Norms below this share of the bound count as zero.
SMALLEST = 1e-12
#: A feed-through below this, relative to the channel's other matrices, counts as zero.
ZERO = 1e-10


class _Lyapunov:
    """A X + X A^T + R = 0 and A^T X + X A + R = 0 for many right-hand sides R, from one Schur form."""

    def __init__(self, A: Array) -> None:
        self._T, self._Z = scipy.linalg.schur(A, output="real")

    def solve(self, R: Array, transposed: bool = False) -> Array:
        F = -self._Z.T @ R @ self._Z
        (trsyl,) = scipy.linalg.get_lapack_funcs(("trsyl",), (self._T, F))
        first, second = ("T", "N") if transposed else ("N", "T")
        X, scale, _ = trsyl(self._T, self._T, F, trana=first, tranb=second)
        return np.asarray(self._Z @ (scale * X) @ self._Z.T)


class H2Evaluator:
    r"""The level :math:`\log(\|T\|_2 / at\_most)` of a channel without feed-through.

    .. math:: \|T\|_2^2 = \mathrm{tr}\, C P C^\top, \quad A P + P A^\top + B B^\top = 0, \quad
              A^\top Q + Q A + C^\top C = 0

    and the gradient of its square in the augmented gain is
    :math:`2 (B_i^\top Q P C_i^\top + B_i^\top Q B D_{21i}^\top + D_{12i}^\top C P C_i^\top)`.

    Parameters
    ----------
    rows, columns : sequence of int
        Of z and w.
    at_most : float
    """

    def __init__(self, rows: tuple[int, ...], columns: tuple[int, ...], at_most: float) -> None:
        self.rows, self.columns, self.at_most = list(rows), list(columns), at_most

    def feedthrough(self, loop: ClosedLoop) -> float:
        """Largest entry of D of the channel, relative to the sizes of its other matrices."""
        channel = channel_loop(loop, self.rows, self.columns)
        size = max(1.0, float(np.linalg.norm(channel.B)), float(np.linalg.norm(channel.C)))
        return float(np.max(np.abs(channel.D), initial=0.0)) / size

    def _level(self, square: float) -> float:
        return 0.5 * float(np.log(max(square / self.at_most**2, SMALLEST**2)))

    def _solved(self, state: LoopState) -> tuple[ClosedLoop, _Lyapunov, Array, Array, float]:
        loop = channel_loop(state.loop, self.rows, self.columns)
        equation = _Lyapunov(loop.A)
        P = equation.solve(loop.B @ loop.B.T)
        Q = equation.solve(loop.C.T @ loop.C, transposed=True)
        return loop, equation, P, Q, float(np.sum((loop.C @ P) * loop.C))

    def measure(self, state: LoopState) -> Measure:
        """The level; infinite with a feed-through."""
        if self.feedthrough(state.loop) > ZERO:
            return Measure(np.inf)
        loop = channel_loop(state.loop, self.rows, self.columns)
        P = _Lyapunov(loop.A).solve(loop.B @ loop.B.T)
        return Measure(self._level(float(np.sum((loop.C @ P) * loop.C))))

    def confirm(self, state: LoopState, measure: Measure) -> Measure:
        """The measure: it is exact already."""
        return measure

    @staticmethod
    def _gradient(loop: ClosedLoop, P: Array, Q: Array) -> Array:
        """Half the gradient of the square of the norm."""
        first = (loop.Bi.T @ Q + loop.D12i.T @ loop.C) @ P @ loop.Ci.T
        return np.asarray(first + loop.Bi.T @ Q @ loop.B @ loop.D21i.T)

    def cuts(self, state: LoopState, measure: Measure, lowest: float) -> list[RawCut]:
        """The norm: it is smooth."""
        return self.again(state, ()) if measure.level >= lowest else []

    def again(self, state: LoopState, key: tuple[Any, ...]) -> list[RawCut]:
        """The norm."""
        loop, _, P, Q, square = self._solved(state)
        floor = max(square, (SMALLEST * self.at_most) ** 2)
        return [RawCut(self._level(square), self._gradient(loop, P, Q) / floor, ())]

    def keys(self, measure: Measure) -> list[tuple[Any, ...]]:
        """One key."""
        return [()]

    def curvature(self, state: LoopState, key: tuple[Any, ...], dK: Array) -> tuple[Array, Array]:
        """Hessian of the level, one Lyapunov equation a direction."""
        loop, equation, P, Q, square = self._solved(state)
        half = self._gradient(loop, P, Q)
        dA, dB, dC = loop.Bi @ dK @ loop.Ci, loop.Bi @ dK @ loop.D21i, loop.D12i @ dK @ loop.Ci
        outer = np.empty_like(dK)
        ahead = loop.Bi.T @ Q + loop.D12i.T @ loop.C
        for j in range(dK.shape[0]):
            R = dA[j] @ P + dB[j] @ loop.B.T
            outer[j] = ahead @ equation.solve(R + R.T) @ loop.Ci.T
        m = dK.shape[0]
        flat = dK.reshape(m, -1)
        mixed = flat @ outer.reshape(m, -1).T + np.einsum("ab,iac,cd,jdb->ij", half, dK, loop.D22i, dK, optimize=True)
        second = mixed + mixed.T
        second = second + dB.reshape(m, -1) @ (Q @ dB).reshape(m, -1).T
        second = second + (dC @ P).reshape(m, -1) @ dC.reshape(m, -1).T
        square = max(square, (SMALLEST * self.at_most) ** 2)
        slope = flat @ half.ravel() / square
        return np.asarray(second / square - 2.0 * np.outer(slope, slope)), half / square

    def exact(self, state: LoopState, plant: int) -> GoalValue:
        """The norm."""
        level = self.measure(state).level
        return GoalValue(value=self.at_most * float(np.exp(level)), where=np.nan, plant=plant, level=level)
