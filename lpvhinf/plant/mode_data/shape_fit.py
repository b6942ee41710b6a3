"""Mode shapes given at points made smooth: penalised least squares, with the error measured by leaving nodes out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant.mode_data.mode_shapes import ModeShapes, plane_shapes, spatial, tensor_rows

DEGREES = (2, 3, 4, 5, 6, 8, 10, 12)  # tried in x and y
SOLID_DEGREES = DEGREES[:6]  # and where z counts too
SMOOTHING = 10.0 ** np.arange(-12.0, -3.0)  # from an interpolation of exact data to measurements with noise
MIN_NODES = 9
SAME_PLACE = 1e-6  # coordinates closer than this share of the mover's size are one level
GOOD_ENOUGH = 1.25  # the lowest degree whose error is within this factor of the smallest one is taken
FULL_LEVERAGE = (
    1e-9  # a node this near to deciding alone what the fit is there: round-off hides what leaving it out does
)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapeFit:
    """Smooth mode shapes and what the fit is worth.

    Attributes
    ----------
    shapes : ModeShapes
    n_nodes : int
        Number of nodes; 0 if the shapes were polynomials already.
    smoothing : float
        Weight of the bending energy.
    residual : (n_modes,)
        Root mean square over the nodes of what the fit leaves, relative to that of the mode.
    left_out : (n_modes,)
        The same at nodes that take no part in the fit: each node is left out once. This is what to judge by.
    """

    shapes: ModeShapes
    n_nodes: int
    smoothing: float
    residual: Array
    left_out: Array

    def __repr__(self) -> str:
        worst = float(np.max(self.left_out, initial=0.0))
        return f"ShapeFit(degree={self.shapes.degree}, n_nodes={self.n_nodes}, largest left_out={worst:.2g})"


def fit_shapes(
    points: ArrayLike,
    shapes: ArrayLike,
    *,
    degree: int | Sequence[int] | None = None,
    tolerance: float = 0.02,
) -> ShapeFit:
    r"""Smooth mode shapes from nodes: tensor Legendre polynomials over the nodes' bounding box.

    .. math::

        \min_c \; \frac1n \sum_k |\phi_c(r_k) - \phi_k|^2
        + \lambda\, \frac{a^4}{V} \int \sum_{ij} (\partial_i\partial_j \phi_c)^2\, dV, \qquad
        \phi_c(x, y, z) = \sum_{ijk} c_{ijk} P_i(\tilde x) P_j(\tilde y) P_k(\tilde z)

    with a the longest side. The second term is a plate's bending energy but for Poisson's ratio: between the nodes the
    fit bends as little as a plate would. The degree and :math:`\lambda` are those with the least error at nodes that
    are left out.

    Parameters
    ----------
    points : (n_nodes, 2) or (n_nodes, 3)
        Nodes in mover coordinates [m].
    shapes : (n_nodes, n_modes) or (n_nodes, 3, n_modes)
        Out-of-plane displacement w, or u, v, w, at the nodes. With w alone, or all nodes in one plane, the fit is one
        in x and y, and points above and below the plane (at the nodes' mean height) move by Kirchhoff's kinematics.
    degree : int or (nx, ny) or (nx, ny, nz), optional
        At most the number of different coordinates less one. If left out, the lowest of 2 to 12 in x and y whose error
        is within a factor 1.25 of the smallest.
    tolerance : float
        Largest leave-one-out error of a mode, relative, that is accepted.

    Raises
    ------
    DimensionError
        If `points` or `shapes` has a wrong shape.
    DomainError
        If the nodes are too few or on one line, a mode is zero everywhere, or a degree is no whole number above 0 or
        too high for the nodes.
    AssumptionError
        If a mode's error is above `tolerance`.

    Examples
    --------
    >>> x, y = np.meshgrid(np.linspace(-0.1, 0.1, 5), np.linspace(-0.1, 0.1, 5))
    >>> fit = fit_shapes(np.column_stack([x.ravel(), y.ravel()]), (40.0 * x * y).reshape(-1, 1))
    >>> fit.shapes.at([[0.03, 0.02]])[0, 2].round(9).tolist()
    [0.024]
    """
    at = spatial(finite_array("points", points, (None, None)), 0.0, "points")
    values = finite_array("shapes", shapes)
    if values.ndim == 2:
        values = values[:, None, :]
    if values.ndim != 3 or values.shape[:2] not in ((len(at), 1), (len(at), 3)):
        raise DimensionError(
            f"shapes has shape {np.shape(shapes)}, wanted ({len(at)}, n_modes) or ({len(at)}, 3, n_modes)."
        )
    positive("tolerance", tolerance)
    still = np.all(values == 0.0, axis=(0, 1))
    if np.any(still):
        raise DomainError(f"shapes of flexible mode {np.argmax(still) + 1} are 0 at every node. Leave the mode out.")
    outline = _outline(at)
    bounds = np.stack([at.min(axis=0), at.max(axis=0)], axis=1)
    side = float(np.max(np.ptp(bounds[:2], axis=1)))
    height = float(at[:, 2].mean())
    # between few rows of nodes a higher degree would follow the bending energy, not the shape, and no node would tell
    highest = [len(np.unique(np.round(at[:, k] / (SAME_PLACE * side)))) - 1 for k in range(3)]
    plane = values.shape[1] == 1 or highest[2] == 0
    if plane:  # the fit is one in x and y: a dummy extent in z, degree 0
        bounds[2], highest[2] = (height - 0.5 * side, height + 0.5 * side), 0
    best = _best(at, values, bounds, _degrees(degree, highest))
    if np.max(best.left_out) > tolerance:
        k = int(np.argmax(best.left_out))
        raise AssumptionError(
            f"shapes of flexible mode {k + 1} differ by {best.left_out[k]:.2g} (relative, rms) at nodes left out of "
            f"the fit of degree {best.degree} to {len(at)} nodes, wanted at most tolerance = {tolerance:g}. Give more "
            "nodes, look for outliers and interchanged nodes, leave out high modes, or raise the tolerance."
        )
    coefficients = best.coefficients.reshape(*(n + 1 for n in best.degree), *values.shape[1:])
    smooth = (
        plane_shapes(coefficients[:, :, 0], bounds[:2], outline, height)
        if plane
        else ModeShapes(coefficients=coefficients, bounds=bounds, outline=outline, height=height)
    )
    return ShapeFit(
        shapes=smooth,
        n_nodes=len(at),
        smoothing=best.smoothing,
        residual=read_only(best.residual),
        left_out=read_only(best.left_out),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Candidate:
    """One degree, one weight of the bending energy, and their fit."""

    degree: tuple[int, int, int]
    smoothing: float
    coefficients: Array
    residual: Array
    left_out: Array


def _outline(at: Array) -> Array:
    """Convex hull of the nodes in (x, y), counter-clockwise."""
    from scipy.spatial import ConvexHull

    if len(at) < MIN_NODES:
        raise DomainError(
            f"points has {len(at)} nodes, wanted at least {MIN_NODES}, and for a good fit several times as many. "
            "Export more nodes."
        )
    extents = np.linalg.svd(at[:, :2] - at[:, :2].mean(axis=0), compute_uv=False)
    if extents[1] <= SAME_PLACE * extents[0]:
        raise DomainError(
            f"points has {len(at)} nodes on one line in (x, y), wanted nodes that span an area. Add nodes beside the "
            "line: a beam needs at least its two edges."
        )
    return np.asarray(at[ConvexHull(at[:, :2]).vertices, :2])


def _degrees(degree: int | Sequence[int] | None, highest: list[int]) -> list[tuple[int, int, int]]:
    """The degrees in x, y and z to try, from low to high."""
    nz = min(2, highest[2])
    if degree is None:
        tried = {(min(n, highest[0]), min(n, highest[1]), nz) for n in (SOLID_DEGREES if nz else DEGREES)}
        return sorted(tried)
    given = np.atleast_1d(np.asarray(degree))
    if not np.issubdtype(given.dtype, np.integer) or np.any(given < 1) or given.shape not in ((1,), (2,), (3,)):
        raise DomainError(f"degree is {degree!r}, wanted one, two or three whole numbers of at least 1.")
    nx, ny = (int(given[0]), int(given[0])) if len(given) == 1 else (int(given[0]), int(given[1]))
    wanted = (nx, ny, int(given[2]) if len(given) == 3 and nz else nz)
    if any(n > most for n, most in zip(wanted, highest, strict=True)):
        raise DomainError(
            f"degree is {wanted} in x, y, z, but points has only {[n + 1 for n in highest]} different coordinates "
            "along them. Lower the degree or give more nodes."
        )
    return [wanted]


def _bending(bounds: Array, degree: tuple[int, int, int]) -> Array:
    r"""F with :math:`|F c|^2 = (a^4/V) \int \sum_{ij} (\partial_i \partial_j \phi_c)^2 dV`."""
    sides = np.ptp(bounds, axis=1)
    grams = []  # of the derivatives 0, 1, 2 along each axis, as means over its side
    for n, side in zip(degree, sides, strict=True):
        t, weights = legendre.leggauss(n + 1)
        rows = []
        for k in range(3):
            D = np.zeros((n + 1, n + 1))
            below = np.atleast_2d(legendre.legder(np.eye(n + 1), k)) if k <= n else np.zeros((1, n + 1))
            D[: len(below)] = below
            rows.append(legendre.legvander(t, n) @ D * (2.0 * sides.max() / side) ** k)
        grams.append([0.5 * (row.T * weights) @ row for row in rows])
    energy = np.zeros((int(np.prod([n + 1 for n in degree])),) * 2)
    for i in range(3):
        for j in range(3):
            order = [(axis == i) + (axis == j) for axis in range(3)]
            energy += np.kron(np.kron(grams[0][order[0]], grams[1][order[1]]), grams[2][order[2]])
    values, vectors = np.linalg.eigh(energy)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


def _best(at: Array, values: Array, bounds: Array, degrees: list[tuple[int, int, int]]) -> _Candidate:
    """The candidate with the least leave-one-out error, or one of lower degree that is nearly as good."""
    flat = values.reshape(len(at), -1)
    size = np.sqrt(np.mean(np.sum(values**2, axis=1), axis=0))

    def relative(deviation: Array) -> Array:
        return np.asarray(np.sqrt(np.mean(np.sum(deviation.reshape(values.shape) ** 2, axis=1), axis=0)) / size)

    best: list[_Candidate] = []
    for degree in degrees:
        rows, F = tensor_rows(at, bounds, degree), _bending(bounds, degree)
        Q, R = np.linalg.qr(rows / np.sqrt(len(at)))
        fits = []
        for smoothing in SMOOTHING:
            T = np.linalg.qr(np.vstack([R, np.sqrt(smoothing) * F]), mode="r")
            half = scipy.linalg.solve_triangular(T, R.T, trans="T")  # the smoother is Q half.T half Q.T
            spread = Q @ half.T
            free = 1.0 - np.sum(spread**2, axis=1)  # what leverage leaves
            if np.min(free) < FULL_LEVERAGE:
                continue
            c = scipy.linalg.solve_triangular(T, half @ (Q.T @ flat)) / np.sqrt(len(at))
            gap = flat - spread @ (spread.T @ flat)
            fits.append(
                _Candidate(
                    degree=degree,
                    smoothing=float(smoothing),
                    coefficients=c,
                    residual=relative(gap),
                    left_out=relative(gap / free[:, None]),
                )
            )
        best.append(min(fits, key=lambda fit: float(np.max(fit.left_out))))
    errors = [float(np.max(fit.left_out)) for fit in best]
    return next(fit for fit, error in zip(best, errors, strict=True) if error <= GOOD_ENOUGH * min(errors))
