"""Part of the study of the plant: its validation against published figures and against itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.decoupling import decouple
from lpvhinf.plant import MechanicalModel, ModalModel, modal_form
from lpvhinf.plant.mmpa import MMPA, RitzPlate, benchmark
from lpvhinf.progress import Progress
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator
from studies.positions import grid

# lambda = omega a^2 sqrt(rho h / D) of a free square plate, nu = 0.3, to the digits known
PUBLISHED = np.array([13.4682, 19.5961, 24.2702, 34.8009, 34.8009, 61.0932, 61.0932, 63.686, 69.265, 77.172])
FREQUENCIES_HZ = (20.0, 100.0, 300.0, 1000.0)  # beside the first eigenfrequency
POSITIONS = np.array([[0.0, 0.0], [0.033, -0.047], [0.06, 0.06]])

Complex = NDArray[np.complex128]
Part = tuple[dict[str, Any], dict[str, Any]]


def validation(settings: Settings, progress: Progress) -> Found:
    """Plate, frequency responses, energy balance and the difference of the two fields."""
    plant = actuator(settings)
    progress.stage("free plate")
    values, arrays = plate_frequencies(plant.parameters.ritz_degree)
    progress.stage("frequency responses", len(POSITIONS))
    every = modal_form(plant.mechanical, rigid_body_modes=plant.mover.rigid_body_modes)  # no mode left out
    for part in (frequency_responses(plant, every), energy_balance(plant, every, settings.seed)):
        values |= part[0]
        arrays |= part[1]
    if settings.magnetics == "exact":
        progress.stage("the two fields")
        values["fields"] = field_difference(plant, grid(plant.box, settings.grid))
    return Found(values=values, arrays=arrays)


def plate_frequencies(degree: int) -> Part:
    """The lowest frequencies of a free square plate, nu = 0.3, of unit side, stiffness and density."""
    plate = RitzPlate(side=1.0, stiffness=1.0, poisson=0.3, area_density=1.0, degree=degree)
    found = np.sqrt(scipy.linalg.eigh(plate.K, plate.M, eigvals_only=True)[3 : 3 + len(PUBLISHED)])
    error = float(np.max(np.abs(found / PUBLISHED - 1.0)))
    return {"plate_error": error}, {"plate": found, "plate_published": PUBLISHED}


def mechanical_response(model: MechanicalModel, points: Array, omega: float) -> tuple[Array, Complex]:
    """Forces Phi_a (N, n_q, n_u) and motion (K + j omega D - omega^2 M)^-1 Phi_a, without going through modes."""
    forces = model.input_map_at(points)
    dynamic = model.K + 1j * omega * model.D - omega**2 * model.M
    return forces, np.asarray(np.linalg.solve(dynamic, forces), dtype=np.complex128)


def modal_dynamics(modal: ModalModel, omega: float) -> Complex:
    """Modal coordinates per unit of modal force, (n_modes,)."""
    return np.asarray(1.0 / (modal.omega**2 - omega**2 + 2j * modal.zeta * modal.omega * omega))


def frequency_responses(plant: MMPA, every: ModalModel) -> Part:
    """Residues c_i b_i and compliance against the equations of motion: largest difference over the largest entry."""
    model, first = plant.mechanical, float(plant.modal.omega[plant.modal.n_rb]) / (2 * np.pi)
    hertz = np.sort([*FREQUENCIES_HZ, first])
    sensors = model.output_map_at(POSITIONS)
    errors = {"all_modes": np.zeros(len(hertz)), "kept_modes": np.zeros(len(hertz))}
    gains = {"all_modes": every.gains(POSITIONS), "kept_modes": plant.modal.gains(POSITIONS)}
    models = {"all_modes": every, "kept_modes": plant.modal}
    for k, f in enumerate(hertz):
        omega = 2 * np.pi * f
        direct = sensors @ mechanical_response(model, POSITIONS, omega)[1]
        for name, g in gains.items():
            series = (g.output_gains * modal_dynamics(models[name], omega)) @ g.input_gains + g.compliance
            errors[name][k] = np.max(np.abs(series - direct)) / np.max(np.abs(direct))
    rows = [{"hertz": f, **{name: error[k] for name, error in errors.items()}} for k, f in enumerate(hertz)]
    return {"responses": rows}, {"frf_hertz": hertz, **{f"frf_{name}": error for name, error in errors.items()}}


def energy_balance(plant: MMPA, every: ModalModel, seed: int) -> Part:
    """Mean power of the coil forces against what the modal dampers take, for random currents at each frequency.

    The power comes from the motion of the mechanical model, the dissipation from the modal one, all modes kept.
    """
    model = plant.mechanical
    flexible = every.omega[every.n_rb :] / (2 * np.pi)
    hertz = np.sort([*FREQUENCIES_HZ[1:], flexible[0], flexible[2]])
    current = np.random.default_rng(seed).standard_normal(model.n_u)
    modal_force = every.input_gains(POSITIONS) @ current
    supplied, dissipated = np.zeros((2, len(hertz), len(POSITIONS)))
    for k, f in enumerate(hertz):
        omega = 2 * np.pi * f
        forces, motion = mechanical_response(model, POSITIONS, omega)
        velocity = 1j * omega * (motion @ current)
        supplied[k] = 0.5 * np.sum((forces @ current) * velocity.real, axis=1)
        rate = np.abs(omega * modal_dynamics(every, omega) * modal_force) ** 2
        dissipated[k] = rate @ (every.zeta * every.omega)
    error = float(np.max(np.abs(supplied / dissipated - 1.0)))
    arrays = {"power_hertz": hertz, "power_supplied": supplied, "power_dissipated": dissipated}
    return {"power_error": error}, arrays


def field_difference(plant: MMPA, points: Array) -> list[dict[str, Any]]:
    """The exact field against its first harmonic, each commutated on itself: largest difference over the largest."""
    other = benchmark(n_flex=plant.modal.n_flex, magnetics="first-harmonic")
    exact, first = plant.modal.input_gains(points), other.modal.input_gains(points)
    n_rb, upper = plant.modal.n_rb, plant.layers[0].n_coils
    root = np.linalg.inv(plant.modal.rigid_body_scaling)
    wrenches = [root @ gains[:, :n_rb] for gains in (exact, first)]
    decoupled = [decouple(p, n_flex=1).sample(points).B for p in (plant, other)]
    left = [B[:, n_rb + 1 :, :3] for B in decoupled]
    pairs: dict[str, list[Array]] = {
        "vertical force of an upper coil": [w[:, 2, :upper] for w in wrenches],
        "vertical force of a lower coil": [w[:, 2, upper:] for w in wrenches],
        "horizontal force of a coil": [w[:, :2] for w in wrenches],
        **{f"force of a coil on mode {k + 1}": [exact[:, n_rb + k], first[:, n_rb + k]] for k in range(3)},
        "force of decoupled translations on the modes that are left": left,
    }
    return [
        {"quantity": name, "difference": np.max(np.abs(b - a)) / np.max(np.abs(a)),
         "exact": np.max(np.abs(a)), "first_harmonic": np.max(np.abs(b))}
        for name, (a, b) in pairs.items()
    ]  # fmt: skip
