"""What a controller costs at every sample: states, and multiplications of its blocks as they would be implemented."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array, positive
from lpvhinf.codesign.design import Design
from lpvhinf.controllers import band_pass
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.problems import Gain

# Entries, or coefficients of entries, below this fraction of the largest one of their matrix are zeros.
NEGLIGIBLE = 1e-13
F_SAMPLE = 10e3  # [Hz]


@dataclass(frozen=True, kw_only=True, eq=False)
class Complexity:
    """The cost of one sample of a controller, behind decoupled and scaled signals that every architecture needs.

    Attributes
    ----------
    states : int
        Order of the controller.
    blocks : mapping of str to int
        Multiplications of every block: "integrators", "K_RB", "band-pass" with the gains xi, and of the observer
        "dynamics", "outputs" C_o(p) x + D_o(p) u, and "correction" L nu.
    scheduled_entries : int
        Entries of matrices that depend on p.
    scheduling : int
        Multiplications that evaluate these entries at p as the polynomials that they are: one for every coefficient
        but the constant one, and those of the Chebyshev polynomials. A table with interpolation needs far fewer.
    """

    states: int
    blocks: Mapping[str, int]
    scheduled_entries: int
    scheduling: int

    @property
    def multiplications(self) -> int:
        """Multiplications per sample with all matrices at hand; `scheduling` comes on top."""
        return sum(self.blocks.values())


def complexity(design: Design, *, f_sample: float = F_SAMPLE) -> Complexity:
    """Count the multiplications of a design's controller per sample.

    Every block is discretised by a zero-order hold and counted by itself: entries of its matrices that are neither 0
    nor 1 or -1. The structure is used: K_RB axis by axis, the modes of the observer one by one.

    Parameters
    ----------
    design : Design
    f_sample : [Hz]

    Raises
    ------
    DomainError
        If the sampling frequency is not above zero.
    """
    period = 1.0 / positive("f_sample", f_sample, "Hz")
    assembly = design.assembly
    tuned, observer, n_rb = assembly.tuned_parts(design.parameters), assembly.observer, assembly.plant.n_rb
    centre = np.mean(assembly.plant.box, axis=1)
    A, B, C, _ = (at(matrix, centre) for matrix in tuned.K_RB)
    blocks = {"integrators": n_rb, "K_RB": sampled(A, B, period) + multiplications(C)}
    moving: list[Gain] = list(tuned.K_RB)
    if observer is not None:
        A, B, C, _ = band_pass(observer.omega, observer.Q)
        model = observer.model
        assert tuned.L is not None
        assert tuned.xi is not None
        blocks["band-pass"] = sampled(A, B, period) + multiplications(C) + observer.n_flex
        blocks["dynamics"] = sampled(at(model.A, centre), at(model.B, centre), period)
        blocks["outputs"] = multiplications(largest(model.C)) + multiplications(largest(model.D))
        blocks["correction"] = multiplications(largest(tuned.L))
        moving += [model.A, model.B, model.C, model.D, tuned.L, tuned.xi]
    entries, scheduling, degree = 0, 0, np.zeros(len(assembly.plant.box), dtype=int)
    for matrix in moving:
        if isinstance(matrix, ChebyshevMatrix) and not matrix.is_constant:
            terms = coefficients_beyond_the_constant(matrix)
            entries += int(np.sum(terms > 0))
            scheduling += int(np.sum(terms))
            degree = np.maximum(degree, matrix.degree)
    if entries:
        # T_k = 2 x T_(k-1) - T_(k-2): one multiplication each with 2 x at hand, then their products over the axes
        scheduling += int(np.sum(degree)) + (int(np.prod(degree + 1)) if np.sum(degree > 0) > 1 else 0)
    return Complexity(states=design.controller.n_x, blocks=blocks, scheduled_entries=entries, scheduling=scheduling)


def at(matrix: Gain, p: Array) -> Array:
    """A matrix at one position."""
    return matrix.at(p) if isinstance(matrix, ChebyshevMatrix) else np.asarray(matrix)


def largest(matrix: Gain) -> Array:
    """The entries of a matrix; of one that depends on p the largest coefficients, 0 where it is zero everywhere."""
    if not isinstance(matrix, ChebyshevMatrix):
        return np.asarray(matrix)
    if matrix.is_constant:
        return np.asarray(matrix.coefficients.reshape(matrix.shape))
    magnitude = np.max(np.abs(matrix.coefficients), axis=tuple(range(matrix.n_p)))
    moves = coefficients_beyond_the_constant(matrix) > 0
    return np.where(moves & (magnitude == 1.0), 2.0, magnitude)  # a one that moves is none


def multiplications(matrix: Array) -> int:
    """Entries that are neither zero nor one in size."""
    size = np.abs(matrix)
    return int(np.sum((size > NEGLIGIBLE * np.max(size, initial=0.0)) & (np.abs(size - 1.0) > NEGLIGIBLE)))


def sampled(A: Array, B: Array, period: float) -> int:
    """Multiplications of x+ = A_d x + B_d u behind a zero-order hold."""
    n, m = B.shape
    whole = np.zeros((n + m, n + m))
    whole[:n, :n], whole[:n, n:] = A, B
    held = scipy.linalg.expm(whole * period)
    return multiplications(held[:n, :n]) + multiplications(held[:n, n:])


def coefficients_beyond_the_constant(matrix: ChebyshevMatrix) -> Array:
    """How many coefficients of every entry are not negligible, the constant one not counted."""
    size = np.abs(matrix.coefficients).reshape(-1, *matrix.shape)
    return np.asarray(np.sum(size[1:] > NEGLIGIBLE * np.max(size, initial=0.0), axis=0))
