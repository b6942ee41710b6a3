r"""From a solved synthesis problem to a controller that can be implemented.

At the optimum of gamma the matrix [R I; I S] is nearly singular somewhere, and the controller has poles far beyond
anything in the plant. So gamma is given up a little, by the back-off, and the room is used for the largest t with

.. math:: \begin{bmatrix} R(p) & t I \\ t I & S(p) \end{bmatrix} \succeq 0 .

It is independent of the coordinates of the state, and I - R S, which is inverted, gets eigenvalues of at most 1 - t^2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.controller import ExplicitController
from lpvhinf.lpv.gridded import GriddedLMIs, LyapunovPair
from lpvhinf.lpv.lmi import LMIProblem, LMISolution
from lpvhinf.lpv.plant_family import PlantFamily
from lpvhinf.lpv.reconstruct import constant_factor, loop_lyapunov, needs_feedthrough
from lpvhinf.lpv.result import LoopLyapunov
from lpvhinf.lpv.solve_lmi import solve_lmi

#: Relative gap at which the margin is large enough: the matrices shall stay inside the cone.
MARGIN_GAP = 0.01
#: Shares by which R and S grow to hold where a general solver misses the inequalities.
REPAIRS = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Design:
    """A controller with the Lyapunov matrices it was made from.

    Attributes
    ----------
    controller : ExplicitController
    pair : LyapunovPair
    lyapunov : callable
        p, p_dot -> P, dP/dt of the closed loop in the plant's coordinates.
    level : float
    coupling : float
        The largest t found.
    """

    controller: ExplicitController
    pair: LyapunovPair
    lyapunov: LoopLyapunov
    level: float
    coupling: float


def coupling_problem(lmis: GriddedLMIs, level: float) -> LMIProblem:
    """Maximise the coupling margin t = -gamma at a fixed level."""
    problem = lmis.problem.at_level(level)
    blocks = [
        replace(block, F0=np.zeros_like(block.F0), Fg=block.F0.copy()) if block.name == "coupling" else block
        for block in problem.blocks
    ]
    return LMIProblem(unknowns=problem.unknowns, blocks=blocks)


def recentred(lmis: GriddedLMIs, level: float, *, solver: str, time_limit: float | None) -> LMISolution | None:
    """R and S with a large coupling margin at a level, or None if there are none with t > 1.

    General solvers miss the inequalities by round-off. That is no reason to drop what they found: what the controller
    made from it is worth is recomputed from the closed loop.
    """
    solution = solve_lmi(coupling_problem(lmis, level), solver=solver, gap=MARGIN_GAP, time_limit=time_limit)
    if solution.usable:
        return solution if solution.gamma < -1.0 else None
    general = solver != "structured" and solution.status == "not solved"
    return solution if general and np.any(solution.unknowns["R"]) else None


def repaired(problem: LMIProblem, solution: LMISolution) -> LMISolution:
    """What a general solver found, moved inside where it misses the inequalities by round-off.

    R and S grow by a small share, which opens their coupling, and gamma by a larger one.
    """
    if solution.usable or not np.isfinite(solution.gamma_lower) or solution.status == "infeasible":
        return solution
    for share in REPAIRS:
        unknowns = {name: (1.0 + share) * Y for name, Y in solution.unknowns.items()}
        for growth in (1.0, 10.0, 100.0):
            gamma = solution.gamma_lower * (1.0 + share * growth)
            found = problem.smallest_eigenvalues(unknowns, gamma)
            if min(float(values.min()) for values in found.values()) > 1e-3 * share:
                message = f"{solution.message}; moved inside by a share of {share:.0e}"
                return replace(
                    solution, status="feasible", unknowns=unknowns, gamma=gamma, eigenvalues=found, message=message
                )
    return solution


def design(family: PlantFamily, lmis: GriddedLMIs, solution: LMISolution, level: float, box: Array) -> Design:
    """The explicit controller at a level above gamma."""
    pair, scaling = lmis.lyapunov(solution), lmis.scaling
    samples = [pair.at(p) for p in family.points]
    R, S = (np.mean([sample[k] for sample in samples], axis=0) for k in range(2))
    factor = constant_factor("M" if lmis.constant == "R" else "N", scaling.scaled_R(R), scaling.scaled_S(S))
    controller = ExplicitController(
        family=family,
        pair=pair,
        level=level,
        factor=factor,
        omega=scaling.omega,
        T=scaling.T,
        has_feedthrough=needs_feedthrough(list(family.plants), level),
        needs_rate=lmis.constant == "none",
        box=box,
    )
    n, T = len(R), scaling.T
    back = np.concatenate([1.0 / T, np.ones(n)])

    def lyapunov(p: Array, p_dot: Array) -> tuple[Array, Array]:
        P, P_dot = loop_lyapunov(*controller.scaled_pair(p), factor, *controller.scaled_rates(p, p_dot))
        return P * back[:, None] * back, scaling.omega * P_dot * back[:, None] * back

    return Design(controller=controller, pair=pair, lyapunov=lyapunov, level=level, coupling=-solution.gamma)
