r"""The inequalities of gridded output-feedback synthesis, controller eliminated.

At every grid point and vertex of the rate box, with N_R and N_S orthonormal bases of the null spaces of
:math:`[B_2^\top\; D_{12}^\top]` and :math:`[C_2\; D_{21}]`:

.. math::

    \begin{bmatrix} N_R & 0 \\ 0 & I \end{bmatrix}^\top
    \begin{bmatrix} A R + R A^\top - \dot R & R C_1^\top & B_1 \\ C_1 R & -\gamma I & D_{11} \\
    B_1^\top & D_{11}^\top & -\gamma I \end{bmatrix}
    \begin{bmatrix} N_R & 0 \\ 0 & I \end{bmatrix} \preceq 0, \quad
    \begin{bmatrix} N_S & 0 \\ 0 & I \end{bmatrix}^\top
    \begin{bmatrix} A^\top S + S A + \dot S & S B_1 & C_1^\top \\ B_1^\top S & -\gamma I & D_{11}^\top \\
    C_1 & D_{11} & -\gamma I \end{bmatrix}
    \begin{bmatrix} N_S & 0 \\ 0 & I \end{bmatrix} \preceq 0

    \begin{bmatrix} R & I \\ I & S \end{bmatrix} \succeq 0, \quad R \preceq r_{max} I, \quad S \preceq r_{max} I

Source: P. Apkarian and R. J. Adams, Advanced gain-scheduling techniques for uncertain systems, IEEE Transactions on
Control Systems Technology 6 (1998); F. Wu, X. H. Yang, A. Packard and G. Becker, International Journal of Robust and
Nonlinear Control 6 (1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, positive
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.lpv.basis import Basis, SampledBasis, checked_points, constant_basis, rate_box, sampled_basis
from lpvhinf.lpv.conditioning import ScaledPlants, scaled_plants
from lpvhinf.lpv.lmi import LMIBlock, LMIProblem, LMISolution, MatrixUnknown, Term
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Which of the two matrices are constant.
CONSTANT = ("R", "S", "both", "none")
#: Bound on R and S in scaled coordinates.
R_MAX = 1e6
#: A mode is uncontrollable where the smallest singular value of [A - s I, B] is below this share of the norm.
UNCONTROLLABLE = 1e-10


@dataclass(frozen=True, kw_only=True, eq=False)
class LyapunovPair:
    """R(p) = sum f_i(p) R_i and S(p) = sum g_i(p) S_i in the coordinates of the plant.

    Attributes
    ----------
    R, S : (n_b, n_x, n_x)
        One matrix (n_b = 1) where it is constant.
    basis_R, basis_S : callable or None
        As given; None is the constant 1.
    """

    R: Array
    S: Array
    basis_R: Basis | None
    basis_S: Basis | None

    def at(self, p: ArrayLike) -> tuple[Array, Array]:
        """R(p), S(p)."""
        where = np.atleast_1d(np.asarray(p, dtype=float))
        return _expanded(self.R, self.basis_R, where), _expanded(self.S, self.basis_S, where)

    def rate_at(self, p: ArrayLike, p_dot: ArrayLike) -> tuple[Array, Array]:
        """dR/dt and dS/dt at p when p moves with p_dot."""
        where, rate = np.atleast_1d(np.asarray(p, dtype=float)), np.atleast_1d(np.asarray(p_dot, dtype=float))
        return _moved(self.R, self.basis_R, where, rate), _moved(self.S, self.basis_S, where, rate)


@dataclass(frozen=True, kw_only=True, eq=False)
class GriddedLMIs:
    """The inequalities of a gridded synthesis, and what maps their solution back.

    Attributes
    ----------
    problem : LMIProblem
        Blocks "R" and "S" (at every point and rate vertex), "coupling", "R bound", "S bound".
    scaling : ScaledPlants
        The coordinates of the problem.
    basis_R, basis_S : SampledBasis
    given_basis_R, given_basis_S : callable or None
    points : (N, n_p)
    rate : (n_p, 2)
    constant : str
    r_max : float
        In scaled coordinates.
    """

    problem: LMIProblem
    scaling: ScaledPlants
    basis_R: SampledBasis
    basis_S: SampledBasis
    given_basis_R: Basis | None
    given_basis_S: Basis | None
    points: Array
    rate: Array
    constant: str
    r_max: float

    def lyapunov(self, solution: LMISolution) -> LyapunovPair:
        """R(p) and S(p) of a solution, in the coordinates of the plant."""
        R, S = self.basis_R.matrices(solution.unknowns["R"]), self.basis_S.matrices(solution.unknowns["S"])
        return LyapunovPair(
            R=self.scaling.original_R(R),
            S=self.scaling.original_S(S),
            basis_R=self.given_basis_R,
            basis_S=self.given_basis_S,
        )

    def bound_activity(self, solution: LMISolution) -> dict[str, float]:
        """Largest eigenvalue of R(p) and S(p) over the grid as a share of r_max; near 1 the bound costs gamma."""
        return {
            name: float(np.linalg.eigvalsh(np.tensordot(basis.values, solution.unknowns[name], axes=1)).max())
            / self.r_max
            for name, basis in (("R", self.basis_R), ("S", self.basis_S))
        }


def gridded_lmis(
    plants: Sequence[GeneralizedPlant],
    points: ArrayLike,
    *,
    basis: Basis | None = None,
    rate: ArrayLike | None = None,
    constant: str = "S",
    r_max: float = R_MAX,
) -> GriddedLMIs:
    """State the synthesis inequalities on a grid.

    Parameters
    ----------
    plants : sequence of GeneralizedPlant
        One a grid point; D22 = 0, D12 of full column rank, D21 of full row rank.
    points : (N, n_p)
    basis : callable, optional
        `basis(p) -> (values (n_b,), gradient (n_b, n_p))` with the constant in its span; None: constant matrices.
    rate : (n_p, 2) or float, optional
        Box of dp/dt; None: frozen.
    constant : "S", "R", "both" or "none"
        Which of R, S does not depend on p. If one is constant, the controller does not need dp/dt.
    r_max : float
        Bound on R and S in scaled coordinates.

    Raises
    ------
    AssumptionError
        If a plant is not stabilisable or detectable (the message says where), D22 is not zero, D12 or D21 is rank
        deficient, or the basis does not fit the grid.
    DimensionError, DomainError
        If shapes disagree or an option is unknown.
    """
    if constant not in CONSTANT:
        raise DomainError(f"constant is {constant!r}, wanted one of {', '.join(CONSTANT)}.")
    r_max = positive("r_max", r_max)
    grid = checked_points(points, len(plants))
    box = rate_box(rate, grid.shape[1])
    scaling = scaled_plants(plants)
    check_stabilisable(scaling.plants, grid)
    varying = sampled_basis(basis, grid, box, scaling.omega)
    fixed = constant_basis(grid)
    basis_R = fixed if constant in ("R", "both") else varying
    basis_S = fixed if constant in ("S", "both") else varying
    n = scaling.plants[0].n_x
    blocks = [
        *control_blocks(scaling.plants, basis_R),
        *filter_blocks(scaling.plants, basis_S),
        coupling_block(basis_R, basis_S, n),
        bound_block("R", basis_R, n, r_max),
        bound_block("S", basis_S, n, r_max),
    ]
    unknowns = [
        MatrixUnknown(name=name, size=n, count=b.count, bound=r_max, unit=tuple(float(c) for c in b.unit))
        for name, b in (("R", basis_R), ("S", basis_S))  # |Y_i| <= mean over the grid of |f_i| r_max <= r_max
    ]
    return GriddedLMIs(
        problem=LMIProblem(unknowns=unknowns, blocks=blocks),
        scaling=scaling,
        basis_R=basis_R,
        basis_S=basis_S,
        given_basis_R=None if basis_R is fixed else basis,
        given_basis_S=None if basis_S is fixed else basis,
        points=grid,
        rate=box,
        constant=constant,
        r_max=r_max,
    )


def control_blocks(plants: Sequence[GeneralizedPlant], basis: SampledBasis) -> list[LMIBlock]:
    """The inequality of R at every point and rate vertex; several blocks where the null spaces differ in size."""
    sides = [(P.A, P.B1, P.C1, P.D11, np.hstack([P.B2.T, P.D12.T])) for P in plants]
    return _side_blocks("R", sides, basis, sign=1.0)


def filter_blocks(plants: Sequence[GeneralizedPlant], basis: SampledBasis) -> list[LMIBlock]:
    """The inequality of S: that of R for the transposed plant, with the rate's sign reversed."""
    sides = [(P.A.T, P.C1.T, P.B1.T, P.D11.T, np.hstack([P.C2, P.D21])) for P in plants]
    return _side_blocks("S", sides, basis, sign=-1.0)


def coupling_block(basis_R: SampledBasis, basis_S: SampledBasis, n: int) -> LMIBlock:
    """[R I; I S] >= 0 at every point."""
    both, first = np.unique(np.round(np.hstack([basis_R.values, basis_S.values]), 13), axis=0, return_index=True)
    first = np.sort(first)
    eye, zero = np.eye(n), np.zeros((n, n))
    return LMIBlock(
        name="coupling",
        F0=np.tile(np.block([[zero, eye], [eye, zero]]), (len(both), 1, 1)),
        terms=[
            Term("R", np.vstack([eye, zero]), inner=basis_R.values[first]),
            Term("S", np.vstack([zero, eye]), inner=basis_S.values[first]),
        ],
        labels=[_label(basis_R.points[i]) for i in first],
    )


def bound_block(name: str, basis: SampledBasis, n: int, r_max: float) -> LMIBlock:
    """r_max I - Y(p) >= 0 at every point."""
    first = np.sort(np.unique(np.round(basis.values, 13), axis=0, return_index=True)[1])
    return LMIBlock(
        name=f"{name} bound",
        F0=np.tile(r_max * np.eye(n), (len(first), 1, 1)),
        terms=[Term(name, np.eye(n), inner=-basis.values[first])],
        labels=[_label(basis.points[i]) for i in first],
    )


def check_stabilisable(plants: Sequence[GeneralizedPlant], points: Array) -> None:
    """Raise an `AssumptionError` naming the point where (A, B2) or (A, C2) has an unstable mode out of reach."""
    for P, p in zip(plants, points):
        for A, B, what, actor in ((P.A, P.B2, "stabilisable", "u"), (P.A.T, P.C2.T, "detectable", "y")):
            scale = max(float(np.linalg.norm(A, 2)), float(np.linalg.norm(B, 2)), 1e-300)
            for s in np.linalg.eigvals(A):
                if s.real < -1e-10 * scale:
                    continue
                smallest = np.linalg.svd(np.hstack([A - s * np.eye(P.n_x), B]), compute_uv=False)[P.n_x - 1]
                if smallest <= UNCONTROLLABLE * scale:
                    raise AssumptionError(
                        f"the plant at p = {_label(p)} is not {what}: {actor} does not reach its mode {complex(s):.4g} "
                        "(in scaled time). Take integrators and unstable weights out of the plant, or add "
                        f"{'an actuator' if actor == 'u' else 'a sensor'}."
                    )


def _side_blocks(
    name: str, sides: Sequence[tuple[Array, Array, Array, Array, Array]], basis: SampledBasis, sign: float
) -> list[LMIBlock]:
    groups: dict[int, list[tuple[Array, Array, Array, Array, Array, Array, str]]] = {}
    for k, (A, B, C, D, constraint) in enumerate(sides):
        n, q = A.shape[0], B.shape[1]
        N = scipy.linalg.null_space(constraint)
        N1, N2, width = N[:n], N[n:], N.shape[1]
        s = width + q
        V, U, F0, Fg = np.zeros((s, n)), np.zeros((s, n)), np.zeros((s, s)), np.zeros((s, s))
        V[:width], U[:width] = N1.T, -(N1.T @ A + N2.T @ C)
        F0[:width, width:] = -(N1.T @ B + N2.T @ D)
        F0[width:, :width] = F0[:width, width:].T
        Fg[:width, :width], Fg[width:, width:] = N2.T @ N2, np.eye(q)
        for rates, vertex in zip(basis.rates[k], basis.vertices[k]):
            label = _label(basis.points[k]) + (f", rate {_label(vertex)}" if len(basis.rates[k]) > 1 else "")
            groups.setdefault(s, []).append((F0, Fg, V, U, basis.values[k], sign * rates, label))
    blocks = []
    for items in groups.values():
        F0s, Fgs, Vs, Us, values, inners = (np.stack([np.asarray(item[j]) for item in items]) for j in range(6))
        blocks.append(
            LMIBlock(
                name=name, F0=F0s, Fg=Fgs, terms=[Term(name, Vs, Us, values, inners)], labels=[str(i[6]) for i in items]
            )
        )
    return blocks


def _label(p: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in p) + ")"


def _expanded(Y: Array, basis: Basis | None, p: Array) -> Array:
    return Y[0] if basis is None else np.tensordot(np.atleast_1d(np.asarray(basis(p)[0], float)), Y, axes=1)


def _moved(Y: Array, basis: Basis | None, p: Array, p_dot: Array) -> Array:
    if basis is None:
        return np.zeros_like(Y[0])
    gradient = np.asarray(basis(p)[1], float).reshape(Y.shape[0], p.size)
    return np.tensordot(gradient @ p_dot, Y, axes=1)
