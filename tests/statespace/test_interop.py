"""Guards the exchange of systems with python-control, scipy.signal, MAT files and plain arrays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
import scipy.io
import scipy.signal

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError, DomainError, StorageError
from lpvhinf.statespace import (
    GeneralizedPlant,
    LPVGeneralizedPlant,
    LPVStateSpace,
    as_control,
    as_scipy,
    as_transfer_function,
    read_mat,
    write_mat,
)
from lpvhinf.statespace.interop import sampled_matrices, state_space_matrices


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
    with pytest.raises(DomainError, match=r"Freeze it with system\.at"):
        state_space_matrices(LPVStateSpace.from_system(2.0, [[0.0, 1.0]]))
    with pytest.raises(DomainError, match="finite"):
        state_space_matrices(([[np.inf]], [[1.0]], [[1.0]], [[0.0]]))


SYSTEMS = [
    control.ss([[0.0, 1.0], [-4.0, -0.5]], [[0.0], [1.0]], [[1.0, 2.0]], [[0.3]]),
    control.ss([[0.5, 0.1], [0.0, 0.2]], [[0.0], [1.0]], [[1.0, 2.0]], [[0.3]], 0.01),
    control.tf(NUMERATOR, DENOMINATOR),
    scipy.signal.dlti([1.0, 0.2], [1.0, -0.5], dt=0.1),
    np.array([[1.0, 2.0], [0.5, 4.0]]),
]


@pytest.mark.parametrize("system", SYSTEMS, ids=["ss", "sampled ss", "tf", "scipy dlti", "gain"])
def test_out_and_in_again(system: Any, tmp_path: Path) -> None:
    wanted, dt = sampled_matrices(system)
    write_mat(tmp_path / "G.mat", system)
    for back in (as_control(system), as_scipy(system), as_transfer_function(system), read_mat(tmp_path / "G.mat")):
        found, found_dt = sampled_matrices(back)
        assert found_dt == dt
        for s in (0.3 + 1.7j, -0.2 + 0.9j):
            assert np.allclose(value(found, s), value(wanted, s), rtol=1e-9)


def test_the_rate_of_a_sampled_system_must_be_known() -> None:
    with pytest.raises(DomainError, match="without a sampling time"):
        sampled_matrices(control.tf([1.0], [1.0, 0.5], True))


def test_generalized_plants_from_any_object(tmp_path: Path) -> None:
    system = control.tf([[[1.0], [2.0]], [[3.0], [1.0]]], [[[1.0, 1.0], [1.0, 3.0]], [[1.0, 2.0], [1.0, 5.0]]])
    P = GeneralizedPlant.from_control(system, 1, 1)
    assert (P.n_w, P.n_u, P.n_z, P.n_y) == (1, 1, 1, 1)
    G = state_space_matrices(P.to_control())
    assert np.allclose(value(G, 1j), [[1 / (1 + 1j), 2 / (3 + 1j)], [3 / (2 + 1j), 1 / (5 + 1j)]], rtol=1e-9)
    Q = GeneralizedPlant.from_control(G, 1, 1)
    assert np.array_equal(P.A, Q.A)
    write_mat(tmp_path / "P.mat", P)
    back = read_mat(tmp_path / "P.mat")
    assert isinstance(back, GeneralizedPlant)
    assert np.array_equal(back.D12, P.D12)
    assert np.array_equal(back.B1, P.B1)
    assert "<td>B1</td><td>B2</td>" in P._repr_html_()
    assert "<td>C2</td><td>0</td><td>0</td>" in P._repr_html_()


@pytest.mark.parametrize("n_u", [1, 3])
def test_a_system_over_a_box_as_a_mat_file(
    random_system: Callable[..., LPVStateSpace], positions: Array, tmp_path: Path, n_u: int
) -> None:
    G = random_system(3, 4, n_u, 1, D="constant")
    write_mat(tmp_path / "G.mat", G)
    back = read_mat(tmp_path / "G.mat")
    assert isinstance(back, LPVStateSpace)
    for wanted, found in zip(G.sample(positions), back.sample(positions), strict=True):
        assert np.array_equal(wanted, found)
    plant = LPVGeneralizedPlant(G, 1, 1)
    assert f"w ({n_u - 1}), u (1) to z (0), y (1)" in plant._repr_html_()


def test_mat_files_that_are_no_systems(tmp_path: Path) -> None:
    path = tmp_path / "G.mat"
    with pytest.raises(StorageError, match="cannot be read"):
        read_mat(path)
    path.write_text("no MAT file at all")
    with pytest.raises(StorageError, match="cannot be read"):
        read_mat(path)
    scipy.io.savemat(path, {"A": np.eye(2), "B": np.ones((2, 1))})
    with pytest.raises(StorageError, match="no variable C, D"):
        read_mat(path)
    scipy.io.savemat(path, {"A": np.eye(2), "B1": np.ones((2, 1))})
    with pytest.raises(StorageError, match="no variable B2"):
        read_mat(path)
    scipy.io.savemat(path, {"A": "text", "B": 1.0, "C": 1.0, "D": 1.0})
    with pytest.raises(StorageError, match="wanted a full array"):
        read_mat(path)
    with pytest.raises(DomainError, match="wanted control"):
        write_mat(path, "1/s")
