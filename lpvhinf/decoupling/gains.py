"""The gains of a decoupled plant at positions, and their polynomial fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.fitting import MatrixFit, interpolate, spread_points
from lpvhinf.polynomial import ChebyshevMatrix


@dataclass(frozen=True, eq=False)
class DecoupledGains:
    """Input, output and feed-through gains of all modes at N positions, from the plant model itself.

    Attributes
    ----------
    B : (N, n_modes, n_rb + n_flex)
        Modal accelerations per unit input.
    C : (N, n_out, n_modes)
        Outputs per unit of every mode.
    D : (N, n_out, n_rb + n_flex)
        Static compliance of the truncated modes.
    """

    B: Array
    C: Array
    D: Array


def fit_gains(gains: Callable[[Array], DecoupledGains], *, box: Array, degree: int) -> dict[str, MatrixFit]:
    """Chebyshev fits "B", "C" and "D" of gains that are computed together, each with its measured error."""
    shapes: list[tuple[int, ...]] = []

    def flat(points: Array) -> Array:
        found = gains(points)
        parts = [found.B, found.C, found.D]
        shapes[:] = [part.shape[1:] for part in parts]
        return np.concatenate([part.reshape(len(points), 1, -1) for part in parts], axis=2)

    joined = interpolate(flat, box=box, degree=degree)
    fits, start = {}, 0
    for name, (rows, cols) in zip("BCD", shapes, strict=True):
        cut = slice(start, start + rows * cols)
        c = joined.matrix.coefficients[..., 0, cut].reshape(*joined.matrix.coefficients.shape[:-2], rows, cols)
        matrix = ChebyshevMatrix(c, box).trimmed(1e-13 * float(np.max(np.abs(c), initial=0.0)))
        scale = float(np.max(np.abs(matrix.sample(spread_points(box, joined.n_test))), initial=0.0))
        fits[name] = MatrixFit(matrix, joined.error[0, cut].reshape(rows, cols), scale, joined.n_test)
        start += rows * cols
    return fits
