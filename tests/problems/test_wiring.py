"""Guards the wiring of signals: sums, gains, driven systems, and diagrams that are not complete."""

from __future__ import annotations

import control
import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.problems.wiring import Wiring

BOX = [[-1.0, 1.0]]


def test_mass_and_spring_whose_stiffness_depends_on_p() -> None:
    wiring = Wiring(BOX, states=[("x", 1), ("v", 1)], inputs=[("f", 1)])
    stiffness = ChebyshevMatrix(np.reshape([3.0, 1.0], (2, 1, 1)), BOX)  # 3 + p
    x, v, f = wiring.state("x"), wiring.state("v"), wiring.input("f")
    wiring.set_derivative("x", v)
    wiring.set_derivative("v", f - stiffness @ x - 0.1 * np.eye(1) @ v)
    system = wiring.read([x, stiffness @ x])
    frozen = system.at([0.5])
    assert frozen.A.tolist() == [[0.0, 1.0], [-3.5, -0.1]]
    assert frozen.B.tolist() == [[0.0], [1.0]]
    assert frozen.C.tolist() == [[1.0, 0.0], [3.5, 0.0]]
    assert frozen.D.tolist() == [[0.0], [0.0]]
    assert system.B.is_constant
    assert system.A.degree == (1,)


def state_space(seed: int, n_x: int, n_u: int, n_y: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    shapes = ((n_x, n_x), (n_x, n_u), (n_y, n_x), (n_y, n_u))
    return control.ss(*(rng.standard_normal(shape) for shape in shapes))


def arrays(system: control.StateSpace) -> tuple[Array, Array, Array, Array]:
    return system.A, system.B, system.C, system.D


def test_driven_systems_in_series_and_parallel() -> None:
    F, G, H = state_space(0, 3, 2, 2), state_space(1, 2, 2, 1), state_space(2, 1, 2, 1)
    wiring = Wiring(BOX, states=[("F", 3), ("G", 2), ("H", 1)], inputs=[("d", 1), ("u", 2)])
    u = wiring.input("u")
    through = wiring.drive("G", arrays(G), wiring.drive("F", arrays(F), u))
    beside = wiring.drive("H", arrays(H), u)
    system = wiring.read([wiring.stack(through - beside, u), wiring.input("d"), wiring.zero(1)]).at([0.0])
    for s in (0.3j, 4.0j):
        value = system(s)
        assert np.allclose(value[0, 1:], (G(s) @ F(s) - H(s)).ravel(), rtol=1e-12)
        assert value[0, 0] == 0.0
        assert np.allclose(value[1:3, 1:], np.eye(2))
        assert value[3].tolist() == [1.0, 0.0, 0.0]
        assert value[4].tolist() == [0.0, 0.0, 0.0]


def test_negative_feedback() -> None:
    G = state_space(3, 3, 1, 1)
    strictly = arrays(G)[:3] + (np.zeros((1, 1)),)
    wiring = Wiring(BOX, states=[("G", 3)], inputs=[("r", 1)])
    y = strictly[2] @ wiring.state("G")
    closed = wiring.read([wiring.drive("G", strictly, wiring.input("r") - y)]).at([0.0])
    assert closed(1j) == pytest.approx(control.feedback(control.ss(*strictly), 1)(1j), rel=1e-12)


def test_order_of_states_and_inputs_is_the_declared_one() -> None:
    wiring = Wiring(BOX, states=[("b", 1), ("a", 2)], inputs=[("v", 1), ("u", 2)])
    wiring.set_derivative("a", wiring.input("u"))
    wiring.set_derivative("b", wiring.input("v"))
    system = wiring.read([wiring.state("a")]).at([0.0])
    assert system.B.tolist() == np.eye(3).tolist()
    assert system.C.tolist() == [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def test_every_state_needs_a_derivative_of_its_size() -> None:
    wiring = Wiring(BOX, states=[("x", 2)], inputs=[("u", 1)])
    with pytest.raises(DimensionError, match="state 'x' needs a derivative of 2 rows"):
        wiring.read([wiring.state("x")])
    wiring.set_derivative("x", wiring.input("u"))
    with pytest.raises(DimensionError, match="2 rows"):
        wiring.read([wiring.state("x")])


def test_signals_that_do_not_fit() -> None:
    wiring = Wiring(BOX, states=[("x", 2)], inputs=[("u", 1)])
    with pytest.raises(DimensionError, match="cannot add"):
        wiring.state("x") + wiring.input("u")
    with pytest.raises(DimensionError, match="cannot multiply"):
        np.eye(3) @ wiring.state("x")
    with pytest.raises(KeyError):
        wiring.state("y")
