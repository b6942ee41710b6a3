"""Part of the study of the plant: how well the LPV polynomial model stands for the plant model."""

from __future__ import annotations

import time

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledGains, decouple
from lpvhinf.progress import Progress
from lpvhinf.statespace import LPVStateSpace
from studies.plant_results import Found
from studies.plant_settings import Settings, actuator, random_positions

# Gains of one unit each, so that the largest of a kind is a fair measure of their errors.
KINDS = (
    "translation inputs",
    "rotation inputs",
    "modal inputs",
    "translation outputs",
    "rotation outputs",
    "redundant outputs",
)


def gains_by_kind(B: Array, C: Array, n_rb: int) -> list[Array]:
    """Gains of the flexible modes at N positions, (N, ...) for each of KINDS.

    Parameters
    ----------
    B : (N, n_modes, n_rb + n_flex)
    C : (N, n_out, n_modes)
    """
    flexible, seen = B[:, n_rb:], C[:, :, n_rb:]
    left = flexible[:, B.shape[2] - n_rb :, n_rb:]  # what modal inputs do to their own modes is exact
    return [flexible[:, :, :3], flexible[:, :, 3:n_rb], left, seen[:, :3], seen[:, 3:n_rb], seen[:, n_rb:]]


def modal_gains(system: LPVStateSpace, points: Array) -> tuple[Array, Array]:
    """B (N, n_modes, n_in) and C (N, n_out, n_modes) of a state space whose states are (eta_1, eta_1', eta_2, ...)."""
    _, B, C, _ = system.sample(points)
    return B[:, 1::2], C[:, :, ::2]


def gain_errors(system: LPVStateSpace, gains: DecoupledGains, points: Array, n_rb: int) -> tuple[Array, Array]:
    """Largest error of each kind at each position, (N, 6), and the largest gain of each kind over all, (6,)."""
    found = gains_by_kind(*modal_gains(system, points), n_rb)
    true = gains_by_kind(gains.B, gains.C, n_rb)
    errors = [np.max(np.abs(a - b), axis=(1, 2), initial=0.0) for a, b in zip(found, true, strict=True)]
    return np.stack(errors, axis=1), np.array([np.max(np.abs(b), initial=0.0) for b in true])


def relative(errors: Array, scales: Array) -> Array:
    """Largest error of each kind (..., 6) relative to the largest gain of its kind; 0 where there are no gains."""
    largest = np.max(errors, axis=-2)
    return np.asarray(np.divide(largest, scales, out=np.zeros_like(largest), where=scales > 0.0))


def polynomial(settings: Settings, n_flex: int, progress: Progress) -> Found:
    """Errors and times of all degrees, with `n_flex` controlled modes."""
    plant = actuator(settings)
    points = random_positions(settings, plant.box)
    n_degrees = len(settings.degrees)
    errors, scales = np.zeros((n_degrees, len(points), len(KINDS))), np.zeros((n_degrees, len(KINDS)))
    seconds = np.zeros(n_degrees)
    progress.stage(f"polynomial model, {n_flex} controlled modes", n_degrees)
    gains = decouple(plant, n_flex=n_flex).sample(points)
    for k, degree in enumerate(settings.degrees):
        model = decouple(plant, n_flex=n_flex, degree=degree)
        began = time.process_time()
        system = model.system
        seconds[k] = time.process_time() - began
        errors[k], scales[k] = gain_errors(system, gains, points, model.n_rb)
        progress.update()
    values = {
        "n_flex": n_flex,
        "degrees": settings.degrees,
        "kinds": KINDS,
        "n_points": len(points),
        "nodes": [(degree + 1) ** 2 for degree in settings.degrees],
        "fit_s": seconds,
        "errors": relative(errors, scales),
    }
    return Found(values=values, arrays={"points": points, "errors": errors, "scales": scales})
