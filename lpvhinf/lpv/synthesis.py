"""Linear parameter-varying output-feedback synthesis on a grid or a polytope."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.errors import AssumptionError, DomainError, SynthesisError
from lpvhinf.lpv.design import Design, design, recentred, repaired
from lpvhinf.lpv.gridded import CONSTANT, R_MAX, GriddedLMIs, gridded_lmis
from lpvhinf.lpv.lmi import LMISolution
from lpvhinf.lpv.plant_family import PlantFamily, PlantFunction, plant_family
from lpvhinf.lpv.polytopic import check_constant, check_polytope, self_scheduled
from lpvhinf.lpv.reconstruct import check_reconstructible
from lpvhinf.lpv.result import LPVSynthesisResult
from lpvhinf.lpv.scheduling import BasisFunction, check_basis, corners, rate_bounds, spanned_box
from lpvhinf.lpv.solve_lmi import solve_lmi
from lpvhinf.lpv.verify import Verified, positions_between, verified
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

METHODS = ("gridded", "polytopic")
#: Back-offs tried after the one asked for, where the controller cannot be verified or is too fast.
FURTHER = (1.014, 1.019, 1.05, 1.1, 1.2, 1.5)
#: Share by which a level counts as reached.
REACHED = 1e-6


@dataclass(frozen=True, kw_only=True)
class _Options:
    solver: str
    gap: float
    backoff: float
    max_pole: float | None
    time_limit: float | None
    progress: Progress


def lpvsyn(
    plants: Sequence[GeneralizedPlant] | LPVGeneralizedPlant | PlantFunction,
    points: ArrayLike,
    *,
    method: str = "gridded",
    basis: BasisFunction | None = None,
    rate: ArrayLike | None = None,
    constant: str = "auto",
    gamma: float | None = None,
    r_max: float = R_MAX,
    backoff: float = 1.01,
    max_pole: float | None = None,
    solver: str = "structured",
    gap: float = 1e-5,
    box: ArrayLike | None = None,
    weights: Callable[[Array], Array] | None = None,
    time_limit: float | None = None,
    progress: Progress = SILENT,
) -> LPVSynthesisResult:
    r"""A scheduled controller u = K(p) y with a small induced L2 norm from w to z for all p(t) in a box.

    Gridded: the synthesis inequalities in :math:`R(p) = \sum_i f_i(p) R_i` and S(p) hold at every grid point and every
    vertex of the rate box; between the points nothing is proved. Polytopic: R and S are constant, and the inequalities
    at the vertices hold for all plants between them, at any rate, with a controller that is the same blend of vertex
    controllers. p is treated as exogenous, also where it is a state of the real machine.

    Parameters
    ----------
    plants : sequence of N GeneralizedPlant, LPVGeneralizedPlant, or function p -> GeneralizedPlant
        With D22 = 0, D12 of full column rank and D21 of full row rank, all in the same states. Of a sequence the plants
        between the points are taken as the combination of 1, p and the basis that agrees with all of them, if there is
        one, else as piecewise linear; the controller between grid points is made for these.
    points : (N, n_p)
        Grid, scattered or not; the vertices for method "polytopic".
    method : "gridded" or "polytopic"
    basis : callable, optional
        p -> values (n_b,), gradient (n_b, n_p), with the constant in its span; see `lpvhinf.lpv.monomials`. Left out:
        R and S are constant.
    rate : (n_p, 2), optional
        Lowest and highest dp/dt. Left out: p may move at any speed, R and S are constant and `basis` is of no use.
    constant : "auto", "S", "R", "both" or "none"
        Which of R and S do not depend on p. The controller depends on dp/dt for "none" only. "auto" tries "S" and "R"
        and takes the one with the smaller gamma.
    gamma : float, optional
        Level to design for, in place of the back-off from the smallest one.
    r_max : float
        Bound on R and S in scaled coordinates.
    backoff : float
        The controller is designed for `backoff` times the smallest gamma; the larger, the slower its poles.
    max_pole : float, optional
        Largest modulus of the controller's poles at the grid points [rad/s]; the back-off grows up to 1.5 to keep it.
    solver : "structured" or "clarabel"
    gap : float
        Relative gap of gamma at which the solver stops.
    box : (n_p, 2), optional
        Box that the grid must span; known for an LPVGeneralizedPlant.
    weights : callable, optional
        For "polytopic": p -> weights (N,) of the vertices, where p is not the position in the polytope itself; `box`
        is that of p then.
    time_limit : float, optional
        Seconds for each of the problems solved.
    progress : Progress

    Returns
    -------
    LPVSynthesisResult

    Raises
    ------
    DimensionError, DomainError
        If sizes disagree, the rate box is empty, or an option is unknown.
    AssumptionError
        If a plant is not stabilisable or detectable (the message says where), D22 is not zero, D12 or D21 lacks rank,
        the basis has no constant term, the grid does not span the box, the vertices are those of no polytope, B2, C2,
        D12 or D21 differ between vertices, or `gamma` is below what can be reached at a single point.
    SynthesisError
        If the inequalities are infeasible (`.result.certificate` shows it) or were not solved, or no back-off gives a
        controller that can be verified.

    References
    ----------
    Wu, F., Yang, X. H., Packard, A. and Becker, G. (1996), International Journal of Robust and Nonlinear Control 6,
    983-998; Apkarian, P. and Adams, R. J. (1998), IEEE Transactions on Control Systems Technology 6, 21-32; Apkarian,
    P., Gahinet, P. and Becker, G. (1995), Self-scheduled H-infinity control of linear parameter-varying systems,
    Automatica 31, 1251-1261.

    Examples
    --------
    A first-order plant x' = p x + u + w1 with noise on its measurement, p between -1 and 1:

    >>> def plant(p):
    ...     return GeneralizedPlant([[p[0]]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...                             np.zeros((2, 2)), [[0.0], [1.0]], [[0.0, 1.0]])
    >>> result = lpvsyn(plant, [[-1.0], [0.0], [1.0]])
    >>> round(result.gamma, 3), result.gamma_achieved < 1.02 * result.gamma
    (2.732, True)
    """
    if method not in METHODS:
        raise DomainError(f"method is {method!r}, wanted one of {', '.join(METHODS)}.")
    if constant not in ("auto", *CONSTANT):
        raise DomainError(f"constant is {constant!r}, wanted 'auto' or one of {', '.join(CONSTANT)}.")
    options = _Options(
        solver=solver,
        gap=positive("gap", gap),
        backoff=_at_least_one("backoff", backoff),
        max_pole=None if max_pole is None else positive("max_pole", max_pole, "rad/s"),
        time_limit=time_limit,
        progress=progress,
    )
    wanted = None if gamma is None else positive("gamma", gamma)
    family = plant_family(plants, points, basis)
    bounds = rate_bounds(rate, family.points.shape[1])
    for p, plant in zip(family.points, family.plants, strict=True):
        check_reconstructible(plant, f"at p = {p.tolist()}")
    if method == "polytopic":
        if basis is not None or constant not in ("auto", "both"):
            raise DomainError("method 'polytopic' has constant R and S: leave `basis` and `constant` out.")
        return _polytopic(family, wanted, r_max, options, weights, box)
    if weights is not None:
        raise DomainError("weights are given, but method is 'gridded'. They belong to method 'polytopic'.")
    over = plants.box if isinstance(plants, LPVGeneralizedPlant) and box is None else box
    where = spanned_box(family.points, over)
    check_basis(basis, family.points)
    used = basis if bounds is not None else None
    if used is None:
        choices: tuple[str, ...] = ("both",)
    else:
        choices = ("S", "R") if constant == "auto" else (constant,)
    lmis, solution = _best(family, used, bounds, choices, r_max, options)
    level = _requested(family, wanted, solution, r_max, options)
    # at rest too: the rate box need not contain zero
    rates = np.zeros((1, len(where))) if bounds is None else corners(bounds)
    between = positions_between(family, where)
    made, checked, note = _designed(family, lmis, solution, level, where, rates, between, options)
    return _result(family, lmis, solution, made, checked, note)


def _at_least_one(name: str, value: float) -> float:
    number = positive(name, value)
    if number < 1.0:
        raise DomainError(f"{name} is {number}, wanted at least 1. The level of the design is {name} times gamma.")
    return number


def _best(
    family: PlantFamily,
    basis: BasisFunction | None,
    bounds: Array | None,
    choices: Sequence[str],
    r_max: float,
    options: _Options,
) -> tuple[GriddedLMIs, LMISolution]:
    """The choice of constant matrices with the smallest gamma."""
    found: list[tuple[GriddedLMIs, LMISolution]] = []
    for choice in choices:
        lmis = gridded_lmis(family.plants, family.points, basis=basis, rate=bounds, constant=choice, r_max=r_max)
        found.append((lmis, _solved(lmis, options)))
    usable = [(lmis, solution) for lmis, solution in found if solution.usable]
    if not usable:
        lmis, solution = min(found, key=lambda pair: pair[1].status != "infeasible")
        told = "; ".join(f"constant={lm.constant!r}: {s.status}, {s.message}" for lm, s in found)
        raise SynthesisError(
            f"no controller was found ({told}). Let R or S depend on p by a basis and a rate box, lower the rates, or "
            "raise r_max.",
            result=solution,
        )
    return min(usable, key=lambda pair: pair[1].gamma)


def _solved(lmis: GriddedLMIs, options: _Options) -> LMISolution:
    solution = solve_lmi(
        lmis.problem,
        solver=options.solver,
        gap=options.gap,
        time_limit=options.time_limit,
        progress=options.progress,
    )
    return solution if options.solver == "structured" else repaired(lmis.problem, solution)


def _requested(
    family: PlantFamily, wanted: float | None, solution: LMISolution, r_max: float, options: _Options
) -> float | None:
    """The level asked for, after a check that it can be reached."""
    if wanted is None or wanted >= solution.gamma * (1.0 + REACHED):
        return wanted
    bounds = [
        _solved(gridded_lmis([plant], p[None, :], constant="both", r_max=r_max), options).gamma_lower
        for p, plant in zip(family.points, family.plants, strict=True)
    ]
    worst = int(np.argmax(bounds))
    if wanted < bounds[worst]:
        raise AssumptionError(
            f"gamma is {wanted:.6g}, below {bounds[worst]:.6g}, the lower bound of the plant at p = "
            f"{family.points[worst].tolist()} alone (R, S <= {r_max:.3g} in scaled coordinates): too small by "
            f"{bounds[worst] - wanted:.3g}, or {100 * (bounds[worst] / wanted - 1):.3g} %. Ask for more, or relax the "
            "weights."
        )
    raise SynthesisError(
        f"gamma is {wanted:.6g}; the smallest level with this basis and rate box is {solution.gamma:.6g}, though each "
        f"point alone allows {bounds[worst]:.6g}. Take more basis functions, a smaller rate box, or ask for more.",
        result=solution,
    )


def _designed(
    family: PlantFamily,
    lmis: GriddedLMIs,
    solution: LMISolution,
    level: float | None,
    box: Array,
    rates: Array,
    between: Array,
    options: _Options,
) -> tuple[Design, Verified, str]:
    """The first design, of growing level, that is verified and slow enough."""
    if level is not None:
        levels = [level]
    else:
        steps = [options.backoff, *(b for b in FURTHER if b > options.backoff)]
        levels = [solution.gamma * step for step in steps]
    last: tuple[Design, Verified] | None = None
    for trial in levels:
        centre = recentred(lmis, trial, solver=options.solver, time_limit=options.time_limit)
        if centre is None:
            continue
        try:
            made = design(family, lmis, centre, trial, box)
            checked = verified(family, made.controller, made.lyapunov, rates, between)
        except (np.linalg.LinAlgError, DomainError):  # I - R S is singular, or the controller is not finite
            continue
        last = made, checked
        too_fast = options.max_pole is not None and checked.fastest_pole > options.max_pole
        if checked.gamma_achieved <= trial * 1.005 and not too_fast:
            note = "" if trial == levels[0] else f"; the back-off grew to {trial / solution.gamma:.4g}"
            return made, checked, note
    if last is None:
        raise SynthesisError(
            f"gamma = {solution.gamma:.6g} was found, but no R, S well inside the inequalities at "
            f"{levels[-1]:.6g}. Take another back-off, or raise r_max.",
            result=solution,
        )
    made, checked = last
    result = _result(family, lmis, solution, made, checked, "; rejected")
    if options.max_pole is not None and checked.fastest_pole > options.max_pole:
        raise SynthesisError(
            f"the controller's fastest pole is {checked.fastest_pole:.4g} rad/s at the level {made.level:.6g}, wanted "
            f"at most {options.max_pole:.4g}. Allow faster poles, or penalise u at high frequencies.",
            result=result,
        )
    raise SynthesisError(
        f"the closed loop proves the level {checked.gamma_achieved:.6g}, the design was made for {made.level:.6g}. "
        "Take a larger back-off or a smaller r_max.",
        result=result,
    )


def _result(
    family: PlantFamily, lmis: GriddedLMIs, solution: LMISolution, made: Design, checked: Verified, note: str
) -> LPVSynthesisResult:
    active = lmis.bound_activity(solution)
    bound = f"; r_max is active ({max(active.values()):.2f}): a larger one may lower gamma"
    return LPVSynthesisResult(
        gamma=solution.gamma,
        gamma_lower=solution.gamma_lower,
        gamma_achieved=checked.gamma_achieved,
        level=made.level,
        controller=made.controller,
        constant=lmis.constant,
        lmi_margin=checked.lmi_margin,
        status=f"{solution.status}: {solution.message}{bound if max(active.values()) > 0.95 else ''}{note}",
        points=read_only(family.points),
        frozen_norms=checked.frozen_norms,
        points_between=checked.points_between,
        frozen_norms_between=checked.frozen_norms_between,
        between=family.between,
        controller_poles=checked.controller_poles,
        bound_activity=active,
        solution=solution,
        _pair=made.pair.at,
        _loop_lyapunov=made.lyapunov,
    )


def _polytopic(
    family: PlantFamily,
    wanted: float | None,
    r_max: float,
    options: _Options,
    weights: Callable[[Array], Array] | None,
    box: ArrayLike | None,
) -> LPVSynthesisResult:
    check_polytope(family.points)
    check_constant(family)
    if weights is not None and box is None:
        raise DomainError("weights are given, but not the box of their position p. Pass box=(n_p, 2) too.")
    lmis, solution = _best(family, None, None, ("both",), r_max, options)
    level = _requested(family, wanted, solution, r_max, options)
    spanned = spanned_box(family.points, None)
    still, nowhere = np.zeros((1, len(spanned))), np.zeros((0, len(spanned)))
    made, checked, note = _designed(family, lmis, solution, level, spanned, still, nowhere, options)
    result = _result(family, lmis, solution, made, checked, note)
    over = spanned if box is None else finite_array("box", box, (None, 2))
    return self_scheduled(family, made, result, weights, over)
