"""Guards co-design with the error-based observer: norms, order, physical gains, damping, shared columns, refusals."""

from __future__ import annotations

import dataclasses
import itertools
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.codesign import (
    Design,
    Specification,
    codesign,
    column_norms,
    complexity,
    feedforward_residual,
    measure,
)
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.codesign import _initial
from lpvhinf.codesign.positions import norms_at
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import AssumptionError, DomainError, LpvHinfWarning
from lpvhinf.fitting import interpolate
from lpvhinf.plant import ModalModel
from lpvhinf.storage import read_arrays

POINTS = np.array([[-0.1], [-0.031], [0.0], [0.047], [0.1]])
QUICK: dict[str, Any] = {"n_positions": 3, "starts": 1, "max_iterations": 1, "exchange_rounds": 0, "n_search": 1}


@pytest.fixture(scope="module")
def by_error(small_plant: DecoupledPlant, rigid: Design, wanted: Specification) -> Design:
    """An error-based design that starts from the conventional one."""
    return codesign(
        small_plant,
        "error-observer",
        wanted,
        positions=rigid.positions,
        warm_start=rigid,
        starts=1,
        max_iterations=10,
        exchange_rounds=1,
        n_search=8,
    )


def test_gammas_are_slicots(by_error: Design) -> None:
    assert (by_error.architecture, by_error.problem) == ("error-observer", "two-by-two")
    for (A, B, C, D), gamma in zip(by_error.frozen(by_error.positions, weighted=True), by_error.gammas, strict=True):
        assert (B.shape[1], C.shape[0]) == (3, 4)
        assert np.max(np.linalg.eigvals(A).real) < 0.0
        norm, _ = control.linfnorm(control.ss(A, B, C, D))
        assert norm == pytest.approx(gamma, rel=1e-6)
    loop = by_error.performance_loop.at(by_error.positions[0])
    assert np.max(loop.poles().real) < 0.0
    assert control.linfnorm(loop)[0] == pytest.approx(by_error.gammas[0], rel=1e-4)


def test_it_damps(rigid: Design, by_error: Design) -> None:
    without, damped = measure(rigid, POINTS), measure(by_error, POINTS)
    assert by_error.xi is not None
    assert np.all(by_error.xi > 0.0)
    assert np.all(damped.damping[:, 0] > 3.0 * without.damping[:, 0])
    assert np.max(damped.mode_peak) < 0.316 * np.max(without.mode_peak)  # 10 dB at the worst position


def test_order_and_multiplications(rigid: Design, observer: Design, by_error: Design) -> None:
    plant = by_error.assembly.plant
    n_rb, n_flex, n_out = plant.n_rb, plant.n_flex, plant.n_out
    assert by_error.controller.n_x == observer.controller.n_x - 2 * n_rb == rigid.controller.n_x + 4 * n_flex
    counts = {d.architecture: complexity(d) for d in (rigid, observer, by_error)}
    assert {name: c.states for name, c in counts.items()} == {
        "rigid-body": 6,
        "output-observer": 14,
        "error-observer": 10,
    }
    # PIDs: 2x2 states, 2x2 inputs and 2 outputs an axis; an integrator each
    assert dict(counts["rigid-body"].blocks) == {"integrators": n_rb, "K_RB": 10 * n_rb}
    assert counts["rigid-body"].scheduling == counts["rigid-body"].scheduled_entries == 0
    by_output, ours = counts["output-observer"].blocks, counts["error-observer"].blocks
    assert ours["dynamics"] == 6 * n_flex == by_output["dynamics"] - 3 * n_rb
    assert ours["outputs"] == 2 * n_out * n_flex == by_output["outputs"] - n_out * n_rb
    assert ours["correction"] == 2 * n_flex * n_out == by_output["correction"] - 2 * n_rb * n_out
    assert ours["band-pass"] == by_output["band-pass"] == 7 * n_flex
    assert counts["error-observer"].multiplications == sum(ours.values())
    assert counts["error-observer"].scheduled_entries == 2 * n_out * n_flex
    assert 0 < counts["error-observer"].scheduling < counts["output-observer"].scheduling
    with pytest.raises(DomainError, match="f_sample is 0"):
        complexity(by_error, f_sample=0.0)


def test_L_and_xi_are_physical(by_error: Design) -> None:
    """The observer's equations in physical units, from (e, y) to u_FM, at a position between the nodes."""
    plant, p, f = by_error.assembly.plant, np.array([0.037]), 47.0
    s, w, z = 2j * np.pi * f, float(plant.omega[2]), float(plant.zeta[2])
    assert by_error.L is not None
    assert by_error.xi is not None
    assert by_error.L.shape == (2, 3)
    A, B = np.array([[0.0, 1.0], [-(w**2), -2 * z * w]]), np.array([[0.0], [1.0]])
    C = np.column_stack([plant.fit["C"].matrix.at(p)[:, 0], np.zeros(3)])
    D = interpolate(plant.static_correction, box=plant.box, degree=plant.degree).matrix.at(p)[:, 2:]
    velocity = np.linalg.inv(s * np.eye(2) - A + by_error.L @ C)[1]
    Q = by_error.specification.Q
    K_FM = by_error.xi[0] * (w / Q * s) / (s**2 + w / Q * s + w**2)
    O_u, O_y = velocity @ (B - by_error.L @ D), velocity @ by_error.L
    # u_FM = -K_FM (O_u u_FM + O_y (-e, y_red))
    wanted = -K_FM * np.concatenate([-O_y[:2], np.zeros(2), O_y[2:]]) / (1.0 + K_FM * O_u[0])
    found = by_error.controller.at(p)(s)
    assert np.max(np.abs(found[2] - wanted)) < 1e-9 * np.max(np.abs(wanted))
    K = by_error.K_RB.response([abs(s)])[0]
    assert np.allclose(found[:2, :2], np.diag(K), rtol=1e-9, atol=1e-9 * np.max(np.abs(K)))
    assert not np.any(found[:, 2:4])  # y_RB is known by e alone


def test_the_controller_closes_the_plant_to_the_loop(by_error: Design) -> None:
    """Plant and controller as they are handed out, connected here, are the closed loop: from modal force to e."""
    p = np.array([0.02])
    G, K, T = (m.at(p) for m in (by_error.assembly.plant.system, by_error.controller, by_error.closed_loop))
    for f in (3.0, 40.0, 60.0, 150.0):
        s = 2j * np.pi * f
        g, k = G(s), K(s)
        # u = K (e, y) + disturbances, e = -y_RB
        back = k @ np.vstack([-np.eye(2, 3), np.eye(3)])
        y = np.linalg.solve(np.eye(3) - g @ back, g)
        wanted = -y[:2]  # from (force at u_RB, modal force)
        found = T(s)[:2, 2:5]
        assert np.max(np.abs(found - wanted) / np.max(np.abs(wanted), axis=0)) < 1e-8


def test_without_damping_it_is_the_conventional_loop(rigid: Design, by_error: Design) -> None:
    """xi = 0: the columns of the rigid-body inputs are those of K_RB alone, in both problems."""
    theta = by_error.parameters.copy()
    theta[-1] = 0.0
    off = dataclasses.replace(by_error, parameters=theta)
    alone = dataclasses.replace(rigid, parameters=theta[:10])
    for problem in ("six-block", "two-by-two"):
        ours, theirs, on = (column_norms(d, POINTS, problem=problem) for d in (off, alone, by_error))
        assert np.allclose(ours.rigid, theirs.rigid, rtol=1e-7)
        assert np.allclose(ours.flexible, theirs.flexible, rtol=1e-6)
        assert np.max(on.flexible) < 0.5 * np.max(ours.flexible)


# Columns that designs share


def test_columns_are_parts_of_the_whole(rigid: Design, observer: Design, by_error: Design) -> None:
    for design, problem in itertools.product((rigid, observer, by_error), ("six-block", "two-by-two")):
        found = column_norms(design, POINTS, problem=problem)
        assert found.problem == problem
        assert np.all(found.whole >= np.maximum(found.rigid, found.flexible) * (1.0 - 1e-8))
        assert np.all(found.whole**2 <= (found.rigid**2 + found.flexible**2) * (1.0 + 1e-8))
        n = 4 if problem == "six-block" else 2
        for (A, B, C, D), gain in zip(design.frozen(POINTS, weighted=True, problem=problem), found.rigid, strict=True):
            assert control.linfnorm(control.ss(A, B[:, :n], C, D[:, :n]))[0] == pytest.approx(gain, rel=1e-6)


def test_gammas_are_norms_of_the_columns_that_count(rigid: Design, observer: Design, by_error: Design) -> None:
    assert np.allclose(column_norms(rigid, rigid.positions).rigid, rigid.gammas, rtol=1e-6)
    for design in (observer, by_error):
        assert np.allclose(column_norms(design, design.positions).whole, design.gammas, rtol=1e-6)


def test_columns_elsewhere(by_error: Design) -> None:
    with pytest.raises(DomainError, match=r"points = \[0\.3\] is outside"):
        column_norms(by_error, [[0.3]])
    with pytest.raises(DomainError, match="problem is 'both'"):
        column_norms(by_error, POINTS, problem="both")


@pytest.mark.parametrize("architecture", ["rigid-body", "output-observer"])
def test_every_architecture_takes_the_two_by_two_problem(
    small_plant: DecoupledPlant, wanted: Specification, rigid: Design, architecture: str
) -> None:
    design = codesign(
        small_plant, architecture, wanted, problem="two-by-two", positions=POINTS[::4], warm_start=rigid, **QUICK
    )
    assert design.problem == "two-by-two"
    columns = column_norms(design, design.positions)
    counted = columns.rigid if architecture == "rigid-body" else columns.whole
    assert np.allclose(counted, design.gammas, rtol=1e-6)
    assert np.allclose(norms_at(design.assembly, design.parameters, design.positions), design.gammas, rtol=1e-6)


# Files, reports, starts


def test_saved_and_reported(by_error: Design, tmp_path: Path) -> None:
    by_error.save(tmp_path / "design")
    arrays = read_arrays(tmp_path / "design" / "design.npz", "lpvhinf.Design")
    assert arrays["architecture"] == "error-observer"
    assert arrays["problem"] == "two-by-two"
    assert np.array_equal(arrays["L"], np.asarray(by_error.L))
    assert "error-observer design" in by_error.report()
    assert "two-by-two problem" in by_error.report()


def test_it_starts_from_any_design(observer: Design, by_error: Design) -> None:
    (own,) = _initial(by_error.assembly, by_error.positions, by_error, None, 2)
    assert np.allclose(own, by_error.parameters, rtol=1e-12, atol=1e-12)
    starts = _initial(by_error.assembly, by_error.positions, observer, None, 2)
    assert len(starts) == 2
    for start in starts:
        assert np.allclose(start[:10], observer.parameters[:10], rtol=1e-12)
        assert len(start) == 10 + 2 * 3 + 1


# What it relies on


def test_an_unobservable_mode_is_refused(small_modal: ModalModel, wanted: Specification) -> None:
    """Both outputs hold the first mode with a gain that vanishes at p = 0.04."""

    def outputs(points: Array) -> Array:
        gains = small_modal.output_gains(points).copy()
        gains[:, :, 2] *= (points[:, :1] - 0.04) / 0.1
        return gains

    hidden = dataclasses.replace(small_modal, output_map=outputs)
    plant = decouple(hidden, n_flex=1, degree=16)
    with pytest.raises(AssumptionError, match=r"flexible mode 1 \(60\.0 Hz\) is not observable at p = \[0\.04\]"):
        codesign(plant, "error-observer", wanted, **QUICK)


def test_no_warning_where_feedforward_cancels(small_plant: DecoupledPlant, by_error: Design) -> None:
    residual, _ = feedforward_residual(small_plant)
    assert residual < 1e-9
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        codesign(small_plant, "error-observer", by_error.specification, warm_start=by_error, **QUICK)


def test_a_wrong_mass_warns_with_its_residual(small_modal: ModalModel, wanted: Specification) -> None:
    """All forces are 3 % weaker on the true plant than believed: 3 % of the acceleration is left in the error."""
    true = dataclasses.replace(small_modal, input_map=lambda p: 0.97 * small_modal.input_gains(p))
    plant = decouple(SimpleNamespace(modal=true, known=small_modal), n_flex=1, degree=16)
    residual, p = feedforward_residual(plant)
    assert residual == pytest.approx(0.03, rel=1e-6)
    assert plant.box[0, 0] <= p[0] <= plant.box[0, 1]
    with pytest.warns(LpvHinfWarning, match=r"leaves 3\.0 % of the rigid-body motion in the error"):
        codesign(plant, "error-observer", wanted, **QUICK)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        codesign(plant, "rigid-body", wanted, **QUICK)


def test_problems_are_named(small_plant: DecoupledPlant) -> None:
    with pytest.raises(DomainError, match="problem is 'four-block', wanted one of six-block, two-by-two"):
        codesign(small_plant, "error-observer", problem="four-block")
    assembly = Assembly(plant=small_plant, specification=Specification(f_bw=12.0), architecture="error-observer")
    assert assembly.problem_name == "two-by-two"
