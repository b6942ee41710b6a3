r"""Positions and frequencies at which a claimed L2 gain is exceeded, with proof.

For u of length one and :math:`x \approx (j\omega I - A)^{-1} B u` the gain is at least :math:`|C x + D u| - |C| |e|`,
where e, the error of x, is bounded by the residual and an approximate inverse Y of :math:`j\omega I - A`:
:math:`\|e\| \le \|Y r\| / (1 - \|I - Y(j\omega I - A)\|)`, all norms the maximum norm.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np

from lpvhinf.certify.cells import Point, grid_points
from lpvhinf.certify.claim import Claim, Refutation
from lpvhinf.certify.loop import LoopMatrix
from lpvhinf.certify.positive_definite import gamma as rounding
from lpvhinf.certify.system import CanonicalSystem
from lpvhinf.checks import Array
from lpvhinf.statespace import LPVStateSpace

STEPS = 12  # intervals per axis of the grid of positions that is looked at; fewer for many axes
FREQUENCIES = 24
NEAR = 0.8  # a grid's largest gain below this share of the bound is not looked into more closely
ZOOMS = 12


@dataclass(frozen=True, eq=False, kw_only=True)
class LargeGain:
    """A frequency and a position at which the frozen system's gain is at least `gain`, proved.

    Attributes
    ----------
    position : (n_p,) rounded
    exact_position : as rationals
    omega : [rad/s]
    gain : lower bound of the largest singular value
    """

    position: Array
    exact_position: tuple[Fraction, ...]
    omega: float
    gain: float


def large_gain(system: LPVStateSpace, canonical: CanonicalSystem, claim: Claim) -> Refutation | None:
    """A refutation at the worst of a grid of positions and frequencies, or None."""
    assert claim.gamma is not None
    steps = min(STEPS, max(1, int(400 ** (1.0 / system.n_p))))
    best = _worst(system, claim.box, grid_points(system.n_p, steps))
    reach = Fraction(1, steps)
    for _ in range(ZOOMS):
        if best is None or not NEAR * claim.gamma <= best[0] < claim.gamma:
            break
        better = _worst(system, claim.box, _around(best[1], reach))
        reach /= 2
        best = better if better is not None and better[0] > best[0] else best
    if best is None or best[0] < claim.gamma:
        return None
    evidence = _prove(canonical, claim.box, best[1], best[2])
    if evidence is None or not evidence.gain >= claim.gamma:
        return None
    return Refutation(claim=claim, evidence=evidence)


def _around(point: Point, reach: Fraction) -> list[Point]:
    """Neighbours inside the box, `reach` away along some of the axes."""
    steps = product((-reach, Fraction(0), reach), repeat=len(point.centre))
    moved = (tuple(c + s for c, s in zip(point.centre, step)) for step in steps)
    return [Point(c) for c in moved if max(map(abs, c)) <= 1]


def _worst(system: LPVStateSpace, box: Array, cells: list[Point]) -> tuple[float, Point, float] | None:
    """The largest gain at the points and a set of frequencies, with its point and frequency."""
    points = np.array([cell.rounded(box) for cell in cells])
    best: tuple[float, Point, float] | None = None
    for cell, A, B, C, D in zip(cells, *system.sample(points)):
        poles, V = np.linalg.eig(A)
        span = np.abs(poles)
        spread = np.geomspace(max(span.min(), 1e-6) / 10.0, 10.0 * span.max() + 1e-6, FREQUENCIES)
        omegas = np.concatenate([[0.0], span, spread])
        try:
            left = np.linalg.solve(V, B.astype(complex))
        except np.linalg.LinAlgError:
            continue
        response = ((C @ V)[None] / (1j * omegas[:, None, None] - poles)) @ left + D
        if not np.all(np.isfinite(response)) or 0 in D.shape:
            continue
        gains = np.linalg.svd(response, compute_uv=False)[:, 0]
        k = int(np.argmax(gains))
        if best is None or gains[k] > best[0]:
            best = (float(gains[k]), cell, float(omegas[k]))
    return best


def _prove(system: CanonicalSystem, box: Array, point: Point, omega: float) -> LargeGain | None:
    """A proved lower bound of the gain at a point."""
    loop = LoopMatrix(system, box, gamma=2.0)
    local = loop.local(point, 1)
    n, n_u = loop.n_x, loop.n_u
    K, E = local.terms[0], local.remainder
    A, B, C, D = K[:n, :n], K[:n, n : n + n_u], K[n + n_u :, :n], K[n + n_u :, n : n + n_u]
    eA, eB, eC, eD = E[:n, :n], E[:n, n : n + n_u], E[n + n_u :, :n], E[n + n_u :, n : n + n_u]
    F = 1j * omega * np.eye(n) - A
    try:
        Y = np.linalg.inv(F)
    except np.linalg.LinAlgError:
        return None
    u = np.linalg.svd(C @ Y @ B + D)[2][0].conj()
    x = Y @ (B @ u)
    g = 8.0 * rounding(4 * n + 4 * n_u + 16)
    size_u, size_x, size_F = np.abs(u), np.abs(x), np.abs(F)
    residual = np.abs(B @ u - F @ x) + eB @ size_u + eA @ size_x + g * (np.abs(B) @ size_u + size_F @ size_x)
    aY = np.abs(Y)
    defect = np.abs(np.eye(n) - Y @ F) + aY @ eA + g * (aY @ size_F)
    q = float(defect.sum(axis=1).max()) * (1.0 + 1e-10)
    if q >= 0.5:
        return None
    error = float((aY @ residual).max()) / (1.0 - q) * (1.0 + 1e-10)
    y = C @ x + D @ u
    wrong = eC @ size_x + eD @ size_u + g * (np.abs(C) @ size_x + np.abs(D) @ size_u)
    wrong = (wrong + (np.abs(C) + eC) @ np.full(n, error)) * (1.0 + 1e-10)
    least = float(np.linalg.norm(np.maximum(np.abs(y) - wrong, 0.0))) * (1.0 - 1e-10)
    gain = least / (float(np.linalg.norm(u)) * (1.0 + 1e-10))
    return LargeGain(position=point.rounded(box), exact_position=point.position(box), omega=omega, gain=gain)
