"""Rigid-body data against the mode shapes: zero-frequency modes and node masses must tell the same story."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError
from lpvhinf.plant.mode_data.plausibility import Plausibility
from lpvhinf.plant.mode_data.rigid_body import RigidBody
from lpvhinf.plant.rigid_motion import AXES

OUT_OF_PLANE = ("z", "rx", "ry")
DEPENDENT = 1e8  # condition number of the zero-frequency modes, rotations scaled by the mover's size


def check_rigid_modes(
    places: Array, values: Array, labels: Sequence[str], body: RigidBody, limits: Plausibility
) -> None:
    r"""Compare zero-frequency modes of an export with mass, centre of gravity and inertia.

    Mass-normalised rigid-body modes are :math:`\Phi_0 = R\, G` with R the unit motions about the centre of gravity,
    and :math:`G G^\top = M_{rb}^{-1}`: from the shapes follows the mass matrix.

    Parameters
    ----------
    places : (n, 3) [m]
    values : (n, 1 or 3, k)
        Mass-normalised shapes of the modes at zero frequency.
    labels : k texts

    Raises
    ------
    AssumptionError
        If a mode deforms the body, modes are missing or dependent, or mass, centre of gravity or inertia disagree.
    """
    n_given, k = values.shape[1:]
    if k == 0:
        return
    axes = OUT_OF_PLANE if n_given == 1 else AXES
    n = len(axes)
    if k not in (n, len(AXES)):
        raise AssumptionError(
            f"{k} modes lie below {limits.rigid_below_hz:g} Hz, wanted none or all {n} rigid-body modes"
            f"{' (or 6)' if n < 6 else ''}. Export all or none; if one is flexible, lower limits.rigid_below_hz."
        )
    size = float(np.max(np.linalg.norm(places - body.centre_of_gravity, axis=1)))
    unit = np.where([name.startswith("r") for name in axes], size, 1.0)
    R = body.motions(places, axes)[:, 3 - n_given :].reshape(-1, n) / unit  # rotations as displacement at the edge
    flat = values.reshape(-1, k)
    G = np.linalg.lstsq(R, flat, rcond=None)[0]
    gap = np.linalg.norm(flat - R @ G, axis=0) / np.sqrt(np.mean(np.sum(flat**2, axis=0)))
    if np.max(gap) > limits.agreement:
        worst = int(np.argmax(gap))
        raise AssumptionError(
            f"shapes of {labels[worst]} deform the body: {gap[worst]:.2g} of the shape is no "
            f"rigid-body motion, wanted at most {limits.agreement:g}. A mode below {limits.rigid_below_hz:g} Hz is "
            "taken as rigid: check the order of nodes and modes, or lower limits.rigid_below_hz."
        )
    if np.linalg.cond(G) > DEPENDENT**0.5:
        raise AssumptionError(f"the {k} zero-frequency modes span fewer than {n} rigid-body motions. Export them all.")
    implied = np.linalg.inv(G @ G.T)
    full = body.mass_matrix()
    chosen = [AXES.index(name) for name in axes]
    wanted = full[np.ix_(chosen, chosen)] if k == n else np.linalg.inv(np.linalg.inv(full)[np.ix_(chosen, chosen)])
    wanted = wanted / np.outer(unit, unit)
    _compare(implied, wanted, axes, size, body, limits.agreement, "the zero-frequency modes")


def check_node_masses(
    places: Array, values: Array, node_mass: Array, labels: Sequence[str], body: RigidBody, limits: Plausibility
) -> None:
    r"""Compare node masses with the body and with flexible modes.

    .. math:: \sum m_k = m, \quad \sum m_k r_k = m\, c, \quad \sum m_k |\phi_i(r_k)|^2 = 1, \quad
              \sum m_k\, \phi_i(r_k)^\top d_j(r_k) = 0

    with :math:`d_j` the rigid-body motions that the given components see.

    Parameters
    ----------
    places : (n, 3) [m]
    values : (n, 1 or 3, n_flex)
        Mass-normalised shapes of the flexible modes.
    node_mass : (n,) [kg]
    labels : n_flex texts

    Raises
    ------
    AssumptionError
        If one of them does not hold.
    """
    n_given = values.shape[1]
    axes = OUT_OF_PLANE if n_given == 1 else AXES
    total = float(node_mass.sum())
    if abs(total / body.mass - 1.0) > limits.agreement:
        raise AssumptionError(
            f"node_mass adds up to {total:.6g} kg, but mass is {body.mass:.6g} kg. Export the masses of all nodes in "
            "kg, or leave node_mass out."
        )
    size = float(np.max(np.linalg.norm(places - body.centre_of_gravity, axis=1)))
    seen = 2 if n_given == 1 else 3  # nodes of a plate say nothing of the height
    centre = (node_mass @ places / total)[:seen]
    if np.max(np.abs(centre - body.centre_of_gravity[:seen])) > limits.agreement * size:
        raise AssumptionError(
            f"node_mass has its centre at {centre.tolist()} m, but centre_of_gravity is "
            f"{body.centre_of_gravity.tolist()} m. Give both in mover coordinates."
        )
    modal = np.einsum("n,ncm->m", node_mass, values**2)
    if np.max(np.abs(modal - 1.0)) > limits.lumping:
        k = int(np.argmax(np.abs(modal - 1.0)))
        raise AssumptionError(
            f"node_mass gives {labels[k]} the modal mass {modal[k]:.4g}, wanted 1 within "
            f"{limits.lumping:g} for mass-normalised shapes (after division by sqrt(modal_mass), if given). Check the "
            "normalisation and the unit of mass; give more nodes; or widen limits.lumping."
        )
    R = (body.motions(places, axes) @ body.scaling(axes))[:, 3 - n_given :]
    overlap = np.abs(np.einsum("n,ncm,ncj->mj", node_mass, values, R))
    if np.max(overlap) > limits.lumping:
        k, j = (int(i) for i in np.unravel_index(int(np.argmax(overlap)), overlap.shape))
        raise AssumptionError(
            f"shapes of {labels[k]} move the body along {axes[j]}: the mass-weighted product of the "
            f"two shapes is {overlap[k, j]:.2g}, wanted 0 within {limits.lumping:g}. Flexible modes of a free body are "
            "orthogonal to its rigid-body motions: check constraints of the model, order of nodes, and node_mass."
        )


def _compare(
    implied: Array, wanted: Array, axes: tuple[str, ...], size: float, body: RigidBody, share: float, source: str
) -> None:
    """Mass, centre of gravity and inertia of two mass matrices about the stated centre of gravity."""
    moving = [i for i, name in enumerate(axes) if not name.startswith("r")]
    turning = [i for i, name in enumerate(axes) if name.startswith("r")]
    masses = implied[moving, moving]
    worst = int(np.argmax(np.abs(np.log(masses / body.mass))))
    if not np.abs(masses[worst] / body.mass - 1.0) <= share:
        raise AssumptionError(
            f"{source} belong to a body of {masses[worst]:.6g} kg (along {axes[moving[worst]]}), but mass is "
            f"{body.mass:.6g} kg. Check the unit of mass, the normalisation of the shapes, and that both describe the "
            "same mover."
        )
    off = implied[np.ix_(moving, turning)] - wanted[np.ix_(moving, turning)]
    if np.max(np.abs(off)) > share * body.mass:
        raise AssumptionError(
            f"{source} have another centre of gravity: it lies {np.max(np.abs(off)) / body.mass * size:.4g} m from "
            f"centre_of_gravity = {body.centre_of_gravity.tolist()} m. Give it in the coordinates of the points."
        )
    inertia, stated = (matrix[np.ix_(turning, turning)] * size**2 for matrix in (implied, wanted))
    if np.max(np.abs(inertia - stated)) > share * np.max(np.abs(stated)):
        names = ", ".join(f"I{axes[i][1:] * 2}" for i in turning)
        raise AssumptionError(
            f"{source} belong to a body with {names} = {np.diag(inertia).round(9).tolist()} kg m2, but inertia has "
            f"{np.diag(stated).round(9).tolist()}, or other products of inertia. Give it about the centre of gravity, "
            "in the axes of the points."
        )
