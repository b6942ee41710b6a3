r"""Linear parameter-varying state feedback u = F(p) x.

With R(p) = P(p)^-1 the inequality of the control side of output feedback is all there is:

.. math::

    \begin{bmatrix} A R + R A^\top - \dot R + B_2 Y + Y^\top B_2^\top & (C_1 R + D_{12} Y)^\top & B_1 \\
    C_1 R + D_{12} Y & -\gamma I & D_{11} \\ B_1^\top & D_{11}^\top & -\gamma I \end{bmatrix} \prec 0,
    \quad F = Y R^{-1}

Y is eliminated, and then found by the formula that minimises the inequality's first block; it does not contain the rate
of p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, positive, read_only
from lpvhinf.errors import AssumptionError, SynthesisError
from lpvhinf.lpv.basis import SampledBasis, sampled_basis
from lpvhinf.lpv.conditioning import ScaledPlants, scaled_plants
from lpvhinf.lpv.controller import StateFeedback
from lpvhinf.lpv.gridded import R_MAX, bound_block, check_stabilisable, control_blocks
from lpvhinf.lpv.lmi import LMIBlock, LMIProblem, MatrixUnknown, Term
from lpvhinf.lpv.plant_family import PlantFamily, PlantFunction, plant_family
from lpvhinf.lpv.reconstruct import check_control_side, control_gain
from lpvhinf.lpv.result import LPVSynthesisResult
from lpvhinf.lpv.scheduling import BasisFunction, check_basis, corners, rate_bounds, spanned_box
from lpvhinf.lpv.solve_lmi import solve_lmi
from lpvhinf.lpv.verify import positions_between, verified
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

#: Relative gap at which R is far enough from singular.
MARGIN_GAP = 0.1


def lpvsyn_statefeedback(
    plants: Sequence[GeneralizedPlant] | LPVGeneralizedPlant | PlantFunction,
    points: ArrayLike,
    *,
    basis: BasisFunction | None = None,
    rate: ArrayLike | None = None,
    r_max: float = R_MAX,
    backoff: float = 1.01,
    solver: str = "structured",
    gap: float = 1e-5,
    box: ArrayLike | None = None,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> LPVSynthesisResult:
    r"""A scheduled state feedback u = F(p) x with a small induced L2 norm from w to z.

    Parameters
    ----------
    plants : sequence of N GeneralizedPlant, LPVGeneralizedPlant, or function p -> GeneralizedPlant
        With D12 of full column rank; their measurement is not used, the controller measures x.
    points : (N, n_p)
    basis, rate, r_max, backoff, solver, gap, box, time_limit, progress
        As for `lpvsyn`; `basis` is that of R(p).

    Returns
    -------
    LPVSynthesisResult
        `.controller.at(p)` is the gain F(p) as a `control.StateSpace` without states, from x to u.

    Raises
    ------
    AssumptionError
        If a plant is not stabilisable (the message says where), D12 lacks rank, the grid does not span the box or the
        basis has no constant term.
    SynthesisError
        If the inequalities are infeasible or were not solved.

    References
    ----------
    Wu, F., Yang, X. H., Packard, A. and Becker, G. (1996), Induced L2-norm control for LPV systems with bounded
    parameter variation rates, International Journal of Robust and Nonlinear Control 6, 983-998.

    Examples
    --------
    For x' = p x + w + u, z = (x, u) and p = 1 the gain F = -k gives |w -> z| = sqrt(1 + k^2) / (k - 1) at rest, which
    falls to 1 with growing k:

    >>> def plant(p):
    ...     return GeneralizedPlant([[p[0]]], [[1.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...                             [[0.0], [0.0]], [[0.0], [1.0]], [[0.0]])
    >>> result = lpvsyn_statefeedback(plant, [[-1.0], [1.0]])
    >>> 1.0 < result.gamma < 1.001
    True
    """
    most, step = positive("r_max", r_max), positive("backoff", backoff)
    given = plant_family(plants, points, basis)
    bounds = rate_bounds(rate, given.points.shape[1])
    over = plants.box if isinstance(plants, LPVGeneralizedPlant) and box is None else box
    where = spanned_box(given.points, over)
    check_basis(basis, given.points)
    for p, plant in zip(given.points, given.plants, strict=True):
        check_control_side(plant, f"at p = {p.tolist()}")
    family = PlantFamily(
        points=given.points,
        plants=tuple(_measuring_states(plant) for plant in given.plants),
        at=lambda p: _measuring_states(given.at(p)),
        between=given.between,
    )
    scaling = scaled_plants([_without_measurement(plant) for plant in given.plants])
    check_stabilisable([_measuring_states(plant) for plant in scaling.plants], given.points)
    used = basis if bounds is not None else None
    rates = np.zeros((1, len(where))) if bounds is None else corners(bounds)
    moving = np.zeros((len(where), 2)) if bounds is None else bounds / scaling.omega
    functions = sampled_basis(used, given.points, moving)
    problem = _problem(scaling, functions, most)
    solution = solve_lmi(problem, solver=solver, gap=gap, time_limit=time_limit, progress=progress)
    if not solution.usable:
        raise SynthesisError(
            f"no state feedback was found ({solution.status}: {solution.message}). Let R depend on p by a basis and a "
            "rate box, lower the rates, or raise r_max.",
            result=solution,
        )
    level = solution.gamma * step
    centre = solve_lmi(_well_inside(problem, level), solver=solver, gap=MARGIN_GAP, time_limit=time_limit)
    chosen = centre if centre.usable and centre.gamma < 0.0 else solution
    made = _GainOf(
        family=family,
        level=level,
        matrices=scaling.original_R(functions.matrices(chosen.unknowns["R"])),
        basis=used,
        scaling=scaling,
    )
    controller = StateFeedback(gain=made.gain, box=read_only(where))
    checked = verified(family, controller, made.lyapunov, rates, positions_between(family, where))
    active = float(np.linalg.eigvalsh(np.tensordot(functions.values, solution.unknowns["R"], 1)).max()) / most
    result = LPVSynthesisResult(
        gamma=solution.gamma,
        gamma_lower=solution.gamma_lower,
        gamma_achieved=checked.gamma_achieved,
        level=level,
        controller=controller,
        constant="both" if used is None else "none",
        lmi_margin=checked.lmi_margin,
        status=f"{solution.status}: {solution.message}",
        points=read_only(given.points),
        frozen_norms=checked.frozen_norms,
        points_between=checked.points_between,
        frozen_norms_between=checked.frozen_norms_between,
        between=given.between,
        controller_poles=checked.controller_poles,
        bound_activity={"R": active},
        solution=solution,
        _pair=made.pair,
        _loop_lyapunov=made.lyapunov,
    )
    if not checked.gamma_achieved <= 1.005 * level:
        raise SynthesisError(
            f"the closed loop proves the level {checked.gamma_achieved:.6g}, the design was made for {level:.6g}. "
            "Take a larger back-off or a smaller r_max.",
            result=result,
        )
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class _GainOf:
    """F(p) and the Lyapunov matrix from R(p)."""

    family: PlantFamily
    level: float
    matrices: Array
    basis: BasisFunction | None
    scaling: ScaledPlants

    def inverse(self, p: Array) -> tuple[Array, Array]:
        """R(p) and its gradient (n_p, n, n)."""
        Y = self.matrices
        if self.basis is None:
            return Y[0], np.zeros((len(p), *Y[0].shape))
        values, gradient = self.basis(p)
        slope = np.asarray(gradient, dtype=float).reshape(len(Y), len(p))
        return np.tensordot(np.asarray(values, dtype=float), Y, 1), np.tensordot(slope.T, Y, 1)

    def gain(self, p: Array) -> Array:
        """F(p)."""
        R = self.inverse(p)[0]
        Y = control_gain(self.family.at(p), R, self.level)
        return np.asarray(scipy.linalg.solve(R, Y.T, assume_a="pos").T)

    def pair(self, p: Array) -> tuple[Array, Array]:
        """R(p) and its inverse."""
        R = self.inverse(p)[0]
        return R, np.asarray(np.linalg.inv(R), dtype=float)

    def lyapunov(self, p: Array, p_dot: Array) -> tuple[Array, Array]:
        """P = R^-1 and dP/dt = -P dR/dt P."""
        R, gradient = self.inverse(p)
        P = np.linalg.inv(R)
        P = 0.5 * (P + P.T)
        return P, -P @ np.tensordot(p_dot, gradient, 1) @ P


def _problem(scaling: ScaledPlants, functions: SampledBasis, r_max: float) -> LMIProblem:
    n = scaling.plants[0].n_x
    R = MatrixUnknown(
        name="R", size=n, count=functions.count, bound=r_max, unit=tuple(float(c) for c in functions.unit)
    )
    lowest = LMIBlock(
        name="positive",
        F0=np.zeros((len(functions.values), n, n)),
        terms=[Term("R", np.eye(n), inner=functions.values)],
    )
    blocks = [*control_blocks(scaling.plants, functions), lowest, bound_block("R", functions, n, r_max)]
    return LMIProblem(unknowns=[R], blocks=blocks)


def _well_inside(problem: LMIProblem, level: float) -> LMIProblem:
    """Maximise t = -gamma with R >= t I at a fixed level."""
    fixed = problem.at_level(level)
    blocks = [
        replace(block, Fg=np.broadcast_to(np.eye(block.size), block.F0.shape)) if block.name == "positive" else block
        for block in fixed.blocks
    ]
    return LMIProblem(unknowns=fixed.unknowns, blocks=blocks)


def _measuring_states(plant: GeneralizedPlant) -> GeneralizedPlant:
    n = plant.n_x
    return GeneralizedPlant(
        plant.A, plant.B1, plant.B2, plant.C1, np.eye(n), plant.D11, plant.D12, np.zeros((n, plant.n_w))
    )


def _without_measurement(plant: GeneralizedPlant) -> GeneralizedPlant:
    """One measurement of nothing but a disturbance: the scaling wants D21 of full rank."""
    if plant.n_w == 0:
        raise AssumptionError("the plant has no disturbance w, so there is no gain to bound. Add one.")
    D21 = np.eye(1, plant.n_w)
    return GeneralizedPlant(plant.A, plant.B1, plant.B2, plant.C1, np.zeros((1, plant.n_x)), plant.D11, plant.D12, D21)
