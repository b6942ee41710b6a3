"""Effects that make the real actuator deviate from what its controller knows of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg

from lpvhinf.checks import finite_array, whole_number
from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa.amplifier import Amplifier
from lpvhinf.plant.mmpa.measurement import SensorErrors

if TYPE_CHECKING:
    import control

Pair = tuple[float, float]

# name: (length or None for a number, lowest, highest, unit, why not beyond)
RANGES: dict[str, tuple[int | None, float, float, str, str]] = {
    "commutation_misalignment": (2, -0.05, 0.05, "m", "it is a small error of the mover's position"),
    "coil_position_rms": (None, 0.0, 1e-3, "m", "neighbouring coils would overlap"),
    "magnet_strength": (None, -0.5, 0.5, "", "it is a relative deviation, 0.01 for 1 %"),
    "magnet_strength_rms": (None, 0.0, 0.2, "", "it is a relative deviation, 0.01 for 1 %"),
    "beam_height_error": (None, -0.05, 0.05, "m", "the beam would miss the mirror"),
    "mirror_slope_x": (2, -0.01, 0.01, "rad", "the readings are of first order in the slope"),
    "mirror_slope_y": (2, -0.01, 0.01, "rad", "the readings are of first order in the slope"),
    "mirror_slope_z": (2, -0.01, 0.01, "rad", "the readings are of first order in the slope"),
    "damping_factor": (None, 0.0, 100.0, "", "it multiplies the damping ratios"),
    "payload_mass": (None, 0.0, 1e3, "kg", "it rides on the mover"),
    "payload_place": (3, -1.0, 1.0, "m", "it rides on the mover"),
    "delay": (None, 0.0, 0.1, "s", "it is that of a control loop"),
}


@dataclass(frozen=True, kw_only=True)
class Effects:
    r"""Deviations of the simulated actuator from the model that its controller believes; all are off by default.

    The first group changes the modal model: `benchmark` then builds two, the true one with the effects (`MMPA.modal`)
    and the one known to commutation and sensor transformation (`MMPA.known`). The amplifier and the delay act before
    the coils (`input_dynamics`, `Amplifier.apply`), the sensor errors after the sensors (`SensorErrors.read`).

    Parameters
    ----------
    commutation_misalignment : (float, float)
        The commutation believes the mover at p + this [m]: raw about 50 um, calibrated 5 um. Along k the wave number
        of the field, T_u then turns forces by :math:`k\delta`, 0.5 mrad for 5 um. The sensors are not concerned.
    coil_position_rms : float
        Standard deviation of the place of every coil along x and along y [m], about 20 um.
    magnet_strength : float
        Relative deviation of all magnets together, such as -0.01 for magnets that are 10 K too warm [-].
    magnet_strength_rms : float
        Standard deviation of the relative strength of each magnet [-], about 0.01.
    seed : int
        Of the random places of coils and strengths of magnets, which do not depend on each other.
    beam_height_error : float
        The horizontal beams run this much higher than known [m]: tilt reads as translation (Abbe error).
    mirror_slope_x : (float, float)
        Slope of the mirror of the x-beams towards y and z [rad]: its normal is (1, s_y, s_z) and the beams read
        :math:`u_x + s_y u_y + s_z u_z`, the displacement of the mirror where the beam meets it, along the normal.
    mirror_slope_y : (float, float)
        Likewise towards x and z: the normal is (s_x, 1, s_z).
    mirror_slope_z : (float, float)
        Likewise that of the vertical beams towards x and y, on the top face: the normal is (s_x, s_y, 1).
    damping_factor : float
        True damping of the flexible modes over the known one [-].
    payload_mass : float
        Mass on the mover that the controller does not know [kg]; it shifts the centre of gravity, the inertia and the
        flexible modes.
    payload_place : (float, float, float)
        Its place in the mover frame, the height from the neutral plane [m]. At a height it couples horizontal motion
        with tilt.
    amplifier : Amplifier, optional
        The power amplifiers; ideal current sources if left out.
    delay : float
        Of the whole loop [s]; 1.5 samples of 0.1 ms are 150 us.
    sensors : SensorErrors
        Noise and resolution of the readings.

    Raises
    ------
    DomainError
        If a value is outside its range.
    DimensionError
        If a tuple has another length.

    Examples
    --------
    >>> Effects().deviates, Effects(payload_mass=0.5).deviates, Effects(delay=150e-6).deviates
    (False, True, False)
    >>> Effects.realistic().coil_position_rms
    2e-05
    """

    commutation_misalignment: Pair = (0.0, 0.0)
    coil_position_rms: float = 0.0
    magnet_strength: float = 0.0
    magnet_strength_rms: float = 0.0
    seed: int = 0
    beam_height_error: float = 0.0
    mirror_slope_x: Pair = (0.0, 0.0)
    mirror_slope_y: Pair = (0.0, 0.0)
    mirror_slope_z: Pair = (0.0, 0.0)
    damping_factor: float = 1.0
    payload_mass: float = 0.0
    payload_place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    amplifier: Amplifier | None = None
    delay: float = 0.0
    sensors: SensorErrors = field(default_factory=SensorErrors)

    def __post_init__(self) -> None:
        for name, (length, low, high, unit, reason) in RANGES.items():
            value: Any = getattr(self, name)
            values = finite_array(name, value, () if length is None else (length,))
            if np.any((values < low) | (values > high)):
                unit = f" {unit}" if unit else ""
                raise DomainError(f"{name} is {value!r}{unit}, wanted values from {low:g} to {high:g}{unit}: {reason}.")
            object.__setattr__(self, name, float(values) if length is None else tuple(values.tolist()))
        whole_number("seed", self.seed, 0)
        if self.amplifier is not None and not isinstance(self.amplifier, Amplifier):
            raise DomainError(f"amplifier is {self.amplifier!r}, wanted an Amplifier or None.")
        if not isinstance(self.sensors, SensorErrors):
            raise DomainError(f"sensors is {self.sensors!r}, wanted SensorErrors(noise_rms=..., quantisation=...).")

    @classmethod
    def realistic(cls, seed: int = 0) -> Effects:
        """A calibrated machine: the values of the benchmark's description; what it leaves open stays off.

        5 um of misalignment, coils 20 um and magnets 1 % rms, current loops of 3 kHz with 16 bits and 100 uA of noise,
        1.5 samples of 0.1 ms of delay, readings with 0.3 nm of noise in steps of 0.15 nm.
        """
        return cls(
            commutation_misalignment=(5e-6, 5e-6),
            coil_position_rms=20e-6,
            magnet_strength_rms=0.01,
            seed=seed,
            amplifier=Amplifier(bandwidth_hz=3000.0),
            delay=150e-6,
            sensors=SensorErrors(noise_rms=0.3e-9, quantisation=0.15e-9),
        )

    @property
    def misplaces_coils_or_magnets(self) -> bool:
        """Whether the true coils or magnets differ from the known ones."""
        return bool(self.coil_position_rms or self.magnet_strength or self.magnet_strength_rms)

    @property
    def changes_mover(self) -> bool:
        """Whether mass, damping or modes of the true mover differ from the known ones."""
        return self.payload_mass > 0.0 or self.damping_factor != 1.0

    @property
    def changes_sensors(self) -> bool:
        """Whether the true sensors see other displacements than the known ones."""
        slopes = self.mirror_slope_x + self.mirror_slope_y + self.mirror_slope_z
        return self.beam_height_error != 0.0 or any(slopes)

    @property
    def deviates(self) -> bool:
        """Whether the true modal model differs from the known one."""
        other = self.misplaces_coils_or_magnets or self.changes_mover or self.changes_sensors
        return other or any(self.commutation_misalignment)

    def input_dynamics(self, n_inputs: int = 1, *, delay_order: int = 2) -> control.StateSpace | None:
        r"""Current loop and delay for `n_inputs` inputs; None if neither is switched on.

        All coils have the same current loop a(s) and delay, so that at a frozen p
        :math:`G\, (a I)\, T_u(p) = G\, T_u(p)\, (a I)`: the dynamics act on each decoupled input as they do on each
        coil, and can stand in series before the decoupled plant.

        Parameters
        ----------
        n_inputs : int
            Inputs of the decoupled plant, each of which gets the same dynamics.
        delay_order : int
            Order of the Padé approximation of the delay.

        Raises
        ------
        DomainError
            If a number is not a whole number of at least 1.

        Examples
        --------
        >>> from lpvhinf import LPVStateSpace
        >>> before = Effects(amplifier=Amplifier(), delay=150e-6).input_dynamics(1)
        >>> box, double_integrator = [[-1.0, 1.0]], ([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
        >>> plant = LPVStateSpace.from_system(double_integrator, box)
        >>> LPVStateSpace.from_system(before, box).series(plant).n_x
        6
        """
        import control

        n = whole_number("n_inputs", n_inputs, 1)
        whole_number("delay_order", delay_order, 1)
        parts = []
        if self.amplifier is not None and self.amplifier.bandwidth_hz is not None:
            parts.append(self.amplifier.state_space())
        if self.delay > 0.0:
            unit = control.ss(control.tf(*control.pade(1.0, delay_order)))  # well conditioned, then scaled in time
            parts.append(control.ss(unit.A / self.delay, unit.B / self.delay, unit.C, unit.D))
        if not parts:
            return None
        one = control.series(*parts) if len(parts) > 1 else parts[0]
        a, b, c, d = (scipy.linalg.block_diag(*[m] * n) for m in (one.A, one.B, one.C, one.D))
        return control.ss(a, b, c, d)
