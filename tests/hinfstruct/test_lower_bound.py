"""The lower bound against published optima, another synthesis, and structured controllers of full order."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.hinfstruct import FixedOrder, hinf_norm, hinfstruct
from lpvhinf.hinfstruct.lower_bound import LowerBound, lower_bound
from lpvhinf.hinfstruct.region import Region
from lpvhinf.hinfstruct.riccati import ControlSide
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.hinfstruct.plants import first_order, random_plant
from tests.hinfstruct.test_compleib import FOLDER, load


def regular_plant(seed: int, n: int = 5) -> GeneralizedPlant:
    """An unstable plant with D12 and D21 of full rank; n_w, n_u, n_z, n_y = 4, 2, 4, 2."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A -= (np.max(np.linalg.eigvals(A).real) - 0.7) * np.eye(n)
    shapes = ((n, 4), (n, 2), (4, n), (2, n), (4, 4), (4, 2), (2, 4))
    B1, B2, C1, C2, D11, D12, D21 = (rng.standard_normal(shape) for shape in shapes)
    return GeneralizedPlant(A, B1, B2, C1, C2, 0.2 * D11, D12, D21)


def sensitivity(zero: float, pole: float, weight_pole: float = 0.0) -> GeneralizedPlant:
    """z = W (w - G u), y = w - G u: G = (zero - s)/((s - pole)(s + 3)), W = (s + 2)/(2 (s + weight_pole)).

    Strictly proper G and no price on u: D12 = 0.
    """
    # G in controllable form, states (x1, x2): x1' = x2, x2' = 3 pole x1 + (pole - 3) x2 + u, output zero x1 - x2
    A = np.zeros((3, 3))
    A[0, 1] = 1.0
    A[1, :2] = [3.0 * pole, pole - 3.0]
    A[2, 2] = -weight_pole
    # W = 1/2 + (2 - weight_pole)/2 / (s + weight_pole)
    A[2, :2] = [-zero, 1.0]
    C1 = np.array([[-0.5 * zero, 0.5, 0.5 * (2.0 - weight_pole)]])
    return GeneralizedPlant(
        A, [[0.0], [0.0], [1.0]], [[0.0], [1.0], [0.0]], C1, [[-zero, 1.0, 0.0]], [[0.5]], [[0.0]], [[1.0]]
    )


def control_effort(pole: float) -> GeneralizedPlant:
    """z = u, y = G u + w with G = 1/(s - pole): the smallest norm of K S is 2 pole."""
    return GeneralizedPlant([[pole]], [[0.0]], [[1.0]], [[0.0]], [[1.0]], [[0.0]], [[1.0]], [[1.0]])


def test_first_order_plant_with_a_closed_form() -> None:
    bound = lower_bound(first_order())
    assert bound.exact
    assert bound.assumptions == ()
    assert 1.0 + np.sqrt(3.0) - 1e-4 < bound.gamma < 1.0 + np.sqrt(3.0)
    assert "coupling" in bound.reason
    assert bound.gap(2.0 * bound.gamma) == pytest.approx(1.0)


@pytest.mark.parametrize("pole", [0.1, 1.0, 30.0])
def test_smallest_control_effort_for_an_unstable_pole(pole: float) -> None:
    # Glover (1986): the reciprocal of the smallest Hankel singular value of the antistable part
    bound = lower_bound(control_effort(pole))
    assert bound.gamma == pytest.approx(2.0 * pole, rel=1e-4)
    assert bound.gamma <= 2.0 * pole


@pytest.mark.parametrize(("zero", "pole", "weight_pole"), [(1.0, -0.5, 0.1), (4.0, 1.0, 0.1), (3.0, 1.5, 0.0)])
def test_sensitivity_bound_of_zames_and_francis(zero: float, pole: float, weight_pole: float) -> None:
    # |W(zero)| and, with an unstable pole, the factor |(zero + pole)/(zero - pole)|; singular: D12 = 0,
    # and with weight_pole = 0 an integrator that no controller moves
    bound = lower_bound(sensitivity(zero, pole, weight_pole))
    wanted = (zero + 2.0) / (2.0 * (zero + weight_pole)) * ((zero + pole) / (zero - pole) if pole > 0.0 else 1.0)
    assert not bound.exact
    assert any("D12 has rank 0" in note for note in bound.assumptions)
    assert any("0j" in note for note in bound.assumptions) == (weight_pole == 0.0)
    assert 0.999 * wanted < bound.gamma <= wanted * (1.0 + 1e-6)
    steps = [gamma for _, gamma in bound.by_region]
    assert steps == sorted(steps)


@pytest.mark.parametrize("seed", range(6))
def test_other_full_order_synthesis_agrees(seed: int) -> None:
    import control

    P = regular_plant(seed)
    bound = lower_bound(P)
    assert bound.exact
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        K, _, gamma, _ = control.hinfsyn(P.to_control(), P.n_y, P.n_u)
    achieved = hinf_norm(*P.close(K.A, K.B, K.C, K.D)).norm
    assert bound.gamma <= achieved * (1.0 + 1e-6)
    assert bound.gamma == pytest.approx(gamma, rel=1e-3)
    assert bound.not_refuted <= bound.gamma * (1.0 + 3e-5)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_structured_controller_of_full_order_comes_close(seed: int) -> None:
    P = random_plant(seed, n=3, sizes=(3, 1, 3, 1))
    bound = lower_bound(P)
    gamma = hinfstruct(P, FixedOrder(3, 1, 1), starts=3).gamma
    assert bound.gamma <= gamma * (1.0 + 1e-6)
    assert bound.gap(gamma) < 0.02


@pytest.mark.parametrize("seed", [4, 9])
def test_so_it_does_on_singular_problems(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_w, n_u, n_z, n_y = (2, 1, 2, 1) if seed == 4 else (1, 1, 1, 1)
    shapes = ((3, 3), (3, n_w), (3, n_u), (n_z, 3), (n_y, 3))
    D12 = np.zeros((n_z, n_u)) if seed % 3 else np.eye(n_z, n_u)
    matrices = [rng.standard_normal(shape) for shape in shapes]
    P = GeneralizedPlant(*matrices, np.zeros((n_z, n_w)), D12, np.zeros((n_y, n_w)))
    bound = lower_bound(P)
    gamma = hinfstruct(P, FixedOrder(3, n_u, n_y), starts=3).gamma
    assert bound.gamma <= gamma * (1.0 + 1e-6)
    assert bound.gap(gamma) < 0.02


def test_similarity_d22_and_scaling_do_not_matter() -> None:
    P = regular_plant(3)
    rng = np.random.default_rng(0)
    S = rng.standard_normal((P.n_x, P.n_x))
    Si = np.linalg.inv(S)
    Q = GeneralizedPlant(
        *(Si @ P.A @ S, Si @ P.B1, 5.0 * Si @ P.B2, P.C1 @ S, 0.1 * P.C2 @ S),
        *(P.D11, 5.0 * P.D12, 0.1 * P.D21, rng.standard_normal((2, 2))),
    )
    assert lower_bound(Q).gamma == pytest.approx(lower_bound(P).gamma, rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_disk_bounds_from_below_and_converges(seed: int) -> None:
    P = regular_plant(seed)
    exact = lower_bound(P).gamma
    size = float(np.max(np.abs(np.linalg.eigvals(P.A))))
    for far, near in ((30.0, 0.1), (1e4, 1e-4)):
        on_disk = lower_bound(Region(near * size, far * size).transform(P)).gamma
        assert on_disk <= exact * (1.0 + 1e-4)
    assert on_disk >= 0.99 * exact


def test_an_input_without_effect_on_z_takes_states_out_of_the_problem() -> None:
    # a fourth state that does not act on z, moved by a third input that does not act on z either
    P = regular_plant(1, n=3)
    A = np.zeros((4, 4))
    A[:3, :3], A[3, :3], A[3, 3] = P.A, 1.0, 2.0
    widened = GeneralizedPlant(
        A,
        np.vstack([P.B1, np.ones((1, 4))]),
        np.block([[P.B2, np.zeros((3, 1))], [np.zeros((1, 2)), np.ones((1, 1))]]),
        np.hstack([P.C1, np.zeros((4, 1))]),
        np.block([[P.C2, np.zeros((2, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]),
        P.D11,
        np.hstack([P.D12, np.zeros((4, 1))]),
        np.vstack([P.D21, [[0.0, 0.0, 0.0, 1e-3]]]),
    )
    side = ControlSide(widened.A, widened.B1, widened.B2, widened.C1, widened.D11, widened.D12, np.zeros_like)
    assert side.usable
    assert side.basis.shape == (4, 3)
    bound = lower_bound(widened)
    assert bound.gamma <= lower_bound(P).gamma * (1.0 + 1e-6)
    assert bound.gamma > 0.0


@pytest.mark.skipif(not (FOLDER / "reference.json").exists(), reason=f"the COMPleib data are not in {FOLDER}")
@pytest.mark.parametrize(
    # badly scaled, singular on one side or both, with integrators; AC12 and NN11 mislead decisions on ranks
    "name",
    [
        "AC1",
        "AC2",
        "AC4",
        "AC7",
        "AC9",
        "AC12",
        "AC15",
        "AC17",
        "HE1",
        "HE3",
        "NN2",
        "NN11",
        "NN17",
        "REA3",
        "EB1",
        "AGS",
    ],
)
def test_no_bound_lies_above_a_norm_that_was_reached(name: str) -> None:
    plant, best = load(name)
    bound = lower_bound(plant, tolerance=1e-3)
    assert bound.gamma <= best * (1.0 + 1e-6)
    if name in ("AC17", "AGS", "REA3"):  # the static controllers known there are optimal among all
        assert bound.gap(best) < 1e-3


def test_norms_that_can_vanish_have_the_bound_zero() -> None:
    # full information of w, free control of the state: z = x can be made as small as wanted
    P = GeneralizedPlant([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], [[0.0]], [[0.0]], [[0.0]])
    bound = lower_bound(P)
    assert bound.gamma < 1e-3
    assert isinstance(bound, LowerBound)


def test_plants_that_cannot_be_stabilised_are_named() -> None:
    P = random_plant(0, n=3)
    A = np.diag([0.5, -1.0, -2.0])
    with pytest.raises(AssumptionError, match=r"0\.5.* not stabilisable by u"):
        lower_bound(GeneralizedPlant(A, P.B1, np.vstack([np.zeros((1, 2)), P.B2[1:]]), *_rest(P)))
    C2 = P.C2.copy()
    C2[:, 0] = 0.0
    with pytest.raises(AssumptionError, match="not detectable from y"):
        lower_bound(GeneralizedPlant(A, P.B1, P.B2, P.C1, C2, P.D11, P.D12, P.D21))


def _rest(P: GeneralizedPlant) -> tuple[np.ndarray, ...]:
    return P.C1, P.C2, P.D11, P.D12, P.D21


def test_bad_arguments() -> None:
    with pytest.raises(DomainError, match="Bound each plant"):
        lower_bound([first_order()])  # type: ignore[arg-type]
    with pytest.raises(DomainError, match="tolerance"):
        lower_bound(first_order(), tolerance=0.0)


def test_no_states_and_bounded_work() -> None:
    static = GeneralizedPlant(
        np.zeros((0, 0)),
        np.zeros((0, 2)),
        np.zeros((0, 1)),
        np.zeros((2, 0)),
        np.zeros((1, 0)),
        [[1.0, 0.0], [0.0, 3.0]],
        [[1.0], [0.0]],
        [[1.0, 0.0]],
    )
    assert lower_bound(static).gamma == pytest.approx(3.0)
    bound = lower_bound(regular_plant(0, n=60), tolerance=1e-3)
    assert bound.gamma > 0.0
    assert bound.evaluations < 100
