"""Guards the exchange of systems with python-control, scipy.signal and plain arrays."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
import scipy.signal

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.statespace.interop import state_space_matrices


def value(matrices: tuple[Array, Array, Array, Array], s: complex) -> Array:
    A, B, C, D = matrices
    return np.asarray(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)


NUMERATOR, DENOMINATOR = [2.0, 1.0], [1.0, 0.5, 4.0]


@pytest.mark.parametrize(
    "system",
    [
        control.tf(NUMERATOR, DENOMINATOR),
        control.ss(control.tf(NUMERATOR, DENOMINATOR)),
        scipy.signal.TransferFunction(NUMERATOR, DENOMINATOR),
        scipy.signal.TransferFunction(NUMERATOR, DENOMINATOR).to_ss(),
        scipy.signal.TransferFunction(NUMERATOR, DENOMINATOR).to_zpk(),
        scipy.signal.tf2ss(NUMERATOR, DENOMINATOR),
        ([[0.0, 1.0], [-4.0, -0.5]], [[0.0], [1.0]], [[1.0, 2.0]], [[0.0]]),
    ],
    ids=["control.tf", "control.ss", "scipy tf", "scipy ss", "scipy zpk", "scipy arrays", "lists"],
)
def test_one_system_in_many_forms(system: Any) -> None:
    s = 0.3 + 1.7j
    wanted = np.polyval(NUMERATOR, s) / np.polyval(DENOMINATOR, s)
    assert value(state_space_matrices(system), s)[0, 0] == pytest.approx(wanted, rel=1e-12)


def test_matrix_of_transfer_functions() -> None:
    system = control.tf([[[1.0], [2.0]]], [[[1.0, 1.0], [1.0, 3.0]]])
    assert np.allclose(value(state_space_matrices(system), 1j), [[1 / (1 + 1j), 2 / (3 + 1j)]], rtol=1e-10)


@pytest.mark.parametrize("gain", [3.0, 3, np.array([[3.0]]), control.ss([], [], [], [[3.0]])])
def test_gains(gain: Any) -> None:
    A, B, C, D = state_space_matrices(gain)
    assert A.shape == (0, 0)
    assert B.shape == (0, 1)
    assert C.shape == (1, 0)
    assert D.tolist() == [[3.0]]


@pytest.mark.parametrize(
    "system",
    [
        control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1),
        control.tf([1.0], [1.0, 0.5], 0.1),
        control.tf([1.0], [1.0, 0.5], True),
        scipy.signal.dlti([1.0], [1.0, 0.5], dt=0.1),
    ],
)
def test_discrete_time_is_refused(system: Any) -> None:
    with pytest.raises(DimensionError, match="continuous time"):
        state_space_matrices(system)


def test_frequency_responses_are_refused() -> None:
    with pytest.raises(DomainError, match="Fit a model to it first"):
        state_space_matrices(control.frd([1.0, 2.0], [1.0, 2.0]))


@pytest.mark.parametrize("system", ["1/s", None, [1.0]])
def test_unknown_objects(system: Any) -> None:
    with pytest.raises(DomainError, match=r"wanted control\.StateSpace"):
        state_space_matrices(system)


def test_matrices_that_do_not_fit() -> None:
    with pytest.raises(DimensionError, match=r"B has shape \(3, 1\), wanted \(2, 1\)"):
        state_space_matrices((np.eye(2), np.ones((3, 1)), np.ones((1, 2)), [[0.0]]))
    with pytest.raises(DomainError, match="real"):
        state_space_matrices(np.array([[1.0 + 2.0j]]))
    with pytest.raises(DomainError, match="finite"):
        state_space_matrices(([[np.inf]], [[1.0]], [[1.0]], [[0.0]]))
