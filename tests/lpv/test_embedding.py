"""Affine embedding: the bound holds everywhere, and falls as directions are added."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.lpv import affine_embedding, lpvsyn
from lpvhinf.lpv.embedding import evaluate
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant
from tests.lpv.small_plants import moving_mode

BOX = np.array([[-0.2, 0.3], [1.0, 2.0]])


def system(seed: int = 0) -> LPVStateSpace:
    """Random polynomials of degree (3, 2), higher degrees smaller; B is constant, one entry of A is zero."""
    rng = np.random.default_rng(seed)
    size = 0.4 ** np.add.outer(np.arange(4.0), np.arange(3.0))[:, :, None, None]
    A = size * rng.normal(size=(4, 3, 3, 3))
    A[..., 0, 1] = 0.0
    C, D = 100.0 * size * rng.normal(size=(4, 3, 2, 3)), size * rng.normal(size=(4, 3, 2, 1))
    return LPVStateSpace.from_coefficients(A, rng.normal(size=(3, 1)), C, D, box=BOX)


@pytest.mark.parametrize("n_theta", [1, 3])
def test_remainder_is_below_its_bound_everywhere(n_theta: int) -> None:
    G = system()
    embedding = affine_embedding(G, n_theta)
    systems, weights, bound = embedding
    assert len(systems) == 2**n_theta
    where = np.vstack([spread_points(BOX, 200), [[x, y] for x in BOX[0] for y in BOX[1]]])
    largest = {name: 0.0 * limit for name, limit in embedding.remainder.items()}
    for p, *truth in zip(where, *G.sample(where), strict=True):
        w = weights(p)
        assert np.all(w >= 0.0)
        assert w.sum() == pytest.approx(1.0)
        # no clipping: theta stays inside its box
        assert np.all(embedding.theta(p) >= embedding.vertices.min(axis=0))
        assert np.all(embedding.theta(p) <= embedding.vertices.max(axis=0))
        total = 0.0
        for name, exact, found in zip("ABCD", truth, evaluate(embedding, p), strict=True):
            error = np.abs(exact - found)
            largest[name] = np.maximum(largest[name], error)
            assert np.all(error <= embedding.remainder[name] + 1e-11)
            total += float(np.sum(error**2))
        assert np.sqrt(total) <= bound
    # and the bound is not far above what is seen
    assert np.max(embedding.remainder["A"]) < 1.3 * np.max(largest["A"])
    assert np.all(embedding.remainder["B"] == 0.0)
    assert embedding.remainder["A"][0, 1] == 0.0


def test_more_directions_lose_less() -> None:
    G = system(1)
    embeddings = [affine_embedding(G, n) for n in (1, 2, 4)]
    assert embeddings[0].error_bound > embeddings[1].error_bound > embeddings[2].error_bound
    assert embeddings[0].share < embeddings[1].share < embeddings[2].share <= 1.0


def test_an_embedded_plant_is_designed_for() -> None:
    """Polytopic synthesis on the embedding of a plant whose stiffness depends on p nonlinearly."""

    def sample(points: Array) -> tuple[Array, Array, Array, Array]:
        P = moving_mode(np.array([0.5])).to_control()
        A = np.tile(np.asarray(P.A), (len(points), 1, 1))
        A[:, 3, 2] -= 6.0 * np.exp(points[:, 0])
        A[:, 3, 3] -= 0.6 * np.exp(points[:, 0])
        rest = [np.tile(np.asarray(m), (len(points), 1, 1)) for m in (P.B, P.C, P.D)]
        return A, rest[0], rest[1], rest[2]

    fit = LPVStateSpace.interpolate(sample, box=[[-1.0, 1.0]], degree=8)
    plant = LPVGeneralizedPlant(fit.system, 1, 1)
    embedding = affine_embedding(plant, 1)
    assert embedding.error_bound < 1e-6
    result = lpvsyn(
        embedding.systems, embedding.vertices, method="polytopic", weights=embedding.weights, box=embedding.box
    )
    for p in (-1.0, 0.3, 1.0):
        K = result.controller.at([p])
        loop = plant.at([p]).close(K.A, K.B, K.C, K.D)
        assert np.max(np.linalg.eigvals(loop[0]).real) < 0.0


def test_refusals() -> None:
    constant = LPVStateSpace.from_coefficients([[[-1.0]]], [[1.0]], [[1.0]], [[0.0]], box=[[0.0, 1.0]])
    with pytest.raises(AssumptionError, match="does not depend on p"):
        affine_embedding(constant, 1)
    with pytest.raises(AssumptionError, match="n_theta is 30, but the system varies in"):
        affine_embedding(system(), 30)
    with pytest.raises(DomainError, match="n_theta is 0"):
        affine_embedding(system(), 0)
    with pytest.raises(DomainError, match="wanted an LPVStateSpace"):
        affine_embedding(constant.at([0.0]), 1)  # type: ignore[arg-type]
