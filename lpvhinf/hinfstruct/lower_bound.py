"""What no controller of any order can beat: a lower bound by full-order synthesis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from lpvhinf.checks import Array, positive, whole_number
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.hinfstruct.peaks import frequency_grid
from lpvhinf.hinfstruct.region import Region
from lpvhinf.hinfstruct.riccati import ControlSide, coupling, reached, remaining_gain
from lpvhinf.statespace.generalized import GeneralizedPlant

Matrices = tuple[Array, Array, Array, Array, Array, Array]

WHOLE = Region()

#: Share by which a level that was refuted is lowered before it is reported.
SAFETY = 1e-7
#: A pole counts as on the imaginary axis within this share of the largest one.
AXIS = 1e-8


@dataclass(frozen=True, kw_only=True)
class LowerBound:
    """A lower bound on the H-infinity norm that any stabilising controller reaches.

    Attributes
    ----------
    gamma : float
        The bound; zero where nothing was shown.
    reason : str
        What refutes the levels below it: "coupling", a Riccati equation, or the gain at one frequency.
    region : str
        Where in the right half plane the closed loop was looked at.
    exact : bool
        True if all assumptions hold, so that the bound is the full-order optimum up to the tolerance.
    assumptions : tuple of str
        The assumptions that do not hold, each with what was done about it.
    by_region : tuple of (str, float)
        The bound after every region that was looked at. Its last increase shows what is left of the regularisation.
    not_refuted : float
        Smallest level that was tried and not refuted; for `exact` a controller (nearly) reaches it.
    evaluations : int
        Levels that were tried.
    """

    gamma: float
    reason: str
    region: str
    exact: bool
    assumptions: tuple[str, ...]
    by_region: tuple[tuple[str, float], ...]
    not_refuted: float
    evaluations: int

    def gap(self, gamma: float) -> float:
        """Relative distance of a reached norm from the bound, gamma / bound - 1."""
        return gamma / self.gamma - 1.0 if self.gamma > 0.0 else np.inf


def lower_bound(plant: GeneralizedPlant, *, tolerance: float = 1e-5, levels: int = 6) -> LowerBound:
    r"""A lower bound on :math:`\|F_l(P, K)\|_\infty` over all stabilising controllers K of any order.

    A level :math:`\gamma` is out of reach if (Doyle, Glover, Khargonekar and Francis) the control or the estimation
    Riccati equation has no positive semidefinite stabilising solution X or Y, or :math:`\rho(X Y) > \gamma^2`. The
    largest level that is refuted beyond the estimated errors of X and Y is found by bisection, so a Riccati equation
    that cannot be solved well lowers the bound, and never raises it. The gain at single frequencies that remains
    whatever K does is taken into account too.

    Where an assumption does not hold the same test is made on a disk inside the right half plane, see `Region`, on
    which the problem is regular. As the closed loop is bounded by its norm there, the result stays a lower bound;
    growing disks bring it close to the optimum. So it is for D12 or D21 without full rank, zeros on the imaginary
    axis, and integrators of weights that no controller moves (closed loops with these are taken to be stable up to
    these poles). An input that does not act on z, or a disturbance that does not act on y, takes what it
    reaches out of the problem.

    Parameters
    ----------
    plant : GeneralizedPlant
        D22 does not matter.
    tolerance : float
        Relative accuracy of the bisection.
    levels : int
        Largest number of disks.

    Returns
    -------
    LowerBound

    Raises
    ------
    DomainError
        If `plant` is not a GeneralizedPlant or an option is not positive.
    AssumptionError
        If an unstable mode is not stabilisable by u or not detectable from y: no controller stabilises this plant.

    References
    ----------
    Doyle, Glover, Khargonekar and Francis (1989), IEEE Transactions on Automatic Control 34, 831-847; Zhou, Doyle and
    Glover (1996), Robust and Optimal Control, theorems 16.4 and 17.1; Chiang and Safonov (1992) for the bilinear map.

    Examples
    --------
    For x' = x + w1 + u, z = (x, u), y = x + w2 both Riccati equations are
    :math:`2 X + 1 - X^2 (1 - 1/\gamma^2) = 0`; X = Y = gamma holds at 1 + sqrt 3.

    >>> P = GeneralizedPlant([[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...                      [[0.0, 0.0], [0.0, 0.0]], [[0.0], [1.0]], [[0.0, 1.0]])
    >>> bound = lower_bound(P)
    >>> round(bound.gamma, 3), bound.exact
    (2.732, True)
    """
    if not isinstance(plant, GeneralizedPlant):
        raise DomainError(
            f"plant is {type(plant).__name__}, wanted one GeneralizedPlant. Bound each plant of a sequence."
        )
    rtol, most = positive("tolerance", tolerance), whole_number("levels", levels, 1)
    poles = np.linalg.eigvals(plant.A) if plant.n_x else np.zeros(0, dtype=complex)
    size = float(np.max(np.abs(poles), initial=0.0))
    marginal = _check_stabilisable(plant, poles, AXIS * size)
    with threadpool_limits(limits=1):
        search = _Search(rtol)
        search.by_frequency(plant, poles)
        control, estimation = _sides(plant)
        if control.regular and estimation.regular:
            search.bisect(Region(), control, estimation)
            search.by_region.append((str(Region()), search.gamma))
            return search.result(True, ())
        notes = _notes(plant, control, estimation, marginal)
        nonzero = np.abs(poles)[np.abs(poles) > AXIS * size]
        slow, fast = (float(np.min(nonzero)), float(np.max(nonzero))) if nonzero.size else (1.0, 1.0)
        ranks = any("rank" in note for note in notes)
        axis = bool(marginal) or not ranks
        stalled, improved = 0, False
        for k in range(1, most + 1):
            far = fast * 10.0 ** (k + 1) if ranks else np.inf
            region = Region(slow * 10.0**-k if axis or stalled else 0.0, far)
            mapped = _sides(plant, region)
            if not axis and min(side.clearance for side in mapped) <= AXIS:
                axis = True  # a zero at s = 0, where the disk would touch the axis
                region = Region(slow * 10.0**-k, far)
                mapped = _sides(plant, region)
            before = search.gamma, search.reason, search.region
            search.bisect(region, *mapped)
            if search.gamma > before[0] and not _robust(plant, region, search.gamma):
                search.gamma, search.reason, search.region = before
            search.by_region.append((str(region), search.gamma))
            stalled = stalled + 1 if search.gamma <= before[0] * (1.0 + 10.0 * rtol) else 0
            improved = improved or stalled == 0
            if stalled == 2 and improved:
                break
        return search.result(False, notes)


def _matrices(P: GeneralizedPlant) -> tuple[Matrices, Matrices]:
    return (P.A, P.B1, P.B2, P.C1, P.D11, P.D12), (P.A.T, P.C1.T, P.C2.T, P.B1.T, P.D11.T, P.D21.T)


def _sides(P: GeneralizedPlant, region: Region = WHOLE) -> tuple[ControlSide, ControlSide]:
    """Control and estimation on a region; gains at single frequencies are those of the plant as it was given."""
    given, mapped = _matrices(P), _matrices(P if region.whole else region.transform(P))
    control, estimation = (
        ControlSide(*there, lambda omega, own=own: remaining_gain(own, region.point(omega)))  # type: ignore[misc]
        for own, there in zip(given, mapped, strict=True)
    )
    return control, estimation


def _refuted(control: ControlSide, estimation: ControlSide, gamma: float) -> str | None:
    """Why a level is out of reach; None if that is not shown."""
    sides = control.solve(gamma), estimation.solve(gamma)
    for side, what in zip(sides, ("control", "estimation"), strict=True):
        if side.refuted:
            return f"{side.reason} ({what})"
    return "coupling of both Riccati equations" if coupling(*sides, gamma) else None


def _robust(P: GeneralizedPlant, region: Region, gamma: float) -> bool:
    """True if the refutation survives changes of coordinates and of the data, and nothing contradicts it.

    On a large disk numbers of very different size meet. A refutation that rests on rounding errors does not outlive
    other coordinates with data changed by a relative 1e-13.
    """
    rng = np.random.default_rng(0)
    for _ in range(2):
        Q = np.linalg.qr(rng.standard_normal((P.n_x, P.n_x)))[0] if P.n_x else np.zeros((0, 0))
        A, B1, B2, C1, C2, D11, D12, D21 = (
            M * (1.0 + 1e-13 * rng.standard_normal(M.shape)) for M in (P.A, P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21)
        )
        other = GeneralizedPlant(Q.T @ A @ Q, Q.T @ B1, Q.T @ B2, C1 @ Q, C2 @ Q, D11, D12, D21)
        if _refuted(*_sides(other, region), gamma * (1.0 - 1e-3)) is None:
            return False
    return not _contradicted(region.transform(P), gamma)


def _contradicted(P: GeneralizedPlant, gamma: float) -> bool:
    """True if a level below gamma can be reached with a price on u and noise on y, which make all ranks full.

    Decisions on ranks cannot mislead this test, so it guards the refutation against wrong ones.
    """
    below = gamma * (1.0 - 1e-3)
    for share in (1e-2, 1e-4, 1e-6):
        price = share * max(float(np.linalg.norm(P.D12)), 1e-12)
        noise = share * max(float(np.linalg.norm(P.D21)), 1e-12)
        augmented = GeneralizedPlant(
            P.A,
            np.hstack([P.B1, np.zeros((P.n_x, P.n_y))]),
            P.B2,
            np.vstack([P.C1, np.zeros((P.n_u, P.n_x))]),
            P.C2,
            np.block([[P.D11, np.zeros((P.n_z, P.n_y))], [np.zeros((P.n_u, P.n_w + P.n_y))]]),
            np.vstack([P.D12, price * np.eye(P.n_u)]),
            np.hstack([P.D21, noise * np.eye(P.n_y)]),
        )
        control, estimation = _sides(augmented)
        if reached(control.solve(below), estimation.solve(below), below):
            return True
    return False


def _check_stabilisable(P: GeneralizedPlant, poles: np.ndarray, width: float) -> list[complex]:
    """Modes on the imaginary axis that u does not move or y does not show; those right of it are an error."""
    marginal: list[complex] = []
    eye = np.eye(P.n_x)
    for pole in poles[(poles.real >= -width) & (poles.imag >= 0.0)]:
        for matrix, what in (
            (np.hstack([P.A - pole * eye, P.B2]), "stabilisable by u"),
            (np.vstack([P.A - pole * eye, P.C2]).T, "detectable from y"),
        ):
            singular = np.linalg.svd(matrix, compute_uv=False)
            if singular[-1] > 1e-11 * max(float(singular[0]), 1e-300):
                continue
            if pole.real > width:
                raise AssumptionError(
                    f"the mode at {complex(np.round(pole, 6))} rad/s is not {what}, wanted every unstable mode to be: "
                    "no controller stabilises this plant. Check B2 and C2, or take the mode out of the weights."
                )
            marginal.append(complex(pole))
    return marginal


def _notes(
    P: GeneralizedPlant, control: ControlSide, estimation: ControlSide, marginal: list[complex]
) -> tuple[str, ...]:
    notes = []
    if marginal:
        listed = ", ".join(sorted({f"{pole.imag:.3g}j" for pole in marginal}))
        notes.append(f"modes at {listed} rad/s are not moved by u or not seen in y: looked at right of them only")
    for name, matrix, full in (("D12", P.D12, P.n_u), ("D21", P.D21, P.n_y)):
        rank = int(np.linalg.matrix_rank(matrix)) if matrix.size else 0
        if rank < full:
            notes.append(f"{name} has rank {rank}, wanted {full}: looked at inside growing disks")
    for side, what in ((control, "from u to z"), (estimation, "from w to y")):
        if side.clearance <= AXIS and not marginal:
            notes.append(f"zeros {what} on the imaginary axis: looked at right of them only")
    return tuple(notes)


class _Search:
    """The largest level that is refuted, over all tests made."""

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.gamma, self.reason, self.region = 0.0, "nothing refuted", Region()
        self.not_refuted, self.evaluations = np.inf, 0
        self.by_region: list[tuple[str, float]] = []

    def _note(self, gamma: float, reason: str, region: Region) -> None:
        if gamma > self.gamma:
            self.gamma, self.reason, self.region = gamma, reason, region

    def by_frequency(self, plant: GeneralizedPlant, poles: np.ndarray) -> None:
        """The gain that remains at single frequencies of the imaginary axis, its largest values refined."""
        grid = frequency_grid(poles, np.zeros(0))[:-1]
        for own, what in zip(_matrices(plant), ("control", "estimation"), strict=True):
            omega, gain = grid, remaining_gain(own, 1j * grid)
            for _ in range(4):
                top = np.unique(np.clip(np.argsort(-gain)[:3, None] + np.array([-1, 0, 1]), 0, omega.size - 1))
                extra = np.setdiff1d(np.linspace(omega[top[:-1]], omega[top[1:]], 7)[1:-1].ravel(), omega)
                omega = np.concatenate([omega, extra])
                gain = np.concatenate([gain, remaining_gain(own, 1j * extra)])
                order = np.argsort(omega)
                omega, gain = omega[order], gain[order]
            self._note(float(np.max(gain)), f"the gain at one frequency that remains ({what})", WHOLE)

    def bisect(self, region: Region, control: ControlSide, estimation: ControlSide) -> None:
        """Refute levels on one region, from the best one known upwards."""

        def refuted(gamma: float) -> str | None:
            self.evaluations += 1
            return _refuted(control, estimation, gamma)

        known = self.gamma
        low = max(known * (1.0 + self.tolerance), 0.0)
        if low > 0.0:
            why = refuted(low)
            if why is None:
                self.not_refuted = low
                return
            self._note(low, why, region)
            high, step = 4.0 * low, 4.0
        else:
            high, step = max(_size(control), 1e-6), 4.0
            while high > 1e-12 and (why := refuted(high)) is None:
                self.not_refuted = high
                high, step = high / 10.0, 10.0
            if high <= 1e-12 or why is None:
                return
            self._note(high, why, region)
            low, high = high, high * step
        for _ in range(60):
            why = refuted(high)
            if why is None:
                break
            self._note(high, why, region)
            low, high = high, 4.0 * high
        else:
            return
        for _ in range(60):
            if high <= low * (1.0 + self.tolerance):
                break
            middle = float(np.sqrt(low * high))
            why = refuted(middle)
            if why is None:
                high = middle
            else:
                low = middle
                self._note(middle, why, region)
        self.not_refuted = high

    def result(self, exact: bool, notes: tuple[str, ...]) -> LowerBound:
        return LowerBound(
            gamma=self.gamma * (1.0 - SAFETY),
            reason=self.reason,
            region=str(self.region),
            exact=exact,
            assumptions=notes,
            by_region=tuple(self.by_region),
            not_refuted=self.not_refuted,
            evaluations=self.evaluations,
        )


def _size(side: ControlSide) -> float:
    """Some gain of the plant, to start the search from."""
    return float(np.linalg.norm(side.B1) * np.linalg.norm(side.C)) + side.floor
