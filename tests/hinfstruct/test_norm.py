"""The exact norm against analytic values, and the level-set iteration against SLICOT."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.hinfstruct import norm as norm_module
from lpvhinf.hinfstruct import response as response_module
from lpvhinf.hinfstruct.peaks import find_peaks
from lpvhinf.hinfstruct.response import Response, largest_sigma


@pytest.fixture(params=["slycot", "own"])
def method(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """With SLICOT's proposal and without."""
    if request.param == "own":
        monkeypatch.setattr(norm_module, "slicot_peak", lambda *matrices: None)
    return str(request.param)


@pytest.mark.parametrize("zeta", [0.5, 0.1, 1e-2, 1e-3, 1e-5])
def test_second_order_resonance(zeta: float, method: str) -> None:
    result = hinf_norm([[0.0, 1.0], [-1.0, -2.0 * zeta]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    assert result.norm == pytest.approx(1.0 / (2.0 * zeta * np.sqrt(1.0 - zeta**2)), rel=1e-7)
    assert result.omega == pytest.approx(np.sqrt(1.0 - 2.0 * zeta**2), rel=1e-5)


def test_peak_at_zero_and_at_infinity(method: str) -> None:
    low = hinf_norm([[-2.0]], [[1.0]], [[6.0]], [[0.0]])
    assert (low.norm, low.omega) == (pytest.approx(3.0), pytest.approx(0.0, abs=1e-6))
    high = hinf_norm([[-2.0]], [[1.0]], [[-6.0]], [[4.0]])
    assert (high.norm, high.omega) == (pytest.approx(4.0), np.inf)


def test_static_and_zero_systems() -> None:
    assert hinf_norm(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[3.0, 4.0]]).norm == pytest.approx(5.0)
    assert hinf_norm([[-1.0]], [[0.0]], [[1.0]], [[0.0]]).norm == 0.0


def test_defective_poles(method: str) -> None:
    # 1 / (s + 1)^6 by a Jordan block: peak 1 at zero
    A = -np.eye(6) + np.diag(np.ones(5), 1)
    result = hinf_norm(A, np.eye(6)[:, 5:], np.eye(6)[:1], [[0.0]])
    assert result.norm == pytest.approx(1.0, rel=1e-8)


def test_not_hurwitz_is_infinite() -> None:
    assert hinf_norm([[0.0]], [[1.0]], [[1.0]], [[0.0]]).norm == np.inf
    assert hinf_norm([[1.0]], [[1.0]], [[1.0]], [[0.0]]).norm == np.inf


@pytest.mark.parametrize("seed", range(6))
def test_methods_agree_and_similarity_does_not_matter(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(seed)
    n = 12
    A = rng.standard_normal((n, n))
    A -= (np.max(np.linalg.eigvals(A).real) + 0.01) * np.eye(n)
    B, C, D = rng.standard_normal((n, 3)), rng.standard_normal((4, n)), rng.standard_normal((4, 3))
    reference = hinf_norm(A, B, C, D).norm
    S = np.diag(10.0 ** rng.uniform(-2, 2, n)) @ np.linalg.qr(rng.standard_normal((n, n)))[0]
    assert hinf_norm(np.linalg.solve(S, A @ S), np.linalg.solve(S, B), C @ S, D).norm == pytest.approx(
        reference, rel=1e-5
    )
    monkeypatch.setattr(norm_module, "slicot_peak", lambda *matrices: None)
    assert hinf_norm(A, B, C, D).norm == pytest.approx(reference, rel=1e-7)


def test_a_wrong_proposal_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(norm_module, "slicot_peak", lambda *matrices: (99.0, 0.3))
    result = hinf_norm([[0.0, 1.0], [-1.0, -0.02]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    assert result.norm == pytest.approx(50.0025, rel=1e-6)


def test_level_test_finds_what_a_grid_missed() -> None:
    A = np.array([[0.0, 1.0], [-1.0, -0.02]])
    B, C, D = np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))
    T = Response(A, B, C, D)
    found = norm_module.above_level(A, B, C, D, T, 40.0)
    assert found.size > 0
    assert np.all(largest_sigma(T.at(found)) > 40.0)
    assert norm_module.above_level(A, B, C, D, T, 51.0).size == 0
    assert norm_module.above_level(A, B, C, D + 60.0, T, 51.0).tolist() == [np.inf]


def test_schur_form_agrees_with_the_eigenbasis(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    A = rng.standard_normal((7, 7)) - 4.0 * np.eye(7)
    B, C, D = rng.standard_normal((7, 2)), rng.standard_normal((3, 7)), rng.standard_normal((3, 2))
    omega = np.array([0.0, 0.3, 2.0, 50.0, np.inf])
    by_eigenvectors = Response(A, B, C, D)
    monkeypatch.setattr(response_module, "EIGENVECTOR_LIMIT", 0.0)
    by_schur = Response(A, B, C, D)
    assert by_schur.left is None
    np.testing.assert_allclose(by_schur.at(omega), by_eigenvectors.at(omega), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(
        by_schur.derivative(omega[:4]), by_eigenvectors.derivative(omega[:4]), rtol=1e-9, atol=1e-12
    )


def test_peaks_of_many_light_modes() -> None:
    frequencies = np.geomspace(1.0, 300.0, 12)
    blocks = [np.array([[0.0, w], [-w, -2.0 * 0.004 * w]]) for w in frequencies]
    A = np.zeros((24, 24))
    for k, block in enumerate(blocks):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    T = Response(A, np.eye(24)[:, 1::2] * frequencies, np.eye(24)[::2], np.zeros((12, 12)))
    peaks = find_peaks(T, extra=np.zeros(0), fraction=0.7)
    # decoupled modes with equal peaks: each is found
    assert peaks.omega.size == 12
    np.testing.assert_allclose(np.sort(peaks.omega), frequencies * np.sqrt(1.0 - 2.0 * 0.004**2), rtol=1e-6)
    np.testing.assert_allclose(peaks.sigma, 1.0 / (2.0 * 0.004), rtol=1e-4)


@pytest.mark.parametrize("shape", [(1, 3), (2, 5), (5, 2), (4, 4)])
def test_largest_sigma(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    T = rng.standard_normal((6, *shape)) + 1j * rng.standard_normal((6, *shape))
    np.testing.assert_allclose(largest_sigma(T), np.linalg.svd(T, compute_uv=False)[:, 0], rtol=1e-12)
    assert np.all(largest_sigma(0.0 * T) == 0.0)


def test_bad_input() -> None:
    with pytest.raises(DimensionError, match="B has shape"):
        hinf_norm([[-1.0]], [[1.0], [2.0]], [[1.0]], [[0.0]])
    with pytest.raises(DomainError, match="finite"):
        hinf_norm([[np.nan]], [[1.0]], [[1.0]], [[0.0]])
