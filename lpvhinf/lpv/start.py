"""Where the interior-point method begins."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.cone import inner, inverse_factors, inverses
from lpvhinf.lpv.operator import LMIOperator

#: Unknown matrices begin as this multiple of the identity.
SIZE = 10.0


def starting_point(operator: LMIOperator) -> tuple[Array, list[Array], list[Array]]:
    """y, X and Z: unknown matrices near the identity, slacks made positive definite, X on the central path of Z."""
    problem = operator.problem
    matrices = {}
    for u in problem.unknowns:
        unit = np.zeros(u.count)
        unit[0] = 1.0
        if u.unit is not None:
            unit = np.asarray(u.unit, dtype=float)
        matrices[u.name] = SIZE * unit[:, None, None] * np.eye(u.size)
    at_zero = problem.evaluate(matrices, 0.0)
    gamma = 10.0 * max(float(np.abs(z).max()) for z, b in zip(at_zero, problem.blocks) if b.Fg is not None)
    Z = []
    for value in problem.evaluate(matrices, gamma):
        least, size = np.linalg.eigvalsh(value)[:, 0], np.maximum(np.abs(value).max(axis=(1, 2)), 1e-3)
        wanted = np.maximum(1.0, np.maximum(0.1 * size, -2.0 * least))
        shift = np.where(least < 0.05 * size, wanted + np.maximum(0.0, -least), 0.0)
        Z.append(value + shift[:, None, None] * np.eye(value.shape[1]))
    factors = inverse_factors(Z)
    assert factors is not None
    W = inverses(factors)
    with_gamma = [(b.Fg, w) for b, w in zip(problem.blocks, W) if b.Fg is not None]
    weight = inner([f for f, _ in with_gamma], [w for _, w in with_gamma])
    mu = 1.0 / abs(weight) if weight != 0.0 else 1.0
    return operator.vector(matrices, gamma), [mu * w for w in W], Z
