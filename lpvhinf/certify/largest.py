"""The strongest claim of a family that can be proved: the largest box, the fastest rate, the smallest gain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpvhinf.certify.claim import Certificate, Refutation, Undecided
from lpvhinf.certify.engine import l2_gain, stability
from lpvhinf.checks import Array, positive, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace import LPVStateSpace

Result = Certificate | Refutation | Undecided


@dataclass(frozen=True, eq=False, kw_only=True)
class Strongest:
    """The strongest claim of a family that was proved, and the weakest that was not.

    Attributes
    ----------
    value : float or None
        Share of the box, speed or gain of the proved claim; None if no claim that was tried is proved.
    proof : Certificate or None
    failed_value : float or None
        None if the strongest claim of all is proved.
    failed : Refutation, Undecided or None
        A refutation bounds what is true; where it is undecided, only the search ends there.
    n_tried : claims that were tried
    """

    value: float | None
    proof: Certificate | None
    failed_value: float | None
    failed: Refutation | Undecided | None
    n_tried: int


def centred_box(box: Array, share: float) -> Array:
    """The part of a box about its centre that has `share` of its width along every axis.

    Examples
    --------
    >>> centred_box(np.array([[-1.0, 3.0]]), 0.5)
    array([[0., 2.]])
    """
    middle, half = box.mean(axis=1), 0.5 * (box[:, 1] - box[:, 0])
    part = np.stack([middle - share * half, middle + share * half], axis=1)
    return np.asarray(np.clip(part, box[:, :1], box[:, 1:]))  # rounding must not leave the box


def largest_quadratic_box(
    system: LPVStateSpace,
    *,
    steps: int = 5,
    decay: float = 0.0,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> Strongest:
    """The largest part about the box's centre over which one Lyapunov matrix is proved, by bisection.

    Parameters
    ----------
    steps : bisections of the share of the width, after the whole box
    decay : [1/s]
    time_limit : [s] of each claim

    Examples
    --------
    >>> import lpvhinf as lh
    >>> A = [[[0.0, 1.0], [-1.0, -0.4]], [[0.0, 0.0], [0.6, 0.0]]]  # one P up to |p| = 0.653
    >>> G = lh.LPVStateSpace.from_coefficients(A, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> found = largest_quadratic_box(G, steps=3)
    >>> found.value, type(found.failed).__name__
    (0.625, 'Refutation')
    """

    def claim(share: float) -> Result:
        box = centred_box(system.box, share)
        return stability(system, kind="quadratic", box=box, decay=decay, time_limit=time_limit, progress=progress)

    return _strongest(claim, [1.0], 0.0, whole_number("steps", steps, 0), _arithmetic)


def largest_rate(
    system: LPVStateSpace,
    *,
    least: float,
    most: float,
    steps: int = 4,
    decay: float = 0.0,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> Strongest:
    """The largest speed v for which stability for all p(t) with dp/dt in [-v, v] on every axis is proved.

    Parameters
    ----------
    least, most : speeds between which it is looked for, by bisection of their logarithm
    steps : bisections
    decay : [1/s]
    time_limit : [s] of each claim

    Examples
    --------
    >>> import lpvhinf as lh
    >>> A = [[[0.0, 1.0], [-1.0, -0.4]], [[0.0, 0.0], [0.6, 0.0]]]
    >>> G = lh.LPVStateSpace.from_coefficients(A, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> largest_rate(G, least=0.01, most=0.1, steps=0).value
    0.1
    """
    _ordered("least", least, "most", most)

    def claim(speed: float) -> Result:
        return stability(system, kind="rate", rate=speed, decay=decay, time_limit=time_limit, progress=progress)

    return _strongest(claim, [least, most], None, whole_number("steps", steps, 0), _geometric)


def smallest_gain(
    system: LPVStateSpace,
    *,
    least: float,
    most: float,
    steps: int = 4,
    rate: float | None = None,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> Strongest:
    """The smallest proved bound of the L2 gain: of the frozen systems, or for speeds up to `rate`.

    Parameters
    ----------
    least, most : bounds between which it is looked for, by bisection of their logarithm
    steps : bisections
    rate : speed on every axis, or None
    time_limit : [s] of each claim

    Examples
    --------
    >>> import lpvhinf as lh
    >>> G = lh.LPVStateSpace.from_coefficients([[[-2.0]], [[1.0]]], [[1.0]], [[1.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> found = smallest_gain(G, least=0.9, most=1.2)  # the gain is 1 / (2 - p)
    >>> 1.0 < found.value < 1.02, found.failed_value < 1.0
    (True, True)
    """
    _ordered("least", least, "most", most)
    kind = "frozen" if rate is None else "rate"

    def claim(gamma: float) -> Result:
        return l2_gain(system, gamma, kind=kind, rate=rate, time_limit=time_limit, progress=progress)

    return _strongest(claim, [most, least], None, whole_number("steps", steps, 0), _geometric)


def _ordered(low: str, least: float, high: str, most: float) -> None:
    if positive(low, least) >= positive(high, most):
        raise DomainError(f"{low} is {least} and {high} is {most}, wanted {low} below {high}.")


def _arithmetic(a: float, b: float) -> float:
    return 0.5 * (a + b)


def _geometric(a: float, b: float) -> float:
    return float(np.sqrt(a * b))


def _strongest(
    claim: Callable[[float], Result],
    first: list[float],
    known: float | None,
    steps: int,
    middle: Callable[[float, float], float],
) -> Strongest:
    """Bisection between a value that is proved and one that is not.

    Parameters
    ----------
    first : values to begin with, the easiest first
    known : a value that needs no proof, such as a box without extent
    """
    value, proof, n_tried = None, None, 0
    failed_value: float | None = None
    failed: Refutation | Undecided | None = None

    def attempt(at: float) -> None:
        nonlocal value, proof, failed_value, failed, n_tried
        result = claim(at)
        n_tried += 1
        if isinstance(result, Certificate):
            value, proof = at, result
        else:
            failed_value, failed = at, result

    for at in first:
        attempt(at)
        if failed is not None:
            break
    for _ in range(steps):
        good = known if value is None else value
        if good is None or failed_value is None:
            break
        attempt(middle(good, failed_value))
    return Strongest(value=value, proof=proof, failed_value=failed_value, failed=failed, n_tried=n_tried)
