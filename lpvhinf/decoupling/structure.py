"""How exactly the structure holds that a design relies on: unit rigid axes, untouched preserved modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.decoupling.gains import DecoupledGains


@dataclass(frozen=True, eq=False)
class StructureReport:
    """How exactly the decoupling holds, over `n_points` positions.

    Attributes
    ----------
    rigid_body : float
        Largest deviation of the rigid-body input and output matrices from the identity, in the plant's units.
    preserved_excitation : float
        Largest force of a rigid-body input on a preserved flexible mode, relative to the largest
        force of the same input on any mode, mass-normalised.
    n_points : int
    rigid_gain : float
        Largest deviation of the rigid-body gain, outputs times inputs, from the identity: the largest singular
        value in mass-normalised coordinates, so that units do not count.
    worst_position : (n_p,) [m]
        Where the rigid-body gain deviates most.
    """

    rigid_body: float
    preserved_excitation: float
    n_points: int
    rigid_gain: float
    worst_position: Array


def structure_report(
    points: Array, gains: DecoupledGains, *, n_flex: int, rigid_body_scaling: Array
) -> StructureReport:
    """The report from the gains of a decoupled plant at positions (N, n_p); S is that of its known model."""
    n_rb = len(rigid_body_scaling)
    from_modal_inputs = np.max(np.abs(gains.B[:, :n_rb, n_rb:]), initial=0.0)
    rigid = max(
        float(np.max(np.abs(gains.B[:, :n_rb, :n_rb] - np.eye(n_rb)))),
        float(np.max(np.abs(gains.C[:, :, :n_rb] - np.eye(gains.C.shape[1], n_rb)))),
        float(from_modal_inputs / max(1.0, np.max(np.abs(gains.B[:, :, n_rb:]), initial=0.0))),
    )
    flexible = np.abs(gains.B[:, n_rb:, :n_rb])
    on_rigid = np.max(np.abs(np.linalg.inv(rigid_body_scaling)), axis=0)
    largest = np.maximum(np.max(flexible, axis=(0, 1), initial=0.0), on_rigid)
    excited = float(np.max(flexible[:, :n_flex] / largest, initial=0.0))
    deviation = rigid_deviation(rigid_gain(gains, n_rb), np.eye(n_rb), rigid_body_scaling)
    worst = int(np.argmax(deviation))
    return StructureReport(rigid, excited, len(points), float(deviation[worst]), read_only(points[worst]))


def rigid_gain(gains: DecoupledGains, n_rb: int) -> Array:
    """Accelerations of the rigid-body outputs per unit of the rigid-body inputs, (N, n_rb, n_rb)."""
    return gains.C[:, :n_rb, :n_rb] @ gains.B[:, :n_rb, :n_rb]


def rigid_deviation(gain: Array, wanted: Array, rigid_body_scaling: Array) -> Array:
    r"""Largest singular value of :math:`S^{-1} (G - G_{wanted}) S` at N positions, (N,)."""
    normalised = np.linalg.inv(rigid_body_scaling) @ (gain - wanted) @ rigid_body_scaling
    return np.asarray(np.max(np.linalg.svd(normalised, compute_uv=False), axis=1, initial=0.0))
