"""What a design achieves, measured on closed loops with the plant model itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign.design import Design
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.hinfstruct.response import Complex, Response, largest_sigma
from lpvhinf.progress import SILENT, Progress

BATCH = 64  # positions whose plant gains are held at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class Measures:
    """Figures of one design at N positions, in scaled units.

    Attributes
    ----------
    points : (N, n_p) [m]
    crossover : (N, n_rb) [Hz]
        First 0 dB crossing of every diagonal loop gain, from above; NaN where there is none.
    sensitivity_peak : (N,)
        Exact norm of S.
    flexible_peak : (N, n_flex)
        Exact norm of the process sensitivity from each flexible-mode input to e: 1 is the static output at the
        position where the mode is best seen. Its peak may be a discarded mode's, which u_FM excites as well.
    mode_peak : (N, n_flex)
        Largest gain of the same transfer within half an octave of the mode's own frequency.
    damping : (N, n_flex)
        Damping ratio of the pole that takes the largest part in each controlled mode.
    discarded_damping : (N,)
        Smallest damping ratio of a pole that belongs to the discarded modes.
    """

    points: Array
    crossover: Array
    sensitivity_peak: Array
    flexible_peak: Array
    mode_peak: Array
    damping: Array
    discarded_damping: Array


def measure(design: Design, points: Array, *, progress: Progress = SILENT) -> Measures:
    """Measure a design at positions (N, n_p)."""
    plant = design.assembly.plant
    n_rb, n_flex = plant.n_rb, plant.n_flex
    omega_flex = plant.omega[n_rb : n_rb + n_flex]
    rows = []
    for start in range(0, len(points), BATCH):
        for A, B, C, D in design.frozen(points[start : start + BATCH]):
            e, w1 = slice(0, n_rb), slice(0, n_rb)
            w3 = range(2 * n_rb, 2 * n_rb + n_flex)
            peaks = [hinf_norm(A, B[:, [k]], C[e], D[e][:, [k]]).norm for k in w3]
            response = Response(A, B[:, 2 * n_rb :], C[e], D[e, 2 * n_rb :])
            own = [peak_near(response, k, w) for k, w in enumerate(omega_flex)]
            controlled, rest = mode_damping(design, A)
            rows.append(
                (
                    crossovers(design, A, B[:, w1], C[e], D[e, w1]),
                    hinf_norm(A, B[:, w1], C[e], D[e, w1]).norm,
                    np.array(peaks),
                    np.array(own),
                    controlled,
                    rest,
                )
            )
            progress.update()
    columns = list(zip(*rows, strict=True))
    return Measures(
        points=points,
        crossover=np.array(columns[0]),
        sensitivity_peak=np.array(columns[1]),
        flexible_peak=np.array(columns[2]).reshape(len(points), n_flex),
        mode_peak=np.array(columns[3]).reshape(len(points), n_flex),
        damping=np.array(columns[4]).reshape(len(points), n_flex),
        discarded_damping=np.array(columns[5]),
    )


def peak_near(response: Response, column: int, omega: float) -> float:
    """Largest gain from one input within half an octave of omega [rad/s], on a grid that follows the poles."""
    low, high = omega / np.sqrt(2.0), omega * np.sqrt(2.0)
    poles = response.poles[(response.poles.imag > low) & (response.poles.imag < high)]
    around = poles.imag[:, None] + np.abs(poles.real)[:, None] * np.linspace(-3.0, 3.0, 61)
    grid = np.unique(np.clip(np.concatenate([np.geomspace(low, high, 200), around.ravel()]), low, high))
    return float(np.max(np.linalg.norm(response.at(grid)[:, :, column], axis=1)))


def crossovers(design: Design, A: Array, B: Array, C: Array, D: Array) -> Array:
    """First downward 0 dB crossing [Hz] of each diagonal loop gain, from the loop -S = (A, B, C, D)."""
    f_bw = design.assembly.scaling.f_bw
    omega = 2 * np.pi * np.geomspace(0.05 * np.min(f_bw), 20.0 * np.max(f_bw), 600)
    S = -Response(A, B, C, D).at(omega)
    gains = np.abs(np.diagonal(np.linalg.inv(S) - np.eye(S.shape[1]), axis1=1, axis2=2))
    out = np.full(gains.shape[1], np.nan)
    for i, gain in enumerate(gains.T):
        below = np.flatnonzero((gain[:-1] >= 1.0) & (gain[1:] < 1.0))
        if len(below):
            k = below[0]
            x = np.log(gain[k]) / np.log(gain[k] / gain[k + 1])
            out[i] = np.exp((1 - x) * np.log(omega[k]) + x * np.log(omega[k + 1])) / (2 * np.pi)
    return out


def mode_damping(design: Design, A: Array) -> tuple[Array, float]:
    """Damping ratios of the controlled modes, and the smallest one among the discarded, by participation.

    A pole belongs to the mode in whose plant states it takes the largest part, the product of right and left
    eigenvectors.
    """
    plant = design.assembly.plant
    poles, V = np.linalg.eig(A)
    part = np.abs(V * np.linalg.inv(V).T)
    n_rb, n_modes = plant.n_rb, plant.n_modes
    per_mode = part[0 : 2 * n_modes : 2] + part[1 : 2 * n_modes : 2]  # (n_modes, n_poles)
    zeta = np.where(np.abs(poles) > 0.0, -poles.real / np.maximum(np.abs(poles), 1e-300), 1.0)
    oscillating = np.abs(poles.imag) > 0.0
    owners = [np.argmax(np.where(oscillating, row, 0.0)) for row in per_mode[n_rb:]]
    damping = zeta[owners]
    n_flex = plant.n_flex
    return damping[:n_flex], float(np.min(damping[n_flex:], initial=np.inf))


def largest_real_part(design: Design, points: Array, *, progress: Progress = SILENT) -> Array:
    """Largest real part of the closed-loop poles [rad/s] at positions (N, n_p), with the plant model itself."""
    out = []
    for start in range(0, len(points), BATCH):
        for A, _, _, _ in design.frozen(points[start : start + BATCH]):
            out.append(float(np.max(np.linalg.eigvals(A).real)))
            progress.update()
    return np.array(out)


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockResponses:
    """Largest singular values of the six blocks S, SG1, SG2, KS, KSG1, KSG2 (unweighted, scaled units).

    Attributes
    ----------
    omega : (n_omega,) [rad/s]
    sigma : (N, 2, 3, n_omega)
    """

    omega: Array
    sigma: Array


def block_responses(design: Design, points: Array, omega: Array) -> BlockResponses:
    """The six blocks of the unweighted M at positions (N, n_p); without observer the third column is measured too."""
    plant = design.assembly.plant
    n_rb, n_flex = plant.n_rb, plant.n_flex
    rows = (slice(0, n_rb), slice(n_rb, 2 * n_rb))
    columns = (slice(0, n_rb), slice(n_rb, 2 * n_rb), slice(2 * n_rb, 2 * n_rb + n_flex))
    sigma = np.empty((len(points), 2, 3, len(omega)))
    for start in range(0, len(points), BATCH):
        for k, (A, B, C, D) in enumerate(design.frozen(points[start : start + BATCH])):
            T: Complex = Response(A, B, C, D).at(omega)
            for i, row in enumerate(rows):
                for j, column in enumerate(columns):
                    sigma[start + k, i, j] = largest_sigma(T[:, row, column])
    return BlockResponses(omega=omega, sigma=sigma)


def bounds(design: Design, omega: Array) -> Array:
    """The inverse shaping filters 1 / (|W_z| |W_w|) per block, (2, 3, n_omega): smallest over the axes.

    With gamma = 1 every block would lie below its bound.
    """
    filters = design.assembly.filters
    W_z = [np.max(np.abs(filters.W_z1(omega)), axis=1), np.max(np.abs(filters.W_z2(omega)), axis=1)]
    one = np.ones(len(omega))
    W_w = [one, one, np.max(np.abs(filters.W_w3(omega)), axis=1, initial=0.0)]
    with np.errstate(divide="ignore"):
        return np.array([[1.0 / (z * w) for w in W_w] for z in W_z])
