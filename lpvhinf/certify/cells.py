"""Dyadic cells: a tree of bisections covers the box by construction (docs/certificate_format.md, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array

LEAF = -1


@dataclass(frozen=True, order=True)
class Cell:
    """A box in [-1, 1]^n_p with dyadic corners: centre (2 index + 1) / 2^level - 1 and half width 2^-level per axis.

    Attributes
    ----------
    level : bisections along every axis
    index : 0 ... 2^level - 1 along every axis
    """

    level: tuple[int, ...]
    index: tuple[int, ...]

    @property
    def centre(self) -> tuple[Fraction, ...]:
        """Centre, exactly."""
        return tuple(Fraction(2 * i + 1, 2**k) - 1 for k, i in zip(self.level, self.index))

    @property
    def radius(self) -> tuple[Fraction, ...]:
        """Half widths, exactly."""
        return tuple(Fraction(1, 2**k) for k in self.level)

    @property
    def share(self) -> float:
        """Volume as a share of the whole box."""
        return float(2.0 ** -sum(self.level))

    def halves(self, axis: int) -> tuple[Cell, Cell]:
        """The lower and the upper half along an axis."""
        level = tuple(k + (a == axis) for a, k in enumerate(self.level))
        lower = tuple(2 * i if a == axis else i for a, i in enumerate(self.index))
        upper = tuple(2 * i + 1 if a == axis else i for a, i in enumerate(self.index))
        return Cell(level, lower), Cell(level, upper)

    def bounds(self, box: Array) -> Array:
        """(n_p, 2) lower and upper bounds of the cell in p, rounded."""
        c, r = np.array([float(x) for x in self.centre]), np.array([float(x) for x in self.radius])
        middle, half = box.mean(axis=1), 0.5 * (box[:, 1] - box[:, 0])
        return np.stack([middle + (c - r) * half, middle + (c + r) * half], axis=1)


@dataclass(frozen=True)
class Point:
    """One position, exactly, as a cell without extent.

    Attributes
    ----------
    centre : coordinates in [-1, 1]^n_p
    """

    centre: tuple[Fraction, ...]

    @property
    def radius(self) -> tuple[Fraction, ...]:
        """Zeros."""
        return (Fraction(0),) * len(self.centre)

    def position(self, box: Array) -> tuple[Fraction, ...]:
        """The position in p, exactly."""
        return tuple(
            (Fraction(low) + Fraction(high)) / 2 + c * (Fraction(high) - Fraction(low)) / 2
            for c, (low, high) in zip(self.centre, box.tolist())
        )

    def rounded(self, box: Array) -> Array:
        """The position in p, rounded and inside the box."""
        middle = np.array([float(v) for v in self.position(box)])
        return np.asarray(np.clip(middle, box[:, 0], box[:, 1]))


def grid_points(n_p: int, steps: int) -> list[Point]:
    """A regular grid with `steps` intervals per axis, its corners included."""
    values = [Fraction(2 * i, steps) - 1 for i in range(steps + 1)]
    return [Point(centre) for centre in product(values, repeat=n_p)]


def whole(n_p: int) -> Cell:
    """The undivided box."""
    return Cell((0,) * n_p, (0,) * n_p)


def preorder(splits: dict[Cell, int], n_p: int) -> tuple[NDArray[np.int8], list[Cell]]:
    """The tree as a list of nodes in preorder, and its leaves in that order.

    Parameters
    ----------
    splits : axis along which a cell was cut; a cell that is not named is a leaf.
    """
    nodes: list[int] = []
    leaves: list[Cell] = []
    stack = [whole(n_p)]
    while stack:
        cell = stack.pop()
        axis = splits.get(cell, LEAF)
        nodes.append(axis)
        if axis == LEAF:
            leaves.append(cell)
        else:
            lower, upper = cell.halves(axis)
            stack += [upper, lower]
    return np.array(nodes, dtype=np.int8), leaves
