r"""The controller of output-feedback synthesis from R, S at one position, by explicit formulas.

With :math:`P = \begin{bmatrix} S & N \\ N^\top & \cdot \end{bmatrix}`,
:math:`P^{-1} = \begin{bmatrix} R & M \\ M^\top & \cdot \end{bmatrix}`, :math:`M N^\top = I - R S`, the closed loop has
the Lyapunov matrix P(p). Where one of M, N is constant the controller is a continuous function of R(p), S(p) and of the
plant's matrices; a factorisation of I - R S at each p, such as an SVD, would not be. The rate of p enters the
controller through :math:`N A_K M^\top = \dots - (\dot S R + \dot N M^\top)`, which vanishes

- with N constant, where S is constant;
- with M constant, where R is constant.

References
----------
Gahinet, P. (1996), Explicit controller formulas for LMI-based H-infinity synthesis, Automatica 32, 1007-1014;
Apkarian, P. and Adams, R. J. (1998), Advanced gain-scheduling techniques for uncertain systems, IEEE Transactions on
Control Systems Technology 6, 21-32.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, SynthesisError
from lpvhinf.statespace.generalized import GeneralizedPlant

Matrices = tuple[Array, Array, Array, Array]

#: Singular values of D12 and D21 below this share of the largest count as zero.
RANK = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class ConstantFactor:
    """The factor of I - R S that does not depend on p.

    Attributes
    ----------
    side : "M" or "N"
    matrix : (n, n)
        Its value, nonsingular.
    """

    side: str
    matrix: Array

    def factors(self, R: Array, S: Array) -> tuple[Array, Array]:
        """M and N with M N' = I - R S."""
        gap = np.eye(len(R)) - R @ S
        if self.side == "N":
            return np.asarray(np.linalg.solve(self.matrix, gap.T).T, dtype=float), self.matrix
        return self.matrix, np.asarray(np.linalg.solve(self.matrix, gap).T, dtype=float)

    def rates(self, R: Array, S: Array, R_dot: Array, S_dot: Array) -> tuple[Array, Array]:
        """M_dot and N_dot."""
        slope = -(R_dot @ S + R @ S_dot)
        zero = np.zeros_like(R)
        if self.side == "N":
            return np.asarray(np.linalg.solve(self.matrix, slope.T).T, dtype=float), zero
        return zero, np.asarray(np.linalg.solve(self.matrix, slope).T, dtype=float)


def constant_factor(side: str, R: Array, S: Array) -> ConstantFactor:
    """A constant factor with its size taken from R, S at one position (such as their means over the grid).

    Any nonsingular matrix gives the same controller up to a constant change of its state; this one leaves that state
    of a moderate size. The SVD is taken once, not at each p.
    """
    U, s, Vt = np.linalg.svd(np.eye(len(R)) - R @ S)
    root = np.sqrt(np.maximum(s, 1e-14 * s[0]))
    return ConstantFactor(side=side, matrix=(U * root if side == "M" else Vt.T * root))


def feedthrough(plant: GeneralizedPlant, gamma: float) -> Array:
    r"""D_K with :math:`\bar\sigma(D_{11} + D_{12} D_K D_{21}) < \gamma`: zero where that will do, else Parrott's.

    The central solution of Parrott's problem, with w and z split into what D21 and D12 reach and the rest, is a
    continuous function of the plant. It is taken at all positions or at none, see `needs_feedthrough`.

    Raises
    ------
    SynthesisError
        If no D_K reaches the level.
    """
    D11, D12, D21 = plant.D11, plant.D12, plant.D21
    Qz, Rz = np.linalg.qr(D12, mode="complete")
    Qw, Rw = np.linalg.qr(D21.T, mode="complete")
    n_u, n_y = D12.shape[1], D21.shape[0]
    Z1, Z2, W1, W2 = Qz[:, :n_u], Qz[:, n_u:], Qw[:, :n_y], Qw[:, n_y:]
    corner = Z2.T @ D11 @ W2
    floor = max(_norm(Z2.T @ D11), _norm(D11 @ W2))
    if floor >= gamma:
        raise SynthesisError(f"the feed-through alone has the gain {floor:.6g}, the level is {gamma:.6g}.")
    inner = gamma**2 * np.eye(corner.shape[1]) - corner.T @ corner
    best = -(Z1.T @ D11 @ W1 + Z1.T @ D11 @ W2 @ np.linalg.solve(inner, corner.T @ (Z2.T @ D11 @ W1)))
    return np.asarray(np.linalg.solve(Rz[:n_u], np.linalg.solve(Rw[:n_y], best.T).T))


def needs_feedthrough(plants: list[GeneralizedPlant], gamma: float) -> bool:
    """Whether D_K = 0 leaves a feed-through of `gamma` or nearly so at some position."""
    return any(_norm(plant.D11) >= 0.98 * gamma for plant in plants)


def check_reconstructible(plant: GeneralizedPlant, where: str) -> None:
    """Refuse plants that the explicit formulas do not serve.

    Raises
    ------
    AssumptionError
        If D22 is not zero, or D12 or D21 has no full rank.
    """
    size = _norm(plant.D22)
    if size > 0.0:
        raise AssumptionError(
            f"D22 {where} is not zero (its norm is {size:.3g}). Design K for y - D22 u (set D22 = 0), then use "
            "K (I + D22 K)^-1."
        )
    check_control_side(plant, where)
    _check_rank(plant, "D21", plant.D21.T, where, "rows: add a small noise on every y to w")


def check_control_side(plant: GeneralizedPlant, where: str) -> None:
    """Refuse a D12 without full column rank.

    Raises
    ------
    AssumptionError
        If D12 has linearly dependent columns.
    """
    _check_rank(plant, "D12", plant.D12, where, "columns: add a small weight on every u to z")


def _check_rank(plant: GeneralizedPlant, name: str, matrix: Array, where: str, remedy: str) -> None:
    s = np.linalg.svd(matrix, compute_uv=False) if matrix.size else np.zeros(0)
    rank = int(np.sum(s > RANK * s[0])) if s.size and s[0] > 0.0 else 0
    if rank < matrix.shape[1]:
        raise AssumptionError(f"{name} {where} has rank {rank}, wanted {matrix.shape[1]} independent {remedy}.")


def linearised_controller(plant: GeneralizedPlant, R: Array, S: Array, gamma: float, D_K: Array) -> Matrices:
    r"""Linearised controller (A_hat, B_hat, C_hat, D_K) that minimises both diagonal blocks of the bounded-real LMI.

    With :math:`\hat B = N B_K + S B_2 D_K`, :math:`\hat C = C_K M^\top + D_K C_2 R`; A_hat makes the coupling of the
    blocks vanish, after elimination of w and z. The term of the rate is left to `controller_matrices`.
    """
    A, B1, B2, C1, C2 = plant.A, plant.B1, plant.B2, plant.C1, plant.C2
    D12, D21 = plant.D12, plant.D21
    Ac, Bc = A + B2 @ D_K @ C2, B1 + B2 @ D_K @ D21
    Cc, D = C1 + D12 @ D_K @ C2, plant.D11 + D12 @ D_K @ D21
    n_y, n_w, n_z = plant.n_y, plant.n_w, plant.n_z
    Iw, Iz = gamma * np.eye(n_w), gamma * np.eye(n_z)
    left = np.block(
        [
            [np.zeros((n_y, n_y)), D21, np.zeros((n_y, n_z))],
            [D21.T, -Iw, D.T],
            [np.zeros((n_z, n_y)), D, -Iz],
        ]
    )
    B_hat = -_symmetric_solve(left, np.vstack([C2, B1.T @ S, Cc]))[:n_y].T
    C_hat = _control_formula(plant, R, gamma, Bc, D)
    W = np.block([[-Iw, D.T], [D, -Iz]])
    # B_hat multiplies y = C2 x + D21 w, and S B2 D_K is part of it
    coupling = np.hstack([S @ B1 + B_hat @ D21, Cc.T])
    A_hat = -Ac.T + coupling @ np.linalg.solve(W, np.vstack([Bc.T, C1 @ R + D12 @ C_hat]))
    return A_hat, B_hat, C_hat, D_K


def control_gain(plant: GeneralizedPlant, R: Array, gamma: float) -> Array:
    """Y = F R of the state feedback u = F x that minimises the first block of the control-side inequality."""
    return _control_formula(plant, R, gamma, plant.B1, plant.D11)


def _control_formula(plant: GeneralizedPlant, R: Array, gamma: float, B: Array, D: Array) -> Array:
    """C_hat, with B and D of the loop closed by D_K."""
    D12, n_u, n_w, n_z = plant.D12, plant.n_u, B.shape[1], plant.n_z
    right = np.block(
        [
            [np.zeros((n_u, n_u)), D12.T, np.zeros((n_u, n_w))],
            [D12, -gamma * np.eye(n_z), D],
            [np.zeros((n_w, n_u)), D.T, -gamma * np.eye(n_w)],
        ]
    )
    return -_symmetric_solve(right, np.vstack([plant.B2.T, plant.C1 @ R, B.T]))[:n_u]


def controller_matrices(
    plant: GeneralizedPlant,
    R: Array,
    S: Array,
    gamma: float,
    factor: ConstantFactor,
    D_K: Array,
    R_dot: Array | None = None,
    S_dot: Array | None = None,
) -> Matrices:
    r"""(A_K, B_K, C_K, D_K) at one position, and at one rate where R and S both vary.

    Parameters
    ----------
    plant : GeneralizedPlant
        With D22 = 0 and D12, D21 of full rank.
    R, S : (n, n)
        With [R I; I S] > 0, of the LMIs at `gamma`.
    gamma : float
        Level, above the smallest one that R and S admit.
    factor : ConstantFactor
    D_K : (n_u, n_y)
    R_dot, S_dot : (n, n), optional
        Left out: zero.
    """
    A_hat, B_hat, C_hat, _ = linearised_controller(plant, R, S, gamma, D_K)
    M, N = factor.factors(R, S)
    B2, C2 = plant.B2, plant.C2
    B_in, C_out = B_hat - S @ B2 @ D_K, C_hat - D_K @ C2 @ R
    inner = A_hat - B_in @ C2 @ R - S @ B2 @ C_out - S @ (plant.A + B2 @ D_K @ C2) @ R
    if R_dot is not None and S_dot is not None:
        _, N_dot = factor.rates(R, S, R_dot, S_dot)
        inner = inner - S_dot @ R - N_dot @ M.T
    N_factors, M_factors = scipy.linalg.lu_factor(N), scipy.linalg.lu_factor(M)
    A_K = scipy.linalg.lu_solve(M_factors, scipy.linalg.lu_solve(N_factors, inner).T).T
    return A_K, scipy.linalg.lu_solve(N_factors, B_in), scipy.linalg.lu_solve(M_factors, C_out.T).T, D_K


def loop_lyapunov(R: Array, S: Array, factor: ConstantFactor, R_dot: Array, S_dot: Array) -> tuple[Array, Array]:
    r"""P and dP/dt of the closed loop with the state (x, x_K).

    P = Pi_2 Pi_1^-1 with Pi_1 = [R I; M' 0] and Pi_2 = [I S; 0 N'].
    """
    n = len(R)
    M, N = factor.factors(R, S)
    _, N_dot = factor.rates(R, S, R_dot, S_dot)
    I, O = np.eye(n), np.zeros((n, n))  # noqa: E741
    pi_1, pi_2 = np.block([[R, I], [M.T, O]]), np.block([[I, S], [O, N.T]])
    P = np.linalg.solve(pi_1.T, pi_2.T)
    coupling = R @ S_dot + M @ N_dot.T
    rate = np.block([[-R_dot, coupling], [coupling.T, S_dot]])  # Pi_1' dP/dt Pi_1
    half = np.linalg.solve(pi_1.T, rate)
    P_dot = np.linalg.solve(pi_1.T, half.T)
    return 0.5 * (P + P.T), 0.5 * (P_dot + P_dot.T)


def _symmetric_solve(matrix: Array, right: Array) -> Array:
    """Solution after scaling to unit rows and columns: the blocks differ by many powers of ten."""
    size = np.sqrt(np.max(np.abs(matrix), axis=1))
    size[size == 0.0] = 1.0
    scaled = matrix / size[:, None] / size
    return np.asarray(np.linalg.solve(scaled, right / size[:, None]) / size[:, None])


def _norm(matrix: Array) -> float:
    return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0
