"""The moving-magnet planar actuator as one mechanical and one modal model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box, read_only
from lpvhinf.errors import DomainError
from lpvhinf.plant.mechanical import MechanicalModel
from lpvhinf.plant.mmpa.coils import CoilLayer, CoilWrench, coil_layers
from lpvhinf.plant.mmpa.commutation import coil_weights, weighted_pseudo_inverse
from lpvhinf.plant.mmpa.magnets import FirstHarmonicField, magnet_array, mirror_bars
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.plate import RitzPlate
from lpvhinf.plant.mmpa.sensors import SENSOR_NAMES, InterferometerMap
from lpvhinf.plant.mmpa.wrench import SeparableWrench
from lpvhinf.plant.modal import ModalModel
from lpvhinf.plant.modal_form import modal_form

RIGID_BODY_NAMES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilInputMap:
    """Phi_a(p) of the coils for q = (x, y, rz, Ritz coefficients): the wrench, its torque moved to the CoG."""

    coils: CoilWrench
    centre_of_gravity: Array

    def __call__(self, points: Array) -> Array:
        """Phi_a at `points` (N, 2), as (N, 3 + n_ritz, n_coils)."""
        wrench = self.coils.wrench(points)
        c_x, c_y = self.centre_of_gravity
        wrench[:, 2] += c_y * wrench[:, 0] - c_x * wrench[:, 1]
        return wrench


@dataclass(frozen=True, kw_only=True, eq=False)
class MMPA:
    """The benchmark: parameters, mechanical model, modal model and commutation.

    Attributes
    ----------
    parameters : MMPAParameters
        What it was built from.
    mechanical : MechanicalModel
        q = (x, y, rz in-plane about the centre of gravity, 225 Ritz coefficients of w); u 160 coil currents [A];
        y nine interferometers [m].
    modal : ModalModel
        Rigid-body modes x, y, z, rx, ry, rz about the centre of gravity, then the flexible modes.
    plate : RitzPlate
        The mover's plate with magnets and mirror bars.
    layers : tuple of CoilLayer
        The stator.
    mass : float
        [kg]
    centre_of_gravity : (2,)
        In the mover frame [m].
    inertia : (3, 3)
        About the centre of gravity, for rx, ry, rz [kg m2].
    """

    parameters: MMPAParameters
    mechanical: MechanicalModel
    modal: ModalModel
    plate: RitzPlate
    layers: tuple[CoilLayer, ...]
    mass: float
    centre_of_gravity: Array
    inertia: Array

    @property
    def box(self) -> Array:
        """The box P of positions of the plate's centre, (2, 2) [m]."""
        return self.mechanical.box

    @property
    def rigid_body_names(self) -> tuple[str, ...]:
        """Order of the rigid-body modes."""
        return RIGID_BODY_NAMES

    def coil_weights(self, points: ArrayLike) -> Array:
        """Smooth weights of the coils at `points` (N, 2) [m], as (N, 160)."""
        return coil_weights(points_in_box(points, self.box), self.layers, self.parameters)

    def wrench_matrix(self, points: ArrayLike) -> Array:
        """Physical wrench (F_x, F_y, F_z, T_x, T_y, T_z) about the centre of gravity per ampere, (N, 6, 160)."""
        root = np.linalg.inv(self.modal.rigid_body_scaling)  # E.T = M_rb^{1/2} V_rb.T
        return np.asarray(root @ self.modal.input_gains(points)[:, :6])

    def levitation_current(self, points: ArrayLike, acceleration: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Coil currents (N, 160) [A] that carry the mover and accelerate it by `acceleration` (3,) [m/s2].

        Raises
        ------
        AssumptionError
            If too few coils are active to levitate.
        """
        a = finite_array("acceleration", acceleration, (3,))
        p = points_in_box(points, self.box)
        inverse = weighted_pseudo_inverse(self.wrench_matrix(p), self.coil_weights(p))
        force = self.mass * (a + np.array([0.0, 0.0, self.parameters.gravity]))
        return np.asarray(inverse[:, :, :3] @ force)


def benchmark(parameters: MMPAParameters | None = None, *, n_flex: int = 15, coils: CoilWrench | None = None) -> MMPA:
    """The open moving-magnet planar actuator benchmark.

    Parameters
    ----------
    parameters : MMPAParameters, optional
        The published benchmark if left out.
    n_flex : int
        Number of flexible modes in the modal model; the static compliance of all others stays in it.
    coils : CoilWrench, optional
        Another model of the magnetics; the first harmonic of the field if left out.

    Raises
    ------
    DomainError
        If `n_flex` is not between 0 and the number of flexible modes.

    Notes
    -----
    The mass of magnets and mirrors is lumped at the neutral plane: the height of the centre of gravity couples no
    horizontal with tilting motion. In-plane deformation (first mode near 3.2 kHz) is left out.

    Examples
    --------
    >>> plant = benchmark()
    >>> round(plant.mass, 2), (plant.modal.omega[6:9] / (2 * np.pi)).round(1).tolist()
    (8.25, [139.4, 206.5, 259.9])
    """
    given = MMPAParameters() if parameters is None else parameters
    magnets = magnet_array(given)
    bar_points, bar_masses = mirror_bars(given)
    plate = RitzPlate(
        side=given.side,
        stiffness=given.bending_stiffness,
        poisson=given.poisson_ratio,
        area_density=given.plate_density * given.plate_thickness,
        degree=given.ritz_degree,
        masses=np.concatenate([magnets.masses, bar_masses]),
        places=np.concatenate([magnets.centres, bar_points]),
    )
    n_flexible = plate.n_ritz - 3
    if isinstance(n_flex, bool) or int(n_flex) != n_flex or not 0 <= n_flex <= n_flexible:
        raise DomainError(f"n_flex is {n_flex!r}, wanted a whole number from 0 to {n_flexible}.")
    one, x, y = plate.function(1, 0, 0), plate.function(0, 1, 0), plate.function(0, 0, 1)
    mass = float(one @ plate.M @ one)
    centre = np.array([one @ plate.M @ x, one @ plate.M @ y]) / mass
    rx, ry = y - centre[1] * one, -(x - centre[0] * one)
    tilt = np.array([[a @ plate.M @ b for b in (rx, ry)] for a in (rx, ry)])
    inertia = scipy.linalg.block_diag(tilt, np.trace(tilt))  # a plane body: Izz = Ixx + Iyy
    M = scipy.linalg.block_diag(mass, mass, inertia[2, 2], plate.M)
    K = scipy.linalg.block_diag(np.zeros((3, 3)), plate.K)
    E = np.zeros((len(M), 6))
    E[0, 0] = E[1, 1] = E[2, 5] = 1.0
    E[3:, 2], E[3:, 3], E[3:, 4] = one, rx, ry
    layers = coil_layers(given)
    magnetics: CoilWrench = (
        SeparableWrench(field=FirstHarmonicField.from_parameters(given), layers=layers, degree=given.ritz_degree)
        if coils is None
        else coils
    )
    mechanical = MechanicalModel(
        M=M,
        D=_plate_damping(plate, given.damping),
        K=K,
        input_map=CoilInputMap(coils=magnetics, centre_of_gravity=centre),
        output_map=InterferometerMap.from_parameters(given, plate, centre),
        box=given.box,
        input_names=tuple(f"i{k + 1}" for k in range(magnetics.n_coils)),
        output_names=SENSOR_NAMES,
    )
    return MMPA(
        parameters=given,
        mechanical=mechanical,
        modal=modal_form(mechanical, n_modes=6 + int(n_flex), rigid_body_modes=E),
        plate=plate,
        layers=layers,
        mass=mass,
        centre_of_gravity=np.asarray(read_only(centre)),
        inertia=np.asarray(read_only(inertia)),
    )


def _plate_damping(plate: RitzPlate, zeta: float) -> Array:
    """D with the same modal damping in every flexible mode of the plate, none in rigid-body motion."""
    eigenvalues, V = scipy.linalg.eigh(plate.K, plate.M)
    eigenvalues[:3] = 0.0
    MV = plate.M @ V
    D = (MV * (2.0 * zeta * np.sqrt(np.maximum(eigenvalues, 0.0)))) @ MV.T
    return np.asarray(scipy.linalg.block_diag(np.zeros((3, 3)), 0.5 * (D + D.T)))
