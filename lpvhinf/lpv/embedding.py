r"""Affine embedding: few scheduling variables in which an LPV system is nearly affine, with a bound on the rest.

The entries of (A, B, C, D), polynomials in p, are gathered in a vector m(p). With the principal directions
:math:`d_1, ..., d_n` of its variation over the box,

.. math:: m(p) = m_0 + \sum_i \theta_i(p)\, d_i + r(p), \quad \theta_i(p) = d_i^\top (m(p) - m_0),

so theta is a polynomial too, and so is the remainder r. Their ranges are bounded from values on a Chebyshev grid: a
polynomial of degree d on [-1, 1] exceeds its largest value at N > d Chebyshev points at most by the factor
:math:`1 / \cos(\pi d / (2 N))`, on every axis. So theta(p) stays in its box, and r(p) below its bound, at every p of
the box (up to round-off), not only at samples.

Source of the factor: H. Ehlich and K. Zeller, Schwankung von Polynomen zwischen Gitterpunkten, Mathematische
Zeitschrift 86 (1964) 41-44. Of the embedding: A. Kwiatkowski and H. Werner, PCA-based parameter set mappings for LPV
models with fewer parameters and less overbounding, IEEE Transactions on Control Systems Technology 16 (2008) 781-788.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, read_only, whole_number
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.lpv.polytopic import polytope_weights
from lpvhinf.polynomial import ChebyshevMatrix, nodes
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

#: Chebyshev points a degree and axis; the ranges are over-estimated by 1 / cos(pi / 16), 2 %, an axis.
DENSITY = 8
#: Numbers of the largest array of samples.
LARGEST = 20_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class AffineEmbedding:
    """Vertex systems, weights and the bound of an affine embedding; it unpacks into these three.

    Attributes
    ----------
    systems : tuple
        One `control.StateSpace` for each vertex (`GeneralizedPlant` where a generalized plant was embedded).
    weights : callable
        p (n_p,) -> (2^n_theta,), not negative, of sum 1: the weighted sum of the vertex systems is the system at p up
        to the remainder.
    error_bound : float
        No more than this is lost anywhere in the box: bound on the Frobenius norm (so on the largest singular value
        and on every entry, too) of the remainder of [A B; C D].
    remainder : dict of "A", "B", "C", "D" to arrays
        Bound on each entry of the remainder over the box, as the certificates take it.
    vertices : (2^n_theta, n_theta)
        Corners of the box of theta.
    theta : callable
        p (n_p,) -> theta (n_theta,).
    share : float
        Share of the variation (sum of squares of scaled entries over the box) that theta describes.
    box : (n_p, 2)
    """

    systems: tuple[Any, ...]
    weights: Callable[[Array], Array]
    error_bound: float
    remainder: dict[str, Array]
    vertices: Array
    theta: Callable[[Array], Array]
    share: float
    box: Array

    def __iter__(self) -> Iterator[Any]:
        return iter((self.systems, self.weights, self.error_bound))


def affine_embedding(system: LPVStateSpace | LPVGeneralizedPlant, n_theta: int) -> AffineEmbedding:
    r"""Embed an LPV system into a polytope of few scheduling variables, with a bound on what is lost.

    Entries of one of the matrices A, B, C, D count equally, and each matrix is scaled by its largest variation.

    Parameters
    ----------
    system : LPVStateSpace or LPVGeneralizedPlant
    n_theta : int
        Number of scheduling variables; 2^n_theta vertices.

    Returns
    -------
    AffineEmbedding
        `systems, weights, error_bound = affine_embedding(...)`, and more.

    Raises
    ------
    DomainError
        If `n_theta` is below 1 or `system` is of another kind.
    AssumptionError
        If the system does not depend on p, or varies in fewer than `n_theta` directions.

    Examples
    --------
    One direction is enough where all entries follow the same function of p; then nothing is lost:

    >>> G = LPVStateSpace.from_coefficients(
    ...     [[[-2.0]], [[0.0]], [[1.0]]], [[[1.0]], [[0.0]], [[0.5]]], [[1.0]], [[0.0]],
    ...     box=[[-1.0, 1.0]], basis="power",
    ... )
    >>> systems, weights, bound = affine_embedding(G, 1)
    >>> len(systems), bound < 1e-12
    (2, True)
    """
    if not isinstance(system, LPVStateSpace | LPVGeneralizedPlant):
        raise DomainError(f"system is {type(system).__name__}, wanted an LPVStateSpace or LPVGeneralizedPlant.")
    inner = system if isinstance(system, LPVStateSpace) else system.system
    count = whole_number("n_theta", n_theta, 1)
    matrices = inner.matrices
    shapes = [m.shape for m in matrices]
    degree = [max(m.degree[axis] for m in matrices) for axis in range(inner.n_p)]
    size = [DENSITY * d if d else 1 for d in degree]
    factor = float(np.prod([1.0 / np.cos(np.pi * d / (2.0 * n)) for d, n in zip(degree, size, strict=True)]))
    moving = [_moving_entries(m) for m in matrices]
    if not sum(len(k) for k in moving):
        raise AssumptionError("the system does not depend on p: there is nothing to embed. Use it as it is.")
    where = nodes(size, inner.box)
    if len(where) * sum(len(k) for k in moving) > LARGEST:
        raise AssumptionError(
            f"the system has degree {degree} and {sum(len(k) for k in moving)} entries that depend on p: too many to "
            "sample. Fit it with a lower degree first."
        )

    def gathered(points: Array) -> Array:
        parts = [m.sample(points).reshape(len(points), -1)[:, k] for m, k in zip(matrices, moving, strict=True)]
        return np.concatenate(parts, axis=1)

    samples = gathered(where)
    middle = 0.5 * (samples.min(axis=0) + samples.max(axis=0))
    spread = [np.ptp(part, axis=0).max(initial=0.0) for part in np.split(samples, _cuts(moving), axis=1)]
    scale = np.concatenate([np.full(len(k), s if s > 0.0 else 1.0) for k, s in zip(moving, spread, strict=True)])
    deviation = (samples - middle) / scale
    _, strength, directions = np.linalg.svd(deviation, full_matrices=False)
    varied = int(np.sum(strength > 1e-12 * strength[0]))
    if count > varied:
        raise AssumptionError(f"n_theta is {count}, but the system varies in {varied} directions. Take no more.")
    chosen = directions[:count]
    thetas = deviation @ chosen.T
    rest = np.max(np.abs(deviation - thetas @ chosen), axis=0) * factor * scale
    centre, half = 0.5 * (thetas.max(0) + thetas.min(0)), 0.5 * (thetas.max(0) - thetas.min(0)) * factor
    vertices = np.array(list(itertools.product(*np.stack([centre - half, centre + half], axis=1))))
    in_box = polytope_weights(vertices)

    def theta(p: Array) -> Array:
        row = gathered(np.asarray(p, dtype=float).reshape(1, -1))[0]
        return np.asarray(chosen @ ((row - middle) / scale))

    def weights(p: Array) -> Array:
        return in_box(np.clip(theta(p), vertices.min(axis=0), vertices.max(axis=0)))

    def assembled(values: Array) -> list[Array]:
        out = []
        for m, k, part in zip(matrices, moving, np.split(values, _cuts(moving)), strict=True):
            full = m.at(inner.box.mean(axis=1)).reshape(-1).copy()
            full[k] = part
            out.append(full.reshape(m.shape))
        return out

    remainder = {}
    for name, shape, k, part in zip("ABCD", shapes, moving, np.split(rest, _cuts(moving)), strict=True):
        full = np.zeros(shape[0] * shape[1])
        full[k] = part
        remainder[name] = read_only(full.reshape(shape))
    return AffineEmbedding(
        systems=tuple(_system(system, assembled(middle + scale * (v @ chosen))) for v in vertices),
        weights=weights,
        error_bound=float(np.linalg.norm(rest)),
        remainder=remainder,
        vertices=read_only(vertices),
        theta=theta,
        share=float(np.sum(strength[:count] ** 2) / np.sum(strength**2)),
        box=inner.box,
    )


def _moving_entries(matrix: ChebyshevMatrix) -> np.ndarray:
    """Entries of the flattened matrix that depend on p: all but the first coefficient are of higher degree."""
    flat = matrix.coefficients.reshape(-1, matrix.shape[0] * matrix.shape[1])
    return np.flatnonzero(np.any(flat[1:] != 0.0, axis=0))


def _cuts(moving: list[np.ndarray]) -> np.ndarray:
    return np.cumsum([len(k) for k in moving])[:-1]


def _system(given: LPVStateSpace | LPVGeneralizedPlant, matrices: list[Array]) -> Any:
    import control

    A, B, C, D = matrices
    if isinstance(given, LPVStateSpace):
        return control.ss(A, B, C, D, remove_useless_states=False)
    w, z = given.n_w, given.n_z
    return GeneralizedPlant(A, B[:, :w], B[:, w:], C[:z], C[z:], D[:z, :w], D[:z, w:], D[z:, :w], D[z:, w:])


def evaluate(embedding: AffineEmbedding, p: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """(A, B, C, D) of the weighted sum of the vertex systems at p."""
    w = embedding.weights(np.asarray(p, dtype=float).reshape(-1))
    parts = []
    for system in embedding.systems:
        whole = system.to_control() if isinstance(system, GeneralizedPlant) else system
        parts.append([np.asarray(m, dtype=float) for m in (whole.A, whole.B, whole.C, whole.D)])
    a, b, c, d = (np.tensordot(w, np.stack([part[k] for part in parts]), 1) for k in range(4))
    return a, b, c, d
