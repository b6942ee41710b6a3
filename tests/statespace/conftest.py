"""Random systems over a box, for the tests of this folder."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.fitting import spread_points
from lpvhinf.statespace import LPVStateSpace

BOX = np.array([[-1.0, 2.0], [0.0, 0.5]])

RandomSystem = Callable[..., LPVStateSpace]


@pytest.fixture(scope="session")
def box() -> Array:
    return BOX


@pytest.fixture(scope="session")
def positions() -> Array:
    return np.vstack([spread_points(BOX, 4, seed=5), [[-1.0, 0.0], [2.0, 0.5]]])


@pytest.fixture(scope="session")
def random_system() -> RandomSystem:
    """Systems (n_x, n_u, n_y) of degree (2, 1); `D` varies with p, is constant, or zero."""

    def make(seed: int, n_x: int, n_u: int, n_y: int, D: str = "varying") -> LPVStateSpace:
        rng = np.random.default_rng(seed)
        parts = [rng.standard_normal((3, 2, *shape)) for shape in ((n_x, n_x), (n_x, n_u), (n_y, n_x))]
        parts[0][0, 0] -= 2.0 * np.eye(n_x)
        shapes = {"varying": (2, 2, n_y, n_u), "constant": (n_y, n_u), "zero": (n_y, n_u)}
        feed_through = 0.3 * rng.standard_normal(shapes[D]) * (D != "zero")
        return LPVStateSpace.from_coefficients(parts[0], parts[1], parts[2], feed_through, box=BOX)

    return make
