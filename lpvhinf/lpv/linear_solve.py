"""Solves H d = r for a huge positive definite H that is factored in place, with refinement on its operator form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from lpvhinf.checks import Array

#: What is added to the diagonal, scaled to 1, where the factorisation breaks down: first nothing.
REGULARISATION = (0.0, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8)
#: Relative residual at which refinement stops.
RESIDUAL = 1e-12
#: Steps in which the residual must have been halved.
PATIENCE = 5
#: Rows that are scaled at a time.
ROWS = 256


@dataclass
class Factor:
    """The Cholesky factor of a scaled and perhaps regularised H, and the scaling.

    Attributes
    ----------
    triangle : (N, N)
        In Fortran order, upper.
    scale : (N,)
        One over the square roots of the diagonal of H.
    level : int
        Place in `REGULARISATION` that was needed.
    """

    triangle: Array
    scale: Array
    level: int

    def solve(self, r: Array) -> Array:
        """The solution for the regularised matrix."""
        return np.asarray(self.scale * lapack.dpotrs(self.triangle, self.scale * r, lower=0)[0])


def factored(assemble: Callable[[Array], None], H: Array, level: int = 0) -> Factor | None:
    """Factor H in place; None if it is not positive definite even with the largest regularisation.

    Parameters
    ----------
    assemble : callable
        Writes the lower triangle of H; called again where a factorisation fails, as that destroys H.
    H : (N, N)
        Room, in C order; finite above the diagonal.
    level : int
        Place in `REGULARISATION` to begin with.
    """
    while level < len(REGULARISATION):
        assemble(H)
        diagonal = np.diagonal(H).copy()
        if not np.all(np.isfinite(diagonal)) or diagonal.max() <= 0.0:
            return None
        scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-300 + 1e-40 * diagonal.max()))
        for start in range(0, len(H), ROWS):  # what is above the diagonal is not touched, so its pages cost no memory
            rows = H[start : start + ROWS, : start + ROWS]
            rows *= scale[: start + ROWS]
            rows *= scale[start : start + ROWS, None]
        np.einsum("ii->i", H)[:] += REGULARISATION[level]
        # the lower triangle in C order is the upper one in Fortran order, which LAPACK takes without a copy
        triangle, info = lapack.dpotrf(H.T, lower=0, clean=0, overwrite_a=1)
        if info == 0:
            return Factor(triangle, scale, level)
        level += 1
    return None


def refined(
    factor: Factor, apply: Callable[[Array], Array], r: Array, steps: int, residual: float = RESIDUAL
) -> tuple[Array, float, float]:
    """H d = r by conjugate gradients on the operator, preconditioned with the factor.

    Returns
    -------
    d : (N,)
        The best iterate.
    error : float
        Its relative residual, in the scaled norm.
    before : float
        That of the factor alone.
    """
    d = factor.solve(r)
    size = float(np.linalg.norm(factor.scale * r))
    if size == 0.0:
        return d, 0.0, 0.0
    left = r - apply(d)
    error = float(np.linalg.norm(factor.scale * left)) / size
    best, least, errors = d, error, [error]
    z = factor.solve(left)
    direction, energy = z, float(left @ z)
    for _ in range(steps):
        if error <= residual or not energy > 0.0:
            break
        image = apply(direction)
        curvature = float(direction @ image)
        if not curvature > 0.0:
            break
        step = energy / curvature
        d, left = d + step * direction, left - step * image
        error = float(np.linalg.norm(factor.scale * left)) / size
        if error < least:
            best, least = d, error
        elif error > 1e3 * least:
            break
        errors.append(least)
        if len(errors) > PATIENCE and least > 0.5 * errors[-1 - PATIENCE]:
            break
        z = factor.solve(left)
        before, energy = energy, float(left @ z)
        direction = z + (energy / before) * direction
    return best, least, errors[0]
