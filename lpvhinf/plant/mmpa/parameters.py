"""Parameters of the moving-magnet planar actuator benchmark."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from lpvhinf.checks import Array, box_array, finite_array, positive, read_only
from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa.plausibility import check_parameters

WHOLE = (
    "magnet_count_half",
    "bar_points",
    "coils_short",
    "coils_long",
    "turns",
    "filaments_width",
    "filaments_height",
    "field_taper_order",
    "window_order",
    "ritz_degree",
)
SIGNED = ("sensor_z_half_span", "sensor_xy_half_span", "sensor_height", "gravity")


@dataclass(frozen=True, kw_only=True)
class MMPAParameters:
    """Parameters of the benchmark, in SI units; the defaults are the published benchmark.

    The mover frame has its origin at the centre of the plate's neutral plane, z up. Seen from there the magnets fill
    -plate_thickness/2 - magnet_height < z < -plate_thickness/2, and the gap and the two coil layers lie below.

    Parameters
    ----------
    side : float
        Side a of the square mover plate [m].
    plate_thickness, youngs_modulus, poisson_ratio, plate_density : float
        Aluminium plate [m], [Pa], [-], [kg/m3].
    damping : float or tuple of float
        Modal damping of every flexible mode [-]; a tuple holds that of the first modes one by one, and its last value
        goes on.
    mass_heights : bool
        Whether plate, magnets and mirror bars have their masses at their real heights, with the rotary inertia about
        horizontal axes and the coupling of horizontal motion with tilt that follow from it. The published benchmark
        lumps all of it at the neutral plane.
    bar_mass, bar_inset, bar_clearance, bar_points : float, float, float, int
        Two mirror bars along the +x and +y edges: mass of each [kg], distance of its centre line to the edge [m],
        clearance at its ends [m], number of points its mass is lumped on.
    bar_height : float
        Height of the mirror bars, which stand on the plate [m]; the horizontal beams hit them.
    remanence, magnet_density, magnet_height : float
        NdFeB: [T], [kg/m3], [m].
    pole_pitch : float
        tau_n, half the period of the field along x and y [m]; the array, turned by 45 degrees, has tau = sqrt(2) tau_n.
    magnet_fill : float
        tau_m / tau, width of the vertically magnetised cuboids over the pitch [-].
    magnet_count_half, magnet_limit : int, float
        The array is laid out over +-count pitches and keeps cuboids with centres within +-limit [m].
    field_taper, field_taper_order : float, int
        The field falls to zero over this width at the plate's edge [m], with this many continuous derivatives.
    gap, layer_spacing : float
        Air gap between magnets and upper coil layer, and between the two layers [m].
    coils_short, coils_long : int
        Coils of a layer along their short and their long axis (16 x 5 = 80).
    pitch_short, pitch_long : float
        Coil pitch along the short and the long axis [m].
    coil_short, coil_long : float
        Outer size of a coil [m].
    bundle_width, bundle_height : float
        Cross-section of the winding [m].
    turns, filaments_width, filaments_height : int
        Turns, and Gauss points that stand for them over the width and the height of the bundle.
    window_short, window_long : (float, float)
        Commutation: coils whose centre is within the first distance of the mover's centre have the weight 1, beyond
        the second one 0, along the coil's short and long axis [m].
    window_order : int
        Continuous derivatives of the weights.
    travel : float
        P = [-travel, travel] squared [m].
    point_of_control : (float, float, float)
        x and y in the frame, and height above the top face of the plate, of the point whose motion counts [m]. The
        substrate lies on the plate, so the surface that is exposed is its top face.
    sensor_z_half_span, sensor_xy_half_span, sensor_height : float
        z-beams at (+-, +-) this [m]; outer horizontal beams at +- this [m]; height of the horizontal beams above
        the neutral plane [m].
    gravity : float
        [m/s2]
    ritz_degree : int
        Degree of the Legendre-Ritz plate in x and in y.

    Raises
    ------
    DomainError
        If a value is not finite, not positive where it must be, or geometrically impossible.

    Examples
    --------
    >>> round(MMPAParameters().bending_stiffness)
    3352
    >>> MMPAParameters().box.tolist()
    [[-0.06, 0.06], [-0.06, 0.06]]
    """

    side: float = 0.300
    plate_thickness: float = 0.008
    youngs_modulus: float = 70e9
    poisson_ratio: float = 0.33
    plate_density: float = 2700.0
    damping: float | tuple[float, ...] = 0.008
    mass_heights: bool = False
    bar_mass: float = 0.40
    bar_inset: float = 0.006
    bar_clearance: float = 0.005
    bar_points: int = 30
    bar_height: float = 0.016
    remanence: float = 1.35
    magnet_density: float = 7600.0
    magnet_height: float = 0.010
    pole_pitch: float = 0.030
    magnet_fill: float = 0.68
    magnet_count_half: int = 8
    magnet_limit: float = 0.1351
    field_taper: float = 0.030
    field_taper_order: int = 2
    gap: float = 0.0015
    layer_spacing: float = 0.0005
    coils_short: int = 16
    coils_long: int = 5
    pitch_short: float = 0.040
    pitch_long: float = 0.120
    coil_short: float = 0.0395
    coil_long: float = 0.1195
    bundle_width: float = 0.011
    bundle_height: float = 0.006
    turns: int = 100
    filaments_width: int = 6
    filaments_height: int = 3
    window_short: tuple[float, float] = (0.140, 0.230)
    window_long: tuple[float, float] = (0.160, 0.240)
    window_order: int = 2
    travel: float = 0.060
    point_of_control: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sensor_z_half_span: float = 0.080
    sensor_xy_half_span: float = 0.080
    sensor_height: float = 0.012
    gravity: float = 9.81
    ritz_degree: int = 14

    def __post_init__(self) -> None:
        for field in fields(self):
            self._check(field.name, getattr(self, field.name))
        check_parameters(self)

    def _check(self, name: str, value: Any) -> None:
        if name in ("window_short", "window_long"):
            inner, outer = (float(x) for x in finite_array(name, value, (2,)))
            if not 0.0 <= inner < outer:
                raise DomainError(f"{name} is {value!r}, wanted two distances 0 <= inner < outer [m].")
            object.__setattr__(self, name, (inner, outer))
            return
        if name == "point_of_control":
            x, y, z = (float(c) for c in finite_array(name, value, (3,)))
            object.__setattr__(self, name, (x, y, z))
            return
        if name == "damping":
            values = finite_array(name, value)
            if values.ndim > 1 or values.size == 0 or np.any((values < 0.0) | (values >= 1.0)):
                raise DomainError(f"damping is {value!r}, wanted damping ratios from 0 to below 1: one, or a tuple.")
            object.__setattr__(self, name, tuple(values.tolist()) if values.ndim else float(values))
            return
        if name == "mass_heights":
            if not isinstance(value, bool):
                raise DomainError(f"mass_heights is {value!r}, wanted True or False.")
            return
        if isinstance(value, bool | str) or not np.isscalar(value) or not np.isreal(value):
            raise DomainError(f"{name} is {value!r}, wanted a number.")
        number = float(value)  # type: ignore[arg-type]
        if name in WHOLE:
            if not number.is_integer() or number < 1:
                raise DomainError(f"{name} is {value!r}, wanted a whole number of at least 1.")
            object.__setattr__(self, name, int(number))
        elif name in SIGNED:
            if not 0.0 <= number < np.inf:
                raise DomainError(f"{name} is {value!r}, wanted a finite number of at least 0.")
        else:
            positive(name, number)

    @property
    def bending_stiffness(self) -> float:
        """E h^3 / (12 (1 - nu^2)) [N m]."""
        return self.youngs_modulus * self.plate_thickness**3 / (12.0 * (1.0 - self.poisson_ratio**2))

    @property
    def magnet_pitch(self) -> float:
        """Pitch tau of the turned array, sqrt(2) tau_n [m]."""
        return float(np.sqrt(2.0)) * self.pole_pitch

    @property
    def magnet_bottom(self) -> float:
        """Height z of the lower face of the magnets, from the neutral plane [m]."""
        return -self.plate_thickness / 2 - self.magnet_height

    @property
    def layer_heights(self) -> tuple[float, float]:
        """Heights z of the mid-planes of the upper and the lower coil layer, from the neutral plane [m]."""
        top = self.magnet_bottom - self.gap - self.bundle_height / 2
        return top, top - self.bundle_height - self.layer_spacing

    @property
    def beam_top(self) -> float:
        """Height z of the upper edge of the mirror bars, from the neutral plane [m]."""
        return self.plate_thickness / 2 + self.bar_height

    @property
    def point_height(self) -> float:
        """Height z of the point of control from the neutral plane [m]."""
        return self.plate_thickness / 2 + self.point_of_control[2]

    def damping_of(self, n: int) -> Array:
        """Damping ratios of the first `n` flexible modes, (n,).

        Examples
        --------
        >>> MMPAParameters(damping=(0.002, 0.004)).damping_of(4).tolist()
        [0.002, 0.004, 0.004, 0.004]
        """
        given = np.atleast_1d(np.asarray(self.damping, dtype=float))[:n]
        return np.concatenate([given, np.full(n - len(given), given[-1] if n else 0.0)])

    @property
    def n_coils(self) -> int:
        """Number of coils in both layers."""
        return 2 * self.coils_short * self.coils_long

    @property
    def box(self) -> Array:
        """The box P of positions of the plate's centre, (2, 2) [m]."""
        return box_array(np.array([[-1.0, 1.0], [-1.0, 1.0]]) * self.travel)

    @property
    def z_beams(self) -> Array:
        """Frame coordinates of the vertical beams, (4, 2) [m]."""
        s = self.sensor_z_half_span
        return np.asarray(read_only([[s, s], [-s, s], [-s, -s], [s, -s]]))
