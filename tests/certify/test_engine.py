from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lpvhinf as lh
from lpvhinf.checks import Array
from lpvhinf.statespace import LPVStateSpace

Certificate, Refutation, Undecided = lh.certify.Certificate, lh.certify.Refutation, lh.certify.Undecided
CLOSE = 1e-6


def autonomous(A: object, box: object, basis: str = "power") -> LPVStateSpace:
    n = np.shape(A)[-1]
    return LPVStateSpace.from_coefficients(A, np.zeros((n, 1)), np.zeros((1, n)), [[0.0]], box=box, basis=basis)


def oscillator(damping: Array, omega: float = 7.0) -> LPVStateSpace:
    """Poles -damping(p)/2 +- j omega (about); damping by powers of p on [-1, 1]^2."""
    A = np.zeros((*damping.shape, 2, 2))
    A[..., 1, 1] = -damping
    A[0, 0] += [[0.0, omega], [-omega, 0.0]]
    return autonomous(A, [[-1.0, 1.0], [-1.0, 1.0]])


def spring(k: float) -> LPVStateSpace:
    """q'' + 0.4 q' + (1 - k p) q = u, y = q, |p| <= 1."""
    A = [[[0.0, 1.0], [-1.0, -0.4]], [[0.0, 0.0], [k, 0.0]]]
    return LPVStateSpace.from_coefficients(A, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], box=[[-1.0, 1.0]], basis="power")


SPRING_LIMIT = 0.4 * np.sqrt(1.0 - 0.04)  # circle criterion: k times the peak of 1 / (s^2 + 0.4 s + 1) is one


def assert_holds_nowhere_worse(result: lh.certify.Certificate, system: LPVStateSpace) -> None:
    grid = np.meshgrid(*[np.linspace(low, high, 31) for low, high in result.box.tolist()])
    points = np.stack([g.ravel() for g in grid], axis=1)
    assert np.max(np.linalg.eigvals(system.A.sample(points)).real) < -result.claim.decay


@pytest.mark.parametrize("gap", [1e-1, CLOSE])
def test_a_boundary_is_approached_to_a_millionth(gap: float) -> None:
    stable = lh.certify.stability(autonomous([[[-1.0]], [[1.0]]], [[-1.0, 1.0 - gap]]))
    assert isinstance(stable, Certificate)
    assert stable.margin > 0.0
    unstable = lh.certify.stability(autonomous([[[-1.0]], [[1.0]]], [[-1.0, 1.0 + gap]]))
    assert isinstance(unstable, Refutation)
    assert unstable.evidence.exact_position[0] >= 1


@pytest.mark.parametrize(("floor", "proved"), [(1e-2, True), (CLOSE, True), (-CLOSE, False), (-1e-2, False)])
def test_damping_with_its_minimum_at_the_corners(floor: float, proved: bool) -> None:
    damping = np.zeros((3, 3))
    damping[0, 0], damping[2, 0], damping[0, 2] = 2.0 + floor, -1.0, -1.0
    result = lh.certify.stability(oscillator(damping))
    assert isinstance(result, Certificate if proved else Refutation)


@pytest.mark.parametrize("centre", [(0.3137, -0.5211), (0.9, 0.9), (0.0, 0.0)])
@pytest.mark.parametrize("radius", [1e-3, 1e-1])
def test_a_tiny_unstable_pocket_is_never_proved(centre: tuple[float, float], radius: float) -> None:
    x, y = centre
    damping = np.zeros((3, 3))
    damping[0, 0], damping[1, 0], damping[2, 0] = x * x + y * y - radius**2, -2.0 * x, 1.0
    damping[0, 1], damping[0, 2] = -2.0 * y, 1.0
    result = lh.certify.stability(oscillator(damping))
    assert not isinstance(result, Certificate)
    if isinstance(result, Refutation):
        assert np.hypot(*(result.evidence.position - centre)) <= radius * (1.0 + 1e-6)


def test_just_stable_everywhere_is_not_refuted() -> None:
    damping = np.zeros((3, 3))
    damping[0, 0], damping[2, 0], damping[0, 2] = 1e-5, 1.0, 1.0
    assert isinstance(lh.certify.stability(oscillator(damping)), Certificate)


def test_the_boundary_itself_is_neither_proved_nor_refuted_wrongly() -> None:
    result = lh.certify.stability(autonomous([[[-1.0]], [[1.0]]], [[-1.0, 1.0]]))
    assert isinstance(result, Undecided)
    assert 0.999 < result.proved_share < 1.0
    assert len(result.remaining) == 1
    assert result.remaining[0, 0, 1] == 1.0


def test_a_matrix_without_eigenvector_basis() -> None:
    J = np.array([[-1.0, 1e3, 0.0], [0.0, -1.0, 1e3], [0.0, 0.0, -1.0]])
    assert isinstance(lh.certify.stability(autonomous(J, [[-1.0, 1.0]])), Certificate)


def test_decay_and_remainder_move_the_boundary() -> None:
    G = autonomous([[[-1.0]], [[0.5]]], [[-1.0, 1.0]])  # decays with 0.5 at least
    assert isinstance(lh.certify.stability(G, decay=0.499), Certificate)
    assert isinstance(lh.certify.stability(G, decay=0.501), Refutation)
    covered = lh.certify.stability(G, remainder={"A": [[0.499]]}, remainder_is="sampled")
    assert isinstance(covered, Certificate)
    assert "conditional" in str(covered.claim)
    assert isinstance(lh.certify.stability(G, remainder={"A": [[0.501]]}), Undecided)


def test_a_part_of_the_box() -> None:
    G = autonomous([[[-1.0]], [[2.0]]], [[-1.0, 1.0]])  # stable for p < 0.5
    assert isinstance(lh.certify.stability(G, box=[[-1.0, 0.4999]]), Certificate)
    assert isinstance(lh.certify.stability(G, box=[[0.1, 0.5001]]), Refutation)


def test_three_coordinates_of_p() -> None:
    A = np.zeros((2, 2, 2, 1, 1))
    A[0, 0, 0], A[1, 1, 1], A[1, 0, 0] = -2.1, 1.0, 1.0
    assert isinstance(lh.certify.stability(autonomous(A, [[-1.0, 1.0]] * 3)), Certificate)
    A[0, 0, 0] = -1.9
    assert isinstance(lh.certify.stability(autonomous(A, [[-1.0, 1.0]] * 3)), Refutation)


@pytest.mark.parametrize(
    ("k", "outcome"),
    [(0.3, Certificate), (0.97 * SPRING_LIMIT, Certificate), (1.03 * SPRING_LIMIT, Refutation), (0.8, Refutation)],
)
def test_quadratic_stability_up_to_the_circle_criterion(k: float, outcome: type) -> None:
    result = lh.certify.stability(spring(k), kind="quadratic")
    assert isinstance(result, outcome)
    if isinstance(result, Refutation):
        A = spring(k).A.sample(result.evidence.positions)
        Z = [F @ F.T for F in result.evidence.factors]
        assert np.linalg.eigvalsh(sum(a @ z + z @ a.T for a, z in zip(A, Z)))[0] > 0.0


def test_rates_lie_between_frozen_and_quadratic() -> None:
    G = spring(0.5)  # beyond quadratic stability
    assert isinstance(lh.certify.stability(G, kind="quadratic"), Refutation)
    assert isinstance(lh.certify.stability(G, kind="rate", rate=0.1), Certificate)
    fast = lh.certify.stability(G, kind="rate", rate=50.0)
    assert isinstance(fast, Undecided)


def test_a_rate_that_destabilises_is_not_proved() -> None:
    # parametric resonance: p = sin(2 t) pumps q'' + 0.4 q' + (1 - 0.9 p) q; its rate is 2
    G, dt, x = spring(0.9), 5e-3, np.array([1.0, 0.0])
    for A in G.A.sample(np.sin(2.0 * dt * np.arange(10_000))[:, None]):
        x = x + dt * (A @ (x + 0.5 * dt * A @ x))
    assert np.linalg.norm(x) > 1.0
    assert not isinstance(lh.certify.stability(G, kind="rate", rate=2.0), Certificate)


PEAK = 1.0 / (0.4 * np.sqrt(0.5 - 0.04))  # of spring(0.5), at p = 1


@pytest.mark.parametrize(("share", "outcome"), [(0.99, Refutation), (1.002, Certificate), (2.0, Certificate)])
def test_frozen_gain_close_to_the_norm(share: float, outcome: type) -> None:
    result = lh.certify.l2_gain(spring(0.5), share * PEAK)
    assert isinstance(result, outcome)
    if isinstance(result, Refutation):
        assert share * PEAK <= result.evidence.gain <= PEAK


def test_gain_with_rates_and_quadratic() -> None:
    assert isinstance(lh.certify.l2_gain(spring(0.5), 3.0 * PEAK, kind="rate", rate=0.2), Certificate)
    assert isinstance(lh.certify.l2_gain(spring(0.1), 4.0 * PEAK, kind="quadratic"), Certificate)


def test_gain_with_feedthrough_and_remainder() -> None:
    G = LPVStateSpace.from_coefficients([[-1.0]], [[1.0]], [[1.0]], [[[0.5]], [[0.25]]], box=[[-1.0, 1.0]])
    assert isinstance(lh.certify.l2_gain(G, 1.751), Certificate)  # 1 + 0.75 at omega = 0
    assert isinstance(lh.certify.l2_gain(G, 1.749), Refutation)
    assert isinstance(lh.certify.l2_gain(G, 1.80, remainder={"D": [[0.02]]}), Certificate)
    assert not isinstance(lh.certify.l2_gain(G, 1.80, remainder={"D": [[0.06]]}), Certificate)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.integers(0, 10_000))
def test_generated_systems_against_dense_sampling(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, degree = int(rng.integers(1, 6)), int(rng.integers(1, 5))
    A = (
        rng.normal(size=(degree, degree, n, n))
        * 0.5 ** np.add.outer(np.arange(degree), np.arange(degree))[..., None, None]
    )
    G = autonomous(A, [[-1.0, 1.0], [0.0, 3.0]], "chebyshev")
    grid = np.stack([g.ravel() for g in np.meshgrid(np.linspace(-1, 1, 41), np.linspace(0, 3, 41))], axis=1)
    worst = float(np.max(np.linalg.eigvals(G.A.sample(grid)).real))
    A[0, 0] -= (worst + rng.choice([-0.05, 0.02, 0.2])) * np.eye(n)
    G = autonomous(A, [[-1.0, 1.0], [0.0, 3.0]], "chebyshev")
    worst = float(np.max(np.linalg.eigvals(G.A.sample(grid)).real))
    result = lh.certify.stability(G, time_limit=5.0)
    if worst >= 0.0:
        assert not isinstance(result, Certificate)
    elif worst < -0.1:
        assert isinstance(result, Certificate)
    if isinstance(result, Refutation):
        p = [float(x) for x in result.evidence.exact_position]
        found = np.linalg.eigvals(G.A.at(p))
        assert np.min(np.abs(found - result.evidence.eigenvalue)) <= result.evidence.radius + 1e-9
        assert np.max(found.real) > -1e-9
    if isinstance(result, Certificate):
        assert_holds_nowhere_worse(result, G)


def test_cells_cover_the_box_exactly() -> None:
    damping = np.zeros((3, 3))
    damping[0, 0], damping[2, 0], damping[0, 2] = 2.0 + CLOSE, -1.0, -1.0
    result = lh.certify.stability(oscillator(damping))
    assert isinstance(result, Certificate)
    area = sum(np.prod([Fraction(float(b)) - Fraction(float(a)) for a, b in cell]) for cell in result.cells)
    assert area == 4
    assert result.n_cells == len(result.margins) == int(np.sum(result.members["tree"] == -1))


def test_a_time_limit_leaves_a_map() -> None:
    result = lh.certify.stability(spring(0.5), time_limit=0.0)
    assert isinstance(result, Undecided)
    assert "time" in result.reason
    assert result.proved_share == 0.0
    assert len(result.remaining) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "frozn"}, "kind is 'frozn'"),
        ({"kind": "rate"}, "rate is missing"),
        ({"rate": 0.1}, "rate is given"),
        ({"kind": "rate", "rate": [[0.1, 0.2]]}, "lowest <= 0"),
        ({"decay": -1.0}, "decay is -1.0"),
        ({"decay": np.nan}, "decay"),
        ({"box": [[0.5, -0.5]]}, "box"),
        ({"box": [[-1.0, 1.5]]}, "leaves the system's box"),
        ({"box": [[-1.0, 1.0], [0.0, 1.0]]}, "box has shape"),
        ({"remainder": {"A": [[1.0]]}}, "remainder"),
        ({"remainder": {"E": [[1.0]]}}, "remainder names"),
        ({"remainder": {"A": -np.ones((2, 2))}}, "negative"),
        ({"remainder_is": "guessed"}, "remainder_is"),
        ({"degree": 0}, "degree 0"),
        ({"degree": 2, "lyapunov_degree": 5}, "lyapunov_degree 5"),
    ],
)
def test_bad_arguments_are_named(options: dict[str, object], message: str) -> None:
    with pytest.raises((lh.DomainError, lh.DimensionError), match=message.replace("(", r"\(")):
        lh.certify.stability(spring(0.1), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("gamma", [0.0, -1.0, np.nan])
def test_a_gain_must_be_above_zero(gamma: float) -> None:
    with pytest.raises(lh.DomainError, match="gamma"):
        lh.certify.l2_gain(spring(0.1), gamma)


@pytest.mark.slow
def test_processes_share_the_cells() -> None:
    damping = np.zeros((3, 3))
    damping[0, 0], damping[2, 0], damping[0, 2] = 2.0 + 1e-3, -1.0, -1.0
    result = lh.certify.stability(oscillator(damping), jobs=2)
    assert isinstance(result, Certificate)
    assert np.prod(result.cells[..., 1] - result.cells[..., 0], axis=1).sum() == pytest.approx(4.0, rel=1e-12)


def test_a_lyapunov_matrix_of_your_own() -> None:
    P = np.array([[1.0, 0.2], [0.2, 1.0]])
    own = lh.certify.constant_lyapunov(P, 1)
    assert isinstance(lh.certify.stability(spring(0.3), kind="quadratic", lyapunov=own), Certificate)
    assert not isinstance(lh.certify.stability(spring(0.5), kind="quadratic", lyapunov=own), Certificate)
    with pytest.raises(lh.DomainError, match="kind is 'frozen'"):
        lh.certify.stability(spring(0.3), lyapunov=own)
    moving = lh.certify.GlobalLyapunov(S=own.S, X=np.concatenate([own.X, 0.1 * own.X]))
    with pytest.raises(lh.DomainError, match="depends on p"):
        lh.certify.stability(spring(0.3), kind="quadratic", lyapunov=moving)
    with pytest.raises(lh.DimensionError, match="lyapunov has S"):
        lh.certify.stability(spring(0.3), kind="quadratic", lyapunov=lh.certify.constant_lyapunov(np.eye(3), 1))


def test_an_indefinite_matrix_proves_nothing() -> None:
    # for an unstable A the Lyapunov inequality holds with a P that is not positive definite
    G = autonomous([[1.0, 0.0], [0.0, -1.0]], [[-1.0, 1.0]])
    X = np.array([[-1.0, 0.0, 1.0]])
    own = lh.certify.GlobalLyapunov(S=np.eye(2), X=X)
    assert isinstance(lh.certify.stability(G, kind="quadratic", lyapunov=own), Refutation)


def test_a_system_without_states() -> None:
    G = LPVStateSpace.from_coefficients(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]], box=[[-1.0, 1.0]]
    )
    with pytest.raises(lh.DimensionError, match="no states"):
        lh.certify.stability(G)
