r"""A primal-dual interior-point method for LMI problems of control.

Infeasible start, the HKM direction, Mehrotra's corrector. With multipliers X, slacks Z and the linear map F:

.. math:: F^* X = e_\gamma, \quad Z = F_0 + F y, \quad X Z = \mu I .

Every iteration factors one Schur complement (`lpvhinf.lpv.schur`). Once a full step on the slacks is taken, Z is
recomputed from y, so gamma is an upper bound up to round-off, which is checked at the end.

Source: C. Helmberg, F. Rendl, R. J. Vanderbei and H. Wolkowicz, SIAM Journal on Optimization 6 (1996); S. J. Wright,
Primal-Dual Interior-Point Methods, SIAM (1997).
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from lpvhinf.checks import Array, positive, read_only, whole_number
from lpvhinf.errors import AssumptionError
from lpvhinf.lpv.cone import inner, inverse_factors, inverses, longest_step, moved
from lpvhinf.lpv.farkas import ANY_LEVEL, certificate, lifted, without_gamma
from lpvhinf.lpv.linear_solve import REGULARISATION, Factor, factored, refined
from lpvhinf.lpv.lmi import InfeasibilityCertificate, LMIProblem, LMISolution
from lpvhinf.lpv.operator import LMIOperator
from lpvhinf.lpv.schur import operator_form, schur_complement, symmetric
from lpvhinf.lpv.start import starting_point
from lpvhinf.lpv.verdict import blended, holds, lower_bound
from lpvhinf.progress import SILENT, Progress

#: Slacks that differ from F0 + F y by less than this share count as feasible.
FEASIBLE = 1e-11
#: Steps below this length, or solutions with a larger relative residual, three times in a row, end the iteration.
SHORT, USELESS = 1e-3, 1e-2
#: Residuals of the multipliers below which the duality gap is taken for an estimate.
CONSISTENT = 1e-6
#: Corrections of a step after Mehrotra's, at most, for small and for large problems: each costs a solve with the factor
#: at hand, which is little where the factor is much.
CORRECTIONS = (2, 4)
#: Variables of a large problem.
LARGE = 2000
#: Relative residual of a solution below which the factor needs no refinement in this iteration.
ACCURATE = 1e-10
#: What the target is multiplied with where the step is long.
BOLDER = 0.4
#: A further correction is kept if it leaves less than this share of what the one before left.
WORTH = 0.98
#: A residual of the multipliers that is left as it is.
ROUND_OFF = 1e-12
#: Points are checked beyond round-off once the gap is this multiple of the wanted one; before, this many are kept.
NEAR, KEPT = 3.0, 4
#: Problems with fewer variables run on one thread: below this a second one costs more than it brings.
ONE_THREAD = 1500
#: Above this the next factor is regularised more.
INACCURATE = 1e-8
#: Steps of refinement of a solution, at most.
REFINEMENTS = 25


@dataclass
class Iterate:
    """Where the iteration stands."""

    y: Array
    X: list[Array]
    Z: list[Array]
    exact: bool  # Z is F0 + F y, recomputed


@dataclass
class Direction:
    """A step and how well its linear system was solved."""

    dy: Array
    dX: list[Array]
    dZ: list[Array]
    error: float


def interior_point(
    problem: LMIProblem,
    *,
    gap: float = 1e-5,
    max_iterations: int = 100,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> LMISolution:
    """Minimise gamma; see `lpvhinf.lpv.solve_lmi.solve_lmi`.

    Raises
    ------
    AssumptionError
        If no block contains gamma.
    DomainError
        If `gap`, `max_iterations` or `time_limit` is not positive.
    """
    gap = positive("gap", gap)
    whole_number("max_iterations", max_iterations, 1)
    if time_limit is not None:
        positive("time_limit", time_limit, "s")
    if all(block.Fg is None for block in problem.blocks):
        raise AssumptionError("no block of the problem contains gamma (Fg), so there is nothing to minimise.")
    began = time.monotonic()
    with threadpool_limits(limits=1 if problem.n_variables < ONE_THREAD else None, user_api="blas"):
        run = _Run(problem, gap, max_iterations, time_limit, progress)
        run.iterate()
        shown = None if run.best is not None else _infeasibility(problem, run, max_iterations, began, time_limit)
    return _solution(run, shown, time.monotonic() - began)


def _infeasibility(
    problem: LMIProblem, run: _Run, max_iterations: int, began: float, time_limit: float | None
) -> InfeasibilityCertificate | None:
    """A checked certificate that no gamma serves, from the run that failed or from the problem without gamma."""
    shown = certificate(problem, run.multipliers)
    if shown is not None and shown.gamma >= ANY_LEVEL:
        return shown
    relaxed = without_gamma(problem)
    left = None if time_limit is None else time_limit - (time.monotonic() - began)
    if relaxed is None or (left is not None and left <= 0.0):
        return None
    del run.H  # room for the second run
    second = _Run(relaxed[0], 0.1, max_iterations, left, SILENT, until=0.0)
    second.iterate()
    shown = certificate(problem, lifted(problem, second.multipliers, relaxed[1]))
    return shown if shown is not None and shown.gamma >= ANY_LEVEL else None


def _solution(run: _Run, shown: InfeasibilityCertificate | None, seconds: float) -> LMISolution:
    y = run.last if run.best is None else run.best
    gamma = np.inf if run.best is None else float(run.best[-1])
    status, message = "not solved", run.reason + "; no point was found that satisfies all inequalities beyond round-off"
    if run.best is not None:
        status = "optimal" if run.closed() <= run.gap else "feasible"
        message = run.reason
    elif shown is not None:
        status, message = "infeasible", "multipliers show that no gamma satisfies the inequalities"
    matrices = run.operator.matrices(y)
    return LMISolution(
        status=status,
        unknowns={name: read_only(Y) for name, Y in matrices.items()},
        gamma=gamma,
        gamma_lower=run.bound if shown is None else np.inf,
        gap=run.closed(),
        iterations=len(run.history),
        eigenvalues=run.problem.smallest_eigenvalues(matrices, float(y[-1])),
        certificate=shown,
        message=message,
        seconds=seconds,
        history=tuple(run.history),
    )


class _Run:
    """One run; `iterate` leaves its outcome in `best`, `bound`, `multipliers`, `last` and `reason`."""

    def __init__(
        self,
        problem: LMIProblem,
        gap: float,
        max_iterations: int,
        time_limit: float | None,
        progress: Progress,
        until: float = np.inf,
    ) -> None:
        self.problem, self.gap, self.progress, self.until = problem, gap, progress, until
        self.max_iterations, self.time_limit, self.began = max_iterations, time_limit, time.monotonic()
        self.operator = LMIOperator(problem)
        self.degree = sum(block.m * block.size for block in problem.blocks)
        self.goal = np.zeros(self.operator.n_variables)
        self.goal[-1] = 1.0
        self.H = np.zeros((self.operator.n_variables, self.operator.n_variables))
        self.level = 0
        self.history: list[dict[str, float]] = []
        self.best: Array | None = None  # the point of least gamma that holds beyond round-off
        self.bound, self.estimate = -np.inf, -np.inf
        self.multipliers: list[Array] = []
        self.pending: list[Array] = []  # feasible points that were not checked yet
        self.last = np.zeros(0)
        self.reason = ""

    def closed(self) -> float:
        """Relative gap between the best point and the dual estimate."""
        if self.best is None:
            return np.inf
        return float((self.best[-1] - self.estimate) / max(abs(self.best[-1]), 1e-12))

    def iterate(self) -> None:
        """Run until the gap is closed, or there is no going on."""
        self._iterate()
        for y in reversed(self.pending):  # points that were not looked at on the way
            if self.best is None:
                self.improve(y)
        for y in self.pending[-1:]:
            self.improve(y)

    def _iterate(self) -> None:
        now = Iterate(*starting_point(self.operator), exact=False)
        self.reason, short = "the limit of iterations was reached", 0
        for _ in range(self.max_iterations):
            mu = inner(now.X, now.Z) / self.degree
            residual_Z, off = self.record(now, mu)
            if self.best is not None and self.best[-1] < self.until < np.inf:
                self.reason = "the bound that was asked for cannot be reached"
                return
            if self.until == np.inf and self.closed() <= self.gap:
                self.reason = "the gap is closed"
                return
            if self.bound > self.until:
                self.reason = "the bound that was asked for is reached"
                return
            if self.time_limit is not None and time.monotonic() - self.began > self.time_limit:
                self.reason = "the time is over"
                return
            following, length, why = self.step(now, mu, residual_Z, off)
            if following is None:
                self.reason = why
                return
            short = short + 1 if length < SHORT or self.history[-1]["error"] > USELESS else 0
            if short == 3:
                self.reason = "round-off left no step"
                return
            now = following

    def record(self, now: Iterate, mu: float) -> tuple[list[Array], float]:
        """Note bounds, the best point and the history; the residuals of Z and their relative size."""
        value = self.operator.value(now.y)
        residual_Z = [f - z for f, z in zip(value, now.Z)]
        off = max(float(np.abs(r).max() / (1.0 + np.abs(f).max())) for r, f in zip(residual_Z, value))
        self.last, gamma = now.y, float(now.y[-1])
        bound = lower_bound(self.operator, now.X)
        if bound > self.bound or not self.multipliers:
            self.bound, self.multipliers = bound, now.X
        residual_X = float(np.linalg.norm(self.goal - self.operator.adjoint(now.X)))
        if residual_X <= CONSISTENT and off <= FEASIBLE:
            self.estimate = max(self.estimate, gamma - mu * self.degree)
        self.estimate = max(self.estimate, self.bound)
        open_gap = (gamma - self.estimate) / max(abs(gamma), 1e-12)
        if off <= FEASIBLE:
            self.pending.append(now.y)
            if open_gap <= NEAR * self.gap:
                for y in self.pending[-3:]:
                    self.improve(y)
                self.pending.clear()
            del self.pending[:-KEPT]
        self.history.append(
            {"gamma": gamma, "bound": bound, "mu": mu, "gap": open_gap, "off_Z": off, "off_X": residual_X}
        )
        self.progress.update(gamma=gamma, gap=open_gap)
        return residual_Z, off

    def improve(self, y: Array) -> None:
        """Take y as the best point if it holds, else what holds on the line to it."""
        if self.best is not None and not y[-1] < self.best[-1]:
            return
        if holds(self.operator, y):
            self.best = y
        elif self.best is not None:
            self.best = blended(self.operator, self.best, y)

    def step(self, now: Iterate, mu: float, residual_Z: list[Array], off: float) -> tuple[Iterate | None, float, str]:
        """The next iterate, the shorter of its step lengths, and why there is none."""
        L_X, L_Z = inverse_factors(now.X), inverse_factors(now.Z)
        if L_X is None or L_Z is None:
            return None, 0.0, "an iterate left the cone by round-off"
        W = inverses(L_Z)
        factor = factored(lambda H: schur_complement(self.operator, now.X, W, H), self.H, self.level)
        if factor is None:
            return None, 0.0, "the Schur complement could not be factored"
        system = _System(self.operator, now, W, residual_Z, self.goal, factor)
        chosen, along_X, along_Z, centring, error = self.mehrotra(system, now, L_X, L_Z, mu)
        # a factor of a matrix that is singular to round-off may succeed and be worth less than a regularised one
        self.level = min(factor.level + 1, len(REGULARISATION) - 1) if error > INACCURATE else max(0, factor.level - 1)
        self.history[-1].update(
            along_X=along_X, along_Z=along_Z, centring=centring, error=error, level=float(factor.level)
        )
        y = now.y + along_Z * chosen.dy
        Z, exact = moved(now.Z, along_Z, chosen.dZ), now.exact
        if exact or off * (1.0 - along_Z) <= FEASIBLE:
            recomputed = self.operator.value(y)
            if inverse_factors(recomputed) is not None:
                Z, exact = recomputed, True
        X = moved(now.X, along_X, chosen.dX)
        return Iterate(y, X, Z, exact), min(along_X, along_Z), ""

    def mehrotra(
        self, system: _System, now: Iterate, L_X: list[Array], L_Z: list[Array], mu: float
    ) -> tuple[Direction, float, float, float, float]:
        """Mehrotra's step, corrected further where that pays, its lengths in X and Z, its centring and the error."""
        plain = system.plain()
        along_X, along_Z = (min(1.0, along) for along in lengths(L_X, L_Z, plain))
        aimed = inner(moved(now.X, along_X, plain.dX), moved(now.Z, along_Z, plain.dZ)) / self.degree
        second, centre = system.second_order(plain), system.centring()
        centring = min(1.0, max(1e-3, (max(aimed, 0.0) / mu) ** max(1.0, 2.0 * min(along_X, along_Z) ** 2)))
        if min(along_X, along_Z) < 0.1:
            centring = max(centring, 0.5)
        chosen = combination(plain, (1.0, second), (centring * mu, centre))
        to_X, to_Z = lengths(L_X, L_Z, chosen)
        shorter = min(1.0, to_X, to_Z)
        for _ in range(
            CORRECTIONS[self.operator.n_variables >= LARGE]
        ):  # the second order of a better step, and a bolder target where there is room
            bolder = max(1e-3, BOLDER * centring) if shorter > 0.9 else centring
            trial = combination(plain, (1.0, system.second_order(chosen)), (bolder * mu, centre))
            trial_X, trial_Z = lengths(L_X, L_Z, trial)
            length = min(1.0, trial_X, trial_Z)
            left, before = 1.0 - length * (1.0 - bolder), 1.0 - shorter * (1.0 - centring)
            if left >= WORTH * before or length < min(0.5, shorter):
                break
            chosen, shorter, centring, to_X, to_Z = trial, length, bolder, trial_X, trial_Z
        corrected = system.corrected(chosen)
        if corrected is not chosen:
            chosen, (to_X, to_Z) = corrected, lengths(L_X, L_Z, corrected)
        share = 0.9 + 0.07 * min(1.0, to_X, to_Z)
        return chosen, min(1.0, share * to_X), min(1.0, share * to_Z), centring, max(plain.error, second.error)


def lengths(L_X: list[Array], L_Z: list[Array], step: Direction) -> tuple[float, float]:
    """Step lengths to the boundaries of the cones."""
    return longest_step(L_X, step.dX), longest_step(L_Z, step.dZ)


def combination(first: Direction, *others: tuple[float, Direction]) -> Direction:
    """First + sum of weight * direction."""
    dy, dX, dZ = first.dy, first.dX, first.dZ
    for weight, other in others:
        dy = dy + weight * other.dy
        dX = [a + weight * b for a, b in zip(dX, other.dX)]
        dZ = [a + weight * b for a, b in zip(dZ, other.dZ)]
    return Direction(dy, dX, dZ, max([first.error] + [other.error for _, other in others]))


class _System:
    """The linearised conditions at an iterate, with the factor that solves them."""

    def __init__(
        self,
        operator: LMIOperator,
        now: Iterate,
        W: list[Array],
        residual_Z: list[Array],
        goal: Array,
        factor: Factor,
    ) -> None:
        self.operator, self.X, self.W, self.residual_Z, self.factor = operator, now.X, W, residual_Z, factor
        self.goal = goal
        self.accurate = False  # the factor alone solves well enough; what it leaves, `corrected` removes

    def solved(self, r: Array) -> tuple[Array, list[Array], float]:
        """dy, F dy and the error for a right-hand side."""
        if self.accurate:
            dy, error = self.factor.solve(r), 0.0
        else:
            dy, error, before = refined(
                self.factor, lambda v: operator_form(self.operator, self.X, self.W, v), r, REFINEMENTS
            )
            self.accurate = self.factor.level == 0 and before <= ACCURATE
        return dy, self.operator.linear(dy), error

    def plain(self) -> Direction:
        """The step towards X Z = 0 that removes all residuals."""
        skewed = self.through(self.residual_Z)
        dy, linear, error = self.solved(-self.goal - self.operator.adjoint(skewed))
        dZ = [symmetric(f + rest) for f, rest in zip(linear, self.residual_Z)]
        return Direction(dy, [-x - t for x, t in zip(self.X, self.through(dZ))], dZ, error)

    def centring(self) -> Direction:
        """What a target X Z = I adds."""
        dy, linear, error = self.solved(self.operator.adjoint(self.W))
        return Direction(dy, [w - t for w, t in zip(self.W, self.through(linear))], linear, error)

    def second_order(self, plain: Direction) -> Direction:
        """Mehrotra's correction: what the product of the steps in X and Z would leave."""
        product = [symmetric(dx @ dz @ w) for dx, dz, w in zip(plain.dX, plain.dZ, self.W)]
        dy, linear, error = self.solved(-self.operator.adjoint(product))
        return Direction(dy, [-q - t for q, t in zip(product, self.through(linear))], linear, error)

    def corrected(self, step: Direction) -> Direction:
        """The step with the residual that round-off leaves in F* (X + dX) removed, as far as round-off allows."""
        first, best, least = step, step, np.inf
        for _ in range(3):
            left = self.goal - self.operator.adjoint([x + d for x, d in zip(self.X, step.dX)])
            size = float(np.linalg.norm(left))
            if size < least:
                best, least = step, size
            if size <= ROUND_OFF or (size > 0.5 * least and step is not best):
                break
            dy = self.factor.solve(left)
            linear = self.operator.linear(dy)
            step = Direction(
                step.dy - dy,
                [a + b for a, b in zip(step.dX, self.through(linear))],
                [a - b for a, b in zip(step.dZ, linear)],
                size,
            )
        return first if best is first else Direction(best.dy, best.dX, best.dZ, least)

    def through(self, T: list[Array]) -> list[Array]:
        """Symmetric part of X T W."""
        return [symmetric(x @ t @ w) for x, t, w in zip(self.X, T, self.W)]
