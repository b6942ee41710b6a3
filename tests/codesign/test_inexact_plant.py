"""Guards co-design for plants whose decoupling is not exact: deviating from what is known, or fully actuated."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, Specification, codesign, largest_real_part, measure
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.fitting import spread_points
from lpvhinf.plant import ModalModel

ARCHITECTURES = ("rigid-body", "output-observer")
POINTS = np.array([[-0.1], [-0.031], [0.0], [0.047], [0.1]])
HERTZ = np.array([0.7, 11.0, 40.0, 59.0, 61.3, 115.0])
Make = Callable[[Assembly, Array], Design]


def fully_actuated(modal: ModalModel) -> DecoupledPlant:
    """The small plant on two actuators, as many as axes: every force also bends it."""
    two = dataclasses.replace(
        modal, input_map=lambda p: modal.input_gains(p)[:, :, [0, 6]], residual=None, input_names=()
    )
    return decouple(two, n_flex=1, actuation="full", mode_weight=0.5, degree=16)


def deviating(modal: ModalModel) -> DecoupledPlant:
    """Uneven actuators and sensors, the first resonance 1.5 % off, and a known model without the last mode."""
    kept = slice(0, 4)
    known = dataclasses.replace(
        modal,
        omega=modal.omega[kept] * np.array([1.0, 1.0, 1.015, 1.0]),
        zeta=modal.zeta[kept],
        input_map=lambda p: modal.input_gains(p)[:, kept] * (1.0 + 0.04 * np.cos(np.arange(7))),
        output_map=lambda p: modal.output_gains(p)[:, :, kept] * np.array([[1.01], [0.99], [1.0]]),
    )
    return decouple(SimpleNamespace(modal=modal, known=known), n_flex=1, degree=16)


MAKERS = {"full": fully_actuated, "deviating": deviating}


@pytest.fixture(scope="module")
def plants(small_modal: ModalModel) -> dict[str, DecoupledPlant]:
    return {name: make(small_modal) for name, make in MAKERS.items()}


@pytest.fixture(scope="module")
def designs(plants: dict[str, DecoupledPlant], wanted: Specification) -> dict[tuple[str, str], Design]:
    """Both architectures on both plants, tuned a little."""
    found: dict[tuple[str, str], Design] = {}
    for name, plant in plants.items():
        for architecture in ARCHITECTURES:
            found[name, architecture] = codesign(
                plant,
                architecture,
                wanted,
                positions=POINTS[[0, 4]],
                warm_start=found.get((name, "rigid-body")),
                starts=1,
                max_iterations=2,
                exchange_rounds=0,
                n_search=2,
            )
    return found


def closed_loop(design: Design, p: Array, s: complex) -> NDArray[np.complex128]:
    """(e, u_RB, u_FM) from (w1, w3) in SI units: the true plant, its transformations, and the controller that is built.

    w2 is left out: it adds to u_RB where the observer sees it, inside of the controller.
    """
    plant = design.assembly.plant
    n_rb, n_out, n_flex = plant.n_rb, plant.n_out, plant.n_flex
    T_y, T_u = plant.matrices(p)
    G = T_y[0] @ plant.modal.local_model(p)(s) @ T_u[0]
    K = design.controller.at(p)(s)
    if design.architecture == "rigid-body":
        K = np.vstack([K, np.zeros((n_flex, n_rb + n_out))])
    rigid = np.eye(n_rb, n_out)
    # y = G (u + [0; w3]), u = K [-rigid y - w1; y]
    from_y = K @ np.vstack([-rigid, np.eye(n_out)])
    inputs = np.hstack([-K[:, :n_rb], np.zeros((n_rb + n_flex, n_flex))])
    w3 = np.vstack([np.zeros((n_rb, n_flex)), np.eye(n_flex)])
    driven = G @ (inputs + np.hstack([np.zeros((n_rb + n_flex, n_rb)), w3]))
    y = np.linalg.solve(np.eye(n_out) - G @ from_y, driven)
    e = -rigid @ y - np.eye(n_rb, n_rb + n_flex)
    return np.asarray(np.vstack([e, from_y @ y + inputs]))


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("name", MAKERS)
def test_loops_are_the_true_plant_and_the_controller(
    designs: dict[tuple[str, str], Design], name: str, architecture: str
) -> None:
    """Frozen and polynomial loops against the physical plant, the transformations and the controller, one by one."""
    design = designs[name, architecture]
    n_rb, scaling = 2, design.assembly.scaling
    columns = [0, 1, 4]  # w1 and w3
    rows = slice(0, 4 if architecture == "rigid-body" else 5)
    left = np.concatenate([1.0 / scaling.output[:n_rb], scaling.input])[rows, None]
    right = np.concatenate([scaling.output[:n_rb], 1.0 / scaling.input])[columns]
    for p, (A, B, C, D) in zip(POINTS, design.frozen(POINTS), strict=True):
        polynomial = design.closed_loop.at(p)
        for f in HERTZ:
            s = 2j * np.pi * f
            wanted = closed_loop(design, p[None], s)[rows]
            tolerance = np.max(np.abs(wanted / left / right)) * left * right
            frozen = (C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)[:, columns] * right
            assert np.all(np.abs(left * frozen[rows] - wanted) < 1e-9 * tolerance)
            assert np.all(np.abs(polynomial(s)[:, columns] - wanted) < 1e-6 * tolerance)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("name", MAKERS)
def test_designs_hold_where_they_were_not_made(
    designs: dict[tuple[str, str], Design], name: str, architecture: str
) -> None:
    design = designs[name, architecture]
    elsewhere = spread_points(design.assembly.plant.box, 16, seed=9)
    assert design.stabilizing
    assert np.max(largest_real_part(design, elsewhere)) < 0.0
    weighted = [np.max(np.linalg.eigvals(A).real) for A, _, _, _ in design.frozen(elsewhere, weighted=True)]
    assert max(weighted) < 0.0
    for p in elsewhere:
        assert np.max(design.closed_loop.at(p).poles().real) < 0.0


@pytest.mark.parametrize("name", MAKERS)
def test_the_observer_damps(designs: dict[tuple[str, str], Design], name: str) -> None:
    without, damped = (measure(designs[name, architecture], POINTS[1::2]) for architecture in ARCHITECTURES)
    assert np.all(damped.damping[:, 0] > 1.5 * without.damping[:, 0])


@pytest.mark.parametrize("name", MAKERS)
def test_the_observer_is_built_from_what_is_known(
    plants: dict[str, DecoupledPlant], wanted: Specification, name: str
) -> None:
    plant = plants[name]
    ours = Assembly(plant=plant, specification=wanted, architecture="output-observer")
    alone = Assembly(plant=plant.known, specification=wanted, architecture="output-observer")
    assert ours.observer is not None
    assert alone.observer is not None
    for one, other in zip(ours.observer.model.matrices, alone.observer.model.matrices, strict=True):
        assert np.array_equal(one.coefficients, other.coefficients)
    for field in ("output", "input", "state"):
        assert np.array_equal(getattr(ours.scaling, field), getattr(alone.scaling, field))
    assert np.array_equal(ours.omega_flex, plant.known.omega[2:3])
    assert (ours.loop.plant.n_x, plant.known.n_modes) == ((10, 5) if name == "full" else (10, 4))
    assert ours.observer.model.B.is_constant == (name == "deviating")


def test_the_controller_does_not_know_the_deviation(
    plants: dict[str, DecoupledPlant], wanted: Specification, with_parameters: Make
) -> None:
    """The same parameters are the same controller, whatever the plant is; only the loops differ."""
    assemblies = [
        Assembly(plant=plant, specification=wanted, architecture="output-observer")
        for plant in (plants["deviating"], plants["deviating"].known)
    ]
    theta = assemblies[1].start(POINTS)
    assert np.array_equal(assemblies[0].start(POINTS), theta)
    ours, alone = (with_parameters(assembly, theta) for assembly in assemblies)
    for one, other in zip(ours.controller.matrices, alone.controller.matrices, strict=True):
        assert np.array_equal(one.coefficients, other.coefficients)
    assert np.array_equal(np.asarray(ours.L), np.asarray(alone.L))
    assert np.array_equal(np.asarray(ours.xi), np.asarray(alone.xi))
    loops = [design.closed_loop.at(POINTS[1])(40j * np.pi) for design in (ours, alone)]
    assert np.linalg.norm(loops[0] - loops[1]) > 1e-3 * np.linalg.norm(loops[1])


def test_observers_follow_input_gains_that_depend_on_p(
    small_modal: ModalModel, wanted: Specification, with_parameters: Make
) -> None:
    """Conventional rigid inputs drive the preserved mode by gains that the observer knows at every position."""
    plant = decouple(small_modal, n_flex=1, input_decoupling="rigid-body", degree=16)
    assembly = Assembly(plant=plant, specification=wanted, architecture="output-observer")
    design = with_parameters(assembly, assembly.start(POINTS))
    for p, (A, B, C, D) in zip(POINTS, design.frozen(POINTS), strict=True):
        polynomial = design.assembly.loop.wire(
            controller=assembly.tuned_parts(design.parameters), weighted=False, flexible_input=True
        ).at(p)
        for f in HERTZ:
            s = 2j * np.pi * f
            frozen = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
            assert np.allclose(frozen, polynomial(s), rtol=0, atol=1e-7 * np.max(np.abs(frozen)))
