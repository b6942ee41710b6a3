"""The induced L2 norm: frozen norms, published values, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError, SynthesisError
from lpvhinf.lpv import lpvnorm, monomials
from lpvhinf.lpv.bounded_real import frozen_norm
from lpvhinf.statespace.lpv import LPVStateSpace

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "anchors" / "lpv"
anchors = pytest.mark.skipif(not FOLDER.exists(), reason=f"the published cases are not in {FOLDER}: skipped")


def swapped_gains(delta: float) -> Any:
    """delta G - G delta with G = 1 / (s + 1): zero at every frozen delta (Peni and Seiler)."""
    return control.ss(-np.eye(2), [[1.0], [delta]], [[delta, -1.0]], [[0.0]])


def cubic(p: Array) -> tuple[list[float], list[list[float]]]:
    x = float(p[0])
    return [1.0, x, x**2, x**3], [[0.0], [1.0], [2 * x], [3 * x**2]]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_one_system_has_its_hinf_norm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(5, 5))
    A -= (np.max(np.linalg.eigvals(A).real) + 0.2) * np.eye(5)
    system = control.ss(A, rng.normal(size=(5, 2)), rng.normal(size=(2, 5)), 0.1 * rng.normal(size=(2, 2)))
    norm = frozen_norm(system.A, system.B, system.C, system.D)
    assert norm == pytest.approx(control.linfnorm(system)[0], rel=1e-6)
    for form in ("primal", "dual"):
        result = lpvnorm([system], [[0.0]], form=form)
        assert norm * (1 - 1e-9) <= result.gamma <= norm * (1 + 1e-4)
        assert result.lmi_margin > 0.0
        assert np.linalg.eigvalsh(result.lyapunov([0.0]))[0] > 0.0


def test_gain_does_not_depend_on_units() -> None:
    """Of time, of states and of the output."""
    points = np.linspace(-1.0, 1.0, 4)
    systems = [swapped_gains(p) for p in points]
    T = np.diag([1e-4, 1e3])
    scaled = [
        control.ss(50.0 * T @ s.A @ np.linalg.inv(T), 50.0 * T @ s.B, 1e3 * s.C @ np.linalg.inv(T), 1e3 * s.D)
        for s in systems
    ]
    plain = lpvnorm(systems, points, basis=cubic, rate=[[-1.0, 1.0]])
    other = lpvnorm(scaled, points, basis=cubic, rate=[[-50.0, 50.0]])
    assert other.gamma == pytest.approx(1e3 * plain.gamma, rel=1e-4)


def test_slow_parameters_are_better_and_any_speed_is_worst() -> None:
    points = np.linspace(-1.0, 1.0, 5)
    systems = [swapped_gains(p) for p in points]
    gains = [lpvnorm(systems, points, basis=cubic, rate=[[-v, v]]).gamma for v in (0.1, 1.0, 10.0)]
    common = lpvnorm(systems, points, basis=cubic)
    assert gains[0] < gains[1] < gains[2] < common.gamma * (1 + 1e-6)
    assert "any speed" in common.status


def test_the_own_lyapunov_matrix_is_a_candidate() -> None:
    points = np.linspace(-1.0, 1.0, 5)
    systems = [swapped_gains(p) for p in points]
    result = lpvnorm(systems, points, basis=cubic, rate=[[-1.0, 1.0]])
    again = lpvnorm(systems, points, rate=[[-1.0, 1.0]], candidate=result.candidate)
    assert again.gamma == pytest.approx(result.gamma, rel=1e-9)
    # the inequality, written out: d(x'Xx)/dt < gamma |w|^2 - |z|^2 / gamma
    X, slope = result.candidate([0.3])
    s, g = swapped_gains(0.3), 1.05 * result.gamma
    Z = np.block(
        [
            [s.A.T @ X + X @ s.A + slope[0], X @ s.B, s.C.T],
            [s.B.T @ X, -g * np.eye(1), np.zeros((1, 1))],
            [s.C, np.zeros((1, 1)), -g * np.eye(1)],
        ]
    )
    assert np.linalg.eigvalsh(Z)[-1] < 0.0
    wrong = lpvnorm(systems, points, rate=[[-1.0, 1.0]], candidate=lambda p: (1e-3 * X, 0.0 * slope))
    assert wrong.gamma > result.gamma
    with pytest.raises(DomainError, match="rate is left out"):
        lpvnorm(systems, points, candidate=result.candidate)


@anchors
def test_published_delta_case() -> None:
    data = json.loads((FOLDER / "peni_seiler_delta.json").read_text("utf-8"))
    points = np.array(data["parameter"]["delta"])
    systems = [swapped_gains(p) for p in points]
    verified = data["verified"]
    assert lpvnorm(systems, points).gamma == pytest.approx(verified["unbounded"], rel=3e-3)
    for rate, gamma in verified["rate"].items():
        v = float(rate)
        result = lpvnorm(systems, points, basis=cubic, rate=[[-v, v]])
        assert result.gamma == pytest.approx(gamma, rel=3e-3)
        assert result.lmi_margin > 0.0


def gain_scheduled_loop(p: float, delta: float) -> Any:
    """A PI controller scheduled on p around a lag and a Pade delay, from reference to error (Tan 1997)."""
    tau, K = np.sqrt(133.6 - 16.8 * p), np.sqrt(4.8 * p - 8.6)
    kp, ki = (2 * 0.7 * 0.25 * tau - 1) / K, 0.25**2 * tau / K
    delay = control.ss(control.tf([0.5**2 / 12, -0.25, 1.0], [0.5**2 / 12, 0.25, 1.0]))
    a, b, c, d = delay.A, delay.B, delay.C, float(delay.D[0, 0])
    e, u, direct = np.array([-K, 0.0, 0.0, 0.0]), np.array([-kp * K, 0.0, 0.0, 1.0]), kp
    A = np.zeros((4, 4))
    A[0, 0], A[0, 1:3] = -1 / tau, c[0] / tau
    A[0] += d * (1 + delta) * u / tau
    A[1:3, 1:3] = a
    A[1:3] += (1 + delta) * b @ u[None]
    A[3] = ki * e
    B = np.vstack([[[d * (1 + delta) * direct / tau]], (1 + delta) * b * direct, [[ki]]])
    return control.ss(A, B, e[None], [[1.0]])


@anchors
@pytest.mark.parametrize(("n_b", "key"), [(1, "no_rate"), (2, "rate01_b2"), (3, "rate01_b3"), (5, "rate01_b5")])
def test_published_worst_case_gain(n_b: int, key: str) -> None:
    gamma = json.loads((FOLDER / "wcgain_pi_delay.json").read_text("utf-8"))["verified"]["Delta_01_" + key]

    def basis(p: Array) -> tuple[list[float], list[list[float]]]:
        x = float(p[0])
        return [1.0, x, x**2, 1 / x, x**0.5][:n_b], [[0.0], [1.0], [2 * x], [-1 / x**2], [0.5 / x**0.5]][:n_b]

    points = np.arange(2.0, 8.0)
    systems = [gain_scheduled_loop(p, 0.1) for p in points]
    result = lpvnorm(systems, points, basis=basis, rate=None if n_b == 1 else [[-0.1, 0.1]])
    assert result.gamma == pytest.approx(gamma, rel=3e-3)


def test_a_polynomial_system_is_sampled() -> None:
    G = LPVStateSpace.from_coefficients(
        [[[-2.0]], [[0.5]]], [[1.0]], [[[1.0]], [[0.3]]], [[0.0]], box=[[-1.0, 1.0]], basis="power"
    )
    points = [[-1.0], [0.0], [1.0]]
    listed = lpvnorm([G.at(p) for p in points], points)
    assert lpvnorm(G, points).gamma == pytest.approx(listed.gamma, rel=1e-9)
    assert listed.gamma >= max(frozen_norm(*[m.at(p) for m in G.matrices]) for p in points)


def test_unstable_and_infeasible_have_no_level() -> None:
    stable, unstable = (control.ss([[a]], [[1.0]], [[1.0]], [[0.0]]) for a in (-1.0, 0.5))
    result = lpvnorm([stable, unstable], [[0.0], [1.0]])
    assert result.gamma == np.inf
    assert "p = [1.0] is not Hurwitz" in result.status
    with pytest.raises(SynthesisError, match="not Hurwitz"):
        result.lyapunov([0.0])
    # each Hurwitz, no common Lyapunov matrix: x can be made to grow by switching
    hard = [control.ss(A, np.eye(2), np.eye(2), np.zeros((2, 2))) for A in ([[-1, 30], [-1, -1]], [[-1, 1], [-30, -1]])]
    assert lpvnorm(hard, [[0.0], [1.0]]).gamma == np.inf


def test_bad_input() -> None:
    systems = [swapped_gains(p) for p in (-1.0, 0.0, 1.0)]
    points = [[-1.0], [0.0], [1.0]]
    with pytest.raises(DomainError, match="rate box is empty"):
        lpvnorm(systems, points, rate=[[1.0, -1.0]])
    with pytest.raises(DimensionError, match=r"points has shape \(2, 1\)"):
        lpvnorm(systems, points[:2])
    with pytest.raises(DomainError, match="1 repeated"):
        lpvnorm(systems, [[0.0], [0.0], [1.0]])
    with pytest.raises(AssumptionError, match="no constant term"):
        lpvnorm(systems, points, basis=lambda p: ([p[0]], [[1.0]]), rate=[[-1.0, 1.0]])
    with pytest.raises(AssumptionError, match=r"gradient of basis function 1"):
        lpvnorm(systems, points, basis=lambda p: ([1.0, p[0]], [[0.0], [2.0]]), rate=[[-1.0, 1.0]])
    with pytest.raises(DomainError, match="sampling time"):
        lpvnorm([control.ss(0.5, 1.0, 1.0, 0.0, 0.1)], [[0.0]])
    with pytest.raises(DimensionError, match=r"systems\[1\]"):
        lpvnorm([systems[0], control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])], [[0.0], [1.0]])
    with pytest.raises(DomainError, match="form is 'both'"):
        lpvnorm(systems, points, form="both")


def test_monomials_have_their_gradients() -> None:
    basis = monomials(3, box=[[0.0, 1.0], [2.0, 5.0]])
    p, h = np.array([0.3, 4.1]), 1e-6
    values, gradient = basis(p)
    assert len(np.asarray(values)) == 10
    assert np.asarray(values)[0] == 1.0
    for axis in range(2):
        step = h * np.eye(2)[axis]
        measured = (np.asarray(basis(p + step)[0]) - np.asarray(basis(p - step)[0])) / (2 * h)
        assert np.allclose(np.asarray(gradient)[:, axis], measured, atol=1e-8)
