"""The claims of the paper, in its order: what it says, where, and which studies measure it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from studies.claims_measured import (
    ERROR,
    FEEDFORWARD,
    OUTPUT,
    Measured,
    both_observers_damp,
    complexity_costs_performance,
    decoupling_hides_modes,
    error_damps,
    error_is_cheaper,
    error_is_limited,
    feedforward_spares_modes,
    flexibility_limits,
    full_loop_is_shaped,
    loops_are_coupled,
    output_damps,
    output_performs_better,
    similar_bandwidth,
    trade_off,
    validated,
)


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim of the paper.

    Attributes
    ----------
    where, claim : str
        Part of the paper, and what it says.
    needs : tuple of str
        Studies whose reports are needed to measure it.
    measure : callable
        From the reports, by the names of the studies.
    """

    where: str
    claim: str
    needs: tuple[str, ...]
    measure: Callable[[dict[str, Any]], Measured]

    def measured(self, reports: dict[str, Any]) -> Measured:
        """What the reports say of it."""
        missing = [name for name in self.needs if name not in reports]
        return Measured(margin=f"run the study {', '.join(missing)}") if missing else self.measure(reports)


def beyond_these_studies(_: dict[str, Any]) -> Measured:
    """Of a claim that no study measures."""
    return Measured(margin="no gain-scheduled design in these studies: the observers schedule C(p), gains are constant")


CLAIMS = (
    Claim(
        where="abstract",
        claim="position-dependent flexible dynamics severely limit what rigid-body control attains",
        needs=(OUTPUT,),
        measure=flexibility_limits,
    ),
    Claim(
        where="abstract, conclusions",
        claim="two extensions of rigid-body control damp position-dependent flexible dynamics actively",
        needs=(ERROR,),
        measure=both_observers_damp,
    ),
    Claim(
        where="abstract, conclusions",
        claim="co-design shapes the full closed loop by structured H-infinity synthesis",
        needs=(ERROR,),
        measure=full_loop_is_shaped,
    ),
    Claim(
        where="abstract",
        claim="effective in simulation on a high-fidelity model of a moving-magnet planar actuator",
        needs=(OUTPUT, ERROR),
        measure=validated,
    ),
    Claim(
        where="V-A",
        claim="the output-based observer damps the flexible mode",
        needs=(OUTPUT,),
        measure=output_damps,
    ),
    Claim(
        where="V-A",
        claim="both approaches achieve similar rigid-body bandwidth",
        needs=(OUTPUT,),
        measure=similar_bandwidth,
    ),
    Claim(
        where="V-A",
        claim="modes decoupled by the extended decoupling leave the rigid-body loop, which allows more bandwidth",
        needs=(OUTPUT,),
        measure=decoupling_hides_modes,
    ),
    Claim(
        where="III, for V-A",
        claim="decoupled flexible modes are not excited by the feedforward",
        needs=(FEEDFORWARD,),
        measure=feedforward_spares_modes,
    ),
    Claim(
        where="V-A",
        claim="active control of resonances allows better closed-loop performance than the conventional approach",
        needs=(ERROR,),
        measure=output_performs_better,
    ),
    Claim(
        where="V-B",
        claim="the error-based observer couples the syntheses of K_RB and K_FM through e",
        needs=(ERROR,),
        measure=loops_are_coupled,
    ),
    Claim(
        where="V-B",
        claim="the error-based observer damps the mode actively",
        needs=(ERROR,),
        measure=error_damps,
    ),
    Claim(
        where="V-B",
        claim="error-based, a trade-off between the rigid-body loop and the suppression of the mode",
        needs=(ERROR,),
        measure=trade_off,
    ),
    Claim(
        where="V-B",
        claim="the error-based observer achieves less than the output-based one",
        needs=(ERROR,),
        measure=error_is_limited,
    ),
    Claim(
        where="introduction, conclusions",
        claim="the error-based observer is attractive computationally",
        needs=(ERROR,),
        measure=error_is_cheaper,
    ),
    Claim(
        where="conclusions",
        claim="the reduction in complexity comes at the cost of closed-loop performance",
        needs=(ERROR,),
        measure=complexity_costs_performance,
    ),
    Claim(
        where="conclusions",
        claim="the approach extends to LPV synthesis, beyond the reach of LTI designs",
        needs=(),
        measure=beyond_these_studies,
    ),
)
