"""What becomes of perturbed plants under a controller: poles, sampled poles, damping and norms of each."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, known_options, read_only
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.hinfstruct.peaks import find_peaks
from lpvhinf.hinfstruct.response import Response
from lpvhinf.robustness.channel import Channel
from lpvhinf.robustness.closed_loop import SystemStack, close
from lpvhinf.robustness.continuous_loop import continuous_plant
from lpvhinf.robustness.controlled_plant import ControlledPlant
from lpvhinf.robustness.perturbed_plant import ModalStack, PerturbedPlants
from lpvhinf.robustness.sampled_loop import sampled_plant, tustin
from lpvhinf.robustness.samples import Samples
from lpvhinf.robustness.uncertainty import Uncertainty

BATCH = 32  # plants whose loops are held at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcomes:
    """Figures of N perturbed plants, norms in scaled units; NaN where a figure was not asked for.

    Attributes
    ----------
    abscissa : (N,) [rad/s]
        Largest real part of the poles of the continuous loop, with the Padé delay.
    spectral_radius : (N,)
        Largest magnitude of the poles of the sampled loop: below 1 is stable.
    damping : (N, n_flex)
        Damping ratio of the pole that takes the largest part in each controlled mode.
    least_damping : (N,)
        Smallest damping ratio of any pole, negative where the loop is unstable.
    sensitivity : (N,)
        Norm of S, from an output disturbance to e; infinity where the loop is unstable.
    flexible_peak : (N, n_flex)
        Norm of the process sensitivity from a force on each controlled mode to e: 1 is the static output at the
        position where the mode is best seen.
    """

    abscissa: Array
    spectral_radius: Array
    damping: Array
    least_damping: Array
    sensitivity: Array
    flexible_peak: Array

    def __post_init__(self) -> None:
        for name, values in self.arrays().items():
            object.__setattr__(self, name, read_only(values))

    def __len__(self) -> int:
        return len(self.abscissa)

    @property
    def unstable(self) -> Array:
        """Which continuous loops are unstable, (N,)."""
        return np.asarray(self.abscissa >= 0.0)

    @property
    def unstable_sampled(self) -> Array:
        """Which sampled loops are unstable, (N,)."""
        return np.asarray(self.spectral_radius >= 1.0)

    def figure(self, name: str) -> Array:
        """One number for each plant, the worst one where there is one for each mode, (N,)."""
        known_options("Outcomes", [name], FIGURES)
        values = self.arrays()[name]
        if values.ndim == 1:
            return values
        empty = np.full(len(values), -BETTER[name] * np.inf)
        worst = np.max if BETTER[name] < 0 else np.min
        return np.asarray(worst(values, axis=1)) if values.shape[1] else empty

    def arrays(self) -> dict[str, Array]:
        """All arrays by name."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    @classmethod
    def join(cls, parts: list[Outcomes]) -> Outcomes:
        """Those of all parts, one after the other."""
        names = [field.name for field in dataclasses.fields(cls)]
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


BETTER = {
    "abscissa": -1,
    "spectral_radius": -1,
    "damping": 1,
    "least_damping": 1,
    "sensitivity": -1,
    "flexible_peak": -1,
}
"""Whether more (1) or less (-1) of a figure is better."""
FIGURES = tuple(BETTER)


class Analysis:
    """Closes and measures the loops of perturbed plants with one controller.

    Parameters
    ----------
    subject : ControlledPlant
    uncertainty : Uncertainty
        Its delay and sample time are used, and the largest misalignment is a limit.
    """

    def __init__(self, subject: ControlledPlant, uncertainty: Uncertainty) -> None:
        self.subject, self.uncertainty = subject, uncertainty
        self.n_rb, self.n_flex = subject.plant.n_rb, subject.plant.n_flex
        self._plants = PerturbedPlants(subject, uncertainty.misalignment[1])
        inputs = 1.0 / np.concatenate([subject.scaling.output[: self.n_rb], subject.scaling.output])
        outputs = 1.0 / subject.scaling.input[: subject.controller.n_y]
        self._controller_units = inputs, outputs

    def continuous(self, samples: Samples) -> SystemStack:
        """The continuous loops from (w1, w3) to e in scaled units; the plant's modal states come first."""
        return self._continuous(self._plants.at(samples), self._controllers(samples))

    def sampled(self, samples: Samples) -> SystemStack:
        """The sampled loops, without disturbances w3."""
        return self._sampled(self._plants.at(samples), self._controllers(samples))

    def measure(self, samples: Samples, figures: Collection[str] = FIGURES, *, exact: bool = False) -> Outcomes:
        """The figures of all samples; norms by tracked peaks, or exactly.

        Raises
        ------
        DomainError
            If a figure is unknown, or a misalignment larger than that of the uncertainty.
        """
        known_options("Outcomes", figures, FIGURES)
        parts = [
            self._measure(samples.take(slice(start, start + BATCH)), frozenset(figures), exact)
            for start in range(0, len(samples), BATCH)
        ]
        return Outcomes.join(parts)

    def _controllers(self, samples: Samples) -> SystemStack:
        """The controllers at the positions, in scaled units."""
        A, B, C, D = self.subject.controller.sample(samples.position)
        inputs, outputs = self._controller_units
        return SystemStack(A=A, B=B * inputs, C=outputs[:, None] * C, D=outputs[:, None] * D * inputs)

    def _continuous(self, modes: ModalStack, controllers: SystemStack) -> SystemStack:
        plant = continuous_plant(
            modes,
            n_u=self.subject.controller.n_y,
            n_rb=self.n_rb,
            delay=self.uncertainty.delay,
            delay_order=self.uncertainty.delay_order,
        )
        return close(plant, controllers, n_rb=self.n_rb)

    def _sampled(self, modes: ModalStack, controllers: SystemStack) -> SystemStack:
        T = self.uncertainty.sample_time
        plant = sampled_plant(modes, n_u=self.subject.controller.n_y, sample_time=T, delay=self.uncertainty.delay)
        return close(plant, tustin(controllers, T), n_rb=self.n_rb)

    def _measure(self, samples: Samples, figures: frozenset[str], exact: bool) -> Outcomes:
        modes, controllers = self._plants.at(samples), self._controllers(samples)
        N, n_flex, n_rb = len(samples), self.n_flex, self.n_rb
        found = {name: np.full(N, np.nan) for name in FIGURES}
        found |= {name: np.full((N, n_flex), np.nan) for name in ("damping", "flexible_peak")}
        if "spectral_radius" in figures:
            loops = self._sampled(modes, controllers)
            found["spectral_radius"] = np.max(np.abs(np.linalg.eigvals(loops.A)), axis=1)
        if figures <= {"spectral_radius"}:
            return Outcomes(**found)
        loops = self._continuous(modes, controllers)
        if not figures & {"damping", "sensitivity", "flexible_peak"}:
            poles = np.linalg.eigvals(loops.A)
            found["abscissa"], found["least_damping"] = np.max(poles.real, axis=1), np.min(_ratios(poles), axis=1)
            return Outcomes(**found)
        for k in range(N):
            T = Response(loops.A[k], loops.B[k], loops.C[k], loops.D[k])
            found["abscissa"][k], found["least_damping"][k] = T.abscissa, np.min(_ratios(T.poles))
            if "damping" in figures:
                found["damping"][k] = _mode_damping(loops.A[k], T, n_rb, n_flex)
            if "sensitivity" in figures:
                found["sensitivity"][k] = _norm(loops, k, T, slice(0, n_rb), exact=exact)
            if "flexible_peak" in figures:
                found["flexible_peak"][k] = [
                    _norm(loops, k, T, slice(n_rb + i, n_rb + i + 1), exact=exact) for i in range(n_flex)
                ]
        return Outcomes(**found)


def _ratios(poles: np.ndarray) -> Array:
    """Damping ratios of poles."""
    size = np.abs(poles)
    return np.asarray(-poles.real / np.where(size > 0.0, size, 1.0))


def _mode_damping(A: Array, T: Response, n_rb: int, n_flex: int) -> Array:
    """Damping ratios (n_flex,) of the poles that take the largest part in the plant states of the controlled modes."""
    poles: np.ndarray = T.poles
    if T.right is not None and T.left is not None:
        right: np.ndarray = T.right
        left: np.ndarray = T.left
    else:  # the response fell back on the Schur form: nearly equal eigenvectors
        poles, right = np.linalg.eig(A)
        left = np.linalg.pinv(right)
    own = slice(2 * n_rb, 2 * (n_rb + n_flex))
    part = np.abs(right[own] * left[:, own].T)
    per_mode = np.where(np.abs(poles.imag) > 0.0, part[0::2] + part[1::2], 0.0)
    return np.asarray(_ratios(poles)[np.argmax(per_mode, axis=1)])


def _norm(loops: SystemStack, k: int, T: Response, columns: slice, *, exact: bool) -> float:
    """Norm of loop k from some of its inputs."""
    if T.abscissa >= 0.0:
        return np.inf
    if exact:
        return hinf_norm(loops.A[k], loops.B[k][:, columns], loops.C[k], loops.D[k][:, columns]).norm
    return float(find_peaks(Channel(T, loops, k, columns), extra=np.zeros(0), fraction=0.99).sigma[0])
