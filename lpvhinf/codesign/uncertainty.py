r"""The flexible modes as dynamic uncertainty around the rigid body, for the conventional design.

The rigid-body plant is the same at every position, :math:`(\omega_{bw}/s)^2` in scaled units; everything else, the
modes whose gains move with p included, becomes :math:`W \Delta` with :math:`\|\Delta\|_\infty < 1`, from what acts on
the rigid-body inputs to the rigid-body outputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, points_in_box, whole_number
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.errors import DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.hinfstruct.uncertainty import (
    Coverage,
    UncertainPlant,
    UncertaintyWeight,
    uncertain_plant,
    uncertainty_weight,
)
from lpvhinf.hinfstruct.uncertainty.deviation import deviation, resonance_grid
from lpvhinf.problems import Loop, four_block
from lpvhinf.statespace.lpv import LPVStateSpace

System = tuple[Array, Array, Array, Array]

#: Frequencies of the fit reach from below the bandwidth to above the highest mode by these factors.
BELOW, ABOVE = 0.1, 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class FlexibleUncertainty:
    """The conventional 4-block problem with the flexible modes as uncertainty.

    Attributes
    ----------
    problem : UncertainPlant
        With the channels of the 4-block problem: `hinfstruct_robust` tunes K_RB for it.
    weight : UncertaintyWeight
    nominal : (A, B, C, D)
        The scaled rigid-body plant.
    omega : (n_omega,)
        rad/s, of the fit.
    coverage : Coverage
        At the positions of the check, at most one unless the exchange ran out of rounds.
    """

    problem: UncertainPlant
    weight: UncertaintyWeight
    nominal: System
    omega: Array
    coverage: Coverage

    def covers(self, assembly: Assembly, points: ArrayLike, *, per_decade: int = 200) -> Coverage:
        """Compare the weight with the plant at other positions, between the ends of the fit's frequencies."""
        systems = rigid_body_systems(assembly, points_in_box(points, assembly.plant.box, name="points"))
        grid = resonance_grid(systems, self.omega[0], self.omega[-1], per_decade=per_decade)
        return self.weight.covers(self.nominal, systems, grid)


def rigid_body_systems(assembly: Assembly, points: Array) -> list[System]:
    """The scaled plant itself from the rigid-body inputs to the rigid-body outputs at positions (N, n_p)."""
    n, out = assembly.plant.n_rb, []
    for loop in assembly.frozen_loops(points):
        A, B, C, D = (m[0] for m in loop.plant.sample(np.mean(assembly.plant.box, axis=1)[None]))
        out.append((A, B[:, :n], C[:n], D[:n, :n]))
    return out


def flexible_uncertainty(
    assembly: Assembly,
    points: ArrayLike,
    *,
    order: int = 4,
    margin: float = 1.1,
    per_decade: int = 20,
    n_check: int = 128,
    rounds: int = 5,
) -> FlexibleUncertainty:
    """The 4-block problem of a conventional design with the flexible modes as additive uncertainty.

    Parameters
    ----------
    assembly : Assembly
        With the architecture "rigid-body" and no delay.
    points : (N, n_p)
        Positions that the weight is fitted to; check others with `covers`.
    order, margin : int, float
        Of the weight, see `uncertainty_weight`.
    per_decade : int
        Frequencies of the fit beside the resonances; ten times as many at the check.
    n_check, rounds : int
        Positions of a spread over P that the weight is checked at; those beyond it join the fit, which is repeated
        so many times at most.

    Raises
    ------
    DomainError
        If the architecture is another one, there is a delay, or a position lies outside of P.
    """
    if assembly.architecture != "rigid-body" or assembly.specification.delay > 0.0:
        raise DomainError(
            f"architecture is {assembly.architecture!r} with a delay of {assembly.specification.delay} s; wanted "
            "'rigid-body' without delay: an observer's model holds some of the modes."
        )
    plant, box = assembly.plant, assembly.plant.box
    n = plant.n_rb
    systems = rigid_body_systems(assembly, points_in_box(points, box, name="points"))
    A, B, C, _ = systems[0]
    rigid = slice(0, 2 * n)  # the modes come first; their gains are the same everywhere
    nominal = (A[rigid, rigid], B[rigid], C[:, rigid], np.zeros((n, n)))
    low = BELOW * 2.0 * np.pi * float(np.min(assembly.scaling.f_bw))
    omega = resonance_grid(systems, low, ABOVE * float(np.max(plant.omega)), per_decade=per_decade)
    others = rigid_body_systems(assembly, spread_points(box, whole_number("n_check", n_check, 1), seed=1))
    grid = resonance_grid(others, omega[0], omega[-1], per_decade=10 * per_decade)
    sizes = deviation(nominal, others, grid)
    for _ in range(whole_number("rounds", rounds, 1)):
        weight = uncertainty_weight(nominal, systems, omega, order=order, margin=margin)
        ratios = sizes / weight.magnitude(grid)
        beyond = np.flatnonzero(np.max(ratios, axis=1) > 1.0)
        if len(beyond) == 0:
            break
        # the worst position, and the worst at each frequency: neighbours are covered with them
        worst = {int(k) for k in np.argmax(ratios, axis=0)} & {int(k) for k in beyond}
        systems = systems + [others[k] for k in sorted(worst)]
    loop = Loop(plant=LPVStateSpace.from_system(nominal, box), filters=assembly.filters, n_rb=n)
    problem = four_block(loop).at(np.mean(box, axis=1))
    # w1 adds to the plant's output, w2 to its input
    uncertain = uncertain_plant(problem, weight, y=slice(0, n), enters_as=slice(0, n), adds=slice(n, 2 * n))
    return FlexibleUncertainty(
        problem=uncertain, weight=weight, nominal=nominal, omega=omega, coverage=weight.covers(nominal, others, grid)
    )
