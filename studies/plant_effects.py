"""Part of the study of the plant: how far deviations of the machine disturb its decoupling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.plant.mmpa import Effects, benchmark
from lpvhinf.progress import Progress
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator
from studies.positions import grid

UM = 1e-6


@dataclass(frozen=True, kw_only=True)
class Case:
    """A deviation with a typical size; `chosen` if the size is a choice of this study."""

    name: str
    effects: Effects
    commutation: str | None = None
    chosen: bool = False

    @property
    def needs_exact_field(self) -> bool:
        """Whether the first harmonic cannot show it."""
        return bool(self.effects.coil_position_rms or self.effects.magnet_strength_rms or self.commutation)


def cases(seed: int) -> list[Case]:
    """The deviations of the table, each alone, then those of a calibrated machine together."""
    raw, calibrated, slope = (50 * UM, 50 * UM), (5 * UM, 5 * UM), (1e-4, 1e-4)
    payload = {"payload_mass": 0.1, "payload_place": (0.1, 0.1, 0.0)}
    return [
        Case(name="none", effects=Effects()),
        Case(name="commutation misaligned by 5 um along x and y", effects=Effects(commutation_misalignment=calibrated)),
        Case(name="commutation misaligned by 50 um", effects=Effects(commutation_misalignment=raw)),
        Case(name="coil positions, 20 um rms", effects=Effects(coil_position_rms=20 * UM, seed=seed)),
        Case(name="all magnets 1 % weaker", effects=Effects(magnet_strength=-0.01)),
        Case(name="strength of each magnet, 1 % rms", effects=Effects(magnet_strength_rms=0.01, seed=seed)),
        Case(name="horizontal beams 0.1 mm too high", effects=Effects(beam_height_error=1e-4), chosen=True),
        Case(
            name="mirrors out of square by 0.1 mrad",
            effects=Effects(mirror_slope_x=slope, mirror_slope_y=slope, mirror_slope_z=slope),
            chosen=True,
        ),
        Case(name="an eighth of the damping (0.1 %)", effects=Effects(damping_factor=0.125)),
        Case(name="payload of 0.1 kg at (100, 100) mm", effects=Effects(**payload), chosen=True),  # type: ignore[arg-type]
        Case(name="commutation on the first harmonic", effects=Effects(), commutation="first-harmonic"),
        Case(name="calibrated machine, all at once", effects=Effects.realistic(seed)),
        Case(
            name="calibrated machine, commutation on the first harmonic",
            effects=Effects.realistic(seed),
            commutation="first-harmonic",
        ),
    ]


def effects(settings: Settings, progress: Progress) -> Found:
    """Deviation of rigid-body input and output gains from the identity, and excitation of the controlled mode."""
    nominal = actuator(settings)
    points = grid(nominal.box, settings.grid)
    shown = [case for case in cases(settings.seed) if settings.magnetics == "exact" or not case.needs_exact_field]
    conventional = decouple(nominal, n_flex=1, input_decoupling="rigid-body")
    scale = float(np.max(disturbance(conventional, points)[2]))
    measures, mode = np.zeros((3, len(shown), len(points))), np.zeros((2, len(shown)))
    progress.stage("effects", len(shown))
    for k, case in enumerate(shown):
        plant = benchmark(
            n_flex=settings.n_plant_modes,
            magnetics=settings.magnetics,
            commutation=case.commutation,
            effects=case.effects,
        )
        measures[:, k] = disturbance(decouple(plant, n_flex=1), points)
        mode[:, k] = plant.modal.omega[plant.modal.n_rb], plant.modal.zeta[plant.modal.n_rb]
        progress.update()
    measures[2] /= scale
    rows: list[dict[str, Any]] = [
        {
            "name": case.name,
            "chosen": case.chosen,
            "input": np.max(measures[0, k]),
            "output": np.max(measures[1, k]),
            "excitation": np.max(measures[2, k]),
            "mode_hertz": mode[0, k] / (2 * np.pi),
            "mode_damping": mode[1, k],
            "worst_position": points[int(np.argmax(measures[0, k]))],
        }
        for k, case in enumerate(shown)
    ]
    left_out = [case.name for case in cases(settings.seed) if case not in shown]
    values = {"rows": rows, "left_out": left_out, "n_points": len(points), "dynamics": dynamics()}
    names = np.array([case.name for case in shown])
    arrays = dict(zip(("input", "output", "excitation"), measures, strict=True))
    return Found(values=values, arrays={"points": points, "names": names, **arrays})


def disturbance(plant: DecoupledPlant, points: Array) -> Array:
    """How far rigid-body input and output gains are from the identity, and the force on the mode, (3, N).

    Largest singular values, in mass-normalised coordinates of the known mover, so that units do not count.
    """
    gains, n_rb, S = plant.sample(points), plant.n_rb, plant.known_modal.rigid_body_scaling
    blocks = np.stack([gains.B[:, :n_rb, :n_rb], gains.C[:, :n_rb, :n_rb]]) - np.eye(n_rb)
    deviations = np.linalg.norm(np.linalg.inv(S) @ blocks @ S, ord=2, axis=(2, 3))
    force = np.linalg.norm(gains.B[:, n_rb, :n_rb] @ S, axis=1)
    return np.concatenate([deviations, force[None]])


def dynamics() -> dict[str, Any]:
    """What stands before and behind the modal model of a calibrated machine."""
    machine = Effects.realistic()
    before = machine.input_dynamics()
    assert before is not None  # it has amplifiers and a delay
    hertz = (40.0, 140.0, 1000.0)
    values = [complex(before(2j * np.pi * f)) for f in hertz]
    return {
        "hertz": hertz,
        "gain_dB": [20 * np.log10(abs(v)) for v in values],
        "phase_deg": [np.angle(v, deg=True) for v in values],
        "delay_us": 1e6 * machine.delay,
        "noise_nm": 1e9 * machine.sensors.noise_rms,
        "step_nm": 1e9 * machine.sensors.quantisation,
    }
