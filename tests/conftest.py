"""Plants that several tests share: the benchmark, and a small one of a user with two axes and three modes."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.plant import ModalModel
from lpvhinf.plant.mmpa import MMPA, benchmark

LENGTH = 0.2  # of the small plant's box [m]


@pytest.fixture(scope="session")
def mmpa() -> MMPA:
    """With the first harmonic of the field, which needs no tables."""
    return benchmark(magnetics="first-harmonic")


@pytest.fixture(scope="session")
def decoupled_mmpa(mmpa: MMPA) -> DecoupledPlant:
    """One preserved mode; a low degree keeps the polynomial model cheap, and coarse."""
    return decouple(mmpa, n_flex=1, degree=10)


def user_plant(output_gains_of_modes: Array | None = None, n_actuators: int = 7, n_sensors: int = 3) -> ModalModel:
    """A beam on `n_actuators` actuators, seen by `n_sensors` sensors that it slides past; p is its shift [m].

    Parameters
    ----------
    output_gains_of_modes : (3,), optional
        Factors of the output gains of the flexible modes; zero hides a mode from every sensor.
    """
    visible = np.ones(3) if output_gains_of_modes is None else output_gains_of_modes
    actuators, sensors = np.linspace(-0.5, 0.5, n_actuators), np.linspace(-0.45, 0.4, n_sensors)
    mass = np.array([[2.0, 0.05], [0.05, 0.3]])  # of height [kg] and tilt [kg m^2], slightly coupled
    values, vectors = np.linalg.eigh(mass)
    S = vectors @ np.diag(values**-0.5) @ vectors.T

    def shapes(x: Array) -> Array:
        """Height, tilt and three bending shapes at places x, mass-normalised: (..., 5)."""
        rigid = np.stack([np.ones_like(x), x], axis=-1) @ S
        bending = np.stack([np.cos(4.0 * x) - 0.4, np.sin(6.0 * x), np.cos(9.0 * x + 0.3)], axis=-1)
        return np.concatenate([rigid, bending], axis=-1)

    def inputs(points: Array) -> Array:
        return np.swapaxes(shapes(actuators - points), 1, 2)

    def outputs(points: Array) -> Array:
        return np.concatenate([np.ones(2), visible]) * shapes(sensors - 0.7 * points)

    return ModalModel.from_modal_data(
        omega=2 * np.pi * np.array([0.0, 0.0, 60.0, 110.0, 240.0]),
        zeta=[0.0, 0.0, 0.01, 0.008, 0.02],
        input_gains=inputs,
        output_gains=outputs,
        box=[[-LENGTH / 2, LENGTH / 2]],
        compliance=1e-8 * np.cos(np.arange(n_sensors * n_actuators)).reshape(n_sensors, n_actuators),
        mass_matrix_rb=mass,
        rigid_body_scaling=S,
    )


@pytest.fixture(scope="session")
def small_modal() -> ModalModel:
    return user_plant()


@pytest.fixture(scope="session")
def small_plant(small_modal: ModalModel) -> DecoupledPlant:
    return decouple(small_modal, n_flex=1, degree=16)


@pytest.fixture(scope="session")
def small_positions() -> Array:
    """Positions of the small plant: ends, centre and others."""
    return LENGTH * np.array([[-0.5], [0.0], [0.5], [0.123], [-0.317]])


@pytest.fixture(scope="session")
def tiny_results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results folder of the study output_observer, preset tiny: most of a minute, once for all workers."""
    from studies import output_observer

    return tiny_run(output_observer, tmp_path_factory)


@pytest.fixture(scope="session")
def tiny_error_results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same of the study error_observer: half a minute."""
    from studies import error_observer

    return tiny_run(error_observer, tmp_path_factory)


def tiny_run(study: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run a study's preset tiny, in a folder below the parent that the folders of all workers have in common.

    The first worker that wants it runs the study, others wait for it.
    """
    from lpvhinf.progress import SILENT
    from studies.settings import load_settings

    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / study.NAME
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # until the file is closed
        if not (folder / "report.json").is_file():
            study.run(load_settings(study.Settings, study.NAME, "tiny"), folder, SILENT)
    return folder
