r"""Closed loops of many plants and controllers at once, in continuous or in discrete time.

::

    w1 --> + <-- y_RB          e = -(y_RB + w1),  u = K (e, y)
           |                   y = G (u, w3)
           e --> [K(p)] --> u --> [G] <-- w3
                   ^              |
                   +------ y -----+
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemStack:
    """N state spaces: A (N, n_x, n_x), B (N, n_x, n_u), C (N, n_y, n_x), D (N, n_y, n_u)."""

    A: Array
    B: Array
    C: Array
    D: Array

    def __len__(self) -> int:
        return len(self.A)


def close(plant: SystemStack, controller: SystemStack, *, n_rb: int) -> SystemStack:
    """The loops from (w1, w3) to e.

    Parameters
    ----------
    plant : SystemStack
        From (u, w3) to y, with any number of inputs w3; the first `n_rb` outputs are y_RB.
    controller : SystemStack
        From (e, y) to u. Its feed-through may close an algebraic loop with the plant's.
    """
    n_g, n_u = plant.A.shape[1], controller.C.shape[1]
    B_u, B_w = plant.B[:, :, :n_u], plant.B[:, :, n_u:]
    D_u, D_w = plant.D[:, :, :n_u], plant.D[:, :, n_u:]
    # e = -(y_RB + w1) makes (e, y) a function of y and w1
    B_e, B_y = controller.B[:, :, :n_rb], controller.B[:, :, n_rb:].copy()
    D_e, D_y = controller.D[:, :, :n_rb], controller.D[:, :, n_rb:].copy()
    B_y[:, :, :n_rb] -= B_e
    D_y[:, :, :n_rb] -= D_e
    U = np.concatenate([D_y @ plant.C, controller.C], axis=2)  # u = U x + U_w (w1, w3)
    U_w = np.concatenate([-D_e, D_y @ D_w], axis=2)
    if np.any(D_y) and np.any(D_u):
        loop = np.eye(n_u) - D_y @ D_u
        U, U_w = np.linalg.solve(loop, U), np.linalg.solve(loop, U_w)
    Y = D_u @ U
    Y[:, :, :n_g] += plant.C
    Y_w = D_u @ U_w
    Y_w[:, :, n_rb:] += D_w
    A = np.concatenate([B_u @ U, B_y @ Y], axis=1)
    A[:, :n_g, :n_g] += plant.A
    A[:, n_g:, n_g:] += controller.A
    B = np.concatenate([B_u @ U_w, B_y @ Y_w], axis=1)
    B[:, :n_g, n_rb:] += B_w
    B[:, n_g:, :n_rb] -= B_e
    D = -Y_w[:, :n_rb]
    D[:, :, :n_rb] -= np.eye(n_rb)
    return SystemStack(A=A, B=B, C=-Y[:, :n_rb], D=D)
