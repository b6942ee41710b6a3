"""A peak with several large singular values, as one function: the largest eigenvalue of a Hermitian matrix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.closed_loops import ClosedLoops
from lpvhinf.hinfstruct.gradient import PeakGain
from lpvhinf.hinfstruct.problem import Cut
from lpvhinf.hinfstruct.response import Complex

#: Gains below this count as zero (their logarithm must stay finite).
SMALLEST = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cluster:
    r"""The gain at a peak near a point: to first order the largest eigenvalue of
    :math:`\mathrm{diag}(\sigma) + \sum_k d_k G_k`.

    Every unit vector c over the cluster is a smooth function below it, with the value :math:`c^* \mathrm{diag}(\sigma)
    c` and the gradient :math:`c^* G_k c`. Where singular values coincide (six axes at zero frequency), a few of
    them describe the maximum badly; a family of cuts gives the one that matters after a step.

    Attributes
    ----------
    sigma : (r,) singular values
    slopes : (n, r, r) complex, Hermitian, derivatives in the parameters
    offset, height : float
        The function is log(gain + offset) + height.
    ascent : (n,)
        Gradient of what `height` stands for.
    label : callable
        c -> label of its cut.
    """

    sigma: Array
    slopes: Complex
    offset: float
    height: float
    ascent: Array
    label: Callable[[Complex], tuple[Any, ...]]

    def cut(self, c: Complex) -> Cut:
        """The smooth function of the unit vector c."""
        gain = max(float(np.sum(np.abs(c) ** 2 * self.sigma)), SMALLEST) + self.offset
        slope = ((self.slopes @ c) @ c.conj()).real
        label = self.label(np.trim_zeros(c, "b"))
        family = self if self.sigma.size > 1 else None
        return Cut(float(np.log(gain)) + self.height, slope / gain + self.ascent, label, family=family)

    def cuts(self) -> list[Cut]:
        """Every singular vector alone."""
        return [self.cut(c) for c in np.eye(self.sigma.size, dtype=complex)]

    def best(self, d: Array) -> Cut:
        """The function that is the largest, to first order, after the step d."""
        S = np.diag(self.sigma) + np.tensordot(d, self.slopes, axes=1)
        return self.cut(np.linalg.eigh(0.5 * (S + S.conj().T))[1][:, -1])


def cluster_at(
    gain: PeakGain,
    loops: ClosedLoops,
    theta: Array,
    plant: int,
    *,
    label: Callable[[Complex], tuple[Any, ...]],
    offset: float = 0.0,
    height: float = 0.0,
    ascent: Array | None = None,
) -> Cluster:
    """The cluster of the singular values at a frequency of a plant's loop."""
    products = np.einsum("im,qj->ijmq", gain.left, gain.right)
    slopes = loops.inner_products(theta, plant, products)
    return Cluster(
        sigma=gain.sigma,
        slopes=0.5 * (slopes + slopes.conj().transpose(0, 2, 1)),
        offset=offset,
        height=height,
        ascent=np.zeros(theta.size) if ascent is None else ascent,
        label=label,
    )
