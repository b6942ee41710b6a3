"""Guards the 6-block plant: every block of M against the paper's formula (eq. 14-16), and the sign z = -M w."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError
from lpvhinf.problems import TunedParts, six_block
from lpvhinf.statespace import LPVStateSpace

# of conftest.py: an Assembly, its Tuned parameters, its Reference
Make = Callable[..., Any]
Tune = Callable[..., Any]
Refer = Callable[..., Any]
Frequencies = Callable[[Any], Array]
Response = Callable[[tuple[Array, Array, Array, Array], float], Array]
CASES = [
    ("small", 1, 0.0, "all", False),
    ("small", 1, 4e-4, "rigid-body", False),
    ("small", 3, 0.0, "rigid-body", True),
    ("small", 3, 4e-4, "all", False),
    ("benchmark", 1, 0.0, "all", False),
    ("benchmark", 1, 2e-4, "rigid-body", True),
    ("benchmark", 3, 0.0, "all", True),
]


def blocks(M: Array, n_rb: int) -> list[Array]:
    """The blocks of M: two rows of n_rb outputs; columns w1, w2 and, if there, w3."""
    ends = [0, n_rb, 2 * n_rb, M.shape[1]]
    rows = (slice(0, n_rb), slice(n_rb, 2 * n_rb))
    return [M[row, a:b] for row in rows for a, b in itertools.pairwise(ends) if b > a]


def places(assembly: Any, frozen: bool) -> Array:
    """Corners and inner positions."""
    box = assembly.plant.box
    inner = box[:, 0] + np.array([[0.31], [0.77]]) * (box[:, 1] - box[:, 0])
    chosen = np.vstack([box[:, 0], inner, box[:, 1]])
    return chosen if frozen else chosen[:3]


@pytest.mark.parametrize(("name", "n_flex", "delay", "sensing", "frozen"), CASES)
def test_every_block_is_the_papers(
    assemble: Make,
    tune: Tune,
    refer: Refer,
    name: str,
    n_flex: int,
    delay: float,
    sensing: str,
    frozen: bool,
    resonances: Frequencies,
    response: Response,
) -> None:
    assembly = assemble(name, n_flex, delay=delay, sensing=sensing)
    n_rb = assembly.plant.n_rb
    points = places(assembly, frozen)
    plants = assembly.generalized_plants(points) if frozen else assembly.problem(assembly.loop).sample(points)
    for k, (p, P) in enumerate(zip(points, plants, strict=True)):
        tuned, at_p = tune(assembly, seed=k), refer(assembly, p, frozen=frozen)
        closed = P.close(*assembly.structure.realize(tuned.theta))
        for omega in resonances(assembly):
            formula = at_p.M(1j * omega, tuned, blocks=6)
            found = blocks(response(closed, omega), n_rb)
            assert len(found) == 6
            for block, wanted in zip(found, blocks(formula, n_rb), strict=True):
                size = np.max(np.abs(wanted))
                assert size > 0.0
                round_off = 1e-15 * np.max(np.abs(formula))  # some blocks are 1e-8 of the others
                assert np.max(np.abs(block + wanted)) < 1e-9 * size + round_off  # z = -M w


@pytest.mark.parametrize("mistake", ["sign of xi", "observer told of w3", "w2 hidden from the observer"])
def test_no_other_wiring_gives_the_same(
    assemble: Make, tune: Tune, refer: Refer, response: Response, mistake: str
) -> None:
    """What a mistake in the wiring would give is far from what is wired, so that the test above can fail."""
    assembly = assemble("small", 1)
    p, omega = assembly.plant.box[:, 0], float(assembly.omega_flex[0])
    s, tuned, at_p = 1j * omega, tune(assembly), refer(assembly, p, frozen=False)
    G_1, G_2, _, _ = at_p.augmented(s, tuned)
    G, (O_u, O_y), K_FM = at_p.plant(s), at_p.observer(s, tuned.L), at_p.K_FM(s, tuned)
    loop = np.eye(1) + K_FM @ (O_u[:, 2:] + O_y @ G[:, 2:])
    if mistake == "sign of xi":
        G_1, G_2, _, _ = at_p.augmented(s, dataclasses.replace(tuned, xi=-tuned.xi))
    elif mistake == "observer told of w3":
        G_2 = G[:2, 2:] @ (np.eye(1) - np.linalg.solve(loop, K_FM @ (O_u[:, 2:] + O_y @ G[:, 2:])))
    else:
        G_1 = G[:2, :2] - G[:2, 2:] @ np.linalg.solve(loop, K_FM @ O_y @ G[:, :2])
    W_z1, _, W_w3 = at_p.weights(s)
    S = np.linalg.inv(np.eye(2) + at_p.augmented(s, tuned)[0] @ at_p.K_RB(s, tuned))
    wrong = W_z1 @ S @ np.hstack([G_1, G_2 @ W_w3])
    found = -response(six_block(assembly.loop).at(p).close(*assembly.structure.realize(tuned.theta)), omega)[:2, 2:]
    assert np.max(np.abs(found - wrong)) > 1e-3 * np.max(np.abs(found))


@pytest.mark.parametrize(("name", "n_flex", "delay", "sensing", "frozen"), [CASES[1], CASES[3], CASES[6]])
def test_wired_closed_loop_is_the_closed_generalized_plant(
    assemble: Make, tune: Tune, name: str, n_flex: int, delay: float, sensing: str, frozen: bool
) -> None:
    assembly = assemble(name, n_flex, delay=delay, sensing=sensing)
    p = assembly.plant.box[:, 1]
    loop = assembly.frozen_loops(p[None])[0] if frozen else assembly.loop
    tuned = tune(assembly)
    parts = assembly.tuned_parts(tuned.theta)
    assert np.allclose(parts.xi, tuned.xi, rtol=1e-14)
    assert np.array_equal(parts.L, tuned.L)
    wired = loop.wire(controller=parts, weighted=True, flexible_input=True).at(p)
    closed = six_block(loop).at(p).close(*assembly.structure.realize(tuned.theta))
    for ours, theirs in zip((wired.A, wired.B, wired.C, wired.D), closed, strict=True):
        assert np.allclose(ours, theirs, rtol=0, atol=1e-11 * max(1.0, float(np.max(np.abs(theirs)))))


@pytest.mark.parametrize("sensing", ["all", "rigid-body"])
def test_unweighted_loop(
    assemble: Make, tune: Tune, refer: Refer, sensing: str, resonances: Frequencies, response: Response
) -> None:
    """Errors and forces without the filters, from (w1, w2, w3) and from (w1, w2) alone."""
    assembly = assemble("small", 1, sensing=sensing)
    p, tuned = assembly.plant.box[:, 1], tune(assembly)
    at_p, parts = refer(assembly, p, frozen=False), assembly.tuned_parts(tuned.theta)
    wired = assembly.loop.wire(controller=parts, weighted=False, flexible_input=True).at(p)
    shorter = assembly.loop.wire(controller=parts, weighted=False, flexible_input=False).at(p)
    for omega in resonances(assembly):
        s = 1j * omega
        G_1, G_2, U_1, U_2 = at_p.augmented(s, tuned)
        K = at_p.K_RB(s, tuned)
        S = np.linalg.inv(np.eye(2) + G_1 @ K)
        e = -S @ np.hstack([np.eye(2), G_1, G_2])
        u_RB = K @ e
        seen = u_RB + np.hstack([np.zeros((2, 2)), np.eye(2), np.zeros((2, 1))])
        u_FM = U_1 @ seen + U_2 @ np.array([[0.0, 0.0, 0.0, 0.0, 1.0]])
        wanted = np.vstack([e, u_RB, u_FM])
        found = response((wired.A, wired.B, wired.C, wired.D), omega)
        for block, formula in zip(np.split(found, [2, 4]), np.split(wanted, [2, 4]), strict=True):
            assert np.max(np.abs(block - formula)) < 1e-9 * np.max(np.abs(formula))
        assert np.allclose(
            response((shorter.A, shorter.B, shorter.C, shorter.D), omega), found[:, :4], rtol=1e-9, atol=1e-12
        )


def slow_start(assembly: Any) -> Array:
    """A stabilising theta: a third of the bandwidth, the Riccati gain, and little damping."""
    box, K = assembly.plant.box, assembly.rigid_body
    rigid = K.parameters(K.rule_of_thumb(assembly.scaling.f_bw / 3))
    return np.asarray(assembly.start(np.linspace(box[:, 0], box[:, 1], 21), rigid=rigid))


@pytest.mark.parametrize("sensing", ["all", "rigid-body"])
def test_the_integrator_is_absorbed(assemble: Make, refer: Refer, sensing: str, tune: Tune, response: Response) -> None:
    """W_z1 and K_RB share one integrator: the stabilised performance loop has no pole at zero."""
    assembly = assemble("small", 1, sensing=sensing)
    theta = slow_start(assembly)
    rigid = dict(zip(("k", "f_i", "f_d", "f_lp", "zeta"), np.exp(theta[:10].reshape(2, 5).T), strict=True))
    L = theta[10:-1].reshape(-1, assembly.plant.n_out)
    tuned = dataclasses.replace(tune(assembly), rigid=rigid, L=L, xi=-theta[-1:])
    P = six_block(assembly.loop)
    for p in np.linspace(assembly.plant.box[:, 0], assembly.plant.box[:, 1], 5):
        closed = P.at(p).close(*assembly.structure.realize(theta))
        assert np.max(np.linalg.eigvals(closed[0]).real) < -0.1
        static = response(closed, 0.0)
        assert np.all(np.isfinite(static))
        slow = refer(assembly, p, frozen=False).M(1e-3j, tuned, blocks=6)
        # S falls with s^3 (plant and integrator), W_z1 rises with 1/s
        assert np.max(np.abs(static[:2, :2])) < 1e-6
        assert np.max(np.abs(slow[:2, :2])) < 1e-6
        assert np.allclose(static[:2, 2:], -slow[:2, 2:], rtol=0, atol=1e-3 * np.max(np.abs(slow[:2, 2:])))


def test_without_damping_the_first_columns_are_the_4_block(
    assemble: Make, tune: Tune, refer: Refer, resonances: Frequencies, response: Response
) -> None:
    assembly = assemble("small", 1)
    p = assembly.plant.box[:, 0]
    tuned = tune(assembly)
    off = dataclasses.replace(tuned, xi=np.zeros(1))
    P, at_p = six_block(assembly.loop).at(p), refer(assembly, p, frozen=False)
    left: dict[str, list[float]] = {"on": [], "off": []}
    for omega in resonances(assembly):
        conventional = at_p.M(1j * omega, tuned, blocks=4)
        for name, parts in (("on", tuned), ("off", off)):
            M = -response(P.close(*assembly.structure.realize(parts.theta)), omega)
            left[name].append(float(np.max(np.abs(M[:, :4] - conventional)) / np.max(np.abs(conventional))))
    assert max(left["off"]) < 1e-9
    assert max(left["on"]) > 1e-3


def test_an_observer_is_needed(assemble: Make) -> None:
    with pytest.raises(AssumptionError, match="Use four_block instead"):
        six_block(assemble("small", 1, architecture="rigid-body").loop)


def test_tuned_parts_must_fit_the_loop(assemble: Make, tune: Tune) -> None:
    assembly = assemble("small", 1)
    parts = assembly.tuned_parts(tune(assembly).theta)
    A, B, C, D = parts.K_RB
    for wrong, message in [
        (TunedParts(K_RB=parts.K_RB), "L or xi is None"),
        (TunedParts(K_RB=parts.K_RB, L=parts.L), "L or xi is None"),
        (TunedParts(K_RB=(A, B, C, D + 1.0), L=parts.L, xi=parts.xi), "feed-through"),
    ]:
        with pytest.raises(AssumptionError, match=message):
            assembly.loop.wire(controller=wrong, weighted=True, flexible_input=True)


def test_sizes(assemble: Make) -> None:
    for sensing, n_out in (("all", 3), ("rigid-body", 2)):
        P = six_block(assemble("small", 3, sensing=sensing).loop)
        assert isinstance(P.system, LPVStateSpace)
        assert (P.n_w, P.n_z) == (2 + 2 + 3, 4)
        assert (P.n_u, P.n_y) == (2 + 10 + 3, 4 + n_out + 3)
