"""Guards the conventional 4-block plant: every block of M against its formula, with or without an observer at hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.problems import four_block
from lpvhinf.statespace.generalized import NAMES

# of conftest.py: an Assembly, its Tuned parameters, its Reference
Make = Callable[..., Any]
Tune = Callable[..., Any]
Refer = Callable[..., Any]
Frequencies = Callable[[Any], Array]
Response = Callable[[tuple[Array, Array, Array, Array], float], Array]


@pytest.mark.parametrize(
    ("name", "n_flex", "delay", "frozen"),
    [("small", 1, 0.0, False), ("small", 3, 4e-4, True), ("benchmark", 1, 0.0, True), ("benchmark", 3, 2e-4, True)],
)
def test_every_block_is_the_formula(
    assemble: Make,
    tune: Tune,
    refer: Refer,
    resonances: Frequencies,
    response: Response,
    name: str,
    n_flex: int,
    delay: float,
    frozen: bool,
) -> None:
    assembly = assemble(name, n_flex, delay=delay, architecture="rigid-body")
    n_rb = assembly.plant.n_rb
    for seed, p in enumerate(assembly.plant.box.T):
        tuned, at_p = tune(assembly, seed=seed), refer(assembly, p, frozen=frozen)
        rigid = tuned.theta[: 5 * n_rb]
        P = assembly.generalized_plants(p[None])[0] if frozen else assembly.problem(assembly.loop).at(p)
        assert (P.n_w, P.n_z, P.n_u, P.n_y) == (2 * n_rb, 2 * n_rb, n_rb, 2 * n_rb)
        closed = P.close(*assembly.structure.realize(rigid))
        for omega in resonances(assembly):
            M = at_p.M(1j * omega, tuned, blocks=4)
            found = response(closed, omega)
            for rows in (slice(0, n_rb), slice(n_rb, None)):
                for cols in (slice(0, n_rb), slice(n_rb, None)):
                    size = np.max(np.abs(M[rows, cols]))
                    error = np.max(np.abs(found[rows, cols] + M[rows, cols]))  # z = -M w
                    assert error < 1e-9 * size + 1e-15 * np.max(np.abs(M))


def test_an_observer_makes_no_difference(assemble: Make) -> None:
    with_observer = assemble("small", 1)
    without = assemble("small", 1, architecture="rigid-body")
    p = with_observer.plant.box[:, 1]
    left, right = four_block(with_observer.loop).at(p), four_block(without.loop).at(p)
    for name in NAMES:
        assert np.array_equal(getattr(left, name), getattr(right, name))


def test_wired_closed_loop_is_the_closed_generalized_plant(assemble: Make, tune: Tune) -> None:
    assembly = assemble("small", 3, delay=4e-4, architecture="rigid-body")
    p = assembly.plant.box[:, 0]
    theta = tune(assembly).theta[:10]
    wired = assembly.loop.wire(controller=assembly.tuned_parts(theta), weighted=True, flexible_input=False).at(p)
    closed = four_block(assembly.loop).at(p).close(*assembly.structure.realize(theta))
    for ours, theirs in zip((wired.A, wired.B, wired.C, wired.D), closed, strict=True):
        assert np.allclose(ours, theirs, rtol=0, atol=1e-12 * max(1.0, float(np.max(np.abs(theirs)))))


def test_flexible_forces_reach_the_conventional_loop(assemble: Make, tune: Tune, response: Response) -> None:
    """The open 6-block column of the conventional design: w3 acts through the plant alone."""
    assembly = assemble("small", 1, architecture="rigid-body")
    p, omega = assembly.plant.box[:, 0], 50.0
    parts = assembly.tuned_parts(tune(assembly).theta[:10])
    wired = assembly.loop.wire(controller=parts, weighted=False, flexible_input=True).at(p)
    found = response((wired.A, wired.B, wired.C, wired.D), omega)
    G = assembly.loop.plant.at(p)(1j * omega)[:2]
    S = -found[:2, :2]
    assert found.shape == (4, 5)
    assert np.allclose(found[:2, 2:4], -S @ G[:, :2], rtol=1e-9)
    assert np.allclose(found[:2, 4:], -S @ G[:, 2:], rtol=1e-9)
