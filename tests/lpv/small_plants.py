"""Plants for the tests of LPV synthesis: a beam-like mode that moves with p, and random ones."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.statespace.generalized import GeneralizedPlant


def moving_mode(p: Array) -> GeneralizedPlant:
    """A mass with one flexible mode whose sensor gain changes with p in [-1, 1], weights on position and force."""
    s = float(np.asarray(p).reshape(-1)[0])
    omega, zeta = 8.0, 0.02
    A = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [0.0, -0.1, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, -(omega**2), -2.0 * zeta * omega],
        ]
    )
    B2 = np.array([[0.0], [1.0], [0.0], [0.6]])
    B1 = np.hstack([B2, np.zeros((4, 1))])
    C2 = np.array([[1.0, 0.0, 0.8 * s, 0.0]])
    C1 = np.vstack([C2, np.zeros((1, 4))])
    return GeneralizedPlant(A, B1, B2, C1, C2, np.zeros((2, 2)), np.array([[0.0], [0.2]]), np.array([[0.0, 0.1]]))


def random_plant(seed: int, n: int = 4, direct: float = 0.0) -> GeneralizedPlant:
    """A stable random plant with two of each signal more than u and y need; `direct` scales D11."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A -= (np.max(np.linalg.eigvals(A).real) + 0.3) * np.eye(n)
    return GeneralizedPlant(
        A,
        rng.normal(size=(n, 3)),
        rng.normal(size=(n, 2)),
        rng.normal(size=(3, n)),
        rng.normal(size=(2, n)),
        direct * rng.normal(size=(3, 3)),
        rng.normal(size=(3, 2)),
        rng.normal(size=(2, 3)),
    )


def cosines(p: Array) -> tuple[Array, Array]:
    """The basis 1, cos p, sin p."""
    x = float(np.asarray(p).reshape(-1)[0])
    return np.array([1.0, np.cos(x), np.sin(x)]), np.array([[0.0], [-np.sin(x)], [np.cos(x)]])
