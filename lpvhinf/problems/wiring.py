"""Signals as rows: a block diagram is written signal by signal and read off as a state space.

Every signal is a matrix of rows over (states, inputs). Adding signals adds rows, a gain multiplies
them from the left, and a system (A, B, C, D) driven by a signal gives its output signal. As long as
the diagram is written from cause to effect, no algebraic loop needs solving, and the degree in p
grows only where two position-dependent gains follow each other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError
from lpvhinf.polynomial import ChebyshevMatrix, block
from lpvhinf.statespace.lpv import LPVStateSpace

Signal = ChebyshevMatrix
Gain = Array | ChebyshevMatrix


class Wiring:
    """The states and inputs of a block diagram over a box.

    Parameters
    ----------
    box : (n_p, 2)
    states, inputs : sequences of (name, size)

    Examples
    --------
    >>> wiring = Wiring([[0.0, 1.0]], states=[("x", 1)], inputs=[("u", 1)])
    >>> x, u = wiring.state("x"), wiring.input("u")
    >>> wiring.set_derivative("x", u - x)  # a first-order lag
    >>> wiring.read(outputs=[x]).at([0.5]).A.tolist()
    [[-1.0]]
    """

    def __init__(self, box: ArrayLike, *, states: Sequence[tuple[str, int]], inputs: Sequence[tuple[str, int]]) -> None:
        self.box = np.asarray(box, dtype=float)
        self._places: dict[str, slice] = {}
        end = 0
        for name, size in [*states, *inputs]:
            self._places[name] = slice(end, end + size)
            end += size
        self._width = end
        self._states = [name for name, _ in states]
        self._n_x = sum(size for _, size in states)
        self._derivatives: dict[str, Signal] = {}

    def _select(self, name: str) -> Signal:
        place = self._places[name]
        rows = np.zeros((place.stop - place.start, self._width))
        rows[np.arange(len(rows)), np.arange(place.start, place.stop)] = 1.0
        return Signal(rows, self.box)

    def state(self, name: str) -> Signal:
        """The signal of a state."""
        return self._select(name)

    def input(self, name: str) -> Signal:
        """The signal of an input."""
        return self._select(name)

    def zero(self, size: int) -> Signal:
        """A signal that is zero."""
        return Signal(np.zeros((size, self._width)), self.box)

    def stack(self, *signals: Signal) -> Signal:
        """Signals on top of each other."""
        return block([[signal] for signal in signals], self.box)

    def set_derivative(self, name: str, signal: Signal) -> None:
        """Say what the time derivative of a state is."""
        self._derivatives[name] = signal

    def drive(self, name: str, system: tuple[Gain, Gain, Gain, Gain], source: Signal) -> Signal:
        """Drive a system (A, B, C, D), whose state is `name`, by `source`; returns its output signal."""
        A, B, C, D = system
        x = self.state(name)
        self.set_derivative(name, A @ x + B @ source)
        return C @ x + D @ source

    def read(self, outputs: Sequence[Signal]) -> LPVStateSpace:
        """The state space from all inputs, in their order, to the stacked `outputs`.

        Raises
        ------
        DimensionError
            If a state has no derivative, or a derivative another size than its state.
        """
        for name in self._states:
            rows = self._places[name].stop - self._places[name].start
            if name not in self._derivatives or self._derivatives[name].shape[0] != rows:
                raise DimensionError(f"state {name!r} needs a derivative of {rows} rows.")
        dynamics = self.stack(*(self._derivatives[name] for name in self._states))
        result = self.stack(*outputs)
        x, u, every = slice(0, self._n_x), slice(self._n_x, None), slice(None)
        parts = (dynamics[every, x], dynamics[every, u], result[every, x], result[every, u])
        return LPVStateSpace(*(part.trimmed() for part in parts))
