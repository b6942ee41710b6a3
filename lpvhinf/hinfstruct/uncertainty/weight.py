"""An uncertainty weight that covers given plants, and the check that it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct.response import Response
from lpvhinf.hinfstruct.uncertainty.deviation import deviation, resonance_grid
from lpvhinf.hinfstruct.uncertainty.magnitude_fit import fit_above, realize


@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage:
    """The largest ratio of a deviation to the weight: at most one where the weight covers.

    Attributes
    ----------
    ratio : float
    omega : float
        rad/s, where it is attained.
    index : int
        Number of the system.
    n_frequencies, n_systems : int
        What was looked at: nothing is said about other ones.
    """

    ratio: float
    omega: float
    index: int
    n_frequencies: int
    n_systems: int

    @property
    def covered(self) -> bool:
        """Whether every deviation looked at lies below the weight."""
        return self.ratio <= 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class UncertaintyWeight:
    r"""A scalar weight W and units L, R of a set of plants, such as :math:`\{G_{nom} + L\, W \Delta\, R\}`.

    :math:`\Delta` is any stable system with :math:`\|\Delta\|_\infty < 1`.

    Attributes
    ----------
    A, B, C, D : (order, order), (order, 1), (1, order), (1, 1)
        Stable and minimum-phase.
    kind : "additive", "input" or "output"
    left, right : (n,) or None
        Diagonals of L and R; None for ones.
    largest_excess, mean_excess : float
        Ratio of the weight to what had to be covered, over the frequencies of the fit (floor included).
    """

    A: Array
    B: Array
    C: Array
    D: Array
    kind: str
    left: Array | None
    right: Array | None
    largest_excess: float
    mean_excess: float

    @property
    def order(self) -> int:
        """Number of states of one channel."""
        return len(self.A)

    def magnitude(self, omega: ArrayLike) -> Array:
        """|W(j omega)|, (n_omega,)."""
        response = Response(self.A, self.B, self.C, self.D)
        return np.asarray(np.abs(response.at(finite_array("omega", omega, (None,)))[:, 0, 0]))

    def covers(self, nominal: Any, systems: Sequence[Any], omega: ArrayLike | None = None) -> Coverage:
        """Compare the weight with the deviations of systems, also of ones that it was not fitted to.

        Parameters
        ----------
        nominal, systems
            As for `uncertainty_weight`.
        omega : (n_omega,), optional
            rad/s, above zero; default a spread over the poles of the systems with ten points on each resonance.
        """
        grid = _default_grid(systems) if omega is None else _frequencies(omega)
        sizes = deviation(nominal, systems, grid, kind=self.kind, left=self.left, right=self.right)
        ratios = sizes / self.magnitude(grid)
        index, k = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
        return Coverage(
            ratio=float(ratios[index, k]),
            omega=float(grid[k]),
            index=int(index),
            n_frequencies=len(grid),
            n_systems=len(systems),
        )


def uncertainty_weight(
    nominal: Any,
    systems: Sequence[Any],
    omega: ArrayLike,
    *,
    kind: str = "additive",
    order: int = 4,
    margin: float = 1.05,
    floor: float = 1e-3,
    left: ArrayLike | None = None,
    right: ArrayLike | None = None,
) -> UncertaintyWeight:
    r"""A stable minimum-phase weight above the deviations of systems from a nominal one.

    .. math:: |W(j\omega)| \ge \bar\sigma\big(E_k(j\omega)\big) \quad \text{for all } k, \omega, \qquad
              G_k = G_{nom} + L E_k R \text{ (additive)}

    What is wanted is the largest deviation times `margin`, nowhere less than `floor` times its maximum. The largest
    ratio of the weight to it is made small by a local search, see `magnitude_fit`. The weight covers what was
    looked at: check with `covers` on a finer grid, and for positions that were not fitted.

    Parameters
    ----------
    nominal : system, or a sequence of N systems
        One for all, or one for each of the systems.
    systems : sequence of N systems
        Such as the plant frozen at positions.
    omega : (n_omega,) rad/s, above zero
        Lightly damped poles of the systems between the smallest and the largest are added.
    kind : "additive", "input" or "output"
    order : int
        Of W.
    margin : float
        At least one: room for what lies between frequencies and positions.
    floor : float
        Above zero: so far below its maximum the deviation need not be followed.
    left, right : (n,) optional
        Units of the channels on either side of Delta.

    Raises
    ------
    DomainError, DimensionError, AssumptionError
        If an argument is out of its range, sizes disagree, or a deviation is not of this kind.

    Examples
    --------
    Gains between 0.5 and 1.5 instead of 1 are an input uncertainty of 50 %.

    >>> lag = [([[-1.0]], [[1.0]], [[gain]], [[0.0]]) for gain in (0.5, 1.0, 1.5)]
    >>> W = uncertainty_weight(lag[1], lag, np.geomspace(0.1, 10.0, 20), kind="input", order=0, margin=1.02)
    >>> round(float(W.D[0, 0]), 6), W.covers(lag[1], lag).covered
    (0.51, True)
    """
    whole_number("order", order, 0)
    if not (np.isfinite(margin) and margin >= 1.0):
        raise DomainError(f"margin is {margin!r}, wanted at least 1.")
    if not 0.0 < floor <= 1.0:
        raise DomainError(f"floor is {floor!r}, wanted a number above 0 and at most 1.")
    units = [
        None if unit is None else read_only(finite_array(n, unit)) for n, unit in (("left", left), ("right", right))
    ]
    given = _frequencies(omega)
    grid = np.unique(np.concatenate([given, resonance_grid(systems, given[0], given[-1], per_decade=1)]))
    sizes = np.max(deviation(nominal, systems, grid, kind=kind, left=units[0], right=units[1]), axis=0)
    largest = float(np.max(sizes))
    if largest == 0.0:
        raise DomainError("no system deviates from the nominal one, so there is nothing to cover.")
    wanted = margin * np.maximum(sizes, floor * largest)
    fitted = fit_above(grid, wanted, order)
    A, B, C, D = realize(fitted)
    # the realisation is what counts: its own round-off is covered as well
    reached = np.abs(Response(A, B, C, D).at(grid)[:, 0, 0])
    gain = max(1.0, float(np.max(wanted / reached)))
    excess = gain * reached / wanted
    return UncertaintyWeight(
        A=read_only(A),
        B=read_only(B),
        C=read_only(gain * C),
        D=read_only(gain * D),
        kind=kind,
        left=units[0],
        right=units[1],
        largest_excess=float(np.max(excess)),
        mean_excess=float(np.exp(np.mean(np.log(excess)))),
    )


def _frequencies(omega: ArrayLike) -> Array:
    grid = np.unique(finite_array("omega", omega, (None,)))
    if len(grid) < 2 or grid[0] <= 0.0:
        raise DomainError(
            f"omega has {len(grid)} different entries from {grid.min(initial=np.inf):.3g} rad/s, wanted at least 2, "
            "all above 0."
        )
    return grid


def _default_grid(systems: Sequence[Any]) -> Array:
    from lpvhinf.statespace.interop import state_space_matrices

    sizes = np.concatenate([np.abs(np.linalg.eigvals(state_space_matrices(system)[0])) for system in systems])
    sizes = sizes[sizes > 1e-9 * np.max(sizes, initial=1e-300)]
    low, high = (0.01 * float(np.min(sizes)), 100.0 * float(np.max(sizes))) if len(sizes) else (0.01, 100.0)
    return resonance_grid(systems, low, high, per_decade=100)
