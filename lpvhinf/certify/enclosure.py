r"""Enclosures of polynomial matrices on a cell: powers of the cell's coordinates and an entrywise remainder.

.. math:: K(\delta) = \sum_{|a| \le d} K_a \delta^a + E(\delta), \qquad |E(\delta)| \le \rho, \quad |\delta_i| \le 1

The remainder holds the truncated degrees and all round-off (docs/certificate_format.md, sections 7 and 8).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpvhinf.certify.cells import Cell, Point
from lpvhinf.certify.positive_definite import TINY, gamma
from lpvhinf.certify.restriction import powers, restriction
from lpvhinf.checks import Array

KEPT = 12  # contractions along the first axis that are remembered: neighbours in the tree share them
NEGLIGIBLE = 1e-9  # degrees whose restriction to the cell is smaller are bounded together, not computed


@lru_cache(maxsize=64)
def multi_indices(n_p: int, degree: int) -> tuple[tuple[int, ...], ...]:
    """All b with b_1 + ... + b_np <= degree, ordered by their sum and then as tuples.

    Examples
    --------
    >>> multi_indices(2, 1)
    ((0, 0), (0, 1), (1, 0))
    """
    every = (b for b in product(range(degree + 1), repeat=n_p) if sum(b) <= degree)
    return tuple(sorted(every, key=lambda b: (sum(b), b)))


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalPolynomial:
    """Entries of a matrix on a cell.

    Attributes
    ----------
    degree : d, the highest total degree that is kept
    terms : (n_terms, N)
        Coefficients of delta^a in the order of `multi_indices`.
    remainder : (N,)
        Bound of what is missing, round-off included.
    slopes : (n_p, N)
        Bound of the derivative of the truncated part to delta_i; zero rows where it was not asked for.
    """

    degree: int
    terms: Array
    remainder: Array
    slopes: Array


class ChebyshevEntries:
    """Chebyshev series of many scalar functions over one box, and their enclosures on its parts.

    Parameters
    ----------
    coefficients : (k_1, ..., k_np, N)
    """

    def __init__(self, coefficients: Array) -> None:
        self.coefficients = np.ascontiguousarray(coefficients)
        self.n_p = coefficients.ndim - 1
        self.size = coefficients.shape[:-1]
        magnitudes = np.abs(self.coefficients)
        self.total = magnitudes.sum(axis=tuple(range(self.n_p))) * (1.0 + 1e-11)
        #: per axis (k_i, N): sums of sizes over the other axes
        self.marginals = [
            magnitudes.sum(axis=tuple(a for a in range(self.n_p) if a != axis)) * (1.0 + 1e-11)
            for axis in range(self.n_p)
        ]
        self._first: OrderedDict[Any, Array] = OrderedDict()

    def local(
        self, centre: Sequence[Fraction], radius: Sequence[Fraction], degree: int, *, slopes: bool = False
    ) -> LocalPolynomial:
        """The enclosure on the part centre + radius delta of [-1, 1]^n_p."""
        n_p, n = self.n_p, self.coefficients.shape[-1]
        maps = [restriction(k, c, r) for k, c, r in zip(self.size, centre, radius)]
        keep = [len(R) if slopes else _needed(R, degree) for R in maps]
        local = self._contract(maps, keep, (centre[0], radius[0]))
        remainder, reach = np.zeros(n), 1.0
        for axis, (R, q) in enumerate(zip(maps, keep)):
            tails = np.abs(R[:, q:]).sum(axis=1)
            remainder += reach * (tails @ self.marginals[axis])
            reach *= 1.0 + float(np.max(tails))
        # everything beyond the total degree d
        orders = np.indices(keep).reshape(n_p, -1)
        flat = local.reshape(orders.shape[1], n)
        high = orders.sum(axis=0) > degree
        beyond = np.abs(flat[high])
        remainder += beyond.sum(axis=0)
        absolute = [float(np.max(np.abs(R[:, :q]).sum(axis=1))) for R, q in zip(maps, keep)]
        inner = sum(self.size) + 8 * n_p
        round_off = gamma(inner) * float(np.prod(absolute)) * self.total
        slope = np.zeros((n_p, n))
        if slopes:
            for axis in range(n_p):
                slope[axis] = (orders[axis, high] ** 2.0) @ beyond + max(keep) ** 2.0 * round_off
        terms, conversion = _to_powers(flat[~high], orders[:, ~high], n_p, degree)
        if slopes:
            slope += degree**2.0 * conversion  # Markov: a polynomial of degree d below e has a slope below d^2 e
        remainder = (remainder + round_off + conversion) * (1.0 + 1e-11) + 1e5 * TINY
        return LocalPolynomial(degree=degree, terms=terms, remainder=remainder, slopes=slope * (1.0 + 1e-11))

    def _contract(self, maps: list[Array], keep: list[int], key: Any) -> Array:
        name = (*key, keep[0])
        if name in self._first:
            self._first.move_to_end(name)
            local = self._first[name]
        else:
            local = maps[0][:, : keep[0]].T @ self.coefficients.reshape(
                self.size[0], int(np.prod(self.coefficients.shape[1:]))
            )
            self._first[name] = local
            if len(self._first) > KEPT:
                self._first.popitem(last=False)
        before = keep[0]
        for axis in range(1, self.n_p):
            after = int(np.prod(self.size[axis + 1 :])) * self.coefficients.shape[-1]
            local = maps[axis][:, : keep[axis]].T @ local.reshape(before, self.size[axis], after)
            before *= keep[axis]
        return np.reshape(local, (*keep, self.coefficients.shape[-1]))


def _needed(R: Array, degree: int) -> int:
    """How many local degrees of R have to be computed."""
    tails = np.cumsum(np.abs(R[:, ::-1]), axis=1)[:, ::-1].max(axis=0)  # of the degrees k and above
    small = np.flatnonzero(tails <= NEGLIGIBLE)
    return max(min(degree + 1, len(R)), int(small[0]) if len(small) else len(R))


def _to_powers(kept: Array, orders: NDArray[np.int64], n_p: int, degree: int) -> tuple[Array, Array]:
    """Chebyshev to powers of delta; the second value bounds the round-off of the sum of all terms."""
    indices = multi_indices(n_p, degree)
    P = powers(degree)
    change = np.ones((len(indices), orders.shape[1]))
    for axis in range(n_p):
        change *= P[orders[axis][None, :], np.array([a[axis] for a in indices])[:, None]]
    round_off = gamma(orders.shape[1] + 8) * (np.abs(change).sum(axis=0) @ np.abs(kept))
    return change @ kept, round_off


def in_system_coordinates(cell: Cell | Point, box: Array, system_box: Array) -> tuple[list[Fraction], list[Fraction]]:
    """Centre and radius of a cell of `box`, in the coordinates in which `system_box` is [-1, 1]^n_p; exact."""
    centre, radius = [], []
    for c, r, (low, high), (first, last) in zip(cell.centre, cell.radius, box.tolist(), system_box.tolist()):
        lo, hi, a, b = Fraction(low), Fraction(high), Fraction(first), Fraction(last)
        middle, half = (lo + hi) / 2, (hi - lo) / 2
        centre.append((2 * (middle + c * half) - a - b) / (b - a))
        radius.append(2 * r * half / (b - a))
    return centre, radius
