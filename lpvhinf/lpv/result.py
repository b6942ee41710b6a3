"""What a linear parameter-varying synthesis hands back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array
from lpvhinf.lpv.controller import FittedController, ScheduledController, position
from lpvhinf.lpv.lmi import LMISolution

#: p, p_dot -> P and dP/dt of the closed loop with the state (x, x_K).
LoopLyapunov = Callable[[Array, Array], tuple[Array, Array]]


@dataclass(frozen=True, kw_only=True, eq=False)
class LPVSynthesisResult:
    r"""A scheduled controller and what was recomputed of it.

    Attributes
    ----------
    gamma : float
        Level of the synthesis inequalities: they hold at all grid points and rate vertices, with R, S <= r_max.
        Never below the infimum.
    gamma_lower : float
        Lower bound on gamma from the dual problem, with R, S <= r_max; -infinity if there is none.
    gamma_achieved : float
        Level that the closed loop's Lyapunov matrix proves with `controller`, by the bounded-real inequality at all
        grid points and rate vertices. Between grid points nothing is proved.
    level : float
        Level that the controller was designed for: gamma times the back-off.
    controller : ScheduledController
        `.at(p)`, `.at(p, p_dot)`, `.to_lpv(degree)`.
    constant : str
        Which of R and S do not depend on p: "R", "S", "both" or "none".
    lmi_margin : float
        Smallest eigenvalue of the recomputed bounded-real inequalities of the closed loop at 1.001 gamma_achieved, in
        coordinates with P = I and a unit diagonal; positive where they hold.
    status : str
        How the solver ended, and what may be done about it.
    points : (N, n_p)
    frozen_norms : (N,)
        H-infinity norm of the closed loop at the grid points.
    points_between, frozen_norms_between : (M, n_p), (M,)
        Likewise between them, with plants found as `between` says.
    between : str
        "given", "combination of functions" or "piecewise linear".
    controller_poles : (N, n_K)
        At the grid points, at rest [rad/s].
    bound_activity : dict
        Largest eigenvalue of R and S over the grid as a share of r_max; near 1 a larger r_max lowers gamma.
    solution : LMISolution
        Of the solver, in scaled coordinates.
    """

    gamma: float
    gamma_lower: float
    gamma_achieved: float
    level: float
    controller: ScheduledController
    constant: str
    lmi_margin: float
    status: str
    points: Array
    frozen_norms: Array
    points_between: Array
    frozen_norms_between: Array
    between: str
    controller_poles: Array
    bound_activity: dict[str, float]
    solution: LMISolution = field(repr=False)
    _pair: Callable[[Array], tuple[Array, Array]] = field(repr=False)
    _loop_lyapunov: LoopLyapunov = field(repr=False)

    @property
    def fastest_pole(self) -> float:
        """Largest modulus of a controller pole at the grid points [rad/s]; zero for a gain."""
        return float(np.max(np.abs(self.controller_poles), initial=0.0))

    def lyapunov(self, p: ArrayLike) -> tuple[Array, Array]:
        """R(p), S(p) (n_x, n_x) in the plant's coordinates; of state feedback R(p) and its inverse."""
        return self._pair(position("p", p, self.points.shape[1]))

    def loop_lyapunov(self, p: ArrayLike, p_dot: ArrayLike | None = None) -> tuple[Array, Array]:
        """P and dP/dt (n, n) of the closed loop with the state (x, x_K), at rest where `p_dot` is left out."""
        n_p = self.points.shape[1]
        rate = np.zeros(n_p) if p_dot is None else position("p_dot", p_dot, n_p)
        return self._loop_lyapunov(position("p", p, n_p), rate)

    def candidate(self, p: ArrayLike) -> tuple[Array, Array]:
        """P(p) (n, n) and its gradient (n_p, n, n): pass it to `lpvnorm(..., candidate=result.candidate)`."""
        where = position("p", p, self.points.shape[1])
        P, _ = self._loop_lyapunov(where, np.zeros(len(where)))
        return P, np.stack([self._loop_lyapunov(where, axis)[1] for axis in np.eye(len(where))])

    def to_lpv(self, degree: int | Sequence[int]) -> FittedController:
        """The controller as an `LPVStateSpace` over the box of the grid, with its measured fit error.

        Raises
        ------
        AssumptionError
            If the controller depends on dp/dt, or the grid does not span a box.
        """
        return self.controller.to_lpv(degree)
