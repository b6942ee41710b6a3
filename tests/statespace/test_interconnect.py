"""Guards series, parallel, feedback and LFT of LPV systems against python-control at frozen positions."""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.statespace import LPVStateSpace

RandomSystem = Callable[..., LPVStateSpace]
OMEGA = np.array([0.0, 0.1, 0.9, 3.0, 20.0])


def response(system: control.StateSpace | LPVStateSpace, p: Array | None = None) -> Array:
    """C (j omega I - A)^-1 B + D at OMEGA, from the definition."""
    if isinstance(system, LPVStateSpace):
        assert p is not None
        A, B, C, D = (m[0] for m in system.sample(p))
    else:
        A, B, C, D = system.A, system.B, system.C, system.D
    eye = np.eye(len(A))
    return np.stack([C @ np.linalg.solve(1j * w * eye - A, B) + D for w in OMEGA])


def close(left: Array, right: Array) -> bool:
    return bool(np.max(np.abs(left - right)) < 1e-10 * max(1.0, float(np.max(np.abs(right)))))


def test_series_parallel_append(random_system: RandomSystem, positions: Array) -> None:
    G, H, J = random_system(0, 3, 2, 4), random_system(1, 2, 4, 3), random_system(2, 5, 2, 4)
    for p in positions:
        assert close(response(G.series(H), p), response(H.at(p) * G.at(p)))
        assert close(response(G.parallel(J), p), response(G.at(p) + J.at(p)))
        assert close(response(G.append(H), p), response(control.append(G.at(p), H.at(p))))


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("kinds", [("zero", "varying"), ("varying", "zero"), ("constant", "constant")])
def test_feedback(random_system: RandomSystem, positions: Array, sign: int, kinds: tuple[str, str]) -> None:
    G, H = random_system(3, 3, 2, 3, kinds[0]), random_system(4, 2, 3, 2, kinds[1])
    closed = G.feedback(H, sign)
    for p in positions:
        assert close(response(closed, p), response(control.feedback(G.at(p), H.at(p), sign)))


@pytest.mark.parametrize("kinds", [("zero", "varying"), ("varying", "zero"), ("constant", "constant")])
def test_lft(random_system: RandomSystem, positions: Array, kinds: tuple[str, str]) -> None:
    P, K = random_system(5, 4, 5, 4, kinds[0]), random_system(6, 3, 2, 3, kinds[1])
    closed = P.lft(K)
    assert (closed.n_x, closed.n_u, closed.n_y) == (7, 2, 2)
    for p in positions:
        assert close(response(closed, p), response(P.at(p).lft(K.at(p))))


def test_lft_without_a_controller_channel_in_use(random_system: RandomSystem, positions: Array) -> None:
    """A zero gain leaves the outer block alone, whatever D22 is."""
    P = random_system(7, 4, 3, 4)
    zero = LPVStateSpace.from_system(np.zeros((1, 2)), P.box)
    outer = LPVStateSpace(P.A, P.B[:, :2], P.C[:2, :], P.D[:2, :2])
    for p in positions:
        assert close(response(P.lft(zero), p), response(outer, p))


def test_lft_of_an_interchange_is_the_controller(random_system: RandomSystem, positions: Array) -> None:
    """F_l([[0, I], [I, 0]], K) = K."""
    K = random_system(8, 3, 2, 2)
    swap = LPVStateSpace.from_system(np.kron([[0.0, 1.0], [1.0, 0.0]], np.eye(2)), K.box)
    for p in positions:
        assert close(response(swap.lft(K), p), response(K, p))


def test_lft_is_associative(random_system: RandomSystem, positions: Array) -> None:
    """Closing a loop with an LFT is closing it twice: F_l(P, F_l(Q, K)) = F_l(F_l(P*Q), K), here with P*Q by append."""
    P, K = random_system(9, 3, 4, 4, "zero"), random_system(10, 2, 1, 1)
    twice = P.lft(K).lft(random_system(11, 2, 1, 1))  # last channel first
    both = random_system(11, 2, 1, 1).append(K)
    for p in positions:
        assert close(response(twice, p), response(P.lft(both), p))


def test_feedback_is_an_lft(random_system: RandomSystem, positions: Array) -> None:
    G, H = random_system(12, 3, 2, 2, "zero"), random_system(13, 2, 2, 2)
    for p in positions:
        g, h = response(G, p), response(H, p)
        direct = np.stack([np.linalg.solve(np.eye(2) + a @ b, a) for a, b in zip(g, h, strict=True)])
        assert close(response(G.feedback(H), p), direct)


def test_similarity_invariance(random_system: RandomSystem, positions: Array) -> None:
    P, K = random_system(14, 4, 3, 3, "zero"), random_system(15, 3, 2, 2)
    T = np.random.default_rng(0).standard_normal((4, 4)) + 3.0 * np.eye(4)
    similar = LPVStateSpace(np.linalg.inv(T) @ P.A @ T, np.linalg.inv(T) @ P.B, P.C @ T, P.D)
    for p in positions:
        assert close(response(similar.lft(K), p), response(P.lft(K), p))


def test_degree_grows_only_in_products_of_varying_matrices(random_system: RandomSystem) -> None:
    G = random_system(16, 3, 2, 2, "zero")
    gain = LPVStateSpace.from_system(np.eye(2), G.box)
    closed = G.feedback(gain)
    assert closed.A.degree == (4, 2)  # B(p) C(p)
    assert closed.B.degree == G.B.degree


def test_varying_algebraic_loops_are_refused(random_system: RandomSystem) -> None:
    with pytest.raises(AssumptionError, match=r"varies with p.*strictly proper"):
        random_system(0, 2, 2, 2).feedback(random_system(1, 2, 2, 2, "constant"))
    with pytest.raises(AssumptionError, match="varies with p"):
        random_system(2, 2, 3, 3).lft(random_system(3, 2, 2, 2, "constant"))


def test_ill_posed_loops_are_refused(box: Array) -> None:
    gain, minus = (LPVStateSpace.from_system(np.array([[k]]), box) for k in (2.0, -0.5))
    with pytest.raises(AssumptionError, match="not well posed"):
        gain.feedback(minus)
    assert gain.feedback(minus, 1).at([0.0, 0.1]).D[0, 0] == pytest.approx(1.0)


def test_sizes_must_fit(random_system: RandomSystem) -> None:
    G, H = random_system(0, 2, 2, 3), random_system(1, 2, 2, 2)
    for connect in (G.series, G.parallel, G.feedback):
        with pytest.raises(DimensionError):
            connect(H)
    with pytest.raises(DimensionError):
        G.lft(random_system(2, 1, 4, 1))


def test_boxes_must_agree(random_system: RandomSystem, box: Array) -> None:
    G = random_system(0, 2, 2, 2, "zero")
    other = LPVStateSpace.from_system(np.eye(2), 2.0 * box)
    for connect in (G.series, G.parallel, G.append, G.feedback, G.lft):
        with pytest.raises(DimensionError, match="Use one box"):
            connect(other)
