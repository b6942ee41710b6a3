"""Controllers of every kind that the exporters meet, and signals for them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.export import SampledController, sampled
from lpvhinf.statespace import LPVStateSpace
from tests.export.systems import BOX, PERIOD, observer_like


@pytest.fixture(scope="session")
def make() -> Callable[[str], SampledController]:
    def controller(kind: str) -> SampledController:
        name = kind.replace(" ", "_")
        if kind == "gain":
            return sampled(np.array([[1.5, -2.0], [0.0, 1.0 / 3.0]]), name=name)
        if kind == "six axes":  # a low-pass and a lead filter each
            w, z, eye = 2.0 * np.pi * 80.0, np.zeros((6, 6)), np.eye(6)
            A = np.block([[-w * eye, w * eye], [z, -3.0 * w * eye]])
            B = np.vstack([z, 3.0 * w * eye])
            axes = [f"e_{axis} [m or rad]" for axis in ("x", "y", "z", "rx", "ry", "rz")]
            return sampled((A, B, np.hstack([1e4 * eye, z]), 2e3 * eye), name=name, inputs=axes)
        if kind == "scheduled gain":
            D = np.arange(12.0).reshape(2, 3, 1, 2)
            return sampled(
                LPVStateSpace.from_coefficients(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), D, box=BOX),
                name=name,
            )
        if kind == "fitted":
            return sampled(observer_like(), form="discrete", degree=(3, 5), name=name)
        return sampled(observer_like(varying=kind == "scheduled"), name=name)

    return controller


@pytest.fixture(scope="session")
def signals() -> Callable[[SampledController, int], tuple[Array, Array | None]]:
    """Inputs (N, n_u), and positions (N, n_p) that run through the box to its border."""

    def generate(controller: SampledController, count: int) -> tuple[Array, Array | None]:
        t = PERIOD * np.arange(count)
        u = np.random.default_rng(7).standard_normal((count, controller.n_u)) + np.sin(300.0 * t)[:, None]
        if not controller.scheduled:
            return u, None
        wave = np.sin(np.outer(t, [7.0, 11.0])) * 1.2
        p = BOX.mean(axis=1) + 0.5 * (BOX[:, 1] - BOX[:, 0]) * np.clip(wave, -1.0, 1.0)
        return u, np.clip(p, BOX[:, 0], BOX[:, 1])

    return generate
