"""The inequalities of every size: bars whose sensors move with p, on a grid, with powers of p as basis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.gridded import GriddedLMIs, gridded_lmis
from lpvhinf.statespace.generalized import GeneralizedPlant

#: The structured solver, and those that are compared where they are installed.
OURS, OTHERS = "structured", ("clarabel", "cvxopt", "sdpa")


@dataclass(frozen=True, kw_only=True)
class Size:
    """States, grid points, basis functions."""

    n_x: int
    n_grid: int
    n_basis: int


SIZES = (
    Size(n_x=10, n_grid=1, n_basis=1),
    Size(n_x=10, n_grid=9, n_basis=3),
    Size(n_x=20, n_grid=1, n_basis=1),
    Size(n_x=20, n_grid=9, n_basis=1),
    Size(n_x=20, n_grid=9, n_basis=3),
    Size(n_x=20, n_grid=25, n_basis=6),
    Size(n_x=20, n_grid=81, n_basis=3),
    Size(n_x=40, n_grid=9, n_basis=3),
    Size(n_x=40, n_grid=25, n_basis=3),
    Size(n_x=60, n_grid=25, n_basis=3),
    Size(n_x=80, n_grid=9, n_basis=1),
)
TINY = (Size(n_x=4, n_grid=1, n_basis=1), Size(n_x=4, n_grid=3, n_basis=2))


def plant(n_x: int, p: float) -> GeneralizedPlant:
    """A rigid mode and n_x / 2 - 1 modes of a free bar of 1 % damping, seen at two places that move with p.

    Frequencies are those of a bar in compression, k pi; two forces at the ends; p in [-1, 1] moves the sensors.
    """
    n = n_x // 2
    k = np.arange(n)
    omega, zeta = np.pi * k, 0.01
    A, B, C = np.zeros((n_x, n_x)), np.zeros((n_x, 2)), np.zeros((2, n_x))
    A[k, n + k] = 1.0
    A[n + k, k], A[n + k, n + k] = -(omega**2), -2.0 * zeta * omega
    shape = np.cos(np.outer([0.0, 1.0], np.pi * k))
    B[n:] = shape.T
    C[:, :n] = np.cos(np.outer([0.25 + 0.1 * p, 0.75 + 0.1 * p], np.pi * k)) / (1.0 + k)
    return GeneralizedPlant(
        A,
        np.hstack([B, np.zeros((n_x, 2))]),
        B,
        np.vstack([C, np.zeros((2, n_x))]),
        C,
        np.zeros((4, 4)),
        np.vstack([np.zeros((2, 2)), np.eye(2)]),
        np.hstack([np.zeros((2, 2)), np.eye(2)]),
    )


def inequalities(size: Size) -> GriddedLMIs:
    """R(p) of `n_basis` powers of p, S constant, |dp/dt| <= 0.1; one basis function: both constant."""
    points = np.linspace(-1.0, 1.0, size.n_grid) if size.n_grid > 1 else np.zeros(1)
    degrees = np.arange(size.n_basis)

    def basis(p: Array) -> tuple[Array, Array]:
        return p[0] ** degrees, (degrees * p[0] ** np.maximum(degrees - 1, 0))[:, None]

    plants = [plant(size.n_x, p) for p in points]
    if size.n_basis == 1:
        return gridded_lmis(plants, points[:, None], constant="both")
    return gridded_lmis(plants, points[:, None], basis=basis, rate=np.array([[-0.1, 0.1]]), constant="S")
