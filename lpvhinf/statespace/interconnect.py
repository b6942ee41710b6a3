"""Series, parallel, feedback and linear fractional interconnections of systems given by their matrices.

All are exact in the coefficients: the degree in p grows only where two matrices that both depend on p are
multiplied. `LPVStateSpace` offers them as methods.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.polynomial import ChebyshevMatrix, block


class Matrices(NamedTuple):
    """The matrices of a system over one box."""

    A: ChebyshevMatrix
    B: ChebyshevMatrix
    C: ChebyshevMatrix
    D: ChebyshevMatrix

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2)."""
        return self.A.box

    @property
    def n_x(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def n_u(self) -> int:
        """Number of inputs."""
        return self.B.shape[1]

    @property
    def n_y(self) -> int:
        """Number of outputs."""
        return self.C.shape[0]


def series(first: Matrices, after: Matrices) -> Matrices:
    """`after` following `first`; the state is (x_first, x_after)."""
    if first.n_y != after.n_u:
        raise DimensionError(f"the first system has {first.n_y} outputs, the second {after.n_u} inputs.")
    zero = np.zeros((first.n_x, after.n_x))
    return Matrices(
        block([[first.A, zero], [after.B @ first.C, after.A]], first.box),
        block([[first.B], [after.B @ first.D]], first.box),
        block([[after.D @ first.C, after.C]], first.box),
        after.D @ first.D,
    )


def parallel(left: Matrices, right: Matrices) -> Matrices:
    """The sum of both outputs for a common input; the state is (x_left, x_right)."""
    if (left.n_u, left.n_y) != (right.n_u, right.n_y):
        raise DimensionError(f"sizes {(left.n_y, left.n_u)} and {(right.n_y, right.n_u)} differ.")
    joined = append(left, right)
    return Matrices(
        joined.A, block([[left.B], [right.B]], left.box), block([[left.C, right.C]], left.box), left.D + right.D
    )


def append(left: Matrices, right: Matrices) -> Matrices:
    """Both systems side by side: diag(left, right)."""

    def diagonal(a: ChebyshevMatrix, b: ChebyshevMatrix) -> ChebyshevMatrix:
        upper, lower = np.zeros((a.shape[0], b.shape[1])), np.zeros((b.shape[0], a.shape[1]))
        return block([[a, upper], [lower, b]], left.box)

    return Matrices(*(diagonal(a, b) for a, b in zip(left, right, strict=True)))


def feedback(forward: Matrices, backward: Matrices, sign: int = -1) -> Matrices:
    """From r to y = forward(r + sign * backward(y)); the state is (x_forward, x_backward)."""
    if (forward.n_y, forward.n_u) != (backward.n_u, backward.n_y):
        raise DimensionError(
            f"the forward system is {forward.n_y}x{forward.n_u}, so the backward one must be "
            f"{forward.n_u}x{forward.n_y}; it is {backward.n_y}x{backward.n_u}."
        )
    # the generalized plant of the loop: [y; y] = forward([r + u]), then u = sign * backward y
    stacked = Matrices(
        forward.A,
        block([[forward.B, forward.B]], forward.box),
        block([[forward.C], [forward.C]], forward.box),
        block([[forward.D, forward.D], [forward.D, forward.D]], forward.box),
    )
    gain = float(np.sign(sign))
    signed = gain * np.eye(backward.n_y)
    return lft(stacked, Matrices(backward.A, backward.B, signed @ backward.C, signed @ backward.D))


def lft(plant: Matrices, controller: Matrices) -> Matrices:
    r"""The lower linear fractional transformation F_l(P, K), u = K y, from w to z.

    The last inputs and outputs of `plant`, as many as `controller` has, are u and y. With both
    feed-throughs :math:`E = I - D_K D_{22}` must be a constant matrix and regular, since its inverse
    would otherwise not be polynomial in p.

    Raises
    ------
    DimensionError
        If the controller has more channels than the plant.
    AssumptionError
        If E varies with p or is singular.
    """
    K = controller
    n_w, n_z = plant.n_u - K.n_y, plant.n_y - K.n_u
    if n_w < 0 or n_z < 0:
        raise DimensionError(f"the plant is {plant.n_y}x{plant.n_u}, the controller {K.n_y}x{K.n_u}: too large.")
    w, u, z, y = slice(0, n_w), slice(n_w, None), slice(0, n_z), slice(n_z, None)
    every = slice(None)
    B1, B2 = plant.B[every, w], plant.B[every, u]
    C1, C2 = plant.C[z, every], plant.C[y, every]
    D11, D12, D21, D22 = plant.D[z, w], plant.D[z, u], plant.D[y, w], plant.D[y, u]
    F = _constant_inverse(K.D @ D22)
    Uy, Uk = F @ K.D, F @ K.C
    # Y = I + D22 Uy, the way from an outer signal to the measurement, is (I - D22 D_K)^-1
    Y = ChebyshevMatrix(np.eye(K.n_u), plant.box) + D22 @ Uy
    BY = K.B @ Y
    return Matrices(
        block([[plant.A + B2 @ Uy @ C2, B2 @ Uk], [BY @ C2, K.A + K.B @ (D22 @ Uk)]], plant.box),
        block([[B1 + B2 @ Uy @ D21], [BY @ D21]], plant.box),
        block([[C1 + D12 @ Uy @ C2, D12 @ Uk]], plant.box),
        D11 + D12 @ Uy @ D21,
    )


def _constant_inverse(product: ChebyshevMatrix) -> Array:
    """(I - product)^-1 for a product that must not vary with p."""
    variation = product.coefficients.reshape(-1, *product.shape)[1:]
    constant = np.eye(product.shape[0]) - product.coefficients.reshape(-1, *product.shape)[0]
    if variation.size and np.max(np.abs(variation)) > 1e-13 * max(1.0, float(np.max(np.abs(constant)))):
        raise AssumptionError(
            "I - D_K D22 varies with p, so that its inverse is not polynomial. "
            "Make the controller or the plant strictly proper."
        )
    if constant.size and np.linalg.cond(constant) > 1e14:
        raise AssumptionError("the loop is not well posed: I - D_K D22 is singular. Use a strictly proper controller.")
    return np.linalg.inv(constant)
