"""Guards the 2x2-block plant: every block of M against the paper's formula with S~, and the sign that damps."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import DomainError
from lpvhinf.problems import places, six_block, two_by_two

# of conftest.py: an Assembly, its Tuned parameters, its Reference
Make = Callable[..., Any]
Tune = Callable[..., Any]
Refer = Callable[..., Any]
Frequencies = Callable[[Any], Array]
Response = Callable[[tuple[Array, Array, Array, Array], float], Array]
CASES = [
    ("small", 1, 0.0, "rigid-body", False),
    ("small", 1, 4e-4, "all", False),
    ("small", 3, 0.0, "all", True),
    ("small", 3, 4e-4, "rigid-body", False),
    ("benchmark", 1, 0.0, "all", False),
    ("benchmark", 1, 2e-4, "rigid-body", True),
    ("benchmark", 3, 2e-4, "all", True),
]
ARCHITECTURES = ("rigid-body", "output-observer", "error-observer")


def compared(found: Array, wanted: Array, n_rb: int, columns: list[int]) -> float:
    """Largest deviation of -found from wanted, relative to every block; some blocks are 1e-8 of the others."""
    ends = [0, *np.cumsum(columns)]
    worst = 0.0
    for rows in (slice(0, n_rb), slice(n_rb, 2 * n_rb)):
        for a, b in itertools.pairwise(ends):
            size = float(np.max(np.abs(wanted[rows, a:b])))
            assert size > 0.0
            error = float(np.max(np.abs(found[rows, a:b] + wanted[rows, a:b])))  # z = -M w
            worst = max(worst, error / (size + 1e-6 * float(np.max(np.abs(wanted)))))  # round-off of the others
    return worst


def closed_at(assembly: Any, points: Array, thetas: list[Array], *, frozen: bool) -> list[Any]:
    """The closed generalized plants."""
    problem = assembly.problem(assembly.loop)
    plants = assembly.generalized_plants(points) if frozen else problem.sample(points)
    gains = [assembly.structure.realize(theta) for theta in thetas]
    return [P.close(*gain) for P, gain in zip(plants, gains, strict=True)]


@pytest.mark.parametrize(
    ("architecture", "name", "n_flex", "delay", "sensing", "frozen"),
    [("error-observer", *case) for case in CASES]
    + [(architecture, *CASES[k]) for architecture in ARCHITECTURES[:2] for k in (1, 5)],
)
def test_every_block_is_the_papers(
    assemble: Make,
    tune: Tune,
    refer: Refer,
    resonances: Frequencies,
    response: Response,
    architecture: str,
    name: str,
    n_flex: int,
    delay: float,
    sensing: str,
    frozen: bool,
) -> None:
    assembly = assemble(name, n_flex, delay=delay, sensing=sensing, architecture=architecture, problem="two-by-two")
    n_rb, box = assembly.plant.n_rb, assembly.plant.box
    points = box[:, 0] + np.array([[0.0], [0.31], [1.0]]) * (box[:, 1] - box[:, 0])
    tuned = [tune(assembly, seed=k) for k in range(3)]
    n_theta = assembly.structure.n_parameters
    columns = [n_rb, n_flex] if assembly.observer else [n_rb]
    closed = closed_at(assembly, points, [t.theta[:n_theta] for t in tuned], frozen=frozen)
    for p, parts, system in zip(points, tuned, closed, strict=True):
        at_p = refer(assembly, p, frozen=frozen)
        for omega in resonances(assembly):
            found = response(system, omega)
            assert found.shape == (2 * n_rb, sum(columns))
            assert compared(found, at_p.two_by_two(1j * omega, parts), n_rb, columns) < 1e-9


@pytest.mark.parametrize(("name", "n_flex", "delay", "sensing", "frozen"), [CASES[1], CASES[2], CASES[5]])
def test_six_blocks_of_the_error_based_observer(
    assemble: Make,
    tune: Tune,
    refer: Refer,
    resonances: Frequencies,
    response: Response,
    name: str,
    n_flex: int,
    delay: float,
    sensing: str,
    frozen: bool,
) -> None:
    """The same loop in the other problem, whose first disturbance the observer sees in e."""
    kind = {"architecture": "error-observer", "problem": "six-block"}
    assembly = assemble(name, n_flex, delay=delay, sensing=sensing, **kind)
    p, parts, n_rb = assembly.plant.box[:, 1], tune(assembly), assembly.plant.n_rb
    (system,) = closed_at(assembly, p[None], [parts.theta], frozen=frozen)
    at_p = refer(assembly, p, frozen=frozen)
    for omega in resonances(assembly):
        wanted = at_p.six_blocks(1j * omega, parts)
        assert compared(response(system, omega), wanted, n_rb, [n_rb, n_rb, n_flex]) < 1e-9


def test_the_printed_sign_is_positive_feedback(assemble: Make, tune: Tune, refer: Refer, response: Response) -> None:
    """u_FM = +K_FM eta' is what is printed: it is ours with -xi, far from ours with xi, and takes damping away."""
    assembly = assemble("small", 1, architecture="error-observer", sensing="rigid-body")
    p, omega = assembly.plant.box[:, 0], float(assembly.omega_flex[0])
    tuned, at_p = tune(assembly), refer(assembly, p, frozen=False)
    s, one = 1j * omega, np.eye(1)
    K_FM, (O_u, O_y) = at_p.K_FM(s, tuned), at_p.error_observer(s, tuned.L)
    printed = np.linalg.solve(one - K_FM @ O_u, K_FM @ -O_y)
    opposite = dataclasses.replace(tuned, xi=-tuned.xi)
    assert np.allclose(printed, at_p.by_error(s, opposite)[2], rtol=1e-12)
    found = response(two_by_two(assembly.loop).at(p).close(*assembly.structure.realize(tuned.theta)), omega)
    wrong = at_p.two_by_two(s, opposite)
    assert np.max(np.abs(found + wrong)) > 1e-3 * np.max(np.abs(wrong))


@pytest.mark.parametrize("sensing", ["all", "rigid-body"])
def test_positive_xi_damps(assemble: Make, sensing: str) -> None:
    """With K_RB at a tenth of its gain and the Riccati observer, the mode's damping rises and falls with xi."""
    assembly = assemble("small", 1, architecture="error-observer", sensing=sensing)
    box, K = assembly.plant.box, assembly.rigid_body
    rigid = K.parameters(K.rule_of_thumb(assembly.scaling.f_bw / 3))
    where = box.mean(axis=1)
    damping = {}
    for xi in (-0.02, 0.0, 0.02, 0.04):
        theta = assembly.start(np.linspace(box[:, 0], box[:, 1], 21), rigid=rigid, xi=xi)
        A = two_by_two(assembly.loop).at(where).close(*assembly.structure.realize(theta))[0]
        poles, w = np.linalg.eigvals(A), float(assembly.omega_flex[0])
        near = poles[(np.abs(poles.imag) > 0.9 * w) & (np.abs(poles.imag) < 1.1 * w)]
        damping[xi] = float(np.min(-near.real / np.abs(near)))
    assert damping[0.0] == pytest.approx(0.01, rel=0.1)
    assert damping[-0.02] < damping[0.0] - 0.003
    assert damping[0.0] + 0.003 < damping[0.02] < damping[0.04]


def test_no_observer_knows_of_the_disturbances(assemble: Make, tune: Tune) -> None:
    """The error-based observer is not told of u_RB, w1 or w2: with L = 0 it moves by u_FM alone."""
    assembly = assemble("small", 3, architecture="error-observer")
    P = two_by_two(assembly.loop).at(assembly.plant.box[:, 0])
    n_plant, n_rb, n_flex = assembly.loop.plant.n_x, 2, 3
    observer = slice(n_plant + n_rb + n_rb + 2 * n_flex, n_plant + n_rb + n_rb + 2 * n_flex + 2 * n_flex)
    assert np.array_equal(P.A[observer, observer], assembly.observer.model.at(assembly.plant.box[:, 0]).A)
    rest = np.delete(P.A[observer], np.arange(observer.start, observer.stop), axis=1)
    assert not np.any(rest)
    assert not np.any(P.B1[observer])
    assert not np.any(P.B2[observer, :n_rb])
    assert np.array_equal(P.B2[observer, n_rb : n_rb + 2 * n_flex], np.diag(assembly.observer.injection))
    assert np.any(P.B2[observer, n_rb + 2 * n_flex :])


def test_wired_closed_loop_is_the_closed_generalized_plant(assemble: Make, tune: Tune) -> None:
    for architecture in ARCHITECTURES:
        assembly = assemble("small", 3, delay=4e-4, architecture=architecture, problem="two-by-two")
        p, n = assembly.plant.box[:, 1], assembly.structure.n_parameters
        theta = tune(assembly).theta[:n]
        wired = assembly.loop.wire(
            controller=assembly.tuned_parts(theta),
            weighted=True,
            flexible_input=assembly.observer is not None,
            problem="two-by-two",
        ).at(p)
        closed = two_by_two(assembly.loop).at(p).close(*assembly.structure.realize(theta))
        for ours, theirs in zip((wired.A, wired.B, wired.C, wired.D), closed, strict=True):
            assert np.allclose(ours, theirs, rtol=0, atol=1e-11 * max(1.0, float(np.max(np.abs(theirs)))))


def test_blocks_of_both_problems_have_the_same_bounds_between_the_cut_offs(assemble: Make) -> None:
    """|W_z| |W_w| of the four common blocks, far above f_I and far below f_r: K_s, K_r and epsilon mean the same."""
    filters = assemble("small", 1).filters
    w = 0.5 * (np.max(filters.f_I) + np.min(filters.f_r)) * 2 * np.pi
    six, two = (places.magnitudes(name, filters, np.array([w])) for name in ("six-block", "two-by-two"))
    for W_z, other_z in zip(six[0], two[0], strict=True):
        for W_w, other_w in zip(six[1][1:], two[1], strict=True):
            assert np.allclose(np.outer(W_z[0], W_w[0]), np.outer(other_z[0], other_w[0]), rtol=0.3)
    low = np.array([1e-3])
    six, two = (places.magnitudes(name, filters, low) for name in ("six-block", "two-by-two"))
    assert np.allclose(six[0][1] * six[1][1], two[0][1] * two[1][0], rtol=1e-6)  # complementary sensitivity: K_r
    assert np.allclose(six[0][0][0] * six[1][2][0, 0], two[0][0][0] * two[1][1][0, 0], rtol=1e-12)


def test_filters_are_what_their_magnitudes_say(assemble: Make, response: Response) -> None:
    filters, omega = assemble("small", 3).filters, np.array([7.0, 380.0, 9e3])
    for name in ("six-block", "two-by-two"):
        parts = places.places(name, filters)
        (W_z1, W_z2), disturbances = places.magnitudes(name, filters, omega)
        force, flexible = disturbances[-2:]
        for k, w in enumerate(omega):
            for system, wanted in ((parts.u_RB, W_z2), (parts.force, force), (parts.flexible, flexible)):
                assert np.allclose(np.abs(response(system, w)), np.diag(wanted[k]), rtol=1e-12, atol=1e-15)
            wanted_z1 = parts.error * np.abs(1j * w + 2 * np.pi * filters.f_I) / w
            assert np.allclose(W_z1[k], wanted_z1, rtol=1e-12)


def test_unknown_problem(assemble: Make) -> None:
    with pytest.raises(DomainError, match="problem is 'four-block', wanted one of six-block, two-by-two"):
        assemble("small", 1, problem="four-block")
    with pytest.raises(DomainError, match="problem is 'nine'"):
        places.magnitudes("nine", assemble("small", 1).filters, np.ones(1))


def test_sizes(assemble: Make) -> None:
    for sensing, n_out in (("all", 3), ("rigid-body", 2)):
        loop = assemble("small", 3, sensing=sensing, architecture="error-observer").loop
        P = two_by_two(loop)
        assert (P.n_w, P.n_z, P.n_u, P.n_y) == (2 + 3, 4, 2 + 6 + 3, 4 + n_out + 3)
        assert six_block(loop).n_w == 2 + 2 + 3
    assert two_by_two(assemble("small", 1, architecture="rigid-body").loop).n_w == 2
