"""The error that the rigid-body feedforward of a step leaves, with the plant frozen at each position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box, positive, read_only
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.simulation.oscillator import oscillator_response
from lpvhinf.simulation.setpoint import FourthOrderStep

PER_PERIOD = 20  # samples of the fastest mode's period
BATCH = 2**22  # numbers held at a time

Outputs = Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class StepError:
    """Largest errors of a step of every axis, one axis at a time, at N positions.

    The unit of an entry is that of the output, for a step of `FourthOrderStep.distance` along the axis.

    Attributes
    ----------
    points : (N, n_p) [m]
    during, after : (N, n_out, n_rb)
        Largest absolute error of each output while axis j moves, and after its step has ended.
    preserved_during, preserved_after : (N, n_out, n_rb)
        What the preserved modes alone contribute; zero to round-off with the extended decoupling.
    n_times : int
        Instants that were looked at; the response at each is exact.
    """

    points: Array
    during: Array
    after: Array
    preserved_during: Array
    preserved_after: Array
    n_times: int


def step_response(
    plant: DecoupledPlant,
    setpoint: FourthOrderStep,
    points: ArrayLike,
    times: ArrayLike,
    *,
    outputs: Outputs | None = None,
    preserved_only: bool = False,
) -> Array:
    r"""The error e = r - y at instants, for the feedforward :math:`u_{RB} = \ddot r` of each axis and no feedback.

    With p frozen every mode is an oscillator that answers the same scalar motion: with h_k of `oscillator_response`
    for mode k, and the gains of the plant at p,

    .. math:: e(t) = (I - \tilde C_{RB} \tilde B_{RB})\, r(t) - \sum_{k} \tilde c_k \tilde b_k\, h_k(t) - \tilde D\,
              \ddot r(t)

    Positions cost a matrix product each, and nothing is discretised.

    Parameters
    ----------
    plant : DecoupledPlant
    setpoint : FourthOrderStep
        Of one axis at a time; distance in m or rad.
    points : (N, n_p)
    times : (n_t,) [s]
    outputs : callable (N, n_p) -> (N, n_out, n_modes), optional
        Gains of the outputs from the mass-normalised modal coordinates, `performance_gains` of the planar actuator
        for its point of control. The error is then measured from the motion of a rigid mover, and the compliance of
        truncated modes, which is known at the sensors only, is left out. Default: the decoupled sensor outputs.
    preserved_only : bool
        Only the sum over the preserved modes.

    Returns
    -------
    (N, n_t, n_out, n_rb)
        Last index: the axis that makes the step.
    """
    where = points_in_box(points, plant.box)
    t = finite_array("times", times, (None,))
    gains, signals = _residues(plant, where, outputs, preserved_only), _signals(plant, setpoint, t, preserved_only)
    return np.asarray(np.moveaxis(gains @ signals, -1, 1))


def step_error(
    plant: DecoupledPlant,
    setpoint: FourthOrderStep,
    points: ArrayLike,
    *,
    settle: float = 0.04,
    outputs: Outputs | None = None,
) -> StepError:
    """Largest errors of the feedforward of a step at positions (N, n_p); see `step_response`.

    Parameters
    ----------
    settle : [s]
        Time after the step that is looked at.

    Raises
    ------
    DomainError
        If `settle` is not above zero, or a position is outside the box.
    """
    where = points_in_box(points, plant.box)
    end = setpoint.duration + positive("settle", settle, "s")
    fastest = float(np.max(plant.omega, initial=2 * np.pi / setpoint.snap_time))
    n_times = 1 + int(np.ceil(end * PER_PERIOD * fastest / (2 * np.pi)))
    times = np.union1d(np.linspace(0.0, end, n_times), setpoint.knots)
    moving = times <= setpoint.duration
    found: list[list[Array]] = [[], []]
    for peaks, preserved_only in zip(found, (False, True), strict=True):
        signals = _signals(plant, setpoint, times, preserved_only)
        gains = _residues(plant, where, outputs, preserved_only)
        size = max(1, BATCH // (gains.shape[1] * gains.shape[2] * len(times)))
        for start in range(0, len(where), size):
            error = np.abs(gains[start : start + size] @ signals)
            parts = [np.max(error[..., chosen], axis=-1, initial=0.0) for chosen in (moving, ~moving)]
            peaks.append(np.stack(parts))
    every, preserved = (np.concatenate(parts, axis=1) for parts in found)
    return StepError(
        points=read_only(where),
        during=read_only(every[0]),
        after=read_only(every[1]),
        preserved_during=read_only(preserved[0]),
        preserved_after=read_only(preserved[1]),
        n_times=len(times),
    )


def _signals(plant: DecoupledPlant, setpoint: FourthOrderStep, times: Array, preserved_only: bool) -> Array:
    """What the error is a combination of: r, r'' and h_k of the flexible modes, (2 + n_flexible, n_t)."""
    n_rb = plant.n_rb
    chosen = slice(n_rb, n_rb + plant.n_flex if preserved_only else None)
    motions = oscillator_response(plant.omega[chosen], plant.zeta[chosen], setpoint, times)
    if preserved_only:
        return motions
    return np.vstack([setpoint.position(times), setpoint.acceleration(times), motions])


def _residues(plant: DecoupledPlant, points: Array, outputs: Outputs | None, preserved_only: bool) -> Array:
    """How much of each signal is in the error, (N, n_out, n_rb, number of signals)."""
    n_rb, gains = plant.n_rb, plant.sample(points)
    S = plant.modal.rigid_body_scaling
    B = gains.B[:, :, :n_rb]
    if outputs is None:
        C, D = gains.C[:, :n_rb], gains.D[:, :n_rb, :n_rb]
        wanted = np.broadcast_to(np.eye(n_rb), D.shape)
    else:
        C = finite_array("outputs(points)", outputs(points), (len(points), None, plant.n_modes)).copy()
        C[:, :, :n_rb] = C[:, :, :n_rb] @ np.linalg.inv(S)  # per m and rad, as B is
        D, wanted = np.zeros((len(points), C.shape[1], n_rb)), C[:, :, :n_rb]
    flexible = slice(n_rb, n_rb + plant.n_flex if preserved_only else None)
    modes: Array = -np.einsum("nok,nki->noik", C[:, :, flexible], B[:, flexible])
    if preserved_only:
        return modes
    rigid = wanted - C[:, :, :n_rb] @ B[:, :n_rb]
    return np.asarray(np.concatenate([rigid[..., None], -D[..., None], modes], axis=-1))
