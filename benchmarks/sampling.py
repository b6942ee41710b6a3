"""Evaluating a polynomial matrix at many positions, at once or one by one."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.polynomial import chebyshev

from benchmarks.benchmark import Benchmark, Case
from lpvhinf.checks import Array
from lpvhinf.polynomial import ChebyshevMatrix

BOX = np.array([[-0.06, 0.06], [-0.06, 0.06]])


def one_by_one(matrix: ChebyshevMatrix, points: Array) -> Array:
    """A Python loop over the positions, with NumPy's own tensor Chebyshev evaluation inside."""
    low, high = matrix.box.T
    scaled = (2.0 * points - low - high) / (high - low)
    return np.stack([chebyshev.chebval2d(x, y, matrix.coefficients) for x, y in scaled])


def cases() -> Iterator[Case]:
    """Three sizes around a closed loop of a planar motor."""
    rng = np.random.default_rng(0)
    for n, degree, count in ((10, 4, 100), (30, 8, 1000), (60, 8, 1000)):
        matrix = ChebyshevMatrix(rng.standard_normal((degree + 1, degree + 1, n, n)), BOX)
        points = rng.uniform(BOX[:, 0], BOX[:, 1], size=(count, 2))
        scale = float(np.max(np.sum(np.abs(matrix.coefficients), axis=(0, 1))))
        yield Case(
            size=f"{n} x {n}, degree {degree}, {count} positions",
            ours=partial(matrix.sample, points),
            baseline=partial(one_by_one, matrix, points),
            difference=lambda a, b, scale=scale: float(np.max(np.abs(a - b))) / scale,  # type: ignore[misc]
            accepted=(0.0, 1e-12),
        )


BENCHMARK = Benchmark(
    name="sampling",
    question="How much faster is a matrix polynomial in p evaluated at many positions at once than one by one?",
    ours="`ChebyshevMatrix.sample`: one basis matrix for all positions, one product",
    baseline="a Python loop over the positions around `numpy.polynomial.chebyshev.chebval2d`",
    difference="largest difference of an entry, relative to the sum of the coefficients' sizes",
    limitation="Full random coefficients: the state matrices of a motion system are sparser, which helps `sample` and "
    "not the loop. A single position is not measured.",
    cases=cases,
)
