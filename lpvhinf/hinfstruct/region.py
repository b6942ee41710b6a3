r"""A generalized plant seen from a disk in the right half plane, for lower bounds on singular problems."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.response import Complex
from lpvhinf.statespace.generalized import GeneralizedPlant


@dataclass(frozen=True)
class Region:
    r"""The disk whose diameter is the real interval (near, far).

    A stable closed loop is bounded by its norm all over the right half plane, so the largest gain over a part
    of it is no larger:

    .. math:: \sup_{s \in \Omega} \bar\sigma(T(s)) \le \|T\|_\infty, \quad \Omega \subset \{\mathrm{Re}\, s > 0\}

    The best that any controller reaches on :math:`\Omega` is thus a lower bound. On the disk, zeros on the imaginary
    axis, a feed-through without full rank (zeros at infinity) and integrators that no controller moves
    lie outside: the problem there is regular.

    Attributes
    ----------
    near : float
        0 <= near < far [rad/s]. With far infinite: the half plane right of it.
    far : float
        [rad/s], may be infinity.
    """

    near: float = 0.0
    far: float = np.inf

    @property
    def whole(self) -> bool:
        """True for the whole right half plane."""
        return self.near == 0.0 and np.isinf(self.far)

    def __str__(self) -> str:
        if self.whole:
            return "the right half plane"
        if np.isinf(self.far):
            return f"Re s > {self.near:.3g} rad/s"
        return f"the disk over ({self.near:.3g}, {self.far:.3g}) rad/s"

    def point(self, omega: Array) -> Complex:
        """Points of the edge, those at the frequencies of the mapped plant: (N,) rad/s to (N,)."""
        return np.asarray((1j * omega + self.near) / (1.0 + 1j * omega / self.far))

    def transform(self, P: GeneralizedPlant) -> GeneralizedPlant:
        r"""The plant in :math:`\hat s = (s - near)/(1 - s/far)`, which maps the disk onto the right half plane.

        With :math:`M = (I - A/far)^{-1}`:

        .. math:: \hat A = M (A - near\, I), \quad \hat B = \sqrt{1 - near/far}\, M B, \quad
                  \hat C = \sqrt{1 - near/far}\, C M, \quad \hat D = D + C M B / far

        Examples
        --------
        >>> P = GeneralizedPlant([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], [[0.0]], [[0.0]], [[0.0]])
        >>> Region(0.5, 4.0).transform(P).A  # (-1 - 0.5) / (1 + 1/4)
        array([[-1.2]])
        """
        n, a = P.n_x, 1.0 / self.far
        M = np.linalg.inv(np.eye(n) - a * P.A)
        root = np.sqrt(1.0 - a * self.near)
        B1, B2, C1, C2 = M @ P.B1, M @ P.B2, P.C1 @ M, P.C2 @ M
        return GeneralizedPlant(
            M @ (P.A - self.near * np.eye(n)),
            root * B1,
            root * B2,
            root * C1,
            root * C2,
            P.D11 + a * P.C1 @ B1,
            P.D12 + a * P.C1 @ B2,
            P.D21 + a * P.C2 @ B1,
            P.D22 + a * P.C2 @ B2,
        )
