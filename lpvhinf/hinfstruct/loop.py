"""Closed loops with the channels through which the controller's matrices act on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.statespace.generalized import GeneralizedPlant


@dataclass(frozen=True, slots=True, eq=False)
class ClosedLoop:
    r"""The loop from w to z and its dependence on the augmented gain.

    With :math:`\bar K = [[A_K, B_K], [C_K, D_K]]` and :math:`R = (j\omega I - A)^{-1}` a change
    :math:`\Delta` of :math:`\bar K` changes the frequency response to exactly

    .. math:: T + L \Delta (I - N \Delta)^{-1} Q, \quad L = C R B_i + D_{12i}, \quad
              Q = C_i R B + D_{21i}, \quad N = C_i R B_i + D_{22i}

    Attributes
    ----------
    A, B, C, D : closed loop, (n, n), (n, n_w), (n_z, n), (n_z, n_w), states (x, x_K)
    Bi : (n, n_K + n_u)
    Ci : (n_K + n_y, n)
    D12i, D21i, D22i : (n_z, n_K + n_u), (n_K + n_y, n_w), (n_K + n_y, n_K + n_u)
    """

    A: Array
    B: Array
    C: Array
    D: Array
    Bi: Array
    Ci: Array
    D12i: Array
    D21i: Array
    D22i: Array


class LoopFactory:
    """Closes one plant with many controllers of the same order.

    A controller of n_K states is a static gain around the plant with n_K
    integrators added, so only one formula is needed.

    Parameters
    ----------
    plant : GeneralizedPlant
    n_K : int
        Number of controller states.
    """

    def __init__(self, plant: GeneralizedPlant, n_K: int) -> None:
        n, n_u, n_y = plant.n_x, plant.n_u, plant.n_y
        self._A = np.zeros((n + n_K, n + n_K))
        self._A[:n, :n] = plant.A
        self._B1 = np.vstack([plant.B1, np.zeros((n_K, plant.n_w))])
        self._C1 = np.hstack([plant.C1, np.zeros((plant.n_z, n_K))])
        self._B2 = np.zeros((n + n_K, n_K + n_u))
        self._B2[:n, n_K:], self._B2[n:, :n_K] = plant.B2, np.eye(n_K)
        self._C2 = np.zeros((n_K + n_y, n + n_K))
        self._C2[n_K:, :n], self._C2[:n_K, n:] = plant.C2, np.eye(n_K)
        self._D11 = plant.D11
        self._D12 = np.hstack([np.zeros((plant.n_z, n_K)), plant.D12])
        self._D21 = np.vstack([np.zeros((n_K, plant.n_w)), plant.D21])
        self._D22 = np.zeros((n_K + n_y, n_K + n_u))
        self._D22[n_K:, n_K:] = plant.D22
        self._has_D22 = bool(np.any(plant.D22))

    def close(self, K: Array) -> ClosedLoop | None:
        """The loop with the augmented gain K, (n_K + n_u, n_K + n_y); None if it is not well posed."""
        B2, C2, D12, D21 = self._B2, self._C2, self._D12, self._D21
        if self._has_D22:
            E = np.eye(K.shape[0]) - K @ self._D22
            if np.linalg.cond(E) > 1e12:
                return None
            Ei = np.linalg.inv(E)
            # U = (I - K D22)^-1 K; the controller sees F (C2 x + D21 w), F = I + D22 U
            U = Ei @ K
            F = np.eye(K.shape[1]) + self._D22 @ U
            Bi, D12i, Ci, D21i, D22i = B2 @ Ei, D12 @ Ei, F @ C2, F @ D21, self._D22 @ Ei
        else:
            U, Bi, D12i, Ci, D21i, D22i = K, B2, D12, C2, D21, self._D22
        UC, UD = U @ C2, U @ D21
        return ClosedLoop(
            self._A + B2 @ UC, self._B1 + B2 @ UD, self._C1 + D12 @ UC, self._D11 + D12 @ UD, Bi, Ci, D12i, D21i, D22i
        )


def augmented_gain(A: Array, B: Array, C: Array, D: Array) -> Array:
    """[[A, B], [C, D]] of a controller, (n_K + n_u, n_K + n_y)."""
    n_K = A.shape[0]
    K = np.empty((n_K + D.shape[0], n_K + D.shape[1]))
    K[:n_K, :n_K], K[:n_K, n_K:], K[n_K:, :n_K], K[n_K:, n_K:] = A, B, C, D
    return K
