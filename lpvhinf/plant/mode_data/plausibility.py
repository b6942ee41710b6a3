"""Units that cannot be right: sizes and amplitudes against what a body of the stated mass can have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, finite_array, positive
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.plant.mode_data.rigid_body import RigidBody

UNIT_NORM = 1e-6  # amplitudes this close to 1 in every mode are a normalisation, not a coincidence


@dataclass(frozen=True, kw_only=True)
class Plausibility:
    r"""Limits of what is taken for a mover's data in SI units; widen one if your data is right.

    Parameters
    ----------
    side : (float, float)
        The mover's longest side in x or y [m].
    gyration : (float, float)
        Largest radius of gyration, relative to the largest distance of a node from the centre of gravity; it cannot
        be above 1 if nodes lie on the whole mover.
    amplitude : (float, float)
        :math:`\mathrm{rms}(|\phi|)\sqrt m` over the nodes of every flexible mode, with m the mass. Mass-normalised
        shapes obey :math:`\int |\phi|^2 dm = 1`, so it is near 1; grams or tonnes move it by a factor 31.6.
    damping : float
        Largest damping ratio of a structural mode.
    agreement : float
        Relative disagreement between two statements of the mass, the centre of gravity or the inertia.
    lumping : float
        Likewise for sums over node masses that stand for integrals of mode shapes.
    rigid_below_hz : float
        Modes with a frequency below it are rigid-body modes of the export.

    Raises
    ------
    DomainError
        If a limit is not above zero, or a range is empty.
    """

    side: tuple[float, float] = (1e-3, 10.0)
    gyration: tuple[float, float] = (0.1, 1.2)
    amplitude: tuple[float, float] = (0.2, 5.0)
    damping: float = 0.2
    agreement: float = 0.05
    lumping: float = 0.15
    rigid_below_hz: float = 1.0

    def __post_init__(self) -> None:
        for name in ("side", "gyration", "amplitude"):
            low, high = finite_array(name, getattr(self, name), (2,))
            if not 0.0 <= low < high:
                raise DomainError(f"{name} is {getattr(self, name)!r}, wanted (lowest, highest) with 0 <= low < high.")
        for name in ("damping", "agreement", "lumping", "rigid_below_hz"):
            positive(name, getattr(self, name))


def mode_labels(frequency_hz: Array) -> list[str]:
    """Modes in words: the number, counted from 1 like the columns of an export, and the frequency."""
    return [f"mode {k + 1} ({f:.6g} Hz)" for k, f in enumerate(frequency_hz)]


def check_frequencies(frequency_hz: Array, rigid_below_hz: float) -> None:
    """Raise a `DomainError` if a frequency is negative, or below that of the mode before (rigid-body modes as 0)."""
    if np.any(frequency_hz < 0.0):
        k = int(np.argmax(frequency_hz < 0.0))
        raise DomainError(
            f"frequency_hz of mode {k + 1} is {frequency_hz[k]:.6g}, wanted at least 0. A negative number often stands "
            "for a negative eigenvalue of a rigid-body mode: set it to 0."
        )
    falls = np.diff(np.where(frequency_hz < rigid_below_hz, 0.0, frequency_hz)) < 0.0
    if np.any(falls):
        k = int(np.argmax(falls))
        raise DomainError(
            f"frequency_hz falls from {frequency_hz[k]:.6g} to {frequency_hz[k + 1]:.6g} Hz at mode {k + 2}, wanted "
            "increasing frequencies. Sort the modes, and the columns of shapes and damping with them."
        )


def check_damping(damping: Array, labels: Sequence[str], highest: float) -> None:
    """Raise a `DomainError` if a damping ratio is negative or too large."""
    if np.any(damping < 0.0):
        k = int(np.argmax(damping < 0.0))
        raise DomainError(f"damping of {labels[k]} is {damping[k]:.6g}, wanted at least 0.")
    if np.any(damping > highest):
        k = int(np.argmax(damping))
        raise DomainError(
            f"damping of {labels[k]} is {damping[k]:.6g}, wanted a ratio of at most {highest:g}. "
            "In percent? Divide by 100. A loss factor is twice the ratio. Or raise limits.damping (below 1)."
        )


def check_sizes(places: Array, body: RigidBody, limits: Plausibility) -> None:
    """Raise a `DomainError` if nodes, centre of gravity and inertia cannot belong to one body in SI units."""
    low, high = places.min(axis=0), places.max(axis=0)
    side, centre = float(np.max((high - low)[:2])), body.centre_of_gravity
    if not limits.side[0] <= side <= limits.side[1]:
        raise DomainError(
            f"points span {side:.6g} m, wanted a mover of {limits.side[0]:g} to {limits.side[1]:g} m. "
            f"{'In mm? Divide by 1000.' if side > limits.side[1] else 'Give metres.'} Or widen limits.side."
        )
    margin = 0.1 * side
    if np.any(centre[:2] < low[:2] - margin) or np.any(centre[:2] > high[:2] + margin):
        raise DomainError(
            f"centre_of_gravity is {centre.tolist()} m, outside the mover from {low[:2].tolist()} to "
            f"{high[:2].tolist()} m. Give it in metres and in the coordinates of the points."
        )
    reach = float(np.max(np.linalg.norm(places - centre, axis=1)))
    radius = float(np.sqrt(np.linalg.eigvalsh(body.inertia)[-1] / body.mass))
    if not limits.gyration[0] * reach <= radius <= limits.gyration[1] * reach:
        raise DomainError(
            f"inertia and mass ({body.mass:.6g} kg) give a radius of gyration of {radius:.6g} m, but the farthest node "
            f"is {reach:.6g} m from the centre of gravity: wanted {limits.gyration[0]:g} to {limits.gyration[1]:g} "
            "times that. Give mass in kg and inertia in kg m2 (1 kg mm2 is 1e-6 kg m2) about the centre of gravity, or "
            "widen limits.gyration."
        )


def check_normalisation(values: Array) -> None:
    """Raise an `AssumptionError` if shapes (n, 1 or 3, n_modes) are scaled to an amplitude or a sum of squares of 1."""
    squares = np.sum(values**2, axis=1)
    sizes = {
        "largest entry": np.max(np.abs(values), axis=(0, 1)),
        "largest amplitude": np.sqrt(squares.max(axis=0)),
        "sum of squares": squares.sum(axis=0),
    }
    for what, size in sizes.items():
        if np.all(np.abs(size - 1.0) < UNIT_NORM):
            raise AssumptionError(
                f"shapes have the {what} 1 in every flexible mode, wanted mass-normalised shapes [1/sqrt(kg)]. "
                "Give modal_mass [kg] of this normalisation, or export mass-normalised shapes."
            )


def check_amplitudes(values: Array, labels: Sequence[str], body: RigidBody, limits: Plausibility) -> None:
    """Raise an `AssumptionError` if shapes (n, 1 or 3, n_modes) have amplitudes that the mass cannot have."""
    amplitude = np.sqrt(np.mean(np.sum(values**2, axis=1), axis=0) * body.mass)
    wrong = (amplitude < limits.amplitude[0]) | (amplitude > limits.amplitude[1])
    if np.any(wrong):
        k = int(np.argmax(wrong))
        raise AssumptionError(
            f"shapes of {labels[k]} have rms(|phi|) sqrt(mass) = {amplitude[k]:.4g} with the mass "
            f"{body.mass:.6g} kg, wanted {limits.amplitude[0]:g} to {limits.amplitude[1]:g}: mass-normalised shapes "
            "have about 1, whatever the unit of length. Give shapes in 1/sqrt(kg) (a model in tonnes gives 31.6 times "
            "too much, one in grams 31.6 times too little), modal_mass in kg if they are not mass-normalised, and the "
            "mass in kg. If this is a local mode, or one that hardly moves out of plane, leave it out or widen "
            "limits.amplitude."
        )
