"""Structured synthesis against dynamic uncertainty: controller and scalings tuned together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only, whole_number
from lpvhinf.errors import DimensionError, DomainError, SynthesisError
from lpvhinf.hinfstruct.solve import hinfstruct
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.hinfstruct.uncertainty.channel import UncertainPlant
from lpvhinf.hinfstruct.uncertainty.robust_gain import RobustGain, robust_gain
from lpvhinf.hinfstruct.uncertainty.small_gain import WithScalings, scaled_plant
from lpvhinf.progress import SILENT, Progress

if TYPE_CHECKING:
    import control

#: A first level where the nominal design is not robustly stable, relative to its norm.
FIRST_LEVEL = 3.0
#: And by how much that level is raised while no robustly stable controller is found.
RAISE = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class RobustRound:
    """One synthesis at one level.

    Attributes
    ----------
    level : float
        The gamma that performance outputs were divided by.
    scaled_norm : float
        Exact norm with the tuned scalings: at most one proves the robust gain `level`.
    gain : float
        Robust gain of the controller with the best scaling at each frequency.
    """

    level: float
    scaled_norm: float
    gain: float


@dataclass(frozen=True, kw_only=True, eq=False)
class RobustResult:
    r"""A structured controller tuned against dynamic uncertainty.

    Attributes
    ----------
    parameters : (n_parameters,)
        theta of the controller's structure.
    controller : control.StateSpace
        K with u = + K y.
    gamma_robust : float
        Largest gain over :math:`\|\Delta\|_\infty \le 1`, see `RobustGain`; infinite if not robustly stable.
    gamma_nominal : float
        Exact norm for Delta = 0.
    stability : float
        Exact norm from d to q; the loop is stable for all :math:`\|\Delta\|_\infty` below its reciprocal.
    rounds : tuple of RobustRound
    status : str
    """

    parameters: Array
    controller: control.StateSpace
    gamma_robust: float
    gamma_nominal: float
    stability: float
    rounds: tuple[RobustRound, ...]
    status: str

    def __repr__(self) -> str:
        return (
            f"RobustResult(gamma_robust={self.gamma_robust:.5g}, gamma_nominal={self.gamma_nominal:.5g}, "
            f"stability={self.stability:.4g}, status={self.status!r})"
        )


def hinfstruct_robust(
    plants: UncertainPlant | Sequence[UncertainPlant],
    controller: ControllerStructure,
    *,
    scaling_order: int = 1,
    scaling_frequency: float | None = None,
    initial: ArrayLike | None = None,
    rounds: int = 6,
    tolerance: float = 0.01,
    starts: int = 3,
    seed: int = 0,
    progress: Progress = SILENT,
    **options: Any,
) -> RobustResult:
    r"""Tune a structured controller for the largest gain over all dynamic uncertainty of size one.

    .. math:: \min_\theta \sup_{\|\Delta\|_\infty < 1} \| F_l(F_u(P, \Delta), K(\theta)) \|_\infty

    For a level gamma, theta and a scaling D(s) are tuned together for the smallest norm of the scaled loop with
    its performance outputs divided by gamma. The robust gain of what comes out, with the best scaling at each
    frequency, is the next level, until it falls no further. The scaling is common to all plants, and of order
    zero or one: the robust gain of the result is computed with a free one.

    Parameters
    ----------
    plants : UncertainPlant or a sequence of them
        The largest robust gain counts; equal channels.
    controller : ControllerStructure
    scaling_order : 0 or 1
        Of D(s). A constant one is cheaper to tune, and costs performance where the uncertainty is large in a band
        only: 6.6 against 4.2 for a beam with three flexible modes.
    scaling_frequency : float, optional
        rad/s, where corners of D(s) start; default the peak of the nominal design's robust gain.
    initial : (n_parameters,), optional
        A start of the controller; default a design for the nominal plants.
    rounds : int
        Levels at most.
    tolerance : float
        Relative decrease of the robust gain that is worth another round.
    starts : int
        Random starts of the nominal design, if there is no `initial`.
    seed : int
    progress : Progress
    **options
        Handed to `hinfstruct`, such as time_limit or max_iterations.

    Raises
    ------
    DimensionError, DomainError
        If sizes disagree, or a number is out of its range.
    SynthesisError
        If no controller stabilises the nominal plants.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> from lpvhinf.hinfstruct.uncertainty import uncertain_plant, uncertainty_weight
    >>> from lpvhinf.statespace.generalized import GeneralizedPlant
    >>> lags = [([[1.0]], [[1.0]], [[gain]], [[0.0]]) for gain in (0.8, 1.0, 1.2)]
    >>> W = uncertainty_weight(lags[1], lags, [0.1, 10.0], kind="input", order=0)
    >>> P = GeneralizedPlant([[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...                      [[0.0, 0.0], [0.0, 0.0]], [[0.0], [1.0]], [[0.0, 1.0]])
    >>> result = hinfstruct_robust(uncertain_plant(P, W), StaticGain(1, 1), starts=1)
    >>> result.stability < 1.0, result.gamma_nominal < result.gamma_robust
    (True, True)
    """
    models = [plants] if isinstance(plants, UncertainPlant) else list(plants)
    if not models or len({(m.n_d, m.n_q) for m in models}) > 1:
        raise DimensionError(f"plants holds {len(models)} plants, wanted at least one, and channels of one size.")
    whole_number("rounds", rounds, 1)
    positive("tolerance", tolerance)
    if scaling_order not in (0, 1):
        raise DomainError(f"scaling_order is {scaling_order!r}, wanted 0 or 1.")
    n = controller.n_parameters
    if initial is None:
        progress.stage("nominal design")
        nominal = hinfstruct(
            [m.nominal for m in models], controller, starts=starts, seed=seed, progress=progress, **options
        )
        theta = np.asarray(nominal.parameters)
    else:
        theta = finite_array("initial", initial, (n,))
    best, found = theta, robust_gains(models, controller, theta)
    if not np.isfinite(found.nominal):
        raise SynthesisError("initial does not stabilise the nominal plants. Leave it out, or tune it for them first.")
    level = found.gain if np.isfinite(found.gain) else FIRST_LEVEL * found.nominal
    unit = scaling_frequency if scaling_frequency is not None else found.omega
    unit = positive("scaling_frequency", unit, "rad/s") if np.isfinite(unit) and unit > 0.0 else 1.0
    scaled = WithScalings(controller, models[0].n_d, models[0].n_q, scaling_order, unit)
    gain = found.scaling if np.isfinite(found.scaling) else 1.0
    extra = np.concatenate([[np.log(gain)], np.zeros(2 * scaling_order)])
    records: list[RobustRound] = []
    status = "stopped by rounds before the robust gain settled; the controller is valid. Raise rounds."
    for number in range(rounds):
        progress.stage(f"robust design, round {number + 1}, level {level:.4g}")
        run = hinfstruct(
            [scaled_plant(m, level) for m in models],
            scaled,
            initial=np.concatenate([theta, extra]),
            starts=0,
            seed=seed,
            progress=progress,
            **options,
        )
        theta, extra = scaled.split(np.asarray(run.parameters))
        here = robust_gains(models, controller, theta)
        records.append(RobustRound(level=level, scaled_norm=run.gamma, gain=here.gain))
        progress.log(f"level {level:.4g}: scaled norm {run.gamma:.4g}, robust gain {here.gain:.4g}")
        before = found
        if here.gain < found.gain or (not np.isfinite(found.gain) and here.stability < found.stability):
            best, found = theta, here
        if not np.isfinite(found.gain):
            level *= RAISE
            continue
        # a little below what is reached: the scaling tends to settle at the level that it was tuned for
        level = found.gain * float(np.sqrt(min(1.0, run.gamma)))
        if np.isfinite(before.gain) and found.gain > (1.0 - tolerance) * before.gain:
            status = (
                "the robust gain settled at a local minimum. Raise starts or scaling_order to look for a better one."
            )
            break
    if not np.isfinite(found.gain):
        status = (
            f"not robustly stable: the norm from d to q is {found.stability:.4g}, wanted below 1. The uncertainty is "
            "too large for this structure: raise the order of the weight, lower its margin, or cover fewer positions."
        )
    import control

    return RobustResult(
        parameters=read_only(best),
        controller=control.ss(*controller.realize(best)),
        gamma_robust=found.gain,
        gamma_nominal=found.nominal,
        stability=found.stability,
        rounds=tuple(records),
        status=status,
    )


def robust_gains(plants: Sequence[UncertainPlant], controller: ControllerStructure, theta: Array) -> RobustGain:
    """The largest robust gain over uncertain plants; nominal norm and norm from d to q are the largest, too."""
    K = controller.realize(theta)
    each = [robust_gain(*m.plant.close(*K), n_d=m.n_d, n_q=m.n_q) for m in plants]
    worst = max(each, key=lambda r: (r.gain, r.stability))
    return RobustGain(
        gain=worst.gain,
        omega=worst.omega,
        scaling=worst.scaling,
        nominal=max(r.nominal for r in each),
        stability=max(r.stability for r in each),
    )
