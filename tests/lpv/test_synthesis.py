"""Gridded output-feedback and state-feedback synthesis: published cases, other methods, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError, SynthesisError
from lpvhinf.lpv import lpvnorm, lpvsyn, lpvsyn_statefeedback, monomials
from lpvhinf.lpv.bounded_real import frozen_norm
from lpvhinf.statespace.generalized import NAMES, GeneralizedPlant
from tests.lpv.small_plants import cosines, moving_mode, random_plant

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "anchors" / "lpv"
anchors = pytest.mark.skipif(not FOLDER.exists(), reason=f"the published cases are not in {FOLDER}: skipped")

BOX = [[-1.0, 1.0]]
GRID = np.linspace(-1.0, 1.0, 5)[:, None]
SLOW = [[-0.1, 0.1]]


def published(name: str, key: str) -> list[GeneralizedPlant]:
    data = json.loads((FOLDER / f"{name}.json").read_text("utf-8"))
    return [GeneralizedPlant(*[plant[m] for m in NAMES[:-1]]) for plant in data[key]]


def rotation() -> tuple[list[GeneralizedPlant], Array]:
    data = json.loads((FOLDER / "wu1996_rotation.json").read_text("utf-8"))
    return published("wu1996_rotation", "generalized_plant_at_grid"), np.array(data["parameter"]["grid"])[:, None]


def check(result: Any, infimum: float, factor: float = 1.02) -> None:
    """Between the infimum and `factor` times it, with a controller that keeps the level."""
    assert infimum <= result.gamma <= factor * infimum
    assert result.gamma_lower <= result.gamma
    assert infimum <= result.gamma_achieved <= 1.02 * result.gamma
    assert np.max(result.frozen_norms) <= result.gamma_achieved
    assert np.max(result.frozen_norms_between, initial=0.0) <= 1.005 * result.gamma_achieved
    assert result.lmi_margin > 0.0


@anchors
@pytest.mark.parametrize(
    ("rate", "constant", "infimum", "largest"),
    [(5.0, "S", 0.905246, 0.9150), (5.0, "none", 0.905246, 0.9150), (0.0, "S", 0.798285, 0.8065)],
)
def test_rotation_plant(rate: float, constant: str, infimum: float, largest: float) -> None:
    """Wu, Yang, Packard and Becker (1996)."""
    plants, points = rotation()
    result = lpvsyn(plants, points, basis=cosines, rate=[[-rate, rate]], constant=constant)
    check(result, infimum)
    assert result.gamma <= largest
    assert result.fastest_pole < 1e4  # the plant's own fastest pole is at 1e3
    assert result.between == "combination of functions"
    assert result.controller.needs_rate == (constant == "none")
    loops = [control.ss(*P.close(*result.controller.matrices(p))) for P, p in zip(plants, points, strict=True)]
    if constant == "S":
        norm = lpvnorm(loops, points, rate=[[-rate, rate]], candidate=result.candidate)
        assert norm.gamma == pytest.approx(result.gamma_achieved, rel=1e-6)


@anchors
def test_rotation_plant_needs_a_varying_r() -> None:
    plants, points = rotation()
    with pytest.raises(SynthesisError, match="infeasible") as caught:
        lpvsyn(plants, points, basis=cosines, rate=[[-5.0, 5.0]], constant="R")
    assert caught.value.result.status == "infeasible"
    assert caught.value.result.certificate.value < 0.0


@anchors
def test_tutorial_with_constant_matrices() -> None:
    result = lpvsyn(published("lft_tutorial_first_order", "vertices"), [[1.0], [10.0]])
    check(result, 1.787676, 1.001)
    assert result.constant == "both"


@pytest.mark.parametrize(("seed", "direct"), [(0, 0.0), (2, 1.0), (1, 3.0)])
def test_one_point_reaches_the_hinf_optimum(seed: int, direct: float) -> None:
    plant = random_plant(seed, 6, direct)
    result = lpvsyn([plant], [[0.0]])
    K = result.controller.at([0.0])
    assert frozen_norm(*plant.close(K.A, K.B, K.C, K.D)) == pytest.approx(result.frozen_norms[0], rel=1e-8)
    assert result.gamma_lower * (1 - 1e-9) <= result.gamma <= result.gamma_lower * 1.01
    if direct < 2.0:  # hinfsyn itself fails with large D11
        assert result.gamma == pytest.approx(control.hinfsyn(plant.to_control(), 2, 2)[2], rel=1e-3)
    else:
        assert np.linalg.norm(K.D) > 0.0
    check(result, result.gamma_lower)


def test_freedom_helps_and_speed_hurts() -> None:
    basis = monomials(2, box=BOX)

    def gamma(**options: Any) -> float:
        result = lpvsyn(moving_mode, GRID, **options)
        check(result, result.gamma_lower)
        return result.gamma

    constant, slow = gamma(), gamma(basis=basis, rate=SLOW)
    assert gamma(basis=basis, rate=SLOW, constant="none") <= slow * 1.0001 < constant
    assert slow <= gamma(basis=basis, rate=[[-5.0, 5.0]]) * 1.0001
    # at any speed only constant matrices are left
    assert gamma(basis=basis) == pytest.approx(constant, rel=1e-6)


def test_controller_is_continuous_and_its_fit_is_measured() -> None:
    result = lpvsyn(moving_mode, GRID, basis=monomials(2, box=BOX), rate=SLOW)
    assert result.constant == "R"  # auto tried both
    values = [np.concatenate([m.ravel() for m in result.controller.matrices([p])]) for p in np.linspace(0, 1e-2, 3)]
    step, half = np.linalg.norm(values[2] - values[0]), np.linalg.norm(values[1] - values[0])
    assert half == pytest.approx(0.5 * step, rel=0.05)
    coarse, fine = result.to_lpv(4), result.to_lpv(10)
    assert fine.fit_error < 0.05 * coarse.fit_error
    K, exact = fine.at([0.37]), result.controller.at([0.37])
    assert np.all(np.abs(K.A - exact.A) <= 2 * fine.fit_errors["A"] + 1e-9 * np.abs(exact.A).max())
    loops = [control.ss(*moving_mode(p).close(*[m.at(p) for m in fine.matrices])) for p in GRID]
    assert lpvnorm(loops, GRID, rate=SLOW, candidate=result.candidate).gamma <= 1.01 * result.gamma_achieved


def test_time_and_states_in_other_units() -> None:
    T = np.diag([1.0, 1e3, 1e-4, 1.0])

    def other(p: Array) -> GeneralizedPlant:
        P, w, inv = moving_mode(p), 300.0, np.linalg.inv(T)
        return GeneralizedPlant(w * T @ P.A @ inv, w * T @ P.B1, w * T @ P.B2, P.C1 @ inv, P.C2 @ inv, *P_rest(P))

    def P_rest(P: GeneralizedPlant) -> tuple[Array, Array, Array]:
        return P.D11, P.D12, P.D21

    basis = monomials(1, box=BOX)
    plain = lpvsyn(moving_mode, GRID, basis=basis, rate=SLOW, constant="R")
    scaled = lpvsyn(other, GRID, basis=basis, rate=[[-30.0, 30.0]], constant="R")
    assert scaled.gamma == pytest.approx(plain.gamma, rel=1e-3)
    check(scaled, scaled.gamma_lower)


def test_poles_are_bounded_on_request() -> None:
    free = lpvsyn(moving_mode, GRID)
    bound = 0.5 * free.fastest_pole
    slower = lpvsyn(moving_mode, GRID, max_pole=bound)
    assert slower.fastest_pole <= bound
    assert slower.level > free.level
    assert "back-off grew" in slower.status
    with pytest.raises(SynthesisError, match="fastest pole"):
        lpvsyn(moving_mode, GRID, max_pole=1e-3)


def test_level_on_request() -> None:
    best = lpvsyn(moving_mode, GRID)
    asked = lpvsyn(moving_mode, GRID, gamma=1.3 * best.gamma)
    assert asked.level == 1.3 * best.gamma
    assert asked.gamma_achieved <= 1.3 * best.gamma * 1.005
    alone = max(lpvsyn([moving_mode(p)], p[None, :]).gamma_lower for p in GRID)
    with pytest.raises(AssumptionError, match=r"lower bound of the plant at p = .*too small by .*, or 100") as caught:
        lpvsyn(moving_mode, GRID, gamma=0.5 * alone)
    assert "alone" in str(caught.value)
    with pytest.raises(SynthesisError, match="each point alone allows"):
        lpvsyn(moving_mode, GRID, gamma=0.5 * (alone + best.gamma))


def test_clarabel_agrees() -> None:
    options: dict[str, Any] = {"basis": monomials(1, box=BOX), "rate": SLOW, "constant": "R", "r_max": 1e4}
    ours = lpvsyn(moving_mode, GRID, **options)
    theirs = lpvsyn(moving_mode, GRID, solver="clarabel", gap=1e-4, **options)
    assert theirs.gamma == pytest.approx(ours.gamma, rel=2e-3)


def test_state_feedback() -> None:
    """It is at least as good as output feedback, and its gain reaches the level."""
    basis = monomials(1, box=BOX)
    result = lpvsyn_statefeedback(moving_mode, GRID, basis=basis, rate=SLOW)
    output = lpvsyn(moving_mode, GRID, basis=basis, rate=SLOW, constant="none")
    assert result.gamma <= output.gamma * 1.0001
    check(result, result.gamma_lower)
    F = result.controller.at([0.2])
    assert F.nstates == 0
    P = moving_mode(np.array([0.2]))
    loop = P.A + P.B2 @ F.D, P.B1, P.C1 + P.D12 @ F.D, P.D11
    assert frozen_norm(*loop) <= result.gamma_achieved * 1.005
    R, S = result.lyapunov([0.2])
    assert np.allclose(R @ S, np.eye(4), atol=1e-6)


def test_plants_at_points_only_are_taken_as_piecewise_linear() -> None:
    def curved(p: Array) -> GeneralizedPlant:
        P = moving_mode(p)
        return GeneralizedPlant(
            P.A - 0.3 * (1.0 + np.sin(3.0 * float(p[0]))) * np.eye(4), P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21
        )

    result = lpvsyn([curved(p) for p in GRID], GRID)
    assert result.between == "piecewise linear"
    K = result.controller
    assert np.allclose(K.matrices([0.499999])[0], K.matrices([0.500001])[0], rtol=1e-3)
    with pytest.raises(DomainError, match="outside the box of the grid"):
        K.at([1.1])


def test_scattered_grid_of_two_axes() -> None:
    def plant(p: Array) -> GeneralizedPlant:
        P = moving_mode(p[:1])
        return GeneralizedPlant(P.A - 0.2 * p[1] * np.eye(4), P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21)

    corners = np.array([[x, y] for x in (-1.0, 1.0) for y in (0.0, 2.0)])
    points = np.vstack([corners, [[0.1, 0.7], [-0.4, 1.5]]])
    basis = monomials(1, box=[[-1.0, 1.0], [0.0, 2.0]])
    result = lpvsyn([plant(p) for p in points], points, basis=basis, rate=[[-0.1, 0.1], [-0.2, 0.2]], constant="R")
    check(result, result.gamma_lower)
    assert result.between == "combination of functions"
    assert result.to_lpv(3).box.tolist() == [[-1.0, 1.0], [0.0, 2.0]]


def test_bad_input() -> None:
    plants = [moving_mode(p) for p in GRID]
    basis = monomials(1, box=BOX)

    def changed(P: GeneralizedPlant, **parts: Array) -> GeneralizedPlant:
        return GeneralizedPlant(*[parts.get(name, getattr(P, name)) for name in NAMES])

    lost = changed(plants[1], A=plants[1].A + np.eye(4), B2=np.array([[0.0], [1.0], [0.0], [0.0]]))
    with pytest.raises(AssumptionError, match=r"p = \(-0\.5\) is not stabilisable"):
        lpvsyn([plants[0], lost, *plants[2:]], GRID)
    with pytest.raises(AssumptionError, match=r"p = \(-0\.5\) is not stabilisable"):
        lpvsyn_statefeedback([plants[0], lost, *plants[2:]], GRID)
    with pytest.raises(AssumptionError, match=r"D22 at p = \[-1.0\] is not zero"):
        lpvsyn([changed(plants[0], D22=np.ones((1, 1))), *plants[1:]], GRID)
    with pytest.raises(AssumptionError, match=r"D12 at p = .*add a small weight"):
        lpvsyn([changed(P, D12=np.zeros((2, 1))) for P in plants], GRID)
    with pytest.raises(AssumptionError, match=r"D21 at p = .*add a small noise"):
        lpvsyn([changed(P, D21=np.zeros((1, 2))) for P in plants], GRID)
    with pytest.raises(AssumptionError, match="the grid does not span the box"):
        lpvsyn(plants, GRID, box=[[-1.0, 1.5]])
    with pytest.raises(AssumptionError, match="no constant term"):
        lpvsyn(plants, GRID, basis=lambda p: ([p[0]], [[1.0]]), rate=SLOW)
    with pytest.raises(DomainError, match="rate box is empty"):
        lpvsyn(plants, GRID, basis=basis, rate=[[0.1, -0.1]])
    with pytest.raises(DimensionError, match=r"rate has shape \(2, 2\)"):
        lpvsyn(plants, GRID, basis=basis, rate=[[-1, 1], [-1, 1]])
    with pytest.raises(DimensionError, match=r"points has shape \(4, 1\)"):
        lpvsyn(plants, GRID[:4])
    with pytest.raises(DomainError, match=r"backoff is 0.9"):
        lpvsyn(plants, GRID, backoff=0.9)
    with pytest.raises(DomainError, match="constant is 'T'"):
        lpvsyn(plants, GRID, constant="T")
    with pytest.raises(DomainError, match="solver is 'sdpt3'"):
        lpvsyn(plants, GRID, solver="sdpt3")
    with pytest.raises(DomainError, match=r"plants\[0\] is StateSpace.*from_control"):
        lpvsyn([P.to_control() for P in plants], GRID)
    both = lpvsyn(plants, GRID, basis=basis, rate=SLOW, constant="none")
    with pytest.raises(AssumptionError, match="depends on dp/dt"):
        both.to_lpv(3)
    assert not np.allclose(both.controller.at([0.3], [0.1]).A, both.controller.at([0.3], [-0.1]).A)
