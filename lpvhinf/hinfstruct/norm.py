"""The exact H-infinity norm with its peak frequency."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.hinfstruct.peaks import find_peaks
from lpvhinf.hinfstruct.response import Response, largest_sigma

#: Relative accuracy of the norm.
TOLERANCE = 1e-8


@dataclass(frozen=True, kw_only=True)
class NormResult:
    """An H-infinity norm and where it is attained.

    Attributes
    ----------
    norm : float
        Infinity if A is not Hurwitz.
    omega : float
        rad/s; infinity where the feed-through is the peak, NaN if A is not Hurwitz.
    """

    norm: float
    omega: float


def hinf_norm(A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike) -> NormResult:
    r"""The H-infinity norm :math:`\sup_\omega \bar\sigma(C (j\omega I - A)^{-1} B + D)`.

    SLICOT's AB13DD proposes the peak. Its value counts only if the response
    evaluated there agrees and no grid point lies above it; otherwise (and without
    slycot) a Hamiltonian level-set iteration is run here.

    Parameters
    ----------
    A, B, C, D : (n, n), (n, n_w), (n_z, n), (n_z, n_w)

    Raises
    ------
    DimensionError, DomainError
        If sizes disagree or entries are not finite.

    References
    ----------
    Bruinsma and Steinbuch (1990), Systems & Control Letters 14, 287-293; Boyd and
    Balakrishnan (1990), Systems & Control Letters 15, 1-7.

    Examples
    --------
    >>> result = hinf_norm([[0.0, 1.0], [-1.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    >>> round(result.norm, 6), round(result.omega, 6)
    (5.025189, 0.989949)
    """
    a = finite_array("A", A, (None, None))
    n = a.shape[0]
    b, c = finite_array("B", B, (n, None)), finite_array("C", C, (None, n))
    d = finite_array("D", D, (c.shape[0], b.shape[1]))
    a = finite_array("A", a, (n, n))
    return exact_norm(a, b, c, d)


def exact_norm(
    A: Array, B: Array, C: Array, D: Array, response: Response | None = None, hints: Array | None = None
) -> NormResult:
    """`hinf_norm` without checks; `response` and frequencies `hints` known already may be passed."""
    T = Response(A, B, C, D) if response is None else response
    if T.abscissa >= 0.0:
        return NormResult(norm=np.inf, omega=np.nan)
    peaks = find_peaks(T, extra=np.zeros(0) if hints is None else hints, fraction=0.99)
    lower, omega = float(peaks.sigma[0]), float(peaks.omega[0])
    if A.shape[0] == 0 or lower == 0.0:
        return NormResult(norm=lower, omega=omega)
    proposal = slicot_peak(A, B, C, D)
    if proposal is not None:
        gain, frequency = proposal
        value = float(largest_sigma(T.at(np.array([frequency])))[0])
        if value > lower:
            lower, omega = value, frequency
        if abs(gain - lower) <= TOLERANCE * lower:
            return NormResult(norm=lower, omega=omega)
    for _ in range(30):
        found = above_level(A, B, C, D, T, lower * (1.0 + TOLERANCE))
        if found.size == 0:
            break
        better = find_peaks(T, extra=found, fraction=0.99)
        if better.sigma[0] <= lower * (1.0 + TOLERANCE):
            break
        lower, omega = float(better.sigma[0]), float(better.omega[0])
    return NormResult(norm=lower, omega=omega)


def slicot_peak(A: Array, B: Array, C: Array, D: Array) -> tuple[float, float] | None:
    """Norm and peak frequency by AB13DD, or None without slycot or after a failure."""
    try:
        import slycot
    except ImportError:
        return None
    n, m, p = A.shape[0], B.shape[1], C.shape[0]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            gain, frequency = slycot.ab13dd("C", "I", "S", "D", n, m, p, A, np.eye(n), B, C, D, 1e-10)[:2]
    except (slycot.exceptions.SlycotError, ValueError, ArithmeticError):
        return None
    if not np.isfinite(gain) or np.isnan(frequency):
        return None
    # SLICOT marks a peak at infinity by a negative or a huge frequency
    return float(gain), float(frequency) if 0.0 <= frequency < 1e300 else np.inf


def above_level(A: Array, B: Array, C: Array, D: Array, T: Response, level: float) -> Array:
    r"""Frequencies with a gain above `level`, one in each interval; empty if the norm is below it.

    :math:`\bar\sigma(T(j\omega)) = \gamma` exactly where :math:`j\omega` is an eigenvalue of the
    Hamiltonian matrix of the bounded real lemma. Eigenvalues near the axis are taken
    generously: a wrong candidate costs one evaluation, as all are evaluated.
    """
    n = A.shape[0]
    if n == 0:
        return np.zeros(0)
    balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    size = np.linalg.norm(B / scale[:, None])
    other = np.linalg.norm(C * scale)
    if size == 0.0 or other == 0.0:
        return np.zeros(0)
    # level one after scaling, with B and C of equal size
    weight = np.sqrt(other / (size * level))
    Bs, Cs, Ds = B / scale[:, None] * weight, C * scale / (level * weight), D / level
    gap = np.eye(D.shape[1]) - Ds.T @ Ds
    if np.min(np.linalg.eigvalsh(gap)) <= 0.0:
        return np.array([np.inf])
    RD, RB = np.linalg.solve(gap, Ds.T), np.linalg.solve(gap, Bs.T)
    F = balanced + Bs @ RD @ Cs
    H = np.block([[F, Bs @ RB], [-Cs.T @ (Cs + Ds @ RD @ Cs), -F.T]])
    eigenvalues = np.linalg.eigvals(H)
    near = np.abs(eigenvalues.real) <= 1e-4 * np.abs(eigenvalues) + 1e-10 * np.max(np.abs(eigenvalues))
    crossings = np.sort(np.unique(np.abs(eigenvalues[near].imag)))
    if crossings.size == 0:
        return np.zeros(0)
    edges = np.concatenate([[0.0], crossings, [2.0 * crossings[-1] + 1e-300]])
    candidates = np.concatenate([[0.0], crossings, 0.5 * (edges[1:] + edges[:-1])])
    return np.asarray(candidates[largest_sigma(T.at(candidates)) > level])
