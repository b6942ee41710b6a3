"""Guards K_RB of free order: its start is the PID, its poles are stable, its derivative, units, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.controllers import FreeRigidBodyStructure, RigidBodyGains, RigidBodyStateSpace, RigidBodyStructure
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct import ControllerStructure, check_structure

F_I = np.array([10.0, 12.5])
UNIT = (2 * np.pi * 4 * F_I) ** 2
OMEGA = 2 * np.pi * np.array([0.3, 5.0, 40.0, 139.0, 3000.0])
ORDERS = [2, 3, 4, 5]


def free(order: int = 4) -> FreeRigidBodyStructure:
    return FreeRigidBodyStructure(F_I, UNIT, order)


def random_theta(order: int, seed: int = 0) -> Array:
    return free(order).initial(np.random.default_rng(seed))


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("zeta_lp", [0.7, 1.0, 1.6])
def test_the_start_is_the_pid(order: int, zeta_lp: float) -> None:
    """Whether the poles of its low-pass are a pair, equal or real."""
    thumb = free(order).rule_of_thumb(4 * F_I)
    gains = RigidBodyGains(gain=thumb.gain, f_i=thumb.f_i, f_d=thumb.f_d, f_lp=thumb.f_lp, zeta_lp=np.full(2, zeta_lp))
    found = free(order).gains(free(order).parameters(gains))
    assert np.allclose(found.response(OMEGA), gains.response(OMEGA), rtol=1e-9, atol=0.0)
    plain = RigidBodyStructure(F_I, UNIT).rule_of_thumb(4 * F_I)
    assert np.array_equal(thumb.gain, plain.gain)


@pytest.mark.parametrize("order", ORDERS)
def test_the_realization_is_what_is_read(order: int) -> None:
    theta = random_theta(order)
    A, B, C, D = free(order).realize(theta)
    assert not np.any(D)
    wanted = free(order).gains(theta).response(OMEGA)
    for k, s in enumerate(1j * OMEGA):
        integrals = np.vstack([np.eye(2), np.diag(2 * np.pi * F_I / s)])
        K = UNIT[:, None] * (C @ np.linalg.solve(s * np.eye(len(A)) - A, B @ integrals))
        assert np.allclose(K, np.diag(wanted[k]), rtol=1e-10, atol=1e-12 * np.max(np.abs(wanted[k])))


@pytest.mark.parametrize("order", ORDERS)
def test_derivative_against_differences(order: int) -> None:
    assert check_structure(free(order), random_theta(order, seed=order), seed=order) < 1e-8


@pytest.mark.parametrize("seed", range(4))
def test_stable_for_all_parameters(seed: int) -> None:
    theta = 5.0 * np.random.default_rng(seed).standard_normal(free(5).n_parameters)
    assert np.max(np.linalg.eigvals(free(5).realize(theta)[0]).real) < 0.0
    assert np.max(free(5).gains(theta).poles.real) < 0.0


def test_added_states_do_nothing_but_can_be_felt() -> None:
    """C = 0 at first, and the gradient in it is not zero: a solver can leave the start."""
    theta = free(4).parameters(free(4).rule_of_thumb(4 * F_I))
    gains = free(4).gains(theta)
    assert not np.any(gains.C[:, 2:])
    assert np.all(np.any(gains.B[:, 2:, 0] != 0.0, axis=1))
    assert np.allclose(np.abs(gains.poles[:, 2:]) / (2 * np.pi), 8 * F_I[:, None], rtol=1e-9)


@pytest.mark.parametrize("order", ORDERS)
def test_state_spaces_round_trip(order: int) -> None:
    theta = random_theta(order)
    gains = free(order).gains(theta)
    assert np.allclose(free(order).gains(free(order).parameters(gains)).response(OMEGA), gains.response(OMEGA))
    other = FreeRigidBodyStructure(0.4 * F_I, 0.2 * UNIT, order + 2)  # more states, in other units
    again = other.gains(other.parameters(gains))
    assert np.allclose(again.response(OMEGA), gains.response(OMEGA), rtol=1e-6, atol=0.0)


def test_it_is_a_structure_for_the_solver() -> None:
    K = free(3)
    assert isinstance(K, ControllerStructure)
    assert (K.n_u, K.n_y, K.n_x, K.n_parameters) == (2, 4, 6, 28)
    assert len(K.names) == K.n_parameters
    assert K.names[14] == "K_RB[1].L[0,0]"


def test_names_and_tables() -> None:
    gains = RigidBodyStateSpace(
        A=[[[-1.0, 2.0, 0.0], [-2.0, -1.0, 0.0], [0.0, 0.0, -20.0 * np.pi]]], B=np.ones((1, 3, 2)), C=np.ones((1, 3))
    )
    assert list(gains.arrays()) == ["A", "B", "C"]
    assert (gains.n_rb, gains.order) == (1, 3)
    assert gains.table(["z"])[1] == "  z      0.4 (0.45), 10.0 (1.00)"


def test_refusals() -> None:
    for wrong in (1, 0, 2.5):
        with pytest.raises(DomainError, match="order is"):
            free(wrong)  # type: ignore[arg-type]
    with pytest.raises(DimensionError, match="f_states"):
        FreeRigidBodyStructure(F_I, UNIT, 4, [10.0, 20.0])
    with pytest.raises(DomainError, match="gain_unit"):
        FreeRigidBodyStructure(F_I, -UNIT, 4)
    with pytest.raises(DomainError, match=r"order 4, wanted at most 3\. Raise order_K_RB"):
        free(3).parameters(free(4).gains(random_theta(4)))
    turned = free(2).gains(random_theta(2))
    with pytest.raises(DomainError, match=r"not of the form S - L L'"):
        free(2).parameters(RigidBodyStateSpace(A=turned.A + np.eye(2)[::-1], B=turned.B, C=turned.C))
    notched = RigidBodyStructure(F_I, UNIT, 1)
    with pytest.raises(DomainError, match="1 notches an axis, wanted a PID without"):
        free(4).parameters(notched.gains(notched.parameters(notched.rule_of_thumb(4 * F_I))))
    with pytest.raises(DimensionError, match="no columns"):
        RigidBodyStateSpace(A=np.zeros((1, 0, 0)), B=np.zeros((1, 0, 2)), C=np.zeros((1, 0)))
    with pytest.raises(DimensionError, match="B has shape"):
        RigidBodyStateSpace(A=turned.A, B=turned.B[:, :1], C=turned.C)
