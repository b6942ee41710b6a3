"""What is uncertain of a plant, in which ranges, and how points of a unit cube become perturbed plants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lpvhinf.checks import Array, finite_array, positive, whole_number
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.robustness.samples import Samples

Pair = tuple[float, float]

# name: (lowest, highest, unit, why not beyond)
RANGES: dict[str, tuple[float, float, str, str]] = {
    "damping": (1e-9, 0.99, "", "they are damping ratios of modes that oscillate, 0.01 for 1 %"),
    "frequency": (-0.5, 0.5, "", "it is a relative deviation, 0.02 for 2 %"),
    "mass": (-0.5, 0.5, "", "it is a relative deviation, 0.02 for 2 %"),
    "misalignment": (0.0, 0.05, " m", "it is a small error of the position"),
}
SIX_AXES = ((0, 1, 2), (3,), (4,), (5,))  # x, y, z have one mass; rx, ry, rz an inertia each


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    r"""Ranges of the deviations of a true plant from the one that a controller was made from.

    All deviations are independent of each other, and uniform but for the damping, which is uniform in its logarithm.

    Parameters
    ----------
    damping : (float, float)
        Damping ratio of every flexible mode of the true plant [-].
    frequency : (float, float)
        Relative deviation of every eigenfrequency: :math:`\omega_i (1 + d)`.
    mass : (float, float)
        Relative deviation of the rigid-body masses and inertias, :math:`M_{rb} \to F M_{rb} F` with
        :math:`F = \mathrm{diag}(\sqrt{1 + d_j})`, and of every modal mass, which divides input and output gains of its
        mode by :math:`\sqrt{1 + d_i}` each.
    mass_groups : tuple of tuples of int, optional
        Rigid axes that share one deviation; if left out, x, y, z of six axes share theirs, all others have their own.
    misalignment : (float, float)
        Magnitude [m] of the error along every coordinate of p, of either sign: the actuators are commutated for
        p + error. Sensors and scheduling keep p.
    delay : float
        Of the loop, at the plant's inputs [s]; zero for none.
    delay_order : int
        Order of its Padé approximation in the continuous loop. The sampled loop has it exactly.
    sample_time : float
        Of the controller in the sampled loop [s].

    Raises
    ------
    DomainError
        If a value is outside its range, or a lower end above its upper one.
    DimensionError
        If a range is not a pair.

    Examples
    --------
    >>> Uncertainty(delay=1.5e-4).delay_in_samples
    1.5
    """

    damping: Pair = (1e-3, 1e-2)
    frequency: Pair = (-0.02, 0.02)
    mass: Pair = (-0.02, 0.02)
    mass_groups: tuple[tuple[int, ...], ...] | None = None
    misalignment: Pair = (5e-6, 50e-6)
    delay: float = 150e-6
    delay_order: int = 2
    sample_time: float = 1e-4

    def __post_init__(self) -> None:
        for name, (low, high, unit, reason) in RANGES.items():
            values: Any = finite_array(name, getattr(self, name), (2,))
            if values[0] > values[1]:
                raise DomainError(f"{name} is {tuple(values.tolist())}, wanted (lowest, highest). Swap them.")
            if values[0] < low or values[1] > high:
                raise DomainError(
                    f"{name} is {tuple(values.tolist())}{unit}, wanted values from {low:g} to {high:g}{unit}: {reason}."
                )
            object.__setattr__(self, name, (float(values[0]), float(values[1])))
        if not 0.0 <= finite_array("delay", self.delay, ()) <= 0.1:
            raise DomainError(f"delay is {self.delay} s, wanted 0 to 0.1 s: it is that of a control loop.")
        whole_number("delay_order", self.delay_order, 1)
        positive("sample_time", self.sample_time, "s")

    @property
    def delay_in_samples(self) -> float:
        """The delay in units of the sample time."""
        return self.delay / self.sample_time

    def groups(self, n_rb: int) -> tuple[tuple[int, ...], ...]:
        """Rigid axes that share one deviation of mass.

        Raises
        ------
        DomainError
            If `mass_groups` leave an axis out, or name one twice or one that there is not.
        """
        if self.mass_groups is None:
            return SIX_AXES if n_rb == 6 else tuple((i,) for i in range(n_rb))
        if sorted(i for group in self.mass_groups for i in group) != list(range(n_rb)):
            raise DomainError(
                f"mass_groups is {self.mass_groups}, wanted every axis 0 to {n_rb - 1} in one group. "
                "Leave it out for the usual groups."
            )
        return self.mass_groups

    def dimension(self, plant: DecoupledPlant) -> int:
        """Number of uncertain parameters, the position included."""
        return 3 * (plant.n_modes - plant.n_rb) + len(self.groups(plant.n_rb)) + 2 * len(plant.box)

    def names(self, plant: DecoupledPlant) -> tuple[str, ...]:
        """Names of the columns of `samples`' argument."""
        n, n_p, groups = plant.n_modes - plant.n_rb, len(plant.box), self.groups(plant.n_rb)
        modes = [f"{what} {i + 1}" for what in ("damping", "frequency", "modal mass") for i in range(n)]
        masses = ["mass of axes " + ", ".join(str(i + 1) for i in group) for group in groups]
        return (*modes, *masses, *(f"{what} {i + 1}" for what in ("misalignment", "position") for i in range(n_p)))

    def samples(self, plant: DecoupledPlant, unit: Array) -> Samples:
        """Perturbed plants of points (N, dimension) of the unit cube.

        A misalignment runs from its most negative value at 0 to its most positive one at 1, without what lies
        between its two smallest magnitudes.

        Raises
        ------
        DimensionError
            If `unit` has another number of columns.
        DomainError
            If an entry is not between 0 and 1.
        """
        u = finite_array("unit", unit)
        n, n_p, groups = plant.n_modes - plant.n_rb, len(plant.box), self.groups(plant.n_rb)
        if u.ndim != 2 or u.shape[1] != self.dimension(plant):
            raise DimensionError(
                f"unit has shape {u.shape}, wanted (N, {self.dimension(plant)}), one column for each of `names(plant)`."
            )
        if np.any((u < 0.0) | (u > 1.0)):
            raise DomainError(f"unit has entries from {u.min():.4g} to {u.max():.4g}, wanted 0 to 1.")
        ends = np.cumsum([n, n, n, len(groups), n_p])
        zeta, frequency, modal, masses, errors, position = np.split(u, ends, axis=1)
        shared = np.empty((len(u), plant.n_rb))
        for j, group in enumerate(groups):
            shared[:, list(group)] = 1.0 + _linear(masses[:, [j]], self.mass)
        toward = 2.0 * errors - 1.0
        size = _linear(np.abs(toward), self.misalignment)
        return Samples(
            zeta=np.exp(_linear(zeta, (np.log(self.damping[0]), np.log(self.damping[1])))),
            omega=plant.omega[plant.n_rb :] * (1.0 + _linear(frequency, self.frequency)),
            modal_mass=1.0 + _linear(modal, self.mass),
            mass=shared,
            misalignment=np.where(toward < 0.0, -size, size),
            position=plant.box[:, 0] + position * (plant.box[:, 1] - plant.box[:, 0]),
        )


def _linear(u: Array, ends: Pair) -> Array:
    """From `ends[0]` at u = 0 to `ends[1]` at u = 1."""
    return ends[0] + u * (ends[1] - ends[0])
