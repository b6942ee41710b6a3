"""A closed loop at a point, factorised once for all goals."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.gradient import PeakGain
from lpvhinf.hinfstruct.loop import ClosedLoop
from lpvhinf.hinfstruct.response import Complex, Response

#: Smallest product of unit left and right eigenvectors; it vanishes at a defective pole.
PRODUCT = 1e-8


class ChannelResponse(Response):
    """Some rows and columns of a response, without a factorisation of its own."""

    def __init__(self, whole: Response, rows: list[int], columns: list[int]) -> None:
        self._whole, self._grid = whole, np.ix_(range(len(rows)), range(len(columns)))
        self._rows, self._columns = rows, columns
        self.D = whole.D[np.ix_(rows, columns)]
        self.poles, self.abscissa = whole.poles, whole.abscissa
        self.right, self.left = whole.right, whole.left

    def _evaluate(self, omega: Array, order: int) -> Complex:
        values = self._whole.at(omega) if order == 0 else self._whole.derivative(omega)
        return values[:, self._rows][:, :, self._columns]


def channel_loop(loop: ClosedLoop, rows: list[int], columns: list[int]) -> ClosedLoop:
    """Some rows of z and columns of w of a closed loop."""
    return replace(
        loop,
        B=loop.B[:, columns],
        C=loop.C[rows],
        D=loop.D[np.ix_(rows, columns)],
        D12i=loop.D12i[rows],
        D21i=loop.D21i[:, columns],
    )


@dataclass(slots=True, eq=False)
class LoopState:
    """One closed loop with its response, and what was computed from them.

    Attributes
    ----------
    loop : ClosedLoop
    response : Response
    """

    loop: ClosedLoop
    response: Response
    _modes: tuple[Complex, Complex, Complex] | None = field(default=None, init=False)

    def modes(self) -> tuple[Complex, Complex, Complex]:
        """Poles, left eigenvectors as rows and right ones as columns, scaled to unit products.

        At a nearly defective pole the product is bounded from below, which limits its sensitivity.
        """
        if self._modes is None:
            T = self.response
            if T.left is not None and T.right is not None:
                self._modes = (T.poles, T.left, T.right)
            else:
                poles, W, V = scipy.linalg.eig(self.loop.A, left=True, right=True)
                product = np.sum(W.conj() * V, axis=0)
                small = np.abs(product) < PRODUCT
                phase = np.where(product == 0.0, 1.0, product / np.where(product == 0.0, 1.0, np.abs(product)))
                product = np.where(small, PRODUCT * phase, product)
                self._modes = (poles, (W.conj() / product).T, V)
        return self._modes


@dataclass(slots=True, eq=False)
class Measure:
    r"""A goal at a point.

    Attributes
    ----------
    level : float
        Zero where the goal is just met, below it where it is met: the logarithm of value / at_most for norms.
    data : anything
        What the evaluator remembers.
    """

    level: float
    data: Any = None


@dataclass(slots=True, eq=False)
class RawCut:
    """One smooth part of a goal: its level, its gradient in the augmented gain, and a key to find it again.

    A part with a `peak` stands for the cluster of singular values there; its key is the frequency, and the level is
    the logarithm of the gain plus `height`.
    """

    level: float
    gradient: Array | None
    key: tuple[Any, ...]
    peak: PeakGain | None = None
    height: float = 0.0


@dataclass(frozen=True, kw_only=True)
class GoalValue:
    """What a goal reaches, computed by exact means.

    Attributes
    ----------
    value : float
        The norm; for poles the largest of the levels.
    where : float or complex
        Frequency [rad/s] or pole; NaN for an H2 norm.
    plant : int
    level : float
        Below zero where the goal is met.
    """

    value: float
    where: complex
    plant: int
    level: float


class Evaluator(Protocol):
    """One goal on one plant."""

    def measure(self, state: LoopState) -> Measure:
        """The level, by fast means."""

    def confirm(self, state: LoopState, measure: Measure) -> Measure:
        """The level, tested by exact means."""

    def cuts(self, state: LoopState, measure: Measure, lowest: float) -> list[RawCut]:
        """Every part with a level above `lowest`, the largest first."""

    def again(self, state: LoopState, key: tuple[Any, ...]) -> list[RawCut]:
        """The parts that a key of another point names."""

    def keys(self, measure: Measure) -> list[tuple[Any, ...]]:
        """Keys of the largest parts."""

    def curvature(self, state: LoopState, key: tuple[Any, ...], dK: Array) -> tuple[Array, Array]:
        """Hessian of a part along directions dK of the augmented gain, and its gradient in the augmented gain."""

    def exact(self, state: LoopState, plant: int) -> GoalValue:
        """The value by exact means."""
