"""The point of control: rigid transform, mode shapes at the mover point -p, the published amplitudes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa import Effects, MMPAParameters, benchmark

P = MMPAParameters()
POINTS = np.array([[0.0, 0.0], [0.06, 0.06], [-0.013, 0.04]])


@pytest.fixture(scope="module", params=[P, replace(P, mass_heights=True, point_of_control=(0.02, -0.03, 0.01))])
def plant(request):
    return benchmark(request.param, magnetics="first-harmonic")


def test_rigid_modes_are_seen_through_the_rigid_transform(plant):
    gains = plant.performance_gains(POINTS)[:, :, :6] @ np.linalg.inv(plant.modal.rigid_body_scaling)
    transform = plant.point_of_control.rigid_transform(POINTS)
    assert gains == pytest.approx(transform, abs=1e-12)
    # by hand: from the centre of gravity to the point, as a cross product
    x, y, z = plant.parameters.point_of_control
    arm = np.column_stack([[x, y] - POINTS, np.full(3, 0.004 + z)]) - plant.centre_of_gravity
    turns = np.array([np.cross(np.eye(3), d).T for d in arm])
    assert transform[:, :3, 3:] == pytest.approx(turns, abs=1e-15)
    assert np.array_equal(transform[:, :, :3], np.broadcast_to(np.eye(6, 3), (3, 6, 3)))
    assert np.array_equal(transform[:, 3:, 3:], np.broadcast_to(np.eye(3), (3, 3, 3)))


def test_flexible_modes_are_seen_by_their_shape(plant):
    gains, V = plant.performance_gains(POINTS)[:, :, 6:], plant.modal.V[:, 6:]
    x, y, z = plant.parameters.point_of_control
    places, Z = np.array([x, y]) - POINTS, 0.004 + z
    w, w_x, w_y = (plant.plate.rows(places, d) @ V[3:] for d in ((0, 0), (1, 0), (0, 1)))
    assert gains[:, 2] == pytest.approx(w, abs=1e-12)
    assert gains[:, 3] == pytest.approx(w_y, abs=1e-12)
    assert gains[:, 4] == pytest.approx(-w_x, abs=1e-12)
    c = plant.centre_of_gravity
    across, along = places[:, 1] - c[1], places[:, 0] - c[0]
    assert gains[:, 0] == pytest.approx(V[0] - Z * w_x - np.outer(across, V[2]), abs=1e-12)
    assert gains[:, 1] == pytest.approx(V[1] - Z * w_y + np.outer(along, V[2]), abs=1e-12)
    assert gains[:, 5] == pytest.approx(np.broadcast_to(V[2], (3, 15)), abs=1e-12)


def test_published_amplitudes_of_the_torsion():
    # mass-normalised amplitude times sqrt(mass), at the centre and in the corner of P
    plant = benchmark(magnetics="first-harmonic", n_flex=1)
    at = plant.performance_gains(POINTS[:2])[:, 2, 6] * np.sqrt(plant.mass)
    assert np.abs(at) == pytest.approx([0.02, 0.66], abs=0.006)


def test_a_position_outside_the_box_is_named(plant):
    with pytest.raises(DomainError, match="outside the box"):
        plant.performance_gains([[0.0, 0.07]])


def test_the_controller_works_about_the_known_centre_of_gravity():
    load = Effects(payload_mass=1.0, payload_place=(0.1, 0.0, 0.03))
    plant = benchmark(magnetics="first-harmonic", n_flex=1, effects=load)
    nominal = benchmark(magnetics="first-harmonic", n_flex=1)
    known, true = (point.rigid_transform(POINTS) for point in (plant.known_point_of_control, plant.point_of_control))
    assert np.array_equal(known, nominal.point_of_control.rigid_transform(POINTS))
    shift = plant.centre_of_gravity - nominal.centre_of_gravity
    assert true[:, 2, 4] - known[:, 2, 4] == pytest.approx(np.full(3, shift[0]), abs=1e-15)
    assert true[:, 0, 4] - known[:, 0, 4] == pytest.approx(np.full(3, -shift[2]), abs=1e-15)
