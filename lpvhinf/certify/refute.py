r"""Positions at which a frozen claim is false, with proof: an enclosed eigenvalue.

With V close to the eigenvectors, Y close to its inverse, R = I - YV and M = YAV - YV diag(lambda):
:math:`V^{-1} A V = \Lambda + (I - R)^{-1} M`, and by Gershgorin's theorem the eigenvalues of A lie in discs about the
numbers lambda_i; a group of k discs that touches no other holds exactly k eigenvalues.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lpvhinf.certify.cells import Point
from lpvhinf.certify.loop import LoopMatrix
from lpvhinf.certify.positive_definite import gamma
from lpvhinf.certify.system import CanonicalSystem
from lpvhinf.checks import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class UnstablePosition:
    """A position at which A(p) has an eigenvalue that the claim excludes.

    Attributes
    ----------
    position : (n_p,) rounded
    exact_position : the same as exact rationals
    eigenvalue : centre of a disc [1/s]
    radius : of the disc, which holds at least one eigenvalue and lies in Re >= -decay
    """

    position: Array
    exact_position: tuple[Fraction, ...]
    eigenvalue: complex
    radius: float


def unstable_position(system: CanonicalSystem, box: Array, point: Point, decay: float) -> UnstablePosition | None:
    """`point`, if an eigenvalue of the stored A is proved to have a real part of at least -decay there.

    A remainder plays no part: the polynomial system itself belongs to the systems of the claim.
    """
    loop = LoopMatrix(system, box, decay=0.0)
    local = loop.local(point, 1)
    disc = enclosed_eigenvalue(local.terms[0], local.remainder, -decay)
    if disc is None:
        return None
    return UnstablePosition(
        position=point.rounded(box), exact_position=point.position(box), eigenvalue=disc[0], radius=disc[1]
    )


def enclosed_eigenvalue(A: Array, error: Array, least: float) -> tuple[complex, float] | None:
    """A disc in Re >= least that holds an eigenvalue of every matrix within `error` of A, or None.

    Examples
    --------
    >>> enclosed_eigenvalue(np.array([[1.0, 5.0], [0.0, -2.0]]), np.zeros((2, 2)), 0.0)[0]
    (1+0j)
    """
    n = len(A)
    values, V = np.linalg.eig(A)
    try:
        Y = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return None
    aV, aY = np.abs(V), np.abs(Y)
    g = 8.0 * gamma(4 * n + 8)  # complex products in real arithmetic, three factors
    product, inverse = Y @ A @ V, Y @ V
    M = product - inverse * values
    wrong_M = aY @ (error + g * np.abs(A)) @ aV + g * (aY @ aV) * np.abs(values)
    R = np.abs(np.eye(n) - inverse) + g * (aY @ aV)
    norm_R = float(R.sum(axis=1).max()) * (1.0 + 1e-10)
    if norm_R >= 0.5:
        return None
    rows = (np.abs(M) + wrong_M).sum(axis=1)
    radius = (rows + norm_R / (1.0 - norm_R) * rows.max()) * (1.0 + 1e-9) + 1e-300
    # groups of discs that touch
    near = np.abs(values[:, None] - values[None, :]) <= (radius[:, None] + radius[None, :]) * (1.0 + 1e-9)
    inside = values.real - radius > least + 1e-12 * np.abs(least)
    group = np.eye(n, dtype=bool)
    while True:
        wider = (group.astype(int) @ near.astype(int)) > 0
        if np.array_equal(wider, group):
            break
        group = wider
    good = [i for i in range(n) if np.all(inside[group[i]])]
    if not good:
        return None
    best = max(good, key=lambda i: float(values[i].real - radius[i]))
    return complex(values[best]), float(radius[best])
