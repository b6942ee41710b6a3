"""What a structured synthesis hands back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lpvhinf.checks import Array
from lpvhinf.notebook import properties

if TYPE_CHECKING:
    import control

    from lpvhinf.hinfstruct.goals import GoalValue
    from lpvhinf.statespace.lpv import LPVStateSpace


@dataclass(frozen=True, kw_only=True)
class PhaseRecord:
    """One phase of one start.

    Attributes
    ----------
    start : int
        Number of the start, from zero; initial parameters come first.
    phase : str
        "stabilise", "descend" or "polish".
    evaluations : int
        Function evaluations of this phase.
    exact : int
        Exact norms and level tests of this phase, one a plant.
    seconds : float
        Wall time of this phase.
    gamma : float
        Norm at its end (by tracked peaks); infinity if not stabilised.
    reason : str
        Why the phase ended.
    """

    start: int
    phase: str
    evaluations: int
    exact: int
    seconds: float
    gamma: float
    reason: str


@dataclass(frozen=True, kw_only=True)
class Evaluations:
    """What a run cost.

    Attributes
    ----------
    trials : int
        Parameters at which the function was evaluated: trial steps of all phases and starts.
    exact : int
        Exact norms and level tests, one a plant. A single small loop is evaluated by its exact norm only.
    every_model : int
        Exact norms that a solver takes which evaluates every plant at each of these trials.
    """

    trials: int
    exact: int
    every_model: int

    def __add__(self, other: Evaluations) -> Evaluations:
        return Evaluations(
            trials=self.trials + other.trials,
            exact=self.exact + other.exact,
            every_model=self.every_model + other.every_model,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class HinfstructResult:
    """A structured H-infinity controller.

    Attributes
    ----------
    gamma : float
        Largest norm over the plants, recomputed exactly on the closed loops.
    controller : control.StateSpace or LPVStateSpace
        K with u = + K y; an LPVStateSpace where the structure is `Scheduled`.
    parameters : (n_parameters,)
        theta of the structure.
    gammas : (n_plants,)
        Exact norm of every plant's loop.
    gamma_worst : float
        Largest norm over the positions looked at; equal to `gamma` for a sequence of plants.
    worst_position : (n_p,) or None
        Position of the plant with the largest norm; None where no `points` were given.
    worst_frequency : float
        rad/s, where `gamma` is attained; infinity where the feed-through decides.
    lower_bound : float or None
        A lower bound on what any controller reaches. None: not computed, and nothing
        is claimed about the distance to the global minimum.
    optimality : float
        Length of the shortest convex combination of the gradients of log(gain) with respect to theta over the
        peaks within 1e-4 of the maximum: small at a local minimum (zero at an exact one).
    status : str
        How the run ended and what may be done about it.
    history : tuple of PhaseRecord
    evaluations : Evaluations
    stabilizing : bool
        Every closed loop is Hurwitz.
    interrupted : bool
        The run was ended by an interruption (Ctrl-C); the controller is the best so far.
    constraints : tuple of GoalValue
        Every constraint on its worst plant, recomputed exactly; its level is not above zero.
    objective : float or None
        The objective that was minimised in place of gamma, recomputed exactly; None where gamma was.
    """

    gamma: float
    controller: control.StateSpace | LPVStateSpace
    parameters: Array
    gammas: Array
    gamma_worst: float
    worst_position: Array | None
    worst_frequency: float
    lower_bound: float | None
    optimality: float
    status: str
    history: tuple[PhaseRecord, ...]
    evaluations: Evaluations
    stabilizing: bool
    interrupted: bool = False
    constraints: tuple[GoalValue, ...] = ()
    objective: float | None = None

    def __repr__(self) -> str:
        return (
            f"HinfstructResult(gamma={self.gamma:.6g}, {len(self.gammas)} plant(s), "
            f"{self.parameters.size} parameters, optimality={self.optimality:.2g}, status={self.status!r})"
        )

    def _repr_html_(self) -> str:
        values = [
            ("gamma", f"{self.gamma:.6g}"),
            ("over the positions", f"{self.gamma_worst:.6g}"),
            ("lower bound", "not computed" if self.lower_bound is None else f"{self.lower_bound:.6g}"),
            ("plants", str(len(self.gammas))),
            ("parameters", str(self.parameters.size)),
            ("stabilizing", "yes" if self.stabilizing else "no"),
            ("optimality", f"{self.optimality:.2g}"),
            *(
                (f"constraint {i + 1}", f"{goal.value:.6g}, {'holds' if goal.level <= 0.0 else 'fails'}")
                for i, goal in enumerate(self.constraints)
            ),
            ("status", self.status),
        ]
        return properties("HinfstructResult", values)
