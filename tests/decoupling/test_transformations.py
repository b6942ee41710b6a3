"""Guards T_y and T_u: one-sided inverses, weights, and refusal where they do not exist."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import input_decoupling, output_decoupling
from lpvhinf.errors import AssumptionError, DomainError


def gains(n: int, rows: int, cols: int) -> Array:
    return np.random.default_rng(0).standard_normal((n, rows, cols))


def test_output_decoupling_is_a_left_inverse() -> None:
    C = gains(5, 6, 3)
    T_y = output_decoupling(C)
    assert T_y.shape == (5, 3, 6)
    assert np.allclose(T_y @ C, np.eye(3), rtol=0, atol=1e-12)


def test_input_decoupling_is_a_right_inverse() -> None:
    B = gains(5, 3, 7)
    T_u = input_decoupling(B)
    assert T_u.shape == (5, 7, 3)
    assert np.allclose(B @ T_u, np.eye(3), rtol=0, atol=1e-12)
    assert np.allclose(T_u, np.linalg.pinv(B), rtol=0, atol=1e-12)


def test_weights_follow_the_formula() -> None:
    B, W = gains(4, 3, 7), np.random.default_rng(1).uniform(0.1, 2.0, (4, 7))
    W[:, 2] = 0.0
    T_u = input_decoupling(B, W)
    for b, w, t in zip(B, W, T_u, strict=True):
        assert np.allclose(t, np.diag(w) @ b.T @ np.linalg.inv(b @ np.diag(w) @ b.T), rtol=0, atol=1e-11)
    assert np.all(T_u[:, 2] == 0.0)
    assert np.allclose(B @ T_u, np.eye(3), rtol=0, atol=1e-11)


def test_units_of_the_modes_do_not_count() -> None:
    B = gains(2, 3, 7)
    unit = np.diag([1e-9, 1.0, 1e9])
    assert np.allclose(input_decoupling(unit @ B) @ unit, input_decoupling(B), rtol=0, atol=1e-12)
    C = np.swapaxes(B, 1, 2)
    assert np.allclose(unit @ output_decoupling(C @ unit), output_decoupling(C), rtol=0, atol=1e-12)


def test_a_sensor_that_sees_no_rigid_body_motion_does_no_harm() -> None:
    C = gains(2, 4, 3)
    C[:, 3] = 0.0  # a strain gauge
    assert np.allclose(output_decoupling(C)[:, :, 3], 0.0, rtol=0, atol=1e-14)


def test_too_few_actuators() -> None:
    with pytest.raises(AssumptionError, match=r"2 active actuators cannot drive 3 modes.*lower n_flex"):
        input_decoupling(gains(2, 3, 2))
    off = np.ones((2, 4))
    off[1, :2] = 0.0  # at one position only
    with pytest.raises(AssumptionError, match="2 active actuators"):
        input_decoupling(gains(2, 3, 4), off)


def test_messages_name_the_position() -> None:
    B, where = gains(2, 3, 7), np.array([[0.0, 0.0], [0.01, -0.02]])
    off = np.ones((2, 7))
    off[1, :5] = 0.0
    with pytest.raises(AssumptionError, match=r"2 active actuators .* at p = \[0.01, -0.02\]"):
        input_decoupling(B, off, positions=where)
    B[1, 2] = B[1, 0] - 2.0 * B[1, 1]
    with pytest.raises(AssumptionError, match=r"condition number \S+ at p = \[0.01, -0.02\], wanted below"):
        input_decoupling(B, positions=where)


def test_too_few_sensors() -> None:
    with pytest.raises(AssumptionError, match="2 sensors cannot tell 3 rigid-body modes apart"):
        output_decoupling(gains(2, 2, 3))


def test_dependent_actuators_and_sensors() -> None:
    B = gains(2, 3, 7)
    B[1, 2] = B[1, 0] - 2.0 * B[1, 1]
    with pytest.raises(AssumptionError, match="cannot drive 3 modes independently: condition number"):
        input_decoupling(B)
    with pytest.raises(AssumptionError, match="do not observe every rigid-body mode"):
        output_decoupling(np.swapaxes(B, 1, 2))
    B[1, 2] = 0.0
    with pytest.raises(AssumptionError, match="condition number inf"):
        input_decoupling(B)


def test_negative_weights() -> None:
    with pytest.raises(DomainError, match="wanted entries of at least 0"):
        input_decoupling(gains(1, 2, 3), np.array([[1.0, -1.0, 1.0]]))
