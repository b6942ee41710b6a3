"""How much the decoupled channels still drive each other: rigid-body axes, preserved modes, and one the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array, read_only


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelCoupling:
    """Coupling of rigid-body and modal channels over `n_points` positions, mass-normalised so that units do not count.

    Every force is one per unit of mass-normalised input; norms over the channels are Euclidean.

    Attributes
    ----------
    rigid : float
        Largest singular value of the deviation of the rigid-body block from the identity.
    rigid_channel : (n_rb,)
        The same for each rigid-body input: what it does to its own axis and to the others beside one unit.
    rigid_at : (n_p,) [m]
        Where `rigid` is reached.
    excitation : (n_flex,)
        Largest force of the rigid-body inputs on each preserved mode, relative to the largest one that the
        conventional decoupling exerts on it: 0 is decoupled, 1 no better than conventional.
    excitation_at : (n_flex, n_p) [m]
    modal_to_rigid : (n_flex,)
        Largest force of each modal input on the rigid-body modes.
    modal_to_rigid_at : (n_flex, n_p) [m]
    modal_to_modal : (n_flex,)
        Largest force of each modal input on the other preserved modes.
    own_gain_min, own_gain_max : (n_flex,)
        Smallest and largest force of each modal input on its own mode; 1 if it is decoupled exactly.
    own_gain_min_at : (n_flex, n_p) [m]
        Where a modal input does least for its mode.
    n_points : int
    """

    rigid: float
    rigid_channel: Array
    rigid_at: Array
    excitation: Array
    excitation_at: Array
    modal_to_rigid: Array
    modal_to_rigid_at: Array
    modal_to_modal: Array
    own_gain_min: Array
    own_gain_max: Array
    own_gain_min_at: Array
    n_points: int


def channel_coupling(points: Array, B: Array, conventional: Array) -> ChannelCoupling:
    """The coupling at positions (N, n_p).

    Parameters
    ----------
    B : (N, n_rb + n_flex, n_rb + n_flex)
        Forces on rigid-body and preserved modes, mass-normalised.
    conventional : (N, n_flex, n_rb)
        Forces of the conventional rigid-body inputs on the preserved modes, likewise.

    Examples
    --------
    >>> B = np.array([[[0.5, 0.5], [0.5, 0.5]]])  # one axis and one mode share one force
    >>> found = channel_coupling(np.zeros((1, 1)), B, np.ones((1, 1, 1)))
    >>> found.rigid, found.excitation.tolist(), found.own_gain_min.tolist()
    (0.5, [0.5], [0.5])
    """
    n_flex, n_rb = conventional.shape[1:]
    deviation = B[:, :n_rb, :n_rb] - np.eye(n_rb)
    rigid = np.max(np.linalg.svd(deviation, compute_uv=False), axis=1, initial=0.0)
    excitation = np.linalg.norm(B[:, n_rb:, :n_rb], axis=2)
    modal_to_rigid = np.linalg.norm(B[:, :n_rb, n_rb:], axis=1)
    own = np.diagonal(B[:, n_rb:, n_rb:], axis1=1, axis2=2)
    others = B[:, n_rb:, n_rb:] * (1.0 - np.eye(n_flex))
    before, after = np.max(np.linalg.norm(conventional, axis=2), axis=0), np.max(excitation, axis=0)
    # a mode that the conventional inputs leave alone can only become worse
    relative = np.divide(after, before, out=np.where(after > 0.0, np.inf, 0.0), where=before > 0.0)
    return ChannelCoupling(
        rigid=float(np.max(rigid)),
        rigid_channel=read_only(np.max(np.linalg.norm(deviation, axis=1), axis=0)),
        rigid_at=read_only(points[int(np.argmax(rigid))]),
        excitation=read_only(relative),
        excitation_at=read_only(points[np.argmax(excitation, axis=0)]),
        modal_to_rigid=read_only(np.max(modal_to_rigid, axis=0)),
        modal_to_rigid_at=read_only(points[np.argmax(modal_to_rigid, axis=0)]),
        modal_to_modal=read_only(np.max(np.linalg.norm(others, axis=1), axis=0)),
        own_gain_min=read_only(np.min(own, axis=0)),
        own_gain_max=read_only(np.max(own, axis=0)),
        own_gain_min_at=read_only(points[np.argmin(own, axis=0)]),
        n_points=len(points),
    )
