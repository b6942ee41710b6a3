"""The peaks of a frequency response: a grid placed by the poles, then refinement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.response import Response, largest_sigma

#: Offsets in half widths |Re lambda| around the frequency of a lightly damped pole.
OFFSETS = np.array([-4.0, -1.5, -0.6, 0.0, 0.6, 1.5, 4.0])
#: A pole counts as lightly damped below this damping ratio.
LIGHT = 0.35
#: Frequencies to a decade that are looked at for a plateau, and their distance from a peak, in units of its logarithm.
PER_DECADE, APART = 4.0, 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """Local maxima of the largest singular value, the largest first.

    Attributes
    ----------
    omega : (k,) rad/s, may be 0 and infinity
    sigma : (k,)
    """

    omega: Array
    sigma: Array


def frequency_grid(poles: np.ndarray, extra: Array) -> Array:
    """Sorted frequencies (N,), 0 and infinity included, that no peak should slip through."""
    upper = poles[poles.imag >= 0.0]
    size = np.maximum(np.abs(upper), 1e-12)
    light = -upper.real < LIGHT * size
    resonant = upper[light]
    around = resonant.imag[:, None] + np.abs(resonant.real)[:, None] * OFFSETS
    rest = size[~light]
    low, high = (float(np.min(size)), float(np.max(size))) if size.size else (1.0, 1.0)
    decades = np.log10(high / low) + 2.0
    background = np.geomspace(0.1 * low, 10.0 * high, int(np.clip(6 * decades, 12, 60)))
    grid = np.concatenate([[0.0], np.abs(around).ravel(), rest, background, extra])
    return np.append(np.unique(grid[np.isfinite(grid)]), np.inf)


def find_peaks(T: Response, *, extra: Array, fraction: float = 0.7, floor: float = 0.0) -> Peaks:
    """All local maxima of the largest singular value above a fraction of the largest.

    Parameters
    ----------
    T : Response
        Of a stable system.
    extra : (k,) rad/s
        Frequencies to look at besides, such as earlier peaks.
    fraction : float
        Peaks below this fraction of the largest one are left out.
    floor : float
        Peaks below this value are left out, except the largest.
    """
    omega = frequency_grid(T.poles, extra)
    values = T.at(omega)
    # the Frobenius norm bounds sigma from both sides: most points need no eigenvalue
    upper = np.sqrt(np.sum(values.real**2 + values.imag**2, axis=(1, 2)))
    smaller = max(1, min(values.shape[1:]))
    lower = np.max(upper, initial=0.0) / np.sqrt(smaller)
    wanted = 0.7 * max(fraction * lower, min(floor, lower))
    sigma = upper
    exact = np.flatnonzero(upper >= wanted)
    if smaller > 1:
        sigma = upper.copy()
        sigma[exact] = largest_sigma(values[exact])
    top = float(np.max(sigma[exact], initial=0.0))
    if top == 0.0:
        return Peaks(np.zeros(1), np.zeros(1))
    # a peak between grid points may be higher than its neighbours: refine with a margin
    keep = 0.75 * max(fraction * top, min(floor, top))
    padded = np.concatenate([[-np.inf], sigma, [-np.inf]])
    maximal = (sigma >= padded[:-2]) & (sigma > padded[2:]) & (sigma >= keep)
    index = np.flatnonzero(maximal)
    interior = index[(index > 0) & (index < omega.size - 2)]
    ends = index[(index == 0) | (index >= omega.size - 2)]
    where, height = _refine(T, omega[interior - 1], omega[interior], omega[interior + 1], sigma[interior])
    where, height = np.concatenate([where, omega[ends]]), np.concatenate([height, sigma[ends]])
    order = np.argsort(-height, kind="stable")
    where, height = where[order], height[order]
    chosen = height >= max(fraction * height[0], min(floor, height[0]))
    return Peaks(where[chosen], height[chosen])


def plateau(T: Response, peaks: Array, level: float) -> Array:
    """Frequencies away from the peaks at which the largest singular value is above a level, (k,) rad/s.

    Where a minimiser has flattened the response, any frequency of the plateau becomes a peak after a small step.
    """
    omega = _background(T.poles)
    proper = peaks[np.isfinite(peaks) & (peaks > 0.0)]
    far = np.all(np.abs(np.log(omega[:, None] / proper)) > APART, axis=1)
    omega = omega[far]
    return omega[largest_sigma(T.at(omega)) >= level] if omega.size else omega


def _background(poles: np.ndarray) -> Array:
    """Some frequencies to a decade, around the range of the poles."""
    size = np.maximum(np.abs(poles), 1e-12)
    low, high = (0.1 * float(np.min(size)), 10.0 * float(np.max(size))) if size.size else (0.1, 10.0)
    return np.geomspace(low, high, int(np.clip(PER_DECADE * np.log10(high / low), 6, 24)))


def _slope(T: Response, omega: Array) -> tuple[Array, Array]:
    """Largest singular values and q = sigma' / sigma^3, which is linear in omega at a single resonance."""
    values, change = T.at(omega), T.derivative(omega)
    if values.shape[1] <= values.shape[2]:
        _, vectors = np.linalg.eigh(values @ values.conj().transpose(0, 2, 1))
        u = vectors[:, :, -1]
        row = np.einsum("ki,kij->kj", u.conj(), values)
        sigma = np.sqrt(np.sum(np.abs(row) ** 2, axis=1))
        moved = np.einsum("ki,kij,kj->k", u.conj(), change, row.conj()).real
    else:
        _, vectors = np.linalg.eigh(values.conj().transpose(0, 2, 1) @ values)
        v = vectors[:, :, -1]
        column = np.einsum("kij,kj->ki", values, v)
        sigma = np.sqrt(np.sum(np.abs(column) ** 2, axis=1))
        moved = np.einsum("ki,kij,kj->k", column.conj(), change, v).real
    return sigma, moved / np.maximum(sigma, 1e-150) ** 4


def _refine(T: Response, a: Array, b: Array, c: Array, sigma_b: Array, steps: int = 7) -> tuple[Array, Array]:
    """Maxima within the brackets a < b < c, by a safeguarded regula falsi on the slope."""
    if b.size == 0:
        return b, sigma_b
    best, height = b.copy(), sigma_b.copy()
    sigma, q_b = _slope(T, b)
    rising = q_b > 0.0
    low, high = np.where(rising, b, a), np.where(rising, c, b)
    _, q_other = _slope(T, np.where(rising, c, a))
    q_low, q_high = np.where(rising, q_b, q_other), np.where(rising, q_other, q_b)
    side = np.zeros(b.size, dtype=int)
    for step in range(steps):
        with np.errstate(divide="ignore", invalid="ignore"):
            share = q_low / (q_low - q_high)
        proper = (q_low > 0.0) & (q_high < 0.0) & np.isfinite(share)
        share = np.where(proper, np.clip(share, 1e-3, 1.0 - 1e-3) if step < 2 else share, 0.5)
        x = low + share * (high - low)
        sigma, q = _slope(T, x)
        better = sigma > height
        best, height = np.where(better, x, best), np.where(better, sigma, height)
        up = q > 0.0
        # Illinois: the end that stays twice has its slope halved
        q_high = np.where(up & (side == 1), 0.5 * q_high, q_high)
        q_low = np.where(~up & (side == -1), 0.5 * q_low, q_low)
        low, q_low = np.where(up, x, low), np.where(up, q, q_low)
        high, q_high = np.where(up, high, x), np.where(up, q_high, q)
        side = np.where(up, 1, -1)
        if np.all((high - low <= 1e-9 * high) | (np.abs(q) * sigma**2 * (high - low) <= 1e-9)):
            break
    return best, height
