"""How much the rigid-body feedforward excites every flexible mode, over P."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, points_in_box, read_only, whole_number
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DomainError
from lpvhinf.simulation.search import largest_over_box


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeExcitation:
    r"""Modal forces that the feedforward of one rigid axis exerts at N positions.

    Attributes
    ----------
    points : (N, n_p) [m]
    gain : (N, n_modes - n_rb, n_rb)
        Force on each flexible mode per unit of acceleration of each axis, :math:`\tilde B_{FM}(p)` of the rigid-body
        inputs [sqrt(kg), or m sqrt(kg) for a rotation]. Preserved modes come first.
    relative : (N, n_modes - n_rb, n_rb)
        The same per unit of the force :math:`\|S^{-1} e_i\|` that accelerates the rigid body: 1 excites a mode as
        much as it moves the axis.
    n_preserved : int
        Number of modes that the decoupling preserves.
    """

    points: Array
    gain: Array
    relative: Array
    n_preserved: int

    @property
    def preserved(self) -> float:
        """Largest relative force on a preserved mode; zero to round-off with the extended decoupling."""
        return float(np.max(np.abs(self.relative[:, : self.n_preserved]), initial=0.0))

    @property
    def discarded(self) -> float:
        """Largest relative force on a discarded mode."""
        return float(np.max(np.abs(self.relative[:, self.n_preserved :]), initial=0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class WorstExcitation:
    """The largest excitation that a search over P finds, mode by mode and axis by axis.

    Attributes
    ----------
    gain, relative : (n, n_rb)
        Largest absolute values of `ModeExcitation.gain` and `relative` of n modes.
    position : (n, n_rb, n_p) [m]
        Where they are reached.
    """

    gain: Array
    relative: Array
    position: Array


def mode_excitation(plant: DecoupledPlant, points: ArrayLike) -> ModeExcitation:
    """The excitation at positions (N, n_p), from the plant model itself.

    Examples
    --------
    >>> from lpvhinf.decoupling import decouple
    >>> from lpvhinf.plant import ModalModel
    >>> modal = ModalModel.from_modal_data(
    ...     omega=[0.0, 300.0], zeta=0.01, box=[[-1.0, 1.0]], input_gains=[[1.0, 1.0], [0.5, 0.0]],
    ...     output_gains=np.eye(2))
    >>> conventional = decouple(modal, n_flex=1, input_decoupling="rigid-body", degree=0)
    >>> mode_excitation(conventional, [[0.0]]).preserved
    0.25
    >>> mode_excitation(decouple(modal, n_flex=1, degree=0), [[0.0]]).preserved < 1e-15
    True
    """
    where = points_in_box(points, plant.box)
    gain = plant.sample(where).B[:, plant.n_rb :, : plant.n_rb]
    return ModeExcitation(
        points=read_only(where),
        gain=read_only(gain),
        relative=read_only(gain / _rigid_force(plant)),
        n_preserved=plant.n_flex,
    )


def worst_excitation(
    plant: DecoupledPlant,
    modes: Sequence[int] | None = None,
    *,
    n_search: int = 256,
    n_starts: int = 3,
    seed: int = 0,
) -> WorstExcitation:
    """The largest excitation over P, by search: a lower bound on the supremum, not a certificate.

    Parameters
    ----------
    plant : DecoupledPlant
    modes : sequence of int, optional
        Flexible modes, 0 the lowest; default the preserved ones.
    n_search, n_starts, seed : int
        Positions of the spread, and climbs for each mode and axis.

    Raises
    ------
    DomainError
        If there is no such mode, or a number is not a whole number of at least 1 (seed: 0).
    """
    n_flexible = plant.n_modes - plant.n_rb
    chosen = list(range(plant.n_flex)) if modes is None else [int(k) for k in modes]
    if not chosen or any(not 0 <= k < n_flexible for k in chosen):
        raise DomainError(f"modes is {chosen}, wanted at least one of the flexible modes 0 to {n_flexible - 1}.")
    for name, value, least in (("n_search", n_search, 1), ("n_starts", n_starts, 1), ("seed", seed, 0)):
        whole_number(name, value, least)

    def sizes(points: Array) -> Array:
        return np.abs(mode_excitation(plant, points).gain[:, chosen]).reshape(len(points), -1)

    found, place = largest_over_box(sizes, plant.box, n_search=n_search, n_starts=n_starts, seed=seed)
    gain = found.reshape(len(chosen), plant.n_rb)
    return WorstExcitation(
        gain=read_only(gain),
        relative=read_only(gain / _rigid_force(plant)),
        position=read_only(place.reshape(len(chosen), plant.n_rb, -1)),
    )


def _rigid_force(plant: DecoupledPlant) -> Array:
    """Size of the mass-normalised modal force per unit of acceleration of every axis, (n_rb,)."""
    return np.asarray(np.linalg.norm(np.linalg.inv(plant.known_modal.rigid_body_scaling), axis=0))
