"""Guards the flexible modes as uncertainty: coverage between positions, the true loops as members, both designs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.codesign import Design
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.positions import norms_at, plant_family
from lpvhinf.codesign.uncertainty import FlexibleUncertainty, flexible_uncertainty, rigid_body_systems
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct.response import Response
from lpvhinf.hinfstruct.uncertainty import compare_designs
from lpvhinf.hinfstruct.uncertainty.robust_design import robust_gains

FITTED = np.linspace(-0.1, 0.1, 11)[:, None]
DENSE = np.linspace(-0.1, 0.1, 47)[:, None]


@pytest.fixture(scope="module")
def flexible(rigid: Design) -> FlexibleUncertainty:
    return flexible_uncertainty(rigid.assembly, FITTED)


def test_the_weight_covers_between_its_positions(rigid: Design, flexible: FlexibleUncertainty) -> None:
    found = flexible.covers(rigid.assembly, DENSE)
    assert found.covered
    assert found.n_systems == 47
    assert found.n_frequencies > 2 * len(flexible.omega)
    assert found.ratio > 0.85  # it is not a weight that covers anything
    assert flexible.weight.mean_excess < 1.5
    assert flexible.coverage.covered
    assert flexible.coverage.n_systems == 128


def test_positions_that_are_not_covered_join_the_fit(rigid: Design) -> None:
    """Fitted to the centre alone: what is checked decides."""
    once = flexible_uncertainty(rigid.assembly, [[0.0]], order=2, margin=1.05, n_check=16, rounds=1)
    more = flexible_uncertainty(rigid.assembly, [[0.0]], order=2, margin=1.05, n_check=16, rounds=5)
    assert once.coverage.ratio > 1.1
    assert more.coverage.covered


def test_the_nominal_plant_is_the_rigid_body(rigid: Design, flexible: FlexibleUncertainty) -> None:
    omega = np.array([3.0, 50.0])
    G = Response(*flexible.nominal).at(omega)
    f_bw = np.array([12.0, 15.0])
    for value, w in zip(G, omega, strict=True):
        assert np.allclose(value, -np.diag((2 * np.pi * f_bw / w) ** 2), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("p", [-0.083, 0.0, 0.061])
def test_the_true_loop_is_a_member(rigid: Design, flexible: FlexibleUncertainty, p: float) -> None:
    """Delta = W^-1 (G - G_nom), closed around the problem with K_RB, is the 4-block loop with the plant itself."""
    K = rigid.assembly.structure.realize(rigid.parameters)
    problem = flexible.problem
    uncertain, true = (
        Response(*problem.plant.close(*K)),
        Response(*rigid.assembly.generalized_plants(np.array([[p]]))[0].close(*K)),
    )
    omega = np.array([5.0, 80.0, 370.0, 690.0, 1500.0])
    (system,) = rigid_body_systems(rigid.assembly, np.array([[p]]))
    E = Response(*system).at(omega) - Response(*flexible.nominal).at(omega)
    W = Response(flexible.weight.A, flexible.weight.B, flexible.weight.C, flexible.weight.D).at(omega)
    M, wanted = uncertain.at(omega), true.at(omega)
    for k in range(len(omega)):
        Delta = E[k] / W[k, 0, 0]
        assert np.linalg.norm(Delta, 2) < 1.0
        closed = M[k, 2:, 2:] + M[k, 2:, :2] @ Delta @ np.linalg.solve(np.eye(2) - M[k, :2, :2] @ Delta, M[k, :2, 2:])
        assert np.max(np.abs(closed - wanted[k])) < 1e-8 * np.max(np.abs(wanted[k]))


def test_what_is_robust_bounds_every_position(rigid: Design, flexible: FlexibleUncertainty) -> None:
    structure = rigid.assembly.structure
    slower = structure.parameters(structure.rule_of_thumb(0.4 * rigid.assembly.scaling.f_bw))  # type: ignore[attr-defined]
    for theta in (rigid.parameters, slower):
        found = robust_gains([flexible.problem], structure, np.asarray(theta))
        true = norms_at(rigid.assembly, np.asarray(theta), DENSE)
        assert np.max(true) <= found.gain * (1.0 + 1e-6)


@pytest.mark.slow
def test_both_designs(rigid: Design, flexible: FlexibleUncertainty) -> None:
    """Against the uncertainty a design gives away nominal performance, and is the best one in the worst case."""
    positions: Array = rigid.positions
    found = compare_designs(
        plant_family(rigid.assembly), flexible.problem, rigid.assembly.structure, positions, starts=1, n_search=16,
        max_iterations=40,
    )  # fmt: skip
    nominal, several, robust = (found.designs[name] for name in ("nominal", "multi-model", "uncertainty"))
    for design in (nominal, several, robust):
        assert design.gamma_worst <= design.gamma_robust * (1.0 + 1e-6)
    assert several.gamma_worst <= nominal.gamma_worst * (1.0 + 1e-3)
    assert np.isfinite(robust.gamma_robust)
    assert robust.gamma_robust <= several.gamma_robust * (1.0 + 1e-6)
    assert several.gamma_worst <= robust.gamma_worst * (1.0 + 1e-3)


def test_an_observer_is_refused(rigid: Design) -> None:
    with pytest.raises(DomainError, match="architecture is 'output-observer'"):
        flexible_uncertainty(dataclasses.replace(rigid.assembly, architecture="output-observer"), FITTED)
    late = dataclasses.replace(rigid.specification, delay=1e-4)
    with pytest.raises(DomainError, match=r"a delay of 0\.0001 s"):
        flexible_uncertainty(
            Assembly(plant=rigid.assembly.plant, specification=late, architecture="rigid-body"), FITTED
        )
