r"""A controller with scalings: the scaled small gain as a structured H-infinity problem.

The norm of :math:`\mathrm{diag}(D, I)\, M(\theta)\, \mathrm{diag}(D^{-1}, I)` becomes that of an ordinary closed loop
when D and its inverse are blocks of the controller, around a plant that hands out q and d. D is then tuned with
theta by the same solver.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from lpvhinf.checks import Array
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct.structures import ControllerStructure, Realization, parameter_names
from lpvhinf.hinfstruct.uncertainty.channel import UncertainPlant
from lpvhinf.statespace.generalized import GeneralizedPlant


class WithScalings:
    r"""diag(K, D I, D^-1 I) with :math:`D(s) = e^\delta` or :math:`e^\delta (s + a) / (s + b)`.

    Parameters
    ----------
    structure : ControllerStructure
        K. Its parameters come first, then delta, log(a / omega), log(b / omega).
    n_d, n_q : int
        Outputs and inputs of Delta.
    order : 0 or 1
        Of D.
    omega : float
        rad/s, unit of a and b.

    Raises
    ------
    DomainError
        If the order is another one.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> scaled = WithScalings(StaticGain(1, 1), 1, 1)
    >>> np.diag(scaled.realize(np.array([3.0, np.log(2.0)]))[3])
    array([3. , 2. , 0.5])
    """

    def __init__(self, structure: ControllerStructure, n_d: int, n_q: int, order: int = 0, omega: float = 1.0) -> None:
        if order not in (0, 1):
            raise DomainError(f"scaling_order is {order!r}, wanted 0 or 1.")
        self.structure, self.n_d, self.n_q, self.order, self.omega = structure, n_d, n_q, order, omega
        self.n_u, self.n_y = structure.n_u + n_q + n_d, structure.n_y + n_q + n_d
        self.n_x = structure.n_x + order * (n_q + n_d)
        self.n_parameters = structure.n_parameters + 1 + 2 * order
        own = ("log d", "log a", "log b")[: 1 + 2 * order]
        self.names = (*parameter_names(structure), *own)

    def split(self, theta: Array) -> tuple[Array, Array]:
        """Parameters of K and of D."""
        n = self.structure.n_parameters
        return theta[:n], theta[n:]

    def scalings(self, extra: Array) -> tuple[float, float, float]:
        """Gain, a and b of D; a and b are one where it has no states."""
        gain = float(np.exp(extra[0]))
        if self.order == 0:
            return gain, 1.0, 1.0
        return gain, float(self.omega * np.exp(extra[1])), float(self.omega * np.exp(extra[2]))

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """Block-diagonal (A, B, C, D)."""
        own, extra = self.split(theta)
        gain, a, b = self.scalings(extra)
        blocks = [self.structure.realize(own, p)]
        for n, g, zero, pole in ((self.n_q, gain, a, b), (self.n_d, 1.0 / gain, b, a)):
            eye, none = np.eye(n), np.zeros((0, 0))
            if self.order == 0:
                blocks.append((none, np.zeros((0, n)), np.zeros((n, 0)), g * eye))
            else:
                blocks.append((-pole * eye, pole * eye, g * (zero - pole) / pole * eye, g * eye))
        A, B, C, D = (block_diag(*[block[k] for block in blocks]) for k in range(4))
        return A, B, C, D

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """That of K, and sums over the diagonals of the scalings' blocks."""
        own, extra = self.split(theta)
        gain, a, b = self.scalings(extra)
        K = self.structure
        out = [
            K.pullback(own, GA[: K.n_x, : K.n_x], GB[: K.n_x, : K.n_y], GC[: K.n_u, : K.n_x], GD[: K.n_u, : K.n_y], p)
        ]
        change = np.zeros(1 + 2 * self.order)
        x, u, y = K.n_x, K.n_u, K.n_y
        for n, sign, zero, pole in ((self.n_q, 1.0, a, b), (self.n_d, -1.0, b, a)):
            g = gain**sign
            iu, iy, ix = slice(u, u + n), slice(y, y + n), slice(x, x + n * self.order)
            tD = float(np.trace(GD[iu, iy]))
            change[0] += sign * g * tD
            if self.order:
                tA, tB, tC = (float(np.trace(m)) for m in (GA[ix, ix], GB[ix, iy], GC[iu, ix]))
                # C = g (zero / pole - 1)
                change[0] += sign * g * (zero - pole) / pole * tC
                of_zero, of_pole = g * zero / pole * tC, pole * (tB - tA) - g * zero / pole * tC
                change[1:] += (of_zero, of_pole) if sign > 0.0 else (of_pole, of_zero)
            x, u, y = x + n * self.order, u + n, y + n
        return np.concatenate([*out, change])

    def initial(self, rng: np.random.Generator) -> Array:
        """The start of K, and scalings of one."""
        return np.concatenate([self.structure.initial(rng), np.zeros(1 + 2 * self.order)])


def scaled_plant(uncertain: UncertainPlant, gamma: float) -> GeneralizedPlant:
    """The plant around `WithScalings`, performance outputs divided by gamma: a norm of one is a robust gain of gamma.

    Outputs (D q, z / gamma), inputs (d', w); the controller gets (y, q, d') and gives (u, D q, D^-1 d').
    """
    P, n_d, n_q = uncertain.plant, uncertain.n_d, uncertain.n_q
    d, w, q, z = slice(0, n_d), slice(n_d, None), slice(0, n_q), slice(n_q, None)
    zero, n_z, n_w = np.zeros, P.n_z - n_q, P.n_w - n_d
    return GeneralizedPlant(
        P.A,
        np.hstack([zero((P.n_x, n_d)), P.B1[:, w]]),
        np.hstack([P.B2, zero((P.n_x, n_q)), P.B1[:, d]]),
        np.vstack([zero((n_q, P.n_x)), P.C1[z] / gamma]),
        np.vstack([P.C2, P.C1[q], zero((n_d, P.n_x))]),
        np.block([[zero((n_q, n_d + n_w))], [zero((n_z, n_d)), P.D11[z, w] / gamma]]),
        np.block(
            [
                [zero((n_q, P.n_u)), np.eye(n_q), zero((n_q, n_d))],
                [P.D12[z] / gamma, zero((n_z, n_q)), P.D11[z, d] / gamma],
            ]
        ),
        np.block([[zero((P.n_y, n_d)), P.D21[:, w]], [zero((n_q, n_d)), P.D11[q, w]], [np.eye(n_d), zero((n_d, n_w))]]),
        np.block(
            [
                [P.D22, zero((P.n_y, n_q)), P.D21[:, d]],
                [P.D12[q], zero((n_q, n_q)), P.D11[q, d]],
                [zero((n_d, P.n_u + n_q + n_d))],
            ]
        ),
    )
