r"""The mover: plate, magnets, mirror bars and payload as mass, stiffness and damping matrices.

With the displacement of a mass element m at (X, Y, Z) from `lpvhinf.plant.mmpa.kinematics`, the kinetic energy
:math:`\tfrac12 \sum m |\dot u|^2` gives for q = (x, y, rz, Ritz coefficients of w)

.. math::

    M = \begin{bmatrix} m & 0 & 0 & -\sum m Z\, \partial_x \\ & m & 0 & -\sum m Z\, \partial_y \\
        & & I_{zz} & \sum m Z\, [(Y - c_y)\, \partial_x - (X - c_x)\, \partial_y] \\ \text{sym.} & & & M_w
        \end{bmatrix}

where the first moments about (c_x, c_y) vanish, as it is the place of the centre of gravity, and M_w is that of
`RitzPlate`. Masses off the neutral plane couple horizontal motion with tilt and bending, by their arm Z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa.kinematics import IN_PLANE
from lpvhinf.plant.mmpa.magnets import magnet_array, mirror_bars
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.plate import RitzPlate


@dataclass(frozen=True, kw_only=True, eq=False)
class Mover:
    """The equations of motion of the free mover.

    Attributes
    ----------
    plate : RitzPlate
        The plate with all lumped masses.
    M, D, K : (3 + n_ritz, 3 + n_ritz)
        Mass, damping and stiffness for q = (x, y, rz, Ritz coefficients of w).
    rigid_body_modes : (3 + n_ritz, 6)
        E: the motions x, y, z, rx, ry, rz of the centre of gravity, at its height, as q.
    mass : float
        [kg]
    centre_of_gravity : (3,)
        In the mover frame, the height from the neutral plane [m].
    inertia : (3, 3)
        About the centre of gravity, for rx, ry, rz [kg m2].
    """

    plate: RitzPlate
    M: Array
    D: Array
    K: Array
    rigid_body_modes: Array
    mass: float
    centre_of_gravity: Array
    inertia: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class LumpedMasses:
    """Point masses of the mover: masses (n,) [kg], places (n, 2) and heights (n,) [m] in the mover frame."""

    masses: Array
    places: Array
    heights: Array


def lumped_masses(parameters: MMPAParameters) -> LumpedMasses:
    r"""Magnets and mirror bars as point masses.

    With ``mass_heights`` each magnet and each piece of a bar stands on two points, half the mass at
    :math:`z \pm h / (2 \sqrt3)`, which have the height and the second moment :math:`z^2 + h^2/12` of a block of height
    h; without, all masses lie in the neutral plane.

    Raises
    ------
    DomainError
        If a magnet reaches beyond the edge of the plate.
    """
    p = parameters
    magnets, (bar_places, bar_masses) = magnet_array(p), mirror_bars(p)
    # the cuboids are turned by 45 degrees: along x and y they reach (a + b) / (2 sqrt 2) from their centres
    reach = np.max(np.abs(magnets.centres), axis=1) + np.sum(magnets.sizes[:, :2], axis=1) / np.sqrt(8.0)
    if np.max(reach) > p.side / 2 * (1 + 1e-9):
        raise DomainError(
            f"the magnets reach {np.max(reach):.5g} m from the centre of the plate, wanted at most side / 2 = "
            f"{p.side / 2:.5g} m. Lower magnet_limit, or make the plate larger."
        )
    masses, places = np.concatenate([magnets.masses, bar_masses]), np.concatenate([magnets.centres, bar_places])
    if not p.mass_heights:
        return LumpedMasses(masses=masses, places=places, heights=np.zeros(len(masses)))
    counts = [len(magnets.masses), len(bar_masses)]
    middle = np.repeat([p.magnet_bottom + p.magnet_height / 2, (p.plate_thickness / 2 + p.beam_top) / 2], counts)
    half = np.repeat([p.magnet_height, p.bar_height], counts) / np.sqrt(12.0)
    return LumpedMasses(
        masses=np.concatenate([masses, masses]) / 2,
        places=np.concatenate([places, places]),
        heights=np.concatenate([middle - half, middle + half]),
    )


def mover(
    parameters: MMPAParameters,
    *,
    payload_mass: float = 0.0,
    payload_place: ArrayLike = (0.0, 0.0, 0.0),
    damping_factor: float = 1.0,
) -> Mover:
    """The mover of the benchmark.

    Parameters
    ----------
    parameters : MMPAParameters
        The actuator.
    payload_mass : float
        A point mass on the mover [kg].
    payload_place : (3,)
        Its place in the mover frame, the height from the neutral plane [m].
    damping_factor : float
        Factor of the damping of all flexible modes.

    Raises
    ------
    DomainError
        If magnets or payload lie off the plate, or a number is out of its range.

    Examples
    --------
    >>> bare, loaded = mover(MMPAParameters()), mover(MMPAParameters(), payload_mass=1.0, payload_place=(0, 0, 0.05))
    >>> round(bare.mass, 3), round(loaded.mass, 3), round(float(loaded.centre_of_gravity[2]) * 1e3, 2)
    (8.251, 9.251, 5.40)
    """
    p, lumps = parameters, lumped_masses(parameters)
    masses, places, heights = lumps.masses, lumps.places, lumps.heights
    if payload_mass:
        X, Y, Z = finite_array("payload_place", payload_place, (3,))
        if max(abs(X), abs(Y)) > p.side / 2:
            raise DomainError(
                f"payload_place is {(float(X), float(Y), float(Z))}, off the plate of half side {p.side / 2:.4g} m. "
                "Put the payload on the mover."
            )
        masses, heights = np.append(masses, payload_mass), np.append(heights, Z)
        places = np.vstack([places, [[X, Y]]])
    plate = RitzPlate(
        side=p.side,
        stiffness=p.bending_stiffness,
        poisson=p.poisson_ratio,
        area_density=p.plate_density * p.plate_thickness,
        degree=p.ritz_degree,
        masses=masses,
        places=places,
        heights=heights,
        rotary_density=p.plate_density * p.plate_thickness**3 / 12.0 if p.mass_heights else 0.0,
    )
    own = plate.area_density * plate.side**2
    mass = float(own + np.sum(masses))
    centre = np.append(masses @ places, masses @ heights) / mass
    arms = places - centre[:2]
    inertia_z = own * (plate.side**2 / 6.0 + float(np.sum(centre[:2] ** 2))) + float(masses @ np.sum(arms**2, axis=1))
    M = scipy.linalg.block_diag(mass, mass, inertia_z, plate.M)
    moments = masses * heights
    if np.any(moments):
        along_x, along_y = plate.rows(places, (1, 0)), plate.rows(places, (0, 1))
        M[:IN_PLANE, IN_PLANE:] = [
            -moments @ along_x,
            -moments @ along_y,
            (moments * arms[:, 1]) @ along_x - (moments * arms[:, 0]) @ along_y,
        ]
        M[IN_PLANE:, :IN_PLANE] = M[:IN_PLANE, IN_PLANE:].T
    K = scipy.linalg.block_diag(np.zeros((IN_PLANE, IN_PLANE)), plate.K)
    E = rigid_body_modes(plate, centre)
    return Mover(
        plate=plate,
        M=read_only(M),
        D=read_only(_damping(M, K, damping_factor * p.damping_of(plate.n_ritz - 3))),
        K=read_only(K),
        rigid_body_modes=read_only(E),
        mass=mass,
        centre_of_gravity=read_only(centre),
        inertia=read_only((E.T @ M @ E)[3:, 3:]),
    )


def rigid_body_modes(plate: RitzPlate, centre: Array) -> Array:
    """E (3 + n_ritz, 6): the rigid-body motions of the centre of gravity as q = (x, y, rz, Ritz coefficients).

    The neutral plane lies -c_z above the centre of gravity and moves sideways by that arm as the body tilts.
    """
    c_x, c_y, c_z = (float(c) for c in centre)
    E = np.zeros((IN_PLANE + plate.n_ritz, 6))
    E[0, 0] = E[1, 1] = E[2, 5] = 1.0
    E[IN_PLANE:, 2] = plate.function(1.0, 0.0, 0.0)
    E[IN_PLANE:, 3], E[1, 3] = plate.function(-c_y, 0.0, 1.0), c_z
    E[IN_PLANE:, 4], E[0, 4] = plate.function(c_x, -1.0, 0.0), -c_z
    return E


def _damping(M: Array, K: Array, zeta: Array) -> Array:
    """D with the damping ratios `zeta` of the flexible modes in order of frequency, none in rigid-body motion."""
    eigenvalues, V = scipy.linalg.eigh(K, M)
    rate = np.zeros(len(M))
    rate[6:] = 2.0 * zeta * np.sqrt(np.maximum(eigenvalues[6:], 0.0))
    MV = M @ V
    D = (MV * rate) @ MV.T
    return np.asarray(0.5 * (D + D.T))
