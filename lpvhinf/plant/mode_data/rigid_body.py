"""Mass, centre of gravity and inertia of a moving body, and the rigid-body motions that follow from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant.rigid_motion import AXES, rigid_displacements

TRIANGLE_SLACK = 0.02  # data sheets round: 0.062 + 0.062 against 0.125


def axis_indices(axes: Sequence[str]) -> list[int]:
    """Places of rigid-body axes in ("x", "y", "z", "rx", "ry", "rz").

    Raises
    ------
    DomainError
        If a name is unknown, comes twice, or none is given.
    """
    given = (axes,) if isinstance(axes, str) else tuple(axes)
    unknown = [name for name in given if name not in AXES]
    if unknown or len(set(given)) != len(given) or not given:
        raise DomainError(f"axes is {given!r}, wanted different names out of {', '.join(AXES)}.")
    return [AXES.index(name) for name in given]


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBody:
    r"""Mass, centre of gravity and inertia of the mover, in mover coordinates.

    Parameters
    ----------
    mass : float
        [kg]
    centre_of_gravity : (3,) or (2,)
        [m]; with two numbers it lies at z = 0.
    inertia : (3, 3) or (3,)
        Inertia tensor about the centre of gravity [kg m2], with :math:`I_{xy} = -\int x y\, dm` off the diagonal
        (some programs print :math:`+\int x y\, dm`), or its diagonal alone.

    Raises
    ------
    DomainError
        If the mass is not above zero or a number is not finite.
    DimensionError
        If a shape is another one.
    AssumptionError
        If the inertia is not symmetric, not positive definite, or its principal moments break the triangle
        inequality :math:`I_1 + I_2 \ge I_3` that every body obeys.

    Examples
    --------
    >>> body = RigidBody(mass=8.0, centre_of_gravity=[0.01, 0.0, 0.0], inertia=[0.06, 0.06, 0.12])
    >>> body.mass_matrix(("z", "rx", "ry")).tolist()
    [[8.0, 0.0, 0.0], [0.0, 0.06, 0.0], [0.0, 0.0, 0.06]]
    """

    mass: float
    centre_of_gravity: Array
    inertia: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", positive("mass", self.mass, "kg"))
        centre = finite_array("centre_of_gravity", self.centre_of_gravity)
        if centre.shape not in ((2,), (3,)):
            raise DimensionError(f"centre_of_gravity has shape {centre.shape}, wanted (3,) or (2,): x, y, z [m].")
        object.__setattr__(self, "centre_of_gravity", read_only(np.append(centre, np.zeros(3 - len(centre)))))
        inertia = finite_array("inertia", self.inertia)
        if inertia.shape not in ((3,), (3, 3)):
            raise DimensionError(
                f"inertia has shape {inertia.shape}, wanted (3, 3), or (3,) for Ixx, Iyy, Izz [kg m2]."
            )
        inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
        if np.max(np.abs(inertia - inertia.T)) > 1e-6 * np.max(np.abs(inertia)):
            raise AssumptionError(
                f"inertia is not symmetric: {inertia.tolist()}. Give the full tensor about the centre of gravity."
            )
        inertia = 0.5 * (inertia + inertia.T)
        low, middle, high = (float(value) for value in np.linalg.eigvalsh(inertia))
        if low <= 0.0:
            raise AssumptionError(
                f"inertia has the principal moment {low:.6g} kg m2, wanted all above 0. Check the entries and the "
                "sign of the products of inertia."
            )
        if low + middle < (1.0 - TRIANGLE_SLACK) * high:
            raise AssumptionError(
                f"inertia has the principal moments {low:.6g}, {middle:.6g}, {high:.6g} kg m2, wanted none above the "
                "sum of the other two, as for every body. Check that all entries have the same unit and refer to the "
                "centre of gravity, and the sign of the products of inertia."
            )
        object.__setattr__(self, "inertia", read_only(inertia))

    def mass_matrix(self, axes: Sequence[str] = AXES) -> Array:
        """Mass matrix (n, n) of motions about the centre of gravity along the given axes [kg, kg m2]."""
        chosen = axis_indices(axes)
        full = scipy.linalg.block_diag(self.mass * np.eye(3), self.inertia)
        return np.asarray(full[np.ix_(chosen, chosen)])

    def scaling(self, axes: Sequence[str] = AXES) -> Array:
        """S = M_rb^{-1/2} (n, n), the symmetric root: physical motions q = S eta of mass-normalised ones."""
        values, vectors = np.linalg.eigh(self.mass_matrix(axes))
        return np.asarray(vectors @ np.diag(values**-0.5) @ vectors.T)

    def motions(self, places: ArrayLike, axes: Sequence[str] = AXES) -> Array:
        """Displacements (..., 3, n) of the points `places` (..., 3) [m] for unit motions along the given axes."""
        return rigid_displacements(np.asarray(places, dtype=float) - self.centre_of_gravity)[..., axis_indices(axes)]

    def __repr__(self) -> str:
        centre, inertia = self.centre_of_gravity.tolist(), self.inertia.tolist()
        return f"RigidBody(mass={self.mass:g}, centre_of_gravity={centre}, inertia={inertia})"
