"""Design positions, and the search for the worst position over the continuum P."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.fitting import spread_points
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.hinfstruct.plant_families import FrozenFamily
from lpvhinf.hinfstruct.position_search import worst_over_box


def design_positions(box: Array, n: int, *, seed: int = 0) -> Array:
    """`n` positions: the corners, and an even spread whose spacing has nothing in common with a magnet pitch.

    A regular grid at the pitch of the magnets samples every ripple at the same phase and hides it.
    """
    corners = np.array(list(itertools.product(*box)))
    rest = max(0, n - len(corners))
    return np.vstack([corners[:n], spread_points(box, rest, seed)]) if rest else corners[:n]


@dataclass(frozen=True, kw_only=True, eq=False)
class WorstPosition:
    """The largest exact norm found over P.

    Attributes
    ----------
    gamma : float
    position : (n_p,)
    candidates : (k, n_p)
        The worst positions that lie apart from each other, worst first.
    gammas : (k,)
        Exact norms there.
    n_evaluated : int
        Exact norms.
    n_tracked : int
        Norms by tracked peaks.
    """

    gamma: float
    position: Array
    candidates: Array
    gammas: Array
    n_evaluated: int
    n_tracked: int


def plant_family(assembly: Assembly) -> FrozenFamily:
    """The synthesis problem with the plant model itself over P."""
    return FrozenFamily(assembly.generalized_plants, assembly.plant.box)


def norms_at(assembly: Assembly, theta: Array, points: Array) -> Array:
    """Exact norms of M with the plant model itself at positions (N, n_p); infinity where the loop is unstable."""
    plants = assembly.generalized_plants(points)
    gains = [assembly.structure.realize(theta, p) for p in points]
    return np.array([hinf_norm(*plant.close(*gain)).norm for plant, gain in zip(plants, gains, strict=True)])


def worst_position(
    assembly: Assembly,
    theta: Array,
    *,
    n_search: int = 128,
    n_refine: int = 3,
    seed: int = 1,
    known: Array | None = None,
) -> WorstPosition:
    """Search P for the largest norm, with the plant model itself; see `worst_over_box`.

    The value is a lower bound on the supremum over P, not a certificate.
    """
    found = worst_over_box(
        plant_family(assembly), assembly.structure, theta, n_search=n_search, n_refine=n_refine, seed=seed, known=known
    )
    return WorstPosition(
        gamma=found.gamma,
        position=found.position,
        candidates=found.candidates,
        gammas=found.gammas,
        n_evaluated=found.n_exact,
        n_tracked=found.n_cheap,
    )
