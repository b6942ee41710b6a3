"""Scheduled controllers: explicit ones from R(p), S(p), blends of vertex controllers, and their polynomial fits."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.fitting import spread_points
from lpvhinf.lpv.gridded import LyapunovPair
from lpvhinf.lpv.plant_family import PlantFamily
from lpvhinf.lpv.reconstruct import ConstantFactor, Matrices, controller_matrices, feedthrough
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace

if TYPE_CHECKING:
    import control


class FittedController(LPVStateSpace):
    """A scheduled controller as polynomials in p, with the largest deviations from what it was fitted to.

    Attributes
    ----------
    fit_errors : dict of "A", "B", "C", "D" to arrays
        Largest absolute deviation of each entry at `n_test` positions that were not used for the fit.
    fit_error : float
        Largest deviation of any of the four matrices relative to its largest entry.
    n_test : int
    """

    fit_errors: dict[str, Array]
    fit_error: float
    n_test: int

    def __init__(
        self,
        A: ChebyshevMatrix | ArrayLike,
        B: ChebyshevMatrix | ArrayLike,
        C: ChebyshevMatrix | ArrayLike,
        D: ChebyshevMatrix | ArrayLike,
        *,
        fit_errors: dict[str, Array] | None = None,
        n_test: int = 0,
        scales: dict[str, float] | None = None,
    ) -> None:
        super().__init__(A, B, C, D)
        errors, sizes = fit_errors or {}, scales or {}
        relative = [float(np.max(e, initial=0.0)) / sizes[name] for name, e in errors.items() if sizes.get(name, 0.0)]
        for name, value in (("fit_errors", errors), ("fit_error", max(relative, default=0.0)), ("n_test", n_test)):
            object.__setattr__(self, name, value)


class ScheduledController(ABC):
    """A controller u = K(p) y that follows the position p."""

    #: Box of the grid, (n_p, 2).
    box: Array
    #: The controller's matrices depend on dp/dt too.
    needs_rate: bool

    @abstractmethod
    def matrices(self, p: ArrayLike, p_dot: ArrayLike | None = None) -> Matrices:
        """(A_K, B_K, C_K, D_K) at a position, and at a rate where the controller depends on it."""

    def at(self, p: ArrayLike, p_dot: ArrayLike | None = None) -> control.StateSpace:
        """The controller at a position p (n_p,), and at a rate dp/dt (n_p,) where it depends on it (else left out).

        Raises
        ------
        DomainError
            If p is outside the box of the grid.
        """
        import control

        return control.ss(*self.matrices(p, p_dot), remove_useless_states=False)

    def to_lpv(self, degree: int | Sequence[int], *, n_test: int = 64) -> FittedController:
        """The controller as polynomials in p over the box of the grid: what is simulated and certified.

        Its `fit_errors` are measured at `n_test` positions between the interpolation nodes.

        Raises
        ------
        AssumptionError
            If the controller depends on dp/dt, or the grid does not move along some axis.
        """
        if self.needs_rate:
            raise AssumptionError(
                "this controller depends on dp/dt, and an LPVStateSpace on p only. Design with constant='R' or "
                "constant='S', whose controllers do not."
            )
        if np.any(self.box[:, 0] >= self.box[:, 1]):
            raise AssumptionError(
                f"the grid spans {self.box.tolist()}, which is no box to fit over. Give grid points on both sides of "
                "every axis."
            )

        def sample(points: Array) -> tuple[Array, Array, Array, Array]:
            rows = [self.matrices(p) for p in points]
            a, b, c, d = (np.stack([row[k] for row in rows]) for k in range(4))
            return a, b, c, d

        fit = LPVStateSpace.interpolate(sample, box=self.box, degree=degree)
        where = spread_points(self.box, n_test)
        truth, found = sample(where), fit.system.sample(where)
        errors = {name: np.max(np.abs(t - f), axis=0) for name, t, f in zip("ABCD", truth, found, strict=True)}
        scales = {name: float(np.max(np.abs(t), initial=0.0)) for name, t in zip("ABCD", truth, strict=True)}
        return FittedController(*fit.system.matrices, fit_errors=errors, n_test=n_test, scales=scales)


@dataclass(frozen=True, kw_only=True, eq=False)
class ExplicitController(ScheduledController):
    """The controller of gridded synthesis, computed from R(p), S(p) and the plant at every position.

    Attributes
    ----------
    family : PlantFamily
    pair : LyapunovPair
        R and S in the plant's coordinates.
    level : float
        Level of the explicit formulas.
    factor : ConstantFactor
        In scaled coordinates.
    omega : float
        Unit of frequency of the scaled coordinates [rad/s].
    T : (n_x,)
        x = T x_hat.
    has_feedthrough : bool
        D_K is Parrott's at all positions; else it is zero at all positions.
    needs_rate : bool
    box : (n_p, 2)
    """

    family: PlantFamily
    pair: LyapunovPair
    level: float
    factor: ConstantFactor
    omega: float
    T: Array
    has_feedthrough: bool
    needs_rate: bool
    box: Array

    def matrices(self, p: ArrayLike, p_dot: ArrayLike | None = None) -> Matrices:
        """(A_K, B_K, C_K, D_K) at a position, and at a rate where the controller depends on it."""
        where = position("p", p, len(self.box))
        plant = self.scaled(self.family.at(where))
        R, S = self.scaled_pair(where)
        D_K = feedthrough(plant, self.level) if self.has_feedthrough else np.zeros((plant.n_u, plant.n_y))
        rates: tuple[Array, Array] | tuple[None, None] = (None, None)
        if self.needs_rate and p_dot is not None:
            rates = self.scaled_rates(where, position("p_dot", p_dot, len(self.box)))
        A, B, C, D = controller_matrices(plant, R, S, self.level, self.factor, D_K, *rates)
        root = np.sqrt(self.omega)
        return self.omega * A, root * B, root * C, D

    def scaled(self, plant: GeneralizedPlant) -> GeneralizedPlant:
        """A plant in scaled coordinates."""
        T, root = self.T, np.sqrt(self.omega)
        return GeneralizedPlant(
            plant.A * T / T[:, None] / self.omega,
            plant.B1 / T[:, None] / root,
            plant.B2 / T[:, None] / root,
            plant.C1 * T / root,
            plant.C2 * T / root,
            plant.D11,
            plant.D12,
            plant.D21,
            plant.D22,
        )

    def scaled_pair(self, p: Array) -> tuple[Array, Array]:
        """R, S in scaled coordinates."""
        R, S = self.pair.at(p)
        return R / self.T[:, None] / self.T, S * self.T[:, None] * self.T

    def scaled_rates(self, p: Array, p_dot: Array) -> tuple[Array, Array]:
        """dR/dt, dS/dt in scaled coordinates and time."""
        R_dot, S_dot = self.pair.rate_at(p, p_dot / self.omega)
        return R_dot / self.T[:, None] / self.T, S_dot * self.T[:, None] * self.T


@dataclass(frozen=True, kw_only=True, eq=False)
class VertexController(ScheduledController):
    r"""The self-scheduled controller of polytopic synthesis, :math:`K(p) = \sum_k w_k(p) K_k`.

    Attributes
    ----------
    vertices : tuple of (A_K, B_K, C_K, D_K)
    weights : callable
        p (n_p,) -> (n_vertices,), not negative, of sum 1.
    box : (n_p, 2)
    """

    vertices: tuple[Matrices, ...]
    weights: Callable[[Array], Array]
    box: Array
    needs_rate: bool = False

    def matrices(self, p: ArrayLike, p_dot: ArrayLike | None = None) -> Matrices:
        """(A_K, B_K, C_K, D_K) at a position; the rate does not matter."""
        w = self.weights(position("p", p, len(self.box)))
        a, b, c, d = (np.tensordot(w, np.stack([K[k] for K in self.vertices]), 1) for k in range(4))
        return a, b, c, d


@dataclass(frozen=True, kw_only=True, eq=False)
class StateFeedback(ScheduledController):
    """The gain u = F(p) x, a controller without states whose measurement is x.

    Attributes
    ----------
    gain : callable
        p (n_p,) -> F (n_u, n_x).
    box : (n_p, 2)
    """

    gain: Callable[[Array], Array]
    box: Array
    needs_rate: bool = False

    def matrices(self, p: ArrayLike, p_dot: ArrayLike | None = None) -> Matrices:
        """(0 x 0, 0 x n_x, n_u x 0, F) at a position."""
        F = self.gain(position("p", p, len(self.box)))
        return np.zeros((0, 0)), np.zeros((0, F.shape[1])), np.zeros((F.shape[0], 0)), F


def position(name: str, p: ArrayLike, n_p: int) -> Array:
    """A position or rate as (n_p,); a number serves a single axis."""
    array = finite_array(name, p)
    if array.size != n_p:
        raise DimensionError(f"{name} has shape {array.shape}, wanted ({n_p},).")
    return array.reshape(n_p)
