"""Guards the frozen generalized plant: partition, closing with u = + K y, and its checks."""

from __future__ import annotations

import control
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.statespace import GeneralizedPlant
from lpvhinf.statespace.generalized import NAMES

SIZES = {"x": 4, "w": 3, "u": 2, "z": 2, "y": 3}
SHAPES = ("xx", "xw", "xu", "zx", "yx", "zw", "zu", "yw", "yu")
OMEGA = [0.0, 0.3, 2.0, 30.0]


def blocks(seed: int = 0) -> dict[str, Array]:
    rng = np.random.default_rng(seed)
    return {
        name: rng.standard_normal((SIZES[r], SIZES[c])) for name, (r, c) in zip(NAMES, map(tuple, SHAPES), strict=True)
    }


def controller(seed: int = 1, n_k: int = 3) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng(seed)
    n_y, n_u = SIZES["y"], SIZES["u"]
    A, B = rng.standard_normal((n_k, n_k)), rng.standard_normal((n_k, n_y))
    return A, B, rng.standard_normal((n_u, n_k)), rng.standard_normal((n_u, n_y))


def transfer(A: Array, B: Array, C: Array, D: Array, omega: float) -> Array:
    return np.asarray(C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B) + D)


@pytest.mark.parametrize("feed_through", [True, False])
@pytest.mark.parametrize("n_k", [3, 0])
def test_closed_loop_is_the_lower_lft(feed_through: bool, n_k: int) -> None:
    parts = blocks()
    if not feed_through:
        del parts["D22"]
    P, K = GeneralizedPlant(**parts), controller(n_k=n_k)
    closed = P.close(*K)
    library = P.to_control().lft(control.ss(*K))
    for omega in OMEGA:
        k = transfer(*K, omega)
        p11, p12 = transfer(P.A, P.B1, P.C1, P.D11, omega), transfer(P.A, P.B2, P.C1, P.D12, omega)
        p21, p22 = transfer(P.A, P.B1, P.C2, P.D21, omega), transfer(P.A, P.B2, P.C2, P.D22, omega)
        formula = p11 + p12 @ k @ np.linalg.solve(np.eye(SIZES["y"]) - p22 @ k, p21)
        assert np.allclose(transfer(*closed, omega), formula, rtol=1e-10, atol=1e-10)
        assert np.allclose(transfer(library.A, library.B, library.C, library.D, omega), formula, rtol=1e-9, atol=1e-9)
    assert closed[0].shape == (4 + n_k, 4 + n_k)


def test_d22_matters() -> None:
    parts = blocks()
    with_it = GeneralizedPlant(**parts).close(*controller())
    without = GeneralizedPlant(**{**parts, "D22": np.zeros((3, 2))}).close(*controller())
    assert np.max(np.abs(with_it[0] - without[0])) > 0.1


def test_ill_posed_loop() -> None:
    P = GeneralizedPlant([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], [[0.0]], [[0.0]], [[0.0]], [[2.0]])
    empty = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    with pytest.raises(AssumptionError, match="not well posed"):
        P.close(*empty, np.array([[0.5]]))
    assert P.close(*empty, np.array([[0.25]]))[0][0, 0] == pytest.approx(-0.5)  # -1 + 0.25/(1 - 0.5)


def test_controller_of_another_size() -> None:
    A, B, C, D = controller()
    with pytest.raises(DimensionError, match="the controller has"):
        GeneralizedPlant(**blocks()).close(A, B, C, D.T)
    with pytest.raises(DimensionError):
        GeneralizedPlant(**blocks()).close(A, B[:, :2], C, D)


def test_round_trip_through_control() -> None:
    P = GeneralizedPlant(**blocks())
    again = GeneralizedPlant.from_control(P.to_control(), n_y=SIZES["y"], n_u=SIZES["u"])
    for name in NAMES:
        assert np.array_equal(getattr(again, name), getattr(P, name))


def test_partition_takes_the_last_channels() -> None:
    D = np.arange(12.0).reshape(3, 4)
    P = GeneralizedPlant.from_control(control.ss(-np.eye(2), np.ones((2, 4)), np.ones((3, 2)), D), n_y=1, n_u=3)
    assert P.D21.tolist() == [[8.0]]
    assert P.D12.tolist() == [[1.0, 2.0, 3.0], [5.0, 6.0, 7.0]]
    assert repr(P) == "GeneralizedPlant(n_x=2, n_w=1, n_u=3, n_z=2, n_y=1)"


def test_partitions_that_do_not_exist() -> None:
    system = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]])
    with pytest.raises(DimensionError, match="wanted at least 2 outputs"):
        GeneralizedPlant.from_control(system, n_y=2, n_u=1)
    with pytest.raises(DimensionError, match="continuous time"):
        GeneralizedPlant.from_control(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1), n_y=1, n_u=1)


@pytest.mark.parametrize("name", NAMES)
def test_every_block_is_checked(name: str) -> None:
    parts = blocks()
    with pytest.raises(DimensionError):
        GeneralizedPlant(**{**parts, name: np.ones((7, 7, 1))})
    parts[name][0, 0] = np.nan
    with pytest.raises(DomainError, match=rf"{name}\[0, 0\] is nan"):
        GeneralizedPlant(**parts)


def test_wrong_sizes_are_named() -> None:
    parts = blocks()
    with pytest.raises(DimensionError, match=r"D12 has shape \(2, 5\), wanted \(2, 2\)"):
        GeneralizedPlant(**{**parts, "D12": np.ones((2, 5))})
    with pytest.raises(DimensionError, match="A has shape"):
        GeneralizedPlant(**{**parts, "A": np.ones((4, 5))})


def test_matrices_cannot_be_changed() -> None:
    P = GeneralizedPlant(**blocks())
    with pytest.raises(ValueError, match="read-only"):
        P.A[0, 0] = 1.0
