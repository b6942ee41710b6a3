"""Guards K_RB: its realization with the integrator outside, its derivative, and its readable parameters."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.controllers import RigidBodyGains, RigidBodyStructure
from lpvhinf.controllers.rigid_body import N_PARAMETERS
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct import ControllerStructure, check_structure

F_I = np.array([10.0, 12.5, 5.0])
UNIT = (2 * np.pi * 4 * F_I) ** 2
OMEGA = 2 * np.pi * np.array([0.3, 5.0, 40.0, 200.0, 3000.0])


def structure() -> RigidBodyStructure:
    return RigidBodyStructure(F_I, UNIT)


def random_theta(seed: int = 0) -> Array:
    return structure().initial(np.random.default_rng(seed))


def test_realization_and_integrator_are_the_formula() -> None:
    """u = K (e, x_I) with x_I' = 2 pi f_I e closed by hand, against the transfer functions of the docstring."""
    theta = random_theta()
    A, B, C, D = structure().realize(theta)
    gains = structure().gains(theta)
    response = gains.response(OMEGA)
    for k, omega in enumerate(OMEGA):
        s = 1j * omega
        integrals = np.vstack([np.eye(3), np.diag(2 * np.pi * F_I / s)])  # (e, x_I) per unit of e
        K = (C @ np.linalg.solve(s * np.eye(6) - A, B) + D) @ integrals
        assert np.allclose(
            K * UNIT[:, None], np.diag(response[k]), rtol=1e-11, atol=1e-11 * np.max(np.abs(response[k]))
        )
        for i in range(3):
            w_lp = 2 * np.pi * gains.f_lp[i]
            formula = (
                gains.gain[i]
                * (1 + 2 * np.pi * gains.f_i[i] / s)
                * (1 + s / (2 * np.pi * gains.f_d[i]))
                / (s**2 / w_lp**2 + 2 * gains.zeta_lp[i] * s / w_lp + 1)
            )
            assert response[k, i] == pytest.approx(formula, rel=1e-13)


def test_strictly_proper() -> None:
    assert not np.any(structure().realize(random_theta())[3])


@pytest.mark.parametrize("seed", range(4))
def test_derivative_against_differences(seed: int) -> None:
    assert check_structure(structure(), random_theta(seed), seed=seed) < 1e-8


def test_a_wrong_derivative_is_found() -> None:
    class Wrong(RigidBodyStructure):
        def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
            g = super().pullback(theta, GA, GB, GC, GD)
            g[4] *= -1.0
            return g

    with pytest.raises(AssumptionError, match=r"pullback\[4\]"):
        check_structure(Wrong(F_I, UNIT), random_theta())


def test_parameters_round_trip() -> None:
    theta = random_theta(5)
    again = structure().parameters(structure().gains(theta))
    assert np.allclose(again, theta, rtol=0, atol=1e-13)
    gains = structure().gains(theta)
    assert gains.gain[1] == pytest.approx(np.exp(theta[N_PARAMETERS]) * UNIT[1], rel=1e-14)
    assert gains.f_lp[2] == pytest.approx(np.exp(theta[2 * N_PARAMETERS + 3]), rel=1e-14)


def test_it_is_a_structure_for_the_solver() -> None:
    K = structure()
    assert isinstance(K, ControllerStructure)
    assert (K.n_u, K.n_y, K.n_x, K.n_parameters) == (3, 6, 6, 15)
    assert K.names[6] == "K_RB[1].f_i"
    assert len(K.names) == K.n_parameters
    assert not np.array_equal(random_theta(0), random_theta(1))
    assert np.array_equal(random_theta(1), random_theta(1))


def test_rule_of_thumb_has_its_crossover_at_the_bandwidth() -> None:
    f_bw = np.array([40.0, 55.0, 20.0])
    gains = structure().rule_of_thumb(f_bw)
    w = 2 * np.pi * f_bw
    loop = np.diagonal(gains.response(w)) / (1j * w) ** 2
    assert np.allclose(np.abs(loop), 1.0, rtol=1e-12)
    margin = 180.0 + np.degrees(np.angle(loop))
    assert np.all((margin > 30.0) & (margin < 60.0))


def test_stiffness() -> None:
    gains = structure().gains(random_theta())
    assert np.allclose(gains.stiffness([8.0, 2.0, 1.0]), gains.gain * [8.0, 2.0, 1.0], rtol=1e-15)
    # far below the differentiator and above the integrator the controller is that spring
    slow = RigidBodyGains(
        gain=np.array([3.0]),
        f_i=np.array([1e-6]),
        f_d=np.array([1e6]),
        f_lp=np.array([1e6]),
        zeta_lp=np.array([0.7]),
    )
    assert slow.response([2 * np.pi])[0, 0] * 2.0 == pytest.approx(slow.stiffness(2.0)[0], rel=1e-5)


@pytest.mark.parametrize("name", ["gain", "f_i", "f_d", "f_lp", "zeta_lp"])
def test_invalid_gains(name: str) -> None:
    parts = {key: np.ones(2) for key in ("gain", "f_i", "f_d", "f_lp", "zeta_lp")}
    for wrong in (np.array([1.0, 0.0]), np.array([1.0, -2.0]), np.array([1.0, np.nan])):
        with pytest.raises(DomainError, match=name):
            RigidBodyGains(**{**parts, name: wrong})
    with pytest.raises(DimensionError):
        RigidBodyGains(**{**parts, name: np.ones(3)})


def test_invalid_structures() -> None:
    with pytest.raises(DimensionError, match="gain_unit"):
        RigidBodyStructure(F_I, UNIT[:2])
    with pytest.raises(DimensionError, match="f_bw"):
        structure().rule_of_thumb([40.0])
    with pytest.raises(DomainError, match="f_I"):
        RigidBodyStructure([10.0, 0.0], [1.0, 1.0])
    with pytest.raises(DomainError, match="gain_unit"):
        RigidBodyStructure([10.0, 1.0], [1.0, -1.0])
