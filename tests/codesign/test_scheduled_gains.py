"""Guards scheduled gains: the layout of theta, gradients, starts, and a controller that carries the polynomials."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from lpvhinf.codesign import Design, Specification, codesign, complexity, largest_real_part
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.positions import norms_at
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct.structures import check_structure
from lpvhinf.storage import read_arrays

POINTS = np.array([[-0.1], [-0.037], [0.0], [0.061], [0.1]])
EVERYTHING = {"K_RB": 1, "L": 2, "xi": 1}
Make = Callable[[Assembly, np.ndarray], Design]


def assembled(plant: DecoupledPlant, wanted: Specification, schedule: dict[str, int], architecture: str) -> Assembly:
    specification = dataclasses.replace(wanted, schedule=schedule)
    return Assembly(plant=plant, specification=specification, architecture=architecture)


def moving(assembly: Assembly, seed: int = 0, size: float = 0.1) -> np.ndarray:
    """The start, with coefficients that depend on p."""
    theta = assembly.start(POINTS)
    rng = np.random.default_rng(seed)
    return theta + size * np.where(theta == 0.0, rng.standard_normal(len(theta)), 0.0)


@pytest.mark.parametrize("architecture", ["rigid-body", "output-observer", "error-observer"])
def test_constant_gains_are_a_special_case(
    small_plant: DecoupledPlant, wanted: Specification, architecture: str
) -> None:
    constant = assembled(small_plant, wanted, {}, architecture)
    scheduled = assembled(small_plant, wanted, EVERYTHING, architecture)
    theta = constant.start(POINTS)
    moved = scheduled.translated(constant, theta)
    assert len(moved) > len(theta)
    assert np.array_equal(scheduled.start(POINTS), moved)
    assert np.array_equal(scheduled.translated(scheduled, moving(scheduled)), moving(scheduled))
    for p in POINTS:
        for one, other in zip(scheduled.structure.realize(moved, p), constant.structure.realize(theta), strict=True):
            assert np.allclose(one, other, rtol=1e-14, atol=0)
    norms = [norms_at(a, t, POINTS) for a, t in ((scheduled, moved), (constant, theta))]
    assert np.allclose(norms[0], norms[1], rtol=1e-9)


@pytest.mark.parametrize("architecture", ["rigid-body", "output-observer", "error-observer"])
def test_gradients(small_plant: DecoupledPlant, wanted: Specification, architecture: str) -> None:
    assembly = assembled(small_plant, wanted, EVERYTHING, architecture)
    for p in POINTS[1:4]:
        assert check_structure(assembly.structure, moving(assembly), p) < 1e-6


@pytest.mark.parametrize("architecture", ["output-observer", "error-observer"])
def test_the_loops_carry_the_polynomials(
    small_plant: DecoupledPlant, wanted: Specification, with_parameters: Make, architecture: str
) -> None:
    """Controller and loops over P, frozen at p, are those of the gains that the structure has there."""
    assembly = assembled(small_plant, wanted, EVERYTHING, architecture)
    theta = moving(assembly)
    design, alone = with_parameters(assembly, theta), assembled(small_plant, wanted, {}, architecture)
    for p in POINTS:
        rigid, L, xi = assembly.split(theta, p)
        there = with_parameters(alone, np.concatenate([rigid, L.ravel(), -xi]))
        for name in ("controller", "closed_loop", "performance_loop"):
            ours, theirs = getattr(design, name).at(p), getattr(there, name).at(p)
            for f in (0.7, 11.0, 60.3, 300.0):
                found, formula = ours(2j * np.pi * f), theirs(2j * np.pi * f)
                assert np.max(np.abs(found - formula)) < 1e-8 * np.max(np.abs(formula))
        for ours, theirs in zip(design.frozen(p[None])[0], there.frozen(p[None])[0], strict=True):
            assert np.allclose(ours, theirs, rtol=1e-12, atol=1e-12 * np.max(np.abs(theirs), initial=0.0))
        gains = design.gains_at(p)
        assert np.allclose(gains.L, there.L, rtol=1e-12)
        assert np.allclose(gains.xi, there.xi, rtol=1e-12)
        assert np.allclose(gains.K_RB.response([50.0]), there.K_RB.response([50.0]), rtol=1e-12)
    assert np.array_equal(np.asarray(design.L), np.asarray(design.gains_at(POINTS[2]).L))
    assert not np.allclose(np.asarray(design.L), np.asarray(design.gains_at(POINTS[0]).L), rtol=1e-3)


@pytest.fixture(scope="module")
def constant(small_plant: DecoupledPlant, rigid: Design, wanted: Specification) -> Design:
    settings: dict[str, Any] = {"positions": POINTS[::2], "starts": 1, "max_iterations": 12, "exchange_rounds": 0}
    return codesign(small_plant, "error-observer", wanted, warm_start=rigid, n_search=4, **settings)


def test_a_scheduled_design_is_no_worse_than_its_start(
    small_plant: DecoupledPlant, constant: Design, wanted: Specification, tmp_path: Path
) -> None:
    design = codesign(
        small_plant,
        "error-observer",
        dataclasses.replace(wanted, schedule={"L": 1}),
        positions=constant.positions,
        warm_start=constant,
        max_iterations=12,
        exchange_rounds=0,
        n_search=4,
    )
    assert len(design.parameters) == len(constant.parameters) + 6
    assert design.gamma < constant.gamma * (1.0 - 1e-3)
    assert np.max(largest_real_part(design, POINTS)) < 0.0
    for (A, B, C, D), gamma in zip(design.frozen(design.positions, weighted=True), design.gammas, strict=True):
        assert control.linfnorm(control.ss(A, B, C, D))[0] == pytest.approx(gamma, rel=1e-6)
    assert np.allclose(norms_at(design.assembly, design.parameters, design.positions), design.gammas, rtol=1e-6)
    assert "polynomials of p: L of degree 1" in design.report()
    design.save(tmp_path)
    assert read_arrays(tmp_path / "design.npz", "lpvhinf.Design")["schedule_L"] == 1
    assert complexity(design).scheduled_entries == complexity(constant).scheduled_entries + 6
    assert complexity(design).multiplications == complexity(constant).multiplications


def test_the_constant_design_comes_first(small_plant: DecoupledPlant, wanted: Specification, rigid: Design) -> None:
    """Without a start there is one all the same."""
    start = rigid.assembly.rigid_body.parameters(rigid.K_RB)
    quick: dict[str, Any] = {"positions": POINTS[::4], "rigid_start": start, "starts": 1, "n_search": 2}
    quick |= {"max_iterations": 2, "exchange_rounds": 0}
    scheduled = dataclasses.replace(wanted, schedule={"L": 1, "xi": 1})
    design = codesign(small_plant, "error-observer", scheduled, **quick)
    before = codesign(small_plant, "error-observer", wanted, **quick)
    assert design.gamma <= before.gamma * (1.0 + 1e-9)
    assert design.evaluations.exact > before.evaluations.exact


def test_degrees_can_be_raised_but_not_lowered(small_plant: DecoupledPlant, wanted: Specification) -> None:
    low, high = (assembled(small_plant, wanted, {"L": k}, "error-observer") for k in (1, 2))
    theta = moving(low)
    raised = high.translated(low, theta)
    assert np.allclose(high.split(raised, POINTS[1])[1], low.split(theta, POINTS[1])[1], rtol=1e-14)
    with pytest.raises(DomainError, match="L of the design to start from has degree 2 in p, wanted at most 1"):
        low.translated(high, raised)


def test_wrong_schedules() -> None:
    with pytest.raises(DomainError, match="has no option 'Q'"):
        Specification(schedule={"Q": 1})
    with pytest.raises(DomainError, match=r"schedule\['L'\] is 0"):
        Specification(schedule={"L": 0})
    with pytest.raises(DomainError, match="wanted only one of them"):
        Specification(schedule={"K_RB": 1}, order_K_RB=4)
    assert Specification.from_mapping({"f_bw": 30.0, "schedule": {"L": 1}}).schedule == {"L": 1}
