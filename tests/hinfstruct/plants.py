"""Plants shared by the tests of structured synthesis."""

from __future__ import annotations

import numpy as np

from lpvhinf.statespace.generalized import GeneralizedPlant


def random_plant(
    seed: int, n: int = 5, sizes: tuple[int, int, int, int] = (3, 2, 3, 2), with_D22: bool = True
) -> GeneralizedPlant:
    """A stable plant with every matrix filled; `sizes` are n_w, n_u, n_z, n_y."""
    rng = np.random.default_rng(seed)
    n_w, n_u, n_z, n_y = sizes
    A = rng.standard_normal((n, n))
    A -= (np.max(np.linalg.eigvals(A).real) + 0.4) * np.eye(n)
    shapes = ((n, n_w), (n, n_u), (n_z, n), (n_y, n), (n_z, n_w), (n_z, n_u), (n_y, n_w))
    D22 = 0.3 * rng.standard_normal((n_y, n_u)) if with_D22 else None
    return GeneralizedPlant(A, *[rng.standard_normal(shape) for shape in shapes], D22=D22)


def first_order() -> GeneralizedPlant:
    """x' = x + w1 + u, z = (x, u), y = x + w2."""
    return GeneralizedPlant(
        [[1.0]],
        [[1.0, 0.0]],
        [[1.0]],
        [[1.0], [0.0]],
        [[1.0]],
        np.zeros((2, 2)),
        [[0.0], [1.0]],
        [[0.0, 1.0]],
    )
