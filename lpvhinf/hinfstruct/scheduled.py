"""Structures whose parameters are polynomials of the position."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array, points_in_box, whole_number
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.hinfstruct.structures import ControllerStructure, Realization, parameter_names
from lpvhinf.polynomial import scaled
from lpvhinf.statespace.lpv import LPVStateSpace

#: Relative error of every matrix of an interpolated controller, and the highest degree that is tried for it.
PRECISE, MOST_DEGREE = 1e-10, 64


@dataclass(frozen=True, eq=False, init=False)
class PolynomialBasis:
    r"""Products of Chebyshev polynomials of the position, scaled to the box, up to a total degree.

    .. math:: \phi_k(p) = T_{i_1}(x_1) \cdots T_{i_{n_p}}(x_{n_p}), \quad i_1 + \dots + i_{n_p} \le d

    with :math:`x_j \in [-1, 1]`. The first one is the constant.

    Parameters
    ----------
    box : (n_p, 2)
        Lower and upper bound of every coordinate of p.
    degree : int
        d, the total degree.

    Raises
    ------
    DomainError
        If the box is empty or the degree negative.

    Examples
    --------
    >>> basis = PolynomialBasis([[-1.0, 1.0], [0.0, 2.0]], degree=1)
    >>> basis([0.5, 2.0])
    array([1. , 1. , 0.5])
    """

    box: Array
    degree: int
    indices: tuple[tuple[int, ...], ...]

    def __init__(self, box: ArrayLike, degree: int) -> None:
        bounds = box_array(box)
        d = whole_number("degree", degree, 0)
        every = product(range(d + 1), repeat=len(bounds))
        object.__setattr__(self, "box", bounds)
        object.__setattr__(self, "degree", d)
        object.__setattr__(self, "indices", tuple(sorted((i for i in every if sum(i) <= d), key=lambda i: (sum(i), i))))

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.indices)

    def __call__(self, p: ArrayLike) -> Array:
        """The values at one position, (size,).

        Raises
        ------
        DimensionError, DomainError
            If p has another length or lies outside the box.
        """
        points = points_in_box(p, self.box)
        if len(points) != 1:
            raise DimensionError(f"p has {len(points)} rows, wanted one position.")
        T = chebyshev.chebvander(scaled(points, self.box)[0], self.degree)
        axes = np.arange(len(self.box))
        return np.array([np.prod(T[axes, list(index)]) for index in self.indices])


class Scheduled:
    r"""Any structure with parameters that are polynomials of the position.

    .. math:: K(\theta, p) = K_0(\vartheta(p)), \quad \vartheta(p) = \sum_k \theta_k \phi_k(p)

    Parameters
    ----------
    structure : ControllerStructure
        K_0. Where its parameters are logarithms, these are the polynomials: gains stay positive.
    basis : PolynomialBasis
        Or any picklable object with `size` that maps p to (size,) numbers, the first of them one.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> K = Scheduled(StaticGain(1, 1), PolynomialBasis([[-1.0, 1.0]], degree=2))
    >>> K.names
    ('D[0,0] (phi_0)', 'D[0,0] (phi_1)', 'D[0,0] (phi_2)')
    >>> float(K.realize(np.array([1.0, 0.5, 0.0]), np.array([0.4]))[3][0, 0])
    1.2
    """

    def __init__(self, structure: ControllerStructure, basis: PolynomialBasis) -> None:
        self.structure, self.basis = structure, basis
        self.n_u, self.n_y, self.n_x = structure.n_u, structure.n_y, structure.n_x
        self.n_parameters = basis.size * structure.n_parameters
        self.names = tuple(f"{name} (phi_{k})" for k in range(basis.size) for name in parameter_names(structure))

    def _phi(self, p: Array | None) -> Array:
        if p is None:
            raise DimensionError(
                "p is None, wanted a position: this structure is scheduled. Pass points to hinfstruct."
            )
        return np.asarray(self.basis(p), dtype=float)

    def frozen(self, theta: ArrayLike, p: Array | None) -> Array:
        """The parameters of the inner structure at p."""
        return np.asarray(self._phi(p) @ np.reshape(np.asarray(theta, dtype=float), (self.basis.size, -1)))

    def constant(self, inner: ArrayLike) -> Array:
        """The theta of a controller that does not depend on the position, for a warm start."""
        theta = np.zeros((self.basis.size, self.structure.n_parameters))
        theta[0] = inner
        return theta.ravel()

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """The inner structure at theta(p)."""
        return self.structure.realize(self.frozen(theta, p), p)

    def over_box(self, theta: Array) -> LPVStateSpace:
        """The controller over the whole box: exact where the inner structure is affine in its parameters.

        Else (logarithms of gains, damping ratios) it is interpolated, with a degree that is raised until the measured
        error of every matrix is below `PRECISE`, relative to its largest entry.

        Raises
        ------
        AssumptionError
            If that takes a degree above `MOST_DEGREE`.
        """

        def sampled(points: Array) -> tuple[Array, Array, Array, Array]:
            A, B, C, D = zip(*(self.realize(theta, p) for p in points), strict=True)
            return np.stack(A), np.stack(B), np.stack(C), np.stack(D)

        degree, worst = max(1, self.basis.degree), np.inf
        while degree <= MOST_DEGREE:
            fit = LPVStateSpace.interpolate(sampled, box=self.basis.box, degree=degree)
            sizes = [float(np.max(np.abs(m.coefficients), initial=0.0)) for m in fit.system.matrices]
            errors = [float(np.max(fit.errors[name], initial=0.0)) for name in "ABCD"]
            worst = max(error / max(size, 1e-300) for error, size in zip(errors, sizes, strict=True))
            if worst <= PRECISE:
                return fit.system
            degree *= 2
        raise AssumptionError(
            f"the scheduled controller is no polynomial of degree {MOST_DEGREE} to {PRECISE:g}: its relative error is "
            f"{worst:.1e}. Use realize(theta, p) at single positions, or a basis of lower degree."
        )

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The inner pullback, times every function of the basis."""
        inner = self.structure.pullback(self.frozen(theta, p), GA, GB, GC, GD, p)
        return np.outer(self._phi(p), inner).ravel()

    def initial(self, rng: np.random.Generator) -> Array:
        """A constant start of the inner structure."""
        return self.constant(self.structure.initial(rng))
