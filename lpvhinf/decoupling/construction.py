"""`decouple`: from a plant to its decoupled form, with the checks that a design relies on."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from lpvhinf.checks import Array, positive, read_only
from lpvhinf.decoupling.decoupled_plant import DecoupledPlant, Weight
from lpvhinf.decoupling.gains import DecoupledGains
from lpvhinf.decoupling.structure import rigid_deviation, rigid_gain, structure_report
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.plant.modal import ModalModel

STRUCTURE_TOLERANCE = 1e-10
MAX_DEVIATION = 0.5  # of the true rigid-body gain from the known one, both in mass-normalised coordinates
N_CHECKED = 32  # positions, beside the centre of P
OPTIONS = {
    "actuation": ("over", "full"),
    "input_decoupling": ("extended", "rigid-body"),
    "sensing": ("all", "rigid-body"),
}


def decouple(
    plant: Any,
    *,
    n_flex: int = 1,
    actuation: str = "over",
    input_decoupling: str = "extended",
    mode_weight: float = 1.0,
    sensing: str = "all",
    weight: Weight | None = None,
    degree: int = 48,
) -> DecoupledPlant:
    r"""Decouple a plant into rigid-body axes and `n_flex` preserved flexible modes (eq. 6-8).

    With more actuators than decoupled modes (`actuation` "over") every axis and every preserved mode has
    an input of its own. A fully actuated plant ("full") has one force for each rigid-body mode: n_rb virtual
    forces, the conventional decoupled inputs :math:`T_v = B_{RB}^\dagger`, which drive the preserved modes
    by :math:`b(p) = B_{FM} T_v`. The n_rb + n_flex axes share them by weighted least squares in mass-normalised
    coordinates,

    .. math:: T_u = T_v T', \quad T' = \arg\min \big\| W^{1/2} ([I;\, b]\, T' - I) \big\|_F
              = (I + \rho^2 b^\top b)^{-1} [\, I \quad \rho^2 b^\top \,], \quad W = \mathrm{diag}(I,\, \rho^2 I),

    so that rigid-body and modal channels are coupled: `DecoupledPlant.coupling` says how much. The columns of T'
    are left as least squares gives them: a modal input moves its own mode by :math:`\rho^2 |b|^2 / (1 + \rho^2
    |b|^2)` (one mode), less than one and depending on p, because a gain of one at every p would ask for
    unbounded forces where :math:`b(p)` is small. Designs see the true gains.

    Parameters
    ----------
    plant : ModalModel, or an object with one as `.modal` and optionally `.known` and `.coil_weights`
        `.known` is the ModalModel that T_y and T_u are computed from, where it is another one than `.modal`.
    n_flex : int
        Number of flexible modes that the actuators drive one by one and the observer preserves.
    actuation : "over" or "full"
        Whether there is an input for every decoupled mode, or only for every rigid-body mode. "full" may
        also be asked of a plant with more actuators: its commutation then offers n_rb virtual forces.
    input_decoupling : "extended" or "rigid-body"
        Whether the rigid-body inputs also avoid the preserved flexible modes (eq. 7), or are those of the
        conventional decoupling (eq. 6), which excites them.
    mode_weight : float
        :math:`\rho` > 0 of a fully actuated plant, per mass-normalised mode. Towards 0: the conventional
        decoupling, and no modal input. Towards infinity: the modes are not excited, but one rigid-body direction
        is lost for each.
    sensing : "all" or "rigid-body"
        Whether redundant sensors stay available to an observer. T_y of eq. 6 alone ("rigid-body") throws away
        what they read beyond rigid-body motion, which may be the only output that sees a flexible mode with
        the same sign at every position.
    weight : callable (N, n_p) -> (N, n_u), optional
        Weights of the actuators in the pseudo-inverse; default those of the plant, else ones.
    degree : int
        Chebyshev degree of the polynomial model along every axis of p.

    Raises
    ------
    DomainError
        If an option or `n_flex` is unknown, or `mode_weight` is not above zero or serves nothing.
    DimensionError
        If the known model has other inputs, outputs, rigid-body modes or another box than the plant, or too few modes.
    AssumptionError
        If there are too few actuators or sensors, a preserved mode is not observable at any position, the
        decoupling of the known model does not hold to 1e-10, or the rigid-body gain of the plant differs from
        that of the known model by more than half.

    Examples
    --------
    One force, one flexible mode that it excites as much as the rigid body:

    >>> plant = ModalModel.from_modal_data(
    ...     omega=[0.0, 300.0], zeta=0.01, box=[[-1.0, 1.0]], input_gains=[[1.0], [1.0]], output_gains=np.eye(2))
    >>> decoupled = decouple(plant, actuation="full", degree=0)
    >>> decoupled.sample([[0.0]]).B.tolist()
    [[[0.5, 0.5], [0.5, 0.5]]]
    """
    modal = plant if isinstance(plant, ModalModel) else getattr(plant, "modal", None)
    if not isinstance(modal, ModalModel):
        raise DomainError(
            f"plant is a {type(plant).__name__}, wanted a ModalModel or an object with one as `.modal`. "
            "Use modal_form on a MechanicalModel first."
        )
    known = modal if isinstance(plant, ModalModel) else getattr(plant, "known", modal)
    if not isinstance(known, ModalModel):
        raise DomainError(
            f"plant.known is a {type(known).__name__}, wanted a ModalModel. Leave it out if it is .modal."
        )
    for name, value in (("actuation", actuation), ("input_decoupling", input_decoupling), ("sensing", sensing)):
        if value not in OPTIONS[name]:
            raise DomainError(f"{name} is {value!r}, wanted {' or '.join(map(repr, OPTIONS[name]))}.")
    if n_flex not in range(modal.n_modes - modal.n_rb + 1):
        raise DomainError(f"n_flex is {n_flex}, wanted 0 to {modal.n_modes - modal.n_rb} flexible modes.")
    rho = positive("mode_weight", mode_weight)
    if actuation == "over" and rho != 1.0:
        raise DomainError(
            f"mode_weight is {rho:g}, but actuation 'over' has no use for it. Leave it out, or use 'full'."
        )
    if known is not modal:
        _check_same_kind(known, modal, n_flex)
    decoupled = DecoupledPlant(
        modal=modal,
        known_modal=known,
        n_flex=int(n_flex),
        actuation=actuation,
        input_decoupling=input_decoupling,
        mode_weight=rho,
        sensing=sensing,
        weight=getattr(plant, "coil_weights", None) if weight is None else weight,
        degree=degree,
    )
    _check(decoupled)
    return decoupled


def _check_same_kind(known: ModalModel, modal: ModalModel, n_flex: int) -> None:
    """Whether the known model is one of the same machine."""
    for name in ("n_rb", "n_u", "n_y"):
        ours, wanted = getattr(known, name), getattr(modal, name)
        if ours != wanted:
            raise DimensionError(f"plant.known has {name} = {ours}, wanted {wanted} as plant.modal. Build both alike.")
    if not np.array_equal(known.box, modal.box):
        raise DimensionError(
            f"plant.known has the box {known.box.tolist()}, wanted {modal.box.tolist()} as plant.modal. Use one box."
        )
    if known.n_flex < n_flex:
        raise DimensionError(
            f"plant.known has {known.n_flex} flexible modes, wanted at least n_flex = {n_flex}. "
            "Keep more modes in it, or lower n_flex."
        )


def _check(plant: DecoupledPlant) -> None:
    """Whether the known model is decoupled, and the true plant near to it."""
    box, known = plant.box, plant.known
    points = read_only(np.vstack([np.mean(box, axis=1)[None], spread_points(box, N_CHECKED)]))
    believed = known.sample(points)
    _check_observable(believed, known)
    # the virtual forces of a fully actuated plant are the conventional decoupling, which is exact
    exact = known if known.exact_inputs else dataclasses.replace(known, actuation="over", n_flex=0, mode_weight=1.0)
    S = known.known_modal.rigid_body_scaling
    sampled = believed if exact is known else exact.sample(points)
    report = structure_report(points, sampled, n_flex=exact.n_flex, rigid_body_scaling=S)
    wrong = max(report.rigid_body, report.preserved_excitation if exact.input_decoupling == "extended" else 0.0)
    if wrong > STRUCTURE_TOLERANCE:
        raise AssumptionError(
            f"the decoupling holds to {wrong:.2g} only, wanted {STRUCTURE_TOLERANCE:.0g}: the actuators or sensors "
            "are nearly dependent. Change their places or the weights."
        )
    if known is plant:
        return
    true = plant.sample(points)
    _check_observable(true, plant)
    deviation = rigid_deviation(rigid_gain(true, plant.n_rb), rigid_gain(believed, plant.n_rb), S)
    worst = int(np.argmax(deviation))
    if deviation[worst] > MAX_DEVIATION:
        raise AssumptionError(
            f"the rigid-body gain of the plant deviates by {100.0 * deviation[worst]:.0f} % from that of its known "
            f"model at p = {points[worst].tolist()}, wanted at most {100.0 * MAX_DEVIATION:.0f} %: signs, units or the "
            "order of actuators, sensors or rigid-body modes differ, or the plant deviates too much. "
            "Compare plant.known with plant.modal there."
        )


def _check_observable(gains: DecoupledGains, plant: DecoupledPlant) -> None:
    sizes: Array = np.max(np.linalg.norm(gains.C, axis=1), axis=0)
    flexible = sizes[plant.n_rb :]
    for k in range(plant.n_flex):
        if flexible[k] <= 1e-9 * np.max(flexible):
            hertz = plant.omega[plant.n_rb + k] / (2 * np.pi)
            raise AssumptionError(
                f"preserved mode {k + 1} ({hertz:.1f} Hz) is not observable at any position: its largest output gain "
                f"is {flexible[k]:.2g}. Add or move a sensor, or lower n_flex."
            )
