"""Structures side by side, between fixed gains, and the structure without parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct.structures import ControllerStructure, Realization, parameter_names


class BlockDiagonal:
    """Structures side by side: block i sees its own measurements and drives its own inputs.

    Parameters
    ----------
    *blocks : ControllerStructure
        theta is the blocks' parameters one after another; so are u, y and the states.

    Raises
    ------
    DimensionError
        If no block is given.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import FixedOrder, StaticGain
    >>> BlockDiagonal(StaticGain(1, 1), FixedOrder(1, 1, 1)).n_parameters
    5
    """

    def __init__(self, *blocks: ControllerStructure) -> None:
        if not blocks:
            raise DimensionError("blocks is empty, wanted at least one structure.")
        self.blocks = blocks
        self.n_u, self.n_y = sum(b.n_u for b in blocks), sum(b.n_y for b in blocks)
        self.n_x, self.n_parameters = sum(b.n_x for b in blocks), sum(b.n_parameters for b in blocks)
        self._cuts = np.cumsum([b.n_parameters for b in blocks])[:-1]
        self.names = tuple(f"block {i}: {name}" for i, b in enumerate(blocks) for name in parameter_names(b))

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """Block-diagonal (A, B, C, D)."""
        parts = [b.realize(t, p) for b, t in zip(self.blocks, np.split(theta, self._cuts), strict=True)]
        A, B, C, D = (_block_diagonal([part[k] for part in parts]) for k in range(4))
        return A, B, C, D

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The blocks' pullbacks of their diagonal parts."""
        out, x, u, y = [], 0, 0, 0
        for b, t in zip(self.blocks, np.split(theta, self._cuts), strict=True):
            ix, iu, iy = slice(x, x + b.n_x), slice(u, u + b.n_u), slice(y, y + b.n_y)
            out.append(b.pullback(t, GA[ix, ix], GB[ix, iy], GC[iu, ix], GD[iu, iy], p))
            x, u, y = x + b.n_x, u + b.n_u, y + b.n_y
        return np.concatenate(out)

    def initial(self, rng: np.random.Generator) -> Array:
        """The blocks' starts."""
        return np.concatenate([b.initial(rng) for b in self.blocks])


class Scaled:
    """A structure between fixed gains: K_scaled = diag(row_scale) K diag(column_scale).

    Parameters
    ----------
    structure : ControllerStructure
    row_scale, column_scale : (n_u,), (n_y,) or a number
        For instance the inverse plant gain at the crossover, so that theta is of size one.

    Raises
    ------
    DomainError
        If a scale is zero, NaN or infinite, or does not fit.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> float(Scaled(StaticGain(1, 1), 10.0, 2.0).realize(np.array([1.0]))[3][0, 0])
    20.0
    """

    def __init__(
        self, structure: ControllerStructure, row_scale: ArrayLike = 1.0, column_scale: ArrayLike = 1.0
    ) -> None:
        self.structure = structure
        self.n_u, self.n_y = structure.n_u, structure.n_y
        self.n_x, self.n_parameters = structure.n_x, structure.n_parameters
        self.names = parameter_names(structure)
        scales = []
        for name, value, n in (("row_scale", row_scale, self.n_u), ("column_scale", column_scale, self.n_y)):
            scale = finite_array(name, value)
            if scale.shape not in ((), (n,)) or np.any(scale == 0.0):
                raise DomainError(f"{name} is {scale.tolist()}, wanted a number or {n} of them, none zero.")
            scales.append(np.broadcast_to(scale, (n,)))
        self.row_scale, self.column_scale = (read_only(scale) for scale in scales)

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B c, r C, r D c)."""
        A, B, C, D = self.structure.realize(theta, p)
        r, c = self.row_scale[:, None], self.column_scale
        return A, B * c, r * C, r * D * c

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The inner pullback of the scaled gradients."""
        r, c = self.row_scale[:, None], self.column_scale
        return self.structure.pullback(theta, GA, GB * c, r * GC, r * GD * c, p)

    def initial(self, rng: np.random.Generator) -> Array:
        """The inner start."""
        return self.structure.initial(rng)


class Constant:
    """A controller without parameters, (A, B, C, D) as given: a fixed filter in a chain.

    Parameters
    ----------
    A, B, C, D : (n_x, n_x), (n_x, n_y), (n_u, n_x), (n_u, n_y)

    Raises
    ------
    DimensionError, DomainError
        If sizes disagree or entries are not finite.

    Examples
    --------
    >>> Constant([[-1.0]], [[1.0]], [[1.0]], [[0.0]]).n_parameters
    0
    """

    def __init__(self, A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike) -> None:
        d = finite_array("D", D, (None, None))
        self.n_u, self.n_y = d.shape
        a = finite_array("A", A, (None, None))
        self.n_x, self.n_parameters = a.shape[0], 0
        self.names: tuple[str, ...] = ()
        self._matrices: Realization = (
            read_only(finite_array("A", a, (self.n_x, self.n_x))),
            read_only(finite_array("B", B, (self.n_x, self.n_y))),
            read_only(finite_array("C", C, (self.n_u, self.n_x))),
            read_only(d),
        )

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """The given matrices."""
        return self._matrices

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """Empty."""
        return np.zeros(0)

    def initial(self, rng: np.random.Generator) -> Array:
        """Empty."""
        return np.zeros(0)


def _block_diagonal(blocks: list[Array]) -> Array:
    """Blocks on the diagonal; called for every parameter at every step, so without the checks of a library."""
    out = np.zeros((sum(len(b) for b in blocks), sum(b.shape[1] for b in blocks)))
    row = column = 0
    for b in blocks:
        out[row : row + b.shape[0], column : column + b.shape[1]] = b
        row, column = row + b.shape[0], column + b.shape[1]
    return out
