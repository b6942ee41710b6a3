"""The decoupling matrices T_y and T_u of eq. 6, and T_u extended to flexible modes."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DomainError

MAX_CONDITION = 1e10


def output_decoupling(output_gains: Array) -> Array:
    r"""T_y: rigid-body coordinates from the sensors, :math:`T_y = C_{RB}(p)^\dagger` (eq. 6).

    Parameters
    ----------
    output_gains : (N, n_y, n_rb)
        Sensor readings per unit of every rigid-body mode, at N positions.

    Returns
    -------
    (N, n_rb, n_y)

    Raises
    ------
    AssumptionError
        If the sensors do not see every rigid-body mode.

    Examples
    --------
    >>> output_decoupling(np.array([[[2.0], [2.0]]])).tolist()
    [[[0.25, 0.25]]]
    """
    n_y, n_rb = output_gains.shape[1:]
    if n_y < n_rb:
        raise AssumptionError(
            f"{n_y} sensors cannot tell {n_rb} rigid-body modes apart. Add sensors, or keep fewer modes."
        )
    modes = np.swapaxes(output_gains, 1, 2)
    worst = float(np.max(_conditions(modes)))
    if worst > MAX_CONDITION:
        raise AssumptionError(
            f"the sensors do not observe every rigid-body mode: condition number {worst:.2g}, wanted below "
            f"{MAX_CONDITION:.0g}. Move or add a sensor."
        )
    size = np.linalg.norm(modes, axis=2, keepdims=True)
    return np.asarray(np.swapaxes(np.linalg.pinv(modes / size), 1, 2) / size)


def input_decoupling(input_gains: Array, weights: Array | None = None, *, positions: Array | None = None) -> Array:
    r"""T_u: actuator commands that drive one mode each, :math:`T_u = W B^\top (B W B^\top)^{-1}`.

    With W = I this is the pseudo-inverse of eq. 6; with the rows of flexible modes in B it is the
    extended modal input decoupling (eq. 7). The weights say how much each actuator takes part; weights
    that are smooth in p keep :math:`\Phi_a(p) T_u(p)` smooth, where switching actuators on and off would not.

    Parameters
    ----------
    input_gains : (N, n_controlled, n_u)
        Modal forces per unit of every actuator, at N positions.
    weights : (N, n_u), optional
        At least zero; zero takes an actuator out.
    positions : (N, n_p), optional
        The positions p that the gains belong to, for the messages.

    Returns
    -------
    (N, n_u, n_controlled)

    Raises
    ------
    DomainError
        If a weight is below zero.
    AssumptionError
        If there are too few actuators, or they cannot drive the modes independently.

    Examples
    --------
    >>> input_decoupling(np.array([[[1.0, 1.0]]])).tolist()
    [[[0.5], [0.5]]]
    """
    n_controlled, n_u = input_gains.shape[1:]
    if weights is not None and np.any(weights < 0.0):
        raise DomainError(f"the weights have the entry {np.min(weights):.4g}, wanted entries of at least 0.")
    active = np.full(len(input_gains), n_u) if weights is None else np.sum(weights > 0.0, axis=1)
    fewest = int(np.argmin(active))
    if active[fewest] < n_controlled:
        raise AssumptionError(
            f"{active[fewest]} active actuators cannot drive {n_controlled} modes independently"
            f"{_at(positions, fewest)}. "
            f"Wanted at least {n_controlled}: add actuators, lower n_flex, or decouple with actuation='full'."
        )
    root = np.ones((len(input_gains), 1, n_u)) if weights is None else np.sqrt(weights)[:, None, :]
    weighted = input_gains * root
    conditions = _conditions(weighted)
    worst = int(np.argmax(conditions))
    if conditions[worst] > MAX_CONDITION:
        raise AssumptionError(
            f"the actuators cannot drive {n_controlled} modes independently: condition number {conditions[worst]:.2g}"
            f"{_at(positions, worst)}, wanted below {MAX_CONDITION:.0g}. Add actuators or lower n_flex."
        )
    size = np.linalg.norm(weighted, axis=2, keepdims=True)
    return np.asarray(np.swapaxes(root, 1, 2) * np.linalg.pinv(weighted / size) / np.swapaxes(size, 1, 2))


def _at(positions: Array | None, i: int) -> str:
    """Where, for a message."""
    return "" if positions is None else f" at p = {positions[i].tolist()}"


def _conditions(matrices: Array) -> Array:
    """Condition numbers after the rows, one a mode, are normalised: units of the modes do not count."""
    rows = np.linalg.norm(matrices, axis=2, keepdims=True)
    dead = np.any(rows == 0.0, axis=(1, 2))
    return np.where(dead, np.inf, np.linalg.cond(matrices / np.where(rows == 0.0, 1.0, rows)))
