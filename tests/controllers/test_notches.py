"""Guards the notches of K_RB: their formula, a start that does nothing, the derivative, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.controllers import RigidBodyGains, RigidBodyStateSpace, RigidBodyStructure
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct import check_structure

F_I = np.array([10.0, 12.5])
UNIT = (2 * np.pi * 4 * F_I) ** 2
OMEGA = 2 * np.pi * np.array([0.3, 5.0, 40.0, 139.0, 140.0, 3000.0])
FIVE = {"gain": [3.0, 4.0], "f_i": [1.0, 2.0], "f_d": [5.0, 6.0], "f_lp": [90.0, 80.0], "zeta_lp": [0.7, 0.6]}
TWO = {"f_n": [[140.0, 200.0], [60.0, 90.0]], "zeta_num": [[0.01, 0.2], [0.3, 0.4]], "zeta_den": [[0.5, 0.6], [0.1, 1]]}


def notched(n_notches: int = 2) -> RigidBodyStructure:
    return RigidBodyStructure(F_I, UNIT, n_notches, np.array([140.0, 210.0, 260.0])[:n_notches])


def given(**values: object) -> RigidBodyGains:
    return RigidBodyGains(**{name: np.asarray(value) for name, value in {**FIVE, **values}.items()})


def response(structure: RigidBodyStructure, theta: Array) -> Array:
    """K (n_omega, n_rb, n_rb) in physical units, with x_I' = 2 pi f_I e closed by hand."""
    A, B, C, D = structure.realize(theta)
    assert A.shape == (structure.n_x, structure.n_x)
    assert not np.any(D)  # strictly proper
    out = []
    for s in 1j * OMEGA:
        integrals = np.vstack([np.eye(2), np.diag(2 * np.pi * F_I / s)])
        out.append(UNIT[:, None] * (C @ np.linalg.solve(s * np.eye(len(A)) - A, B @ integrals)))
    return np.array(out)


def test_the_response_is_the_formula() -> None:
    gains = given(**TWO)
    assert gains.n_notches == 2
    for k, s in enumerate(1j * OMEGA):
        for i in range(2):
            wanted = given().response(OMEGA)[k, i]
            for f, num, den in zip(gains.f_n[i], gains.zeta_num[i], gains.zeta_den[i], strict=True):
                w = 2 * np.pi * f
                wanted *= (s**2 + 2 * num * w * s + w**2) / (s**2 + 2 * den * w * s + w**2)
            assert gains.response(OMEGA)[k, i] == pytest.approx(wanted, rel=1e-12)


def test_the_realization_has_that_response() -> None:
    structure = notched()
    found, wanted = response(structure, structure.parameters(given(**TWO))), given(**TWO).response(OMEGA)
    for i in range(2):
        assert np.allclose(found[:, i, i], wanted[:, i], rtol=1e-10, atol=0.0)
        assert not np.any(found[:, i, 1 - i])
    depth = np.abs(wanted / given().response(OMEGA))
    assert depth[4, 0] < 0.025  # a deep one at 140 Hz


@pytest.mark.parametrize("n_notches", [1, 2, 3])
def test_a_neutral_start_does_nothing(n_notches: int) -> None:
    structure, plain = notched(n_notches), RigidBodyStructure(F_I, UNIT)
    theta = structure.parameters(structure.rule_of_thumb(4 * F_I))
    found, without = response(structure, theta), response(plain, plain.parameters(plain.rule_of_thumb(4 * F_I)))
    assert np.allclose(found, without, rtol=1e-12, atol=0.0)
    gains = structure.gains(theta)
    assert np.array_equal(gains.zeta_num, gains.zeta_den)
    assert np.allclose(gains.f_n, structure.f_notches, rtol=1e-14)


@pytest.mark.parametrize("n_notches", [1, 2, 3])
def test_derivative_against_differences(n_notches: int) -> None:
    structure = notched(n_notches)
    assert check_structure(structure, structure.initial(np.random.default_rng(n_notches)), seed=n_notches) < 1e-8


def test_parameters_round_trip_and_notches_are_added() -> None:
    structure = notched()
    theta = structure.initial(np.random.default_rng(3))
    assert np.allclose(structure.parameters(structure.gains(theta)), theta, rtol=0.0, atol=1e-13)
    assert structure.n_parameters == len(structure.names) == len(theta) == 2 * 11
    assert structure.names[5:8] == ("K_RB[0].f_n[0]", "K_RB[0].zeta_num[0]", "K_RB[0].zeta_den[0]")
    assert structure.names[8] == "K_RB[0].f_n[1]"
    more = notched(3).gains(notched(3).parameters(structure.gains(theta)))
    assert np.allclose(more.f_n[:, :2], structure.gains(theta).f_n, rtol=1e-13)
    assert np.allclose(more.f_n[:, 2], 260.0, rtol=1e-13)


def test_frequencies_of_every_axis() -> None:
    assert RigidBodyStructure(F_I, UNIT, 2).f_notches.tolist() == [[80.0, 160.0], [100.0, 200.0]]
    assert notched().f_notches.tolist() == [[140.0, 210.0], [140.0, 210.0]]
    assert RigidBodyStructure(F_I, UNIT, 1, [[140.0], [150.0]]).f_notches.tolist() == [[140.0], [150.0]]


def test_names_and_tables() -> None:
    assert list(given().arrays()) == list(FIVE)
    assert list(given(**TWO).arrays()) == [*FIVE, *TWO]
    assert len(given().table(["z", "rx"])) == 3
    assert given(**TWO).table(["z", "rx"])[4] == "  z      140.0 (0.010 / 0.500), 200.0 (0.200 / 0.600)"


@pytest.mark.parametrize("name", TWO)
def test_invalid_gains(name: str) -> None:
    for wrong in ([[1.0, 0.0], [1.0, 1.0]], [[1.0, -1.0], [1.0, 1.0]], [[1.0, np.nan], [1.0, 1.0]]):
        with pytest.raises(DomainError, match=name):
            given(**{**TWO, name: wrong})
    with pytest.raises(DimensionError):
        given(**{**TWO, name: np.ones((2, 3))})
    with pytest.raises(DimensionError):
        given(**{key: value for key, value in TWO.items() if key != name})


def test_invalid_structures() -> None:
    for wrong in (-1, 1.5, True):
        with pytest.raises(DomainError, match="n_notches"):
            RigidBodyStructure(F_I, UNIT, wrong)  # type: ignore[arg-type]
    with pytest.raises(DimensionError, match="f_notches"):
        RigidBodyStructure(F_I, UNIT, 2, [100.0])
    with pytest.raises(DomainError, match="f_notches"):
        RigidBodyStructure(F_I, UNIT, 1, [0.0])
    with pytest.raises(DomainError, match=r"2 notches an axis, wanted at most 1\. Raise n_notches"):
        notched(1).parameters(given(**TWO))
    free = RigidBodyStateSpace(A=-np.ones((2, 1, 1)), B=np.ones((2, 1, 2)), C=np.ones((2, 1)))
    with pytest.raises(DomainError, match="free order 1, wanted a PID"):
        notched().parameters(free)
