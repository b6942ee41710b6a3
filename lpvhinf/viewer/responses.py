r"""Singular values and poles of a stored design's loop on a grid of positions.

All in the scaled units of the design, in which the expected error of every axis is 1. With the unweighted loop's e =
-S w1, e = -S G w2 and e = -S G_F w3:

* S: largest singular value of the sensitivity;
* SG: of the process sensitivity, from accelerations at the rigid-body inputs to e;
* SGF: likewise, from forces on the controlled modes;
* L: largest and smallest singular value of :math:`S^{-1} - I`, the open loop at e with the observer's loop closed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.response import Complex, Response, largest_sigma
from lpvhinf.progress import Progress
from lpvhinf.stored_design import StoredDesign

CURVES = ("S", "SG", "SGF", "L", "Lmin")
PER_MODE, WIDTH = 13, 0.03  # frequencies about each mode, and how far they reach
LOWEST, HIGHEST, N_EVEN = 1.0, 2000.0, 220  # Hz
FLOOR = -200.0  # dB: less is not drawn
BATCH = 32


@dataclass(frozen=True, kw_only=True, eq=False)
class Responses:
    """Of one design at N positions.

    Attributes
    ----------
    decibels : dict of CURVES to (N, n_f)
        20 log10 of singular values.
    poles : list of N arrays
        Closed-loop poles of the upper half plane, real ones included [1/s].
    """

    decibels: dict[str, Array]
    poles: list[Complex]

    @property
    def abscissa(self) -> Array:
        """Largest real part of the poles at every position (N,) [1/s]."""
        return np.array([float(np.max(poles.real)) for poles in self.poles])


def frequencies(designs: list[StoredDesign]) -> Array:
    """Frequencies of the page (n_f,) [Hz]: logarithmic, denser about the modes of all plants."""
    modes = np.unique(np.concatenate([np.round(eigenfrequencies(design), 3) for design in designs]))
    highest = max(HIGHEST, 1.3 * float(np.max(modes, initial=0.0)))
    around = modes[:, None] * (1.0 + WIDTH * np.linspace(-1.0, 1.0, PER_MODE) ** 3)
    return np.unique(np.concatenate([np.geomspace(LOWEST, highest, N_EVEN), around.ravel()]))


def eigenfrequencies(design: StoredDesign) -> Array:
    """Of the flexible modes of a stored plant [Hz]."""
    A = design.plant.A.sample(np.mean(design.box, axis=1)[None])[0]
    found = np.abs(np.linalg.eigvals(A)[::1])
    return np.unique(np.round(found[found > 1e-3 * np.max(found, initial=1.0)], 6)) / (2.0 * np.pi)


def responses(design: StoredDesign, points: Array, hertz: Array, progress: Progress) -> Responses:
    """Singular values and poles at positions (N, n_p) and frequencies (n_f,) [Hz]."""
    n_rb = len(design.f_bw)
    out = {name: np.empty((len(points), len(hertz))) for name in CURVES}
    poles: list[Complex] = []
    for first in range(0, len(points), BATCH):
        for k, system in enumerate(zip(*design.closed_loop.sample(points[first : first + BATCH]), strict=True)):
            found = one(design, system, 2.0 * np.pi * hertz, n_rb)
            for name, values in found.items():
                out[name][first + k] = values
            eigenvalues: Complex = np.linalg.eigvals(system[0]).astype(complex)
            upper = eigenvalues[eigenvalues.imag >= 0.0]
            poles.append(upper[np.argsort(np.abs(upper))])
            progress.update()
    return Responses(decibels=out, poles=poles)


def one(design: StoredDesign, system: tuple[Array, ...], omega: Array, n_rb: int) -> dict[str, Array]:
    """All curves of one frozen loop, in dB."""
    A, B, C, D = system
    so, si = design.arrays["scaling_output"][:n_rb], design.arrays["scaling_input"]
    n_u = B.shape[1] - n_rb  # rigid-body inputs, then one for each controlled mode
    right = np.concatenate([1.0 / so, si[:n_u]])
    T = Response(A, B * right, so[:, None] * C[:n_rb], so[:, None] * D[:n_rb] * right).at(omega)
    S = -T[:, :, :n_rb]
    L = np.asarray(np.linalg.inv(S) - np.eye(n_rb))
    sigma = {
        "S": largest_sigma(np.asarray(S)),
        "SG": largest_sigma(T[:, :, n_rb : 2 * n_rb]),
        "SGF": largest_sigma(T[:, :, 2 * n_rb :]),
        "L": largest_sigma(np.asarray(L, dtype=complex)),
        "Lmin": np.linalg.svd(L, compute_uv=False)[:, -1],
    }
    with np.errstate(divide="ignore"):
        return {name: np.maximum(20.0 * np.log10(values), FLOOR) for name, values in sigma.items()}
