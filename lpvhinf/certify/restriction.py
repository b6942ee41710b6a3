r"""Chebyshev polynomials on a part of their interval, with exact integers.

.. math:: T_j(a + r \delta) = \sum_k R_{jk} T_k(\delta)
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import comb, lcm

import numpy as np

from lpvhinf.checks import Array, read_only


@lru_cache(maxsize=4096)
def restriction(size: int, centre: Fraction, radius: Fraction) -> Array:
    """R (size, size), lower triangular, every entry the exact rational rounded to the nearest double.

    Examples
    --------
    >>> restriction(3, Fraction(1, 2), Fraction(1, 2))
    array([[ 1.  ,  0.  ,  0.  ],
           [ 0.5 ,  0.5 ,  0.  ],
           [-0.25,  1.  ,  0.25]])
    """
    scale = lcm(centre.denominator, radius.denominator)
    a, r = int(centre * scale), int(radius * scale)
    previous, current = [0] * (size + 1), [1] + [0] * size  # times scale^j
    R = np.zeros((size, size))
    power = 1
    for j in range(size):
        R[j, : j + 1] = [value / power for value in current[: j + 1]]
        if j == size - 1:
            break
        factor = 1 if j == 0 else 2
        # delta T_0 = T_1, delta T_k = (T_(k+1) + T_(k-1)) / 2: twice the product stays an integer
        following = [0] * (size + 1)
        for k in range(j + 1):
            value = current[k]
            if value == 0:
                continue
            following[k] += factor * a * value
            if k == 0:
                following[1] += factor * r * value
            elif factor == 2:
                following[k + 1] += r * value
                following[k - 1] += r * value
        for k in range(j):
            following[k] -= scale * scale * previous[k]
        previous, current = current, following
        power *= scale
    out: Array = read_only(R)
    return out


@lru_cache(maxsize=64)
def powers(degree: int) -> Array:
    """(degree + 1, degree + 1): row k holds the coefficients of T_k in powers; small whole numbers, exact."""
    table: Array = read_only(np.array([_pad(_chebyshev(k), degree + 1) for k in range(degree + 1)], dtype=float))
    return table


def _chebyshev(k: int) -> list[int]:
    before, now = [1], [0, 1]
    for _ in range(k):
        step = [0] + [2 * c for c in now]
        before, now = now, [s - (before[i] if i < len(before) else 0) for i, s in enumerate(step)]
    return before


def _pad(values: list[int], length: int) -> list[int]:
    return values[:length] + [0] * (length - len(values))


@lru_cache(maxsize=64)
def bernstein(degree: int) -> Array:
    """(degree + 1, degree + 1): row k holds the Bernstein coefficients of delta^k on [-1, 1], rounded once."""
    table = [
        [
            float(
                sum(Fraction(comb(k, m) * 2**m * (-1) ** (k - m) * comb(i, m), comb(degree, m)) for m in range(k + 1))
            )
            for i in range(degree + 1)
        ]
        for k in range(degree + 1)
    ]
    out: Array = read_only(np.array(table))
    return out
