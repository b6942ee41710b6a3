"""Unstable modes that no controller can move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError
from lpvhinf.hinfstruct.response import Complex
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Relative size of the smallest singular value of the Popov-Belevitch-Hautus matrix that counts as zero.
RANK = 1e-13


def immovable(A: Array, B: Array) -> Complex:
    r"""Modes with Re >= 0 that B does not reach: :math:`\mathrm{rank}\,[\lambda I - A, B] < n`.

    The test of Popov, Belevitch and Hautus. Only what is zero to round-off counts: a mode that is barely reached is
    left to the search.
    """
    n = A.shape[0]
    if n == 0:
        return np.zeros(0, dtype=complex)
    balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    Bs = B / scale[:, None]
    size = max(float(np.linalg.norm(balanced, 2)), 1e-300)
    columns = np.linalg.norm(Bs, axis=0)
    Bs = Bs[:, columns > 0.0] / columns[columns > 0.0] * size
    out = []
    for pole in np.linalg.eigvals(balanced):
        if pole.real >= -RANK * size and pole.imag >= 0.0:
            matrix = np.hstack([pole * np.eye(n) - balanced, Bs])
            if np.linalg.svd(matrix, compute_uv=False)[n - 1] <= n * RANK * size:
                out.append(pole)
    return np.array(out, dtype=complex)


def named(modes: Iterable[complex]) -> str:
    """Poles in words, a complex pair once."""
    words = [f"{m.real:.4g}" + (f" +- {m.imag:.4g}j" if m.imag > 0.0 else "") for m in modes if m.imag >= 0.0]
    return ", ".join(words) + " rad/s"


def check_movable(plants: Sequence[GeneralizedPlant]) -> None:
    """Raise an `AssumptionError` that names the modes of a plant that is not stabilisable or not detectable."""
    for i, P in enumerate(plants):
        for word, letter, modes, remedy in (
            ("stabilisable", "u does not reach", immovable(P.A, P.B2), "B2"),
            ("detectable", "y does not show", immovable(P.A.T, P.C2.T), "C2"),
        ):
            if modes.size:
                raise AssumptionError(
                    f"plants[{i}] is not {word}: {letter} its unstable mode(s) {named(modes)}, wanted none. No "
                    f"controller can move them; check {remedy}, or remove these modes (integrators of a weight: absorb "
                    "them, or shift them a little to the left)."
                )
