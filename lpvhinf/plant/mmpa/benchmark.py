"""The planar actuator benchmark: the true model with its effects, and the one that the controller knows."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np

from lpvhinf.checks import Array, whole_number
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant.mechanical import MechanicalModel
from lpvhinf.plant.mmpa.actuator import MMPA
from lpvhinf.plant.mmpa.coils import CoilLayer, CoilWrench, coil_layers
from lpvhinf.plant.mmpa.effects import Effects
from lpvhinf.plant.mmpa.imperfections import deviating_magnets, misplaced_layers
from lpvhinf.plant.mmpa.input_map import CoilInputMap
from lpvhinf.plant.mmpa.magnetics.coil_wrench import KINDS, coil_wrench
from lpvhinf.plant.mmpa.magnets import MagnetArray, magnet_array
from lpvhinf.plant.mmpa.mover import Mover, mover
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.sensors import SENSOR_NAMES, InterferometerMap
from lpvhinf.plant.modal import ModalModel
from lpvhinf.plant.modal_form import modal_form
from lpvhinf.progress import SILENT, Progress


def benchmark(
    parameters: MMPAParameters | None = None,
    *,
    n_flex: int = 15,
    magnetics: str | CoilWrench = "exact",
    commutation: str | CoilWrench | None = None,
    effects: Effects | None = None,
    cache: bool | str | os.PathLike[str] = True,
    jobs: int = 1,
    progress: Progress = SILENT,
) -> MMPA:
    """The open moving-magnet planar actuator benchmark.

    Parameters
    ----------
    parameters : MMPAParameters, optional
        The published benchmark if left out.
    n_flex : int
        Number of flexible modes in the modal models; the static compliance of all others stays in them.
    magnetics : "exact", "first-harmonic" or CoilWrench
        The field that the simulated mover lives in: that of all magnets, whose tables are built once and kept on disk,
        its first harmonic, which needs none, or a model of your own.
    commutation : "exact", "first-harmonic" or CoilWrench, optional
        The field that the commutation believes in; the same as `magnetics` if left out.
    effects : Effects, optional
        Deviations of the true actuator from what its controller knows; none if left out.
    cache : bool or path
        Whether, or in which folder, the tables of the exact field are kept.
    jobs : int
        Processes that build them.
    progress : Progress
        Told of the building.

    Raises
    ------
    DomainError
        If `n_flex` is not between 0 and the number of flexible modes, the name of a field is unknown, or an effect
        does not fit the parameters.
    AssumptionError
        If the field cannot show the misplaced coils or deviating magnets that `effects` ask for.
    DimensionError
        If truth and commutation have different numbers of coils.

    Notes
    -----
    The mass of plate, magnets and mirrors is lumped at the neutral plane, where it couples no horizontal with tilting
    motion, unless ``parameters.mass_heights`` says otherwise. In-plane deformation (first mode near 3.2 kHz) is left
    out.

    Examples
    --------
    >>> plant = benchmark(magnetics="first-harmonic")
    >>> round(plant.mass, 2), (plant.modal.omega[6:9] / (2 * np.pi)).round(1).tolist(), plant.known is plant.modal
    (8.25, [139.4, 206.5, 259.9], True)

    With a payload that the controller does not know, the truth is another model than the known one:

    >>> loaded = benchmark(magnetics="first-harmonic", effects=Effects(payload_mass=0.5, payload_place=(0.1, 0.1, 0.0)))
    >>> round(loaded.mass, 2), round(loaded.known_mover.mass, 2), loaded.known is loaded.modal
    (8.75, 8.25, False)
    """
    given = MMPAParameters() if parameters is None else parameters
    deviations = Effects() if effects is None else effects
    if not isinstance(given, MMPAParameters):
        raise DomainError(f"parameters is a {type(given).__name__}, wanted MMPAParameters or None.")
    if not isinstance(deviations, Effects):
        raise DomainError(f"effects is a {type(deviations).__name__}, wanted Effects or None.")
    n_flexible = (given.ritz_degree + 1) ** 2 - 3
    if whole_number("n_flex", n_flex, 0) > n_flexible:
        raise DomainError(f"n_flex is {n_flex!r}, wanted a whole number from 0 to {n_flexible}.")
    _check_misalignment(given, deviations)

    def field(kind: str | CoilWrench, layers: tuple[CoilLayer, ...], magnets: MagnetArray) -> CoilWrench:
        if not isinstance(kind, str):
            if not (callable(getattr(kind, "wrench", None)) and hasattr(kind, "n_coils")):
                raise DomainError(
                    f"magnetics or commutation is {kind!r}, wanted one of {', '.join(KINDS)}, or an object with "
                    "`n_coils` and `wrench`, as CoilWrench describes it."
                )
            return kind
        return coil_wrench(given, layers, magnets, kind=kind, cache=cache, jobs=jobs, progress=progress)

    layers, magnets = coil_layers(given), magnet_array(given)
    believed = magnetics if commutation is None else commutation
    same_field = believed == magnetics if isinstance(believed, str) else believed is magnetics
    if deviations.misplaces_coils_or_magnets and not isinstance(magnetics, str):
        raise AssumptionError(
            "effects misplace coils or change magnets, but magnetics is an object with coils and magnets of its own. "
            'Use magnetics="exact", or build the deviations into the object.'
        )
    true_layers = misplaced_layers(layers, deviations)
    true_coils = field(magnetics, true_layers, deviating_magnets(magnets, deviations))
    known_mover = mover(given)
    true_mover = known_mover
    if deviations.changes_mover:
        true_mover = mover(
            given,
            payload_mass=deviations.payload_mass,
            payload_place=deviations.payload_place,
            damping_factor=deviations.damping_factor,
        )
    n_modes = 6 + int(n_flex)
    mechanical = _mechanical(given, true_mover, true_coils, np.zeros(2), deviations)
    modal = modal_form(mechanical, n_modes=n_modes, rigid_body_modes=true_mover.rigid_body_modes)
    known = modal
    if deviations.deviates or not same_field:
        if same_field and not deviations.misplaces_coils_or_magnets:
            known_coils = true_coils
        else:
            known_coils = field(believed, layers, magnets)
        if known_coils.n_coils != true_coils.n_coils:
            raise DimensionError(
                f"commutation knows {known_coils.n_coils} coils, magnetics has {true_coils.n_coils}, wanted the same."
            )
        shift = np.array(deviations.commutation_misalignment)
        believes = _mechanical(given, known_mover, known_coils, shift, Effects())
        known = modal_form(believes, n_modes=n_modes, rigid_body_modes=known_mover.rigid_body_modes)
        if true_mover is not known_mover:
            modal = _with_signs_of(modal, known, known_mover.M)
    return MMPA(
        parameters=given,
        effects=deviations,
        mechanical=mechanical,
        modal=modal,
        known=known,
        mover=true_mover,
        known_mover=known_mover,
        layers=true_layers,
    )


def _mechanical(
    parameters: MMPAParameters, body: Mover, coils: CoilWrench, shift: Array, effects: Effects
) -> MechanicalModel:
    """The equations of motion of a mover over coils, as the beams see it."""
    centre = body.centre_of_gravity
    return MechanicalModel(
        M=body.M,
        D=body.D,
        K=body.K,
        input_map=CoilInputMap(coils=coils, centre_of_gravity=centre, shift=shift),
        output_map=InterferometerMap.from_parameters(parameters, body.plate, centre, effects),
        box=parameters.box,
        input_names=tuple(f"i{k + 1}" for k in range(coils.n_coils)),
        output_names=SENSOR_NAMES,
    )


def _with_signs_of(modal: ModalModel, known: ModalModel, mass: Array) -> ModalModel:
    """The true modes with the signs of the known ones: a small payload can turn the usual choice of a sign round."""
    assert modal.V is not None and known.V is not None  # both come from mechanical models
    signs = np.where(np.einsum("ik,ik->k", known.V, mass @ modal.V) < 0.0, -1.0, 1.0)
    return replace(modal, V=modal.V * signs)


def _check_misalignment(parameters: MMPAParameters, effects: Effects) -> None:
    """Beyond half a pole pitch, a quarter period of the field, forces change their sign."""
    largest = max(abs(d) for d in effects.commutation_misalignment)
    if largest >= parameters.pole_pitch / 2:
        raise DomainError(
            f"commutation_misalignment is {effects.commutation_misalignment} m, wanted less than half the pole pitch, "
            f"{parameters.pole_pitch / 2:.4g} m: beyond, the commutation turns forces round."
        )
