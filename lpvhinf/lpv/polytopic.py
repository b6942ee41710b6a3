r"""Polytopic synthesis: vertices, weights, and the self-scheduled controller.

With R and S constant, and B2, C2, D12, D21 the same at all vertices, the closed loop of
:math:`\sum_k w_k P_k` with :math:`\sum_k w_k K_k` is :math:`\sum_k w_k` times the closed loops at the vertices, so that
one constant Lyapunov matrix proves the level for every plant between the vertices, at any rate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lpvhinf.checks import Array, positive, read_only
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.lpv.bounded_real import frozen_norm
from lpvhinf.lpv.controller import VertexController
from lpvhinf.lpv.design import Design
from lpvhinf.lpv.plant_family import PlantFamily
from lpvhinf.lpv.result import LPVSynthesisResult
from lpvhinf.statespace.generalized import NAMES, GeneralizedPlant

#: Relative size below which a difference of matrices, or a distance, counts as zero.
SAME = 1e-9
#: Blends of the vertices at which the closed loop is looked at.
BLENDS = 32

Weights = Callable[[Array], Array]


def check_polytope(vertices: Array) -> None:
    """Check that points (N, n_p) are the vertices of a polytope with an interior.

    Raises
    ------
    AssumptionError
        If they lie in a plane of lower dimension, or one is a blend of the others.
    """
    from scipy.optimize import linprog

    N, n_p = vertices.shape
    if N == 1:
        return
    width = np.ptp(vertices, axis=0)
    scaled = (vertices - vertices.mean(axis=0)) / np.where(width > 0.0, width, 1.0)
    rank = int(np.linalg.matrix_rank(scaled, tol=1e-9))
    if rank < n_p:
        raise AssumptionError(
            f"the {N} vertices are no polytope in {n_p} dimensions: they span {rank}. Leave out scheduling variables "
            "that do not move, or give vertices on both sides of every axis."
        )
    for k in range(N):
        others = np.delete(scaled, k, axis=0)
        found = linprog(
            np.zeros(N - 1),
            A_eq=np.vstack([others.T, np.ones(N - 1)]),
            b_eq=np.concatenate([scaled[k], [1.0]]),
            bounds=(0.0, None),
            method="highs",
        )
        if found.status == 0:
            raise AssumptionError(
                f"points[{k}] = {vertices[k].tolist()} is no vertex of the polytope: it is a blend of the others. "
                "Leave it out (for points inside use method 'gridded')."
            )


def check_constant(family: PlantFamily) -> None:
    """Check that B2, C2, D12, D21 are the same at all vertices.

    Raises
    ------
    AssumptionError
        If one differs.
    """
    first = family.plants[0]
    lags = "Put fast lags where it acts, with lpvhinf.lpv.with_constant_channels(plants, omega)"
    weights = "Take a constant weight"
    for name, remedy in (("B2", lags), ("C2", lags), ("D12", weights), ("D21", weights)):
        ours = getattr(first, name)
        for p, plant in zip(family.points, family.plants, strict=True):
            change = float(np.max(np.abs(getattr(plant, name) - ours), initial=0.0))
            if change > SAME * max(float(np.max(np.abs(ours), initial=0.0)), 1e-300):
                raise AssumptionError(
                    f"{name} at the vertex {p.tolist()} differs from that at {family.points[0].tolist()} by "
                    f"{change:.3g}; polytopic synthesis wants constant B2, C2, D12, D21. {remedy}, or use method "
                    "'gridded' with these points and some between them (without a basis R and S are constant too)."
                )


def with_constant_channels(plants: Sequence[GeneralizedPlant], omega: float) -> list[GeneralizedPlant]:
    r"""Plants whose B2 and C2 are constant: first-order lags of bandwidth `omega` take what varies into A.

    .. math::

        \dot x = A x + B_1 w + B_2(p)\, u_f, \quad \dot u_f = \omega (u - u_f), \qquad
        \dot v = \omega (C_2(p)\, x - v), \quad y = v + D_{21} w

    A lag is added only where B2, or C2, differs between the plants. What reaches z and y directly is not delayed, so
    D12 and D21 keep their rank. The lags are part of the model: take omega well above the closed loop's bandwidth, and
    verify the controller on the plants without them.

    Parameters
    ----------
    plants : sequence of GeneralizedPlant
    omega : float
        Bandwidth of the lags [rad/s].

    Raises
    ------
    DomainError
        If `omega` is not positive.
    """
    fast = positive("omega", omega, "rad/s")
    first = plants[0]
    vary_B, vary_C = (any(np.any(getattr(P, name) != getattr(first, name)) for P in plants) for name in ("B2", "C2"))
    out = []
    for P in plants:
        A, B1, B2, C1, C2 = P.A, P.B1, P.B2, P.C1, P.C2
        if vary_B:
            n, m = B2.shape
            A = np.block([[A, B2], [np.zeros((m, n)), -fast * np.eye(m)]])
            B1 = np.vstack([B1, np.zeros((m, P.n_w))])
            B2 = np.vstack([np.zeros((n, m)), fast * np.eye(m)])
            C1, C2 = np.hstack([C1, np.zeros((P.n_z, m))]), np.hstack([C2, np.zeros((P.n_y, m))])
        if vary_C:
            k, n = C2.shape
            A = np.block([[A, np.zeros((n, k))], [fast * C2, -fast * np.eye(k)]])
            B1, B2 = np.vstack([B1, np.zeros((k, P.n_w))]), np.vstack([B2, np.zeros((k, P.n_u))])
            C1, C2 = np.hstack([C1, np.zeros((P.n_z, k))]), np.hstack([np.zeros((k, n)), np.eye(k)])
        out.append(GeneralizedPlant(A, B1, B2, C1, C2, P.D11, P.D12, P.D21, P.D22))
    return out


def polytope_weights(vertices: Array) -> Weights:
    r"""Continuous weights w(p) >= 0 with :math:`\sum_k w_k = 1` and :math:`\sum_k w_k v_k = p`.

    Products of linear functions for the corners of a box, barycentric coordinates for a simplex, else the weights of
    least squared sum.

    Parameters
    ----------
    vertices : (N, n_p)

    Returns
    -------
    callable
        p (n_p,) -> (N,); it raises a `DomainError` outside the polytope.

    Examples
    --------
    >>> polytope_weights(np.array([[0.0], [2.0]]))(np.array([0.5])).tolist()
    [0.75, 0.25]
    """
    N, n_p = vertices.shape
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    width = high - low
    if N == 1:
        return lambda p: np.ones(1)
    at_corner = np.isclose(vertices, low) | np.isclose(vertices, high)
    if 2**n_p == N and np.all(at_corner) and np.all(width > 0.0):
        upper = np.isclose(vertices, high)

        def multilinear(p: Array) -> Array:
            s = _inside((p - low) / width, p)
            return np.asarray(np.prod(np.where(upper, s, 1.0 - s), axis=1))

        return multilinear
    middle, size = vertices.mean(axis=0), np.where(width > 0.0, width, 1.0)
    E = np.vstack([((vertices - middle) / size).T, np.ones(N)])

    def least_squares(p: Array) -> Array:
        from scipy.optimize import nnls

        f = np.concatenate([(p - middle) / size, [1.0]])
        if n_p + 1 == N:
            w = np.linalg.solve(E, f)
        else:
            heavy = 1e5
            w, _ = nnls(np.vstack([heavy * E, np.eye(N)]), np.concatenate([heavy * f, np.zeros(N)]))
            used = w > 1e-9
            w[used] = np.linalg.lstsq(E[:, used], f, rcond=None)[0]
        if np.any(w < -1e-9) or np.max(np.abs(E @ w - f)) > 1e-7:
            raise DomainError(f"p = {p.tolist()} is outside the polytope of the vertices. Keep inside, or enlarge it.")
        w = np.maximum(w, 0.0)
        return np.asarray(w / w.sum())

    return least_squares


def blended_plant(family: PlantFamily, weights: Array) -> GeneralizedPlant:
    """sum_k w_k P_k."""
    parts = [sum(w * getattr(P, name) for w, P in zip(weights, family.plants, strict=True)) for name in NAMES]
    return GeneralizedPlant(*[np.asarray(part) for part in parts])


def self_scheduled(
    family: PlantFamily, made: Design, result: LPVSynthesisResult, weights: Weights | None, box: Array
) -> LPVSynthesisResult:
    """The result with the blend of the vertex controllers in place of the explicit controller.

    Raises
    ------
    DimensionError
        If given weights are not one number a vertex.
    """
    controllers = tuple(made.controller.matrices(p) for p in family.points)
    blend = polytope_weights(family.points) if weights is None else _checked(weights, len(family.points))
    controller = VertexController(vertices=controllers, weights=blend, box=read_only(box))
    shares = np.random.default_rng(0).dirichlet(np.ones(len(family.points)), BLENDS)
    norms = []
    for w in shares:
        K = tuple(np.tensordot(w, np.stack([c[k] for c in controllers]), 1) for k in range(4))
        norms.append(frozen_norm(*blended_plant(family, w).close(*K)))
    return replace(
        result,
        controller=controller,
        points_between=read_only(shares @ family.points),
        frozen_norms_between=read_only(norms),
        between="blend of the vertices",
    )


def _checked(weights: Weights, n: int) -> Weights:
    def checked(p: Array) -> Array:
        w = np.asarray(weights(p), dtype=float).reshape(-1)
        if w.shape != (n,):
            raise DimensionError(f"weights({p.tolist()}) has {w.size} entries, wanted {n}: one for each vertex.")
        if np.any(w < -1e-9) or abs(float(w.sum()) - 1.0) > 1e-9:
            raise DomainError(f"weights({p.tolist()}) is {w.tolist()}, wanted numbers of at least 0 of sum 1.")
        return w

    return checked


def _inside(s: Array, p: Array) -> Array:
    if np.any(s < -1e-9) or np.any(s > 1.0 + 1e-9):
        raise DomainError(f"p = {p.tolist()} is outside the box of the vertices. Keep inside, or enlarge it.")
    return np.clip(s, 0.0, 1.0)
