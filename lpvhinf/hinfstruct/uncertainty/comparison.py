"""The same controller structure tuned three ways: nominal, for several models, and against the uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lpvhinf.checks import Array, points_in_box, read_only
from lpvhinf.hinfstruct.plant_families import PlantFamily, as_family
from lpvhinf.hinfstruct.position_search import worst_over_box
from lpvhinf.hinfstruct.solve import hinfstruct
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.hinfstruct.uncertainty.channel import UncertainPlant
from lpvhinf.hinfstruct.uncertainty.robust_design import hinfstruct_robust, robust_gains
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedDesign:
    """One way of tuning.

    Attributes
    ----------
    parameters : (n_parameters,)
    gamma_nominal : float
        Norm with the nominal plant.
    gamma_robust : float
        Largest gain over the whole uncertainty; infinite if not robustly stable.
    stability : float
        Norm from d to q; below one if robustly stable.
    gamma_worst, worst_position
        Largest norm found over the positions of the true plant, and where.
    """

    parameters: Array
    gamma_nominal: float
    gamma_robust: float
    stability: float
    gamma_worst: float
    worst_position: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Designs by their names: "nominal", "multi-model" and "uncertainty"."""

    designs: dict[str, ComparedDesign]

    def table(self) -> str:
        """The figures as a Markdown table."""
        lines = ["| design | nominal | worst position | robust | d to q |", "|---|---|---|---|---|"]
        lines += [
            f"| {name} | {d.gamma_nominal:.4g} | {d.gamma_worst:.4g} | {d.gamma_robust:.4g} | {d.stability:.4g} |"
            for name, d in self.designs.items()
        ]
        return "\n".join(lines)


def compare_designs(
    plants: LPVGeneralizedPlant | PlantFamily,
    uncertain: UncertainPlant,
    controller: ControllerStructure,
    positions: Array,
    *,
    starts: int = 3,
    seed: int = 0,
    scaling_order: int = 1,
    n_search: int = 64,
    progress: Progress = SILENT,
    **options: Any,
) -> Comparison:
    r"""Tune a structure for the nominal plant, for frozen plants, and against the uncertainty that covers them.

    For every design where the weight covers the plants over P,

    .. math:: \text{nominal} \le \sup_{\|\Delta\|_\infty < 1} \text{ and } \sup_{p \in P} \le
              \sup_{\|\Delta\|_\infty < 1}:

    the uncertainty design pays for plants that do not exist, and holds for positions that nobody looked at.

    Parameters
    ----------
    plants : LPVGeneralizedPlant or a family such as FrozenFamily
        The true plant over P, with the channels of `uncertain.nominal`.
    uncertain : UncertainPlant
        The nominal plant with its uncertainty.
    controller : ControllerStructure
    positions : (N, n_p)
        Of the multi-model design.
    starts, seed
        Of the nominal and the multi-model design.
    scaling_order : 0 or 1
    n_search : int
        Positions of the search for the worst one.
    progress : Progress
    **options
        Handed to `hinfstruct`.
    """
    family = as_family(plants)
    points = points_in_box(positions, family.box, name="positions")
    nominal = hinfstruct(uncertain.nominal, controller, starts=starts, seed=seed, progress=progress, **options)
    start = np.asarray(nominal.parameters)
    several = hinfstruct(
        family.sample(points), controller, points=points, initial=start, starts=starts, seed=seed, progress=progress,
        **options,
    )  # fmt: skip
    # of both starts the one that is better against the uncertainty
    sets = [start, np.asarray(several.parameters)]
    first = min(sets, key=lambda theta: _key(uncertain, controller, theta))
    robust = hinfstruct_robust(
        uncertain, controller, initial=first, scaling_order=scaling_order, seed=seed, progress=progress, **options
    )
    designs = {}
    for name, theta in (("nominal", start), ("multi-model", sets[1]), ("uncertainty", np.asarray(robust.parameters))):
        gains = robust_gains([uncertain], controller, theta)
        worst = worst_over_box(family, controller, theta, n_search=n_search, seed=seed + 1, known=points)
        designs[name] = ComparedDesign(
            parameters=read_only(theta),
            gamma_nominal=gains.nominal,
            gamma_robust=gains.gain,
            stability=gains.stability,
            gamma_worst=worst.gamma,
            worst_position=worst.position,
        )
    return Comparison(designs=designs)


def _key(uncertain: UncertainPlant, controller: ControllerStructure, theta: Array) -> tuple[float, float]:
    gains = robust_gains([uncertain], controller, theta)
    # a start must stabilise the nominal plant
    return (gains.gain, gains.stability) if np.isfinite(gains.nominal) else (np.inf, np.inf)
