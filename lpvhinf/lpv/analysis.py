"""The induced L2 norm of a linear parameter-varying system, by parameter-dependent Lyapunov matrices on a grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, positive, read_only
from lpvhinf.errors import DimensionError, DomainError, SynthesisError
from lpvhinf.lpv.basis import SampledBasis, sampled_basis
from lpvhinf.lpv.bounded_real import gains, proven_level, smallest_margin
from lpvhinf.lpv.conditioning import balancing, time_unit
from lpvhinf.lpv.lmi import LMIBlock, LMIProblem, LMISolution, MatrixUnknown, Term
from lpvhinf.lpv.scheduling import BasisFunction, check_basis, corners, grid_points, rate_bounds
from lpvhinf.lpv.solve_lmi import solve_lmi
from lpvhinf.statespace.interop import state_space_matrices
from lpvhinf.statespace.lpv import LPVStateSpace

Matrices = tuple[Array, Array, Array, Array]
Candidate = Callable[[Array], tuple[Array, Array]]

#: Smallest eigenvalue of X in scaled coordinates, relative to the largest that is allowed.
SMALLEST = 1e-12
FORMS = ("primal", "dual")


@dataclass(frozen=True, kw_only=True, eq=False)
class LPVNormResult:
    r"""A bound on the induced L2 norm, with the Lyapunov matrix that proves it at the grid points.

    Attributes
    ----------
    gamma : float
        The bounded-real inequality holds at every grid point and rate vertex for every level above it, recomputed from
        X and the systems. Infinity where no X was found.
    lower : float
        Largest frozen gain seen on a grid of frequencies: no smaller level can be proved.
    lmi_margin : float
        Smallest eigenvalue of the recomputed inequalities at 1.001 gamma, in coordinates with X = I and a unit
        diagonal; positive where they hold.
    status : str
    worst_point : (n_p,)
        Grid point that decides gamma.
    points : (N, n_p)
    solution : LMISolution or None
        Of the solver, in scaled coordinates; None where a candidate was evaluated.
    """

    gamma: float
    lower: float
    lmi_margin: float
    status: str
    worst_point: Array
    points: Array
    solution: LMISolution | None
    _candidate: Candidate | None = field(repr=False)

    def lyapunov(self, p: ArrayLike) -> Array:
        """X(p) (n, n), with :math:`d(x^T X x)/dt < gamma |w|^2 - |z|^2 / gamma` at the grid points.

        Raises
        ------
        SynthesisError
            If none was found.
        """
        return self.candidate(p)[0]

    def candidate(self, p: ArrayLike) -> tuple[Array, Array]:
        """X(p) (n, n) and its gradient (n_p, n, n).

        Raises
        ------
        SynthesisError
            If none was found.
        """
        if self._candidate is None:
            raise SynthesisError(f"there is no Lyapunov matrix: {self.status}", result=self)
        return self._candidate(np.asarray(p, dtype=float).reshape(-1))


def lpvnorm(
    systems: Sequence[Any] | LPVStateSpace,
    points: ArrayLike,
    *,
    basis: BasisFunction | None = None,
    rate: ArrayLike | None = None,
    form: str = "primal",
    candidate: Candidate | None = None,
    x_max: float = 1e7,
    gap: float = 1e-6,
    solver: str = "structured",
) -> LPVNormResult:
    r"""Smallest level of the bounded-real inequality over Lyapunov matrices :math:`X(p) = \sum_i f_i(p) X_i`.

    It bounds the induced L2 norm from w to z along all trajectories that stay on the grid points' inequalities; what
    holds between the points is not proved here.

    Parameters
    ----------
    systems : sequence of N systems, or LPVStateSpace
        `control.StateSpace` in continuous time (or anything read as one), frozen at `points`, in the same states:
        parameter-varying systems do not tolerate a change of state from point to point.
    points : (N, n_p)
    basis : callable, optional
        p -> values (n_b,), gradient (n_b, n_p); some combination must be constant. Left out: X does not depend on p.
    rate : (n_p, 2), optional
        Lowest and highest dp/dt. Left out: p may move at any speed, then X is constant and `basis` is of no use.
    form : "primal" or "dual"
        Whether X(p), or its inverse, is the combination of the basis functions; both bounds are valid, and differ where
        X depends on p. The dual is the one that fits closed loops of `lpvsyn` with a constant S.
    candidate : callable, optional
        p -> X (n, n), gradient (n_p, n, n), such as the Lyapunov matrix of a synthesis. Its level is computed instead
        of solving for X; with `rate` left out its gradient must vanish.
    x_max : float
        Bound on the eigenvalues of X in scaled coordinates.
    gap : float
        Relative gap at which the solver stops.
    solver : "structured" or "clarabel"

    Returns
    -------
    LPVNormResult

    Raises
    ------
    DimensionError
        If sizes disagree.
    DomainError
        If a system is in discrete time, the rate box is empty or an option is unknown.
    AssumptionError
        If the basis has no constant term or a wrong gradient.

    References
    ----------
    Wu, F., Yang, X. H., Packard, A. and Becker, G. (1996), Induced L2-norm control for LPV systems with bounded
    parameter variation rates, International Journal of Robust and Nonlinear Control 6, 983-998.

    Examples
    --------
    The gain of x' = -a x + w, z = x is 1/a: the slowest of three frozen systems decides.

    >>> import control
    >>> systems = [control.ss([[-a]], [[1.0]], [[1.0]], [[0.0]]) for a in (2.0, 3.0, 4.0)]
    >>> result = lpvnorm(systems, [[2.0], [3.0], [4.0]])
    >>> round(result.gamma, 4)
    0.5
    """
    if form not in FORMS:
        raise DomainError(f"form is {form!r}, wanted one of {', '.join(FORMS)}.")
    if isinstance(systems, LPVStateSpace):
        systems = list(zip(*systems.sample(points), strict=True))
    data = _checked_systems(systems)
    where = grid_points(points, len(data))
    box = rate_bounds(rate, where.shape[1])
    rates = None if box is None else corners(box)
    most = positive("x_max", x_max)
    check_basis(basis, where)
    unstable = next((k for k, (A, *_) in enumerate(data) if _abscissa(A) >= 0.0), None)
    lower = max(_frozen_gain(*m) for m in data) if unstable is None else np.inf
    if unstable is not None:
        status = f"the system at p = {where[unstable].tolist()} is not Hurwitz: no level holds"
        return _no_result(where, where[unstable], lower, status, None)
    if candidate is not None:
        return _evaluated(data, where, rates, candidate, lower, "the candidate was evaluated", None)
    if data[0][0].shape[0] == 0:
        empty = np.zeros((0, 0)), np.zeros((where.shape[1], 0, 0))
        return _evaluated(data, where, rates, lambda _: empty, lower, "there are no states", None)
    dual = form == "dual"
    # the inverse of X obeys the same inequality for the transposed systems, with the rates reversed
    stated = [(A.T, C.T, B.T, D.T) for A, B, C, D in data] if dual else data
    scale = _scaling(stated, lower)
    # where p may jump, only a matrix that does not move with it is a Lyapunov matrix
    used = basis if box is not None else None
    moving = np.zeros((where.shape[1], 2)) if box is None else box / scale.omega
    functions = sampled_basis(used, where, -moving[:, ::-1] if dual else moving)
    problem = _problem(_scaled(stated, scale), functions, most)
    solution = solve_lmi(problem, solver=solver, gap=gap)
    Y = functions.matrices(solution.unknowns["X"]) * (scale.level / (scale.T[:, None] * scale.T))

    def lyapunov(p: Array) -> tuple[Array, Array]:
        if used is None:
            X, slope = Y[0], np.zeros((len(p), *Y[0].shape))
        else:
            values, gradient = used(p)
            X = np.tensordot(np.asarray(values, dtype=float), Y, 1)
            slope = np.tensordot(np.asarray(gradient, dtype=float).reshape(len(Y), len(p)).T, Y, 1)
        if dual:
            X = np.linalg.inv(X)
            slope = -X @ slope @ X
        return np.asarray(X, dtype=float), np.asarray(slope, dtype=float)

    status = f"{solution.status}: {solution.message}" if solution.message else solution.status
    if basis is not None and rates is None:
        status += "; rate left out: p may move at any speed, so X is constant"
    result = _evaluated(data, where, rates, lyapunov, lower, status, solution)
    if not np.isfinite(result.gamma):
        return _no_result(where, result.worst_point, lower, status, solution)
    if solution.status == "not solved":  # by its own measure: X proves a level all the same
        return replace(result, status=f"feasible: X proves gamma, though the solver ended {status}")
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scaling:
    """x = T x_hat, t = t_hat / omega, and z / level."""

    omega: float
    T: Array
    level: float


def _checked_systems(systems: Sequence[Any]) -> list[Matrices]:
    try:
        given = list(systems)
    except TypeError as error:
        raise DomainError(
            f"systems is {type(systems).__name__}, wanted a sequence of control.StateSpace, one for each point."
        ) from error
    if not given:
        raise DimensionError("systems is empty, wanted one system for each point.")
    data: list[Matrices] = []
    for k, system in enumerate(given):
        if getattr(system, "dt", None) not in (None, 0):
            raise DomainError(f"systems[{k}] has the sampling time {system.dt}, wanted continuous time.")
        A, B, C, D = (np.asarray(m, dtype=float) for m in state_space_matrices(system))
        data.append((A, B, C, D))
    shapes = [tuple(m.shape for m in matrices) for matrices in data]
    for k, shape in enumerate(shapes):
        if shape != shapes[0]:
            raise DimensionError(f"systems[{k}] has matrices {shape}, systems[0] has {shapes[0]}, wanted the same.")
    return data


def _abscissa(A: Array) -> float:
    return float(np.max(np.linalg.eigvals(A).real, initial=-np.inf))


def _frozen_gain(A: Array, B: Array, C: Array, D: Array) -> float:
    """Largest gain on a grid of frequencies around the poles: at most the frozen norm."""
    if A.shape[0] == 0:
        return float(np.linalg.norm(D, 2)) if D.size else 0.0
    moduli = np.abs(np.linalg.eigvals(A))
    low, high = max(float(moduli.min()), 1e-9 * float(moduli.max())), float(moduli.max())
    omega = np.unique(np.concatenate([[0.0], np.geomspace(0.1 * low, 10.0 * high, 60), moduli]))
    return max(float(np.max(gains(A, B, C, D, omega))), float(np.linalg.norm(D, 2)))


def _scaling(data: list[Matrices], lower: float) -> _Scaling:
    A, B, C = (np.stack([m[k] for m in data]) for k in range(3))
    omega = time_unit(A)
    # a system that vanishes at every frozen position, but not where p moves, has no gain to scale with
    reach = max(float(np.linalg.norm(b, 2) * np.linalg.norm(c, 2)) for b, c in zip(B, C, strict=True)) / omega
    level = max(lower, 1e-3 * reach)
    level = float(2.0 ** np.round(np.log2(level))) if level > 0.0 else 1.0
    return _Scaling(omega=omega, T=balancing(A / omega, B / np.sqrt(omega), C / np.sqrt(omega) / level), level=level)


def _scaled(data: list[Matrices], scale: _Scaling) -> list[Matrices]:
    root = np.sqrt(scale.omega)
    return [
        (
            A * scale.T / scale.T[:, None] / scale.omega,
            B / scale.T[:, None] / root,
            C * scale.T / root / scale.level,
            D / scale.level,
        )
        for A, B, C, D in data
    ]


def _problem(data: list[Matrices], functions: SampledBasis, most: float) -> LMIProblem:
    """One bounded-real inequality for each grid point and rate vertex, and bounds on X at each grid point."""
    n, n_w = data[0][1].shape
    n_z = data[0][2].shape[0]
    size = n + n_w + n_z
    V = np.vstack([np.eye(n), np.zeros((n_w + n_z, n))])
    F0, U, value, inner = [], [], [], []
    for (A, B, C, D), f, slopes in zip(data, functions.values, functions.rates, strict=True):
        constant = np.zeros((size, size))
        constant[n + n_w :, :n], constant[n + n_w :, n : n + n_w] = -C, -D
        for slope in slopes:
            F0.append(constant + constant.T)
            U.append(-np.vstack([A.T, B.T, np.zeros((n_z, n))]))
            value.append(f)
            inner.append(-slope)
    Fg = np.broadcast_to(np.diag(np.concatenate([np.zeros(n), np.ones(n_w + n_z)])), (len(F0), size, size))
    gain = LMIBlock(
        name="gain", F0=np.stack(F0), Fg=Fg, terms=[Term("X", V, np.stack(U), np.stack(value), np.stack(inner))]
    )
    f = functions.values[np.sort(np.unique(np.round(functions.values, 13), axis=0, return_index=True)[1])]
    identity = np.broadcast_to(np.eye(n), (len(f), n, n))
    lowest = LMIBlock(name="positive", F0=-SMALLEST * most * identity, terms=[Term("X", np.eye(n), inner=f)])
    highest = LMIBlock(name="bound", F0=most * identity, terms=[Term("X", np.eye(n), inner=-f)])
    X = MatrixUnknown(name="X", size=n, count=functions.count, bound=most, unit=tuple(map(float, functions.unit)))
    return LMIProblem(unknowns=[X], blocks=[gain, lowest, highest])


def _evaluated(
    data: list[Matrices],
    where: Array,
    rates: Array | None,
    candidate: Candidate,
    lower: float,
    status: str,
    solution: LMISolution | None,
) -> LPVNormResult:
    """The level that a Lyapunov matrix proves at all points and rate vertices."""
    n, levels, cases = data[0][0].shape[0], [], []
    for p, matrices in zip(where, data, strict=True):
        X, gradient = (np.asarray(m, dtype=float) for m in candidate(p))
        if X.shape != (n, n) or gradient.shape != (where.shape[1], n, n):
            raise DimensionError(
                f"candidate({p.tolist()}) has shapes {X.shape} and {gradient.shape}, wanted ({n}, {n}) and "
                f"({where.shape[1]}, {n}, {n}): X and its gradient."
            )
        if rates is None and np.max(np.abs(gradient), initial=0.0) > 1e-9 * np.max(np.abs(X), initial=1e-300):
            raise DomainError("the candidate depends on p, but rate is left out: give the rate box.")
        slopes = np.zeros((1, n, n)) if rates is None else np.tensordot(rates, gradient, 1)
        levels.append(max(proven_level(*matrices, X, slope) for slope in slopes))
        cases.append((matrices, X, slopes))
    worst = int(np.argmax(levels))
    gamma = float(levels[worst])
    margin = min(
        (smallest_margin(*m, X, slope, 1.001 * gamma) for m, X, slopes in cases for slope in slopes), default=np.inf
    )
    return LPVNormResult(
        gamma=gamma,
        lower=lower,
        lmi_margin=margin if np.isfinite(gamma) else -np.inf,
        status=status,
        worst_point=read_only(where[worst]),
        points=read_only(where),
        solution=solution,
        _candidate=candidate,
    )


def _no_result(where: Array, worst: Array, lower: float, status: str, solution: LMISolution | None) -> LPVNormResult:
    return LPVNormResult(
        gamma=np.inf,
        lower=lower,
        lmi_margin=-np.inf,
        status=status,
        worst_point=read_only(worst),
        points=read_only(where),
        solution=solution,
        _candidate=None,
    )
