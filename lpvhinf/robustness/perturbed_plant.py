"""The gains of perturbed plants behind the commutation of the plant that is believed, in scaled units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.robustness.controlled_plant import ControlledPlant
from lpvhinf.robustness.misalignment import NARROWEST, misaligned
from lpvhinf.robustness.samples import Samples

N_UNITS = 16  # positions from which the units of modal coordinates are taken


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalStack:
    r"""N plants of independent modes, in scaled channels and modal coordinates.

    .. math:: \ddot\eta_i + 2\zeta_i\omega_i\dot\eta_i + \omega_i^2\eta_i = b_i u, \quad y = C\eta + D u

    Attributes
    ----------
    omega, zeta : (N, n_modes)
        [rad/s], [-]; rigid-body modes first, with zeros.
    B : (N, n_modes, n_in) [1/s^2]
    C : (N, n_out, n_modes)
    D : (N, n_out, n_in)
    rate : (n_modes,) [rad/s]
        The state of a mode is (eta_i, eta_i' / rate_i), which are of one size.
    """

    omega: Array
    zeta: Array
    B: Array
    C: Array
    D: Array
    rate: Array

    def __len__(self) -> int:
        return len(self.omega)


class PerturbedPlants:
    """Makes the perturbed plants of `Samples`; what all of them share is computed once.

    Parameters
    ----------
    subject : ControlledPlant
    largest_misalignment : float
        Of any sample, of either sign [m].
    """

    def __init__(self, subject: ControlledPlant, largest_misalignment: float) -> None:
        plant, scaling = subject.plant, subject.scaling
        self.n_rb, self._largest = plant.n_rb, max(largest_misalignment, NARROWEST)
        self._plant: DecoupledPlant = misaligned(plant, largest_misalignment)
        self._output, self._input = scaling.output, scaling.input
        # a coordinate of a mode is of size one where the scaled outputs are
        points = np.vstack([np.mean(plant.box, axis=1)[None], spread_points(plant.box, N_UNITS - 1)])
        size = np.max(np.linalg.norm(plant.sample(points).C * self._output[:, None], axis=1), axis=0)
        self._unit = 1.0 / np.where(size > 0.0, size, 1.0)
        self._rate = np.concatenate([2 * np.pi * scaling.f_bw, plant.omega[plant.n_rb :]])
        S = plant.modal.rigid_body_scaling
        self._compliant_mass = S @ S.T  # inverse of the rigid-body mass matrix

    def at(self, samples: Samples) -> ModalStack:
        """The plants of all samples, each at its position; a `DomainError` if a misalignment is too large."""
        n_rb, N = self.n_rb, len(samples)
        largest = float(np.max(np.abs(samples.misalignment), initial=0.0))
        if largest > self._largest:
            raise DomainError(
                f"misalignment goes up to {largest:.4g} m, wanted at most {self._largest:.4g} m, the largest of the "
                "uncertainty. Widen its range."
            )
        gains = self._plant.sample(np.hstack([samples.position, samples.misalignment]))
        B, C = gains.B.copy(), gains.C.copy()
        # rigid accelerations M^-1 f become (F M F)^-1 f
        root = 1.0 / np.sqrt(samples.mass)
        force = np.linalg.solve(self._compliant_mass, B[:, :n_rb])
        B[:, :n_rb] = root[:, :, None] * (self._compliant_mass @ (root[:, :, None] * force))
        modal = 1.0 / np.sqrt(samples.modal_mass)
        B[:, n_rb:] *= modal[:, :, None]
        C[:, :, n_rb:] *= modal[:, None, :]
        rigid = np.zeros((N, n_rb))
        return ModalStack(
            omega=np.hstack([rigid, samples.omega]),
            zeta=np.hstack([rigid, samples.zeta]),
            B=B * self._input / self._unit[:, None],
            C=self._output[:, None] * C * self._unit,
            D=self._output[:, None] * gains.D * self._input,
            rate=self._rate,
        )
