"""The mover's mass, inertia and damping, and how its points move: point masses, rigid bodies, hand formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa import MMPAParameters, magnet_array
from lpvhinf.plant.mmpa.kinematics import displacement_rows, rigid_transform, rotation_rows
from lpvhinf.plant.mmpa.magnets import mirror_bars
from lpvhinf.plant.mmpa.mover import lumped_masses, mover

P = MMPAParameters()
HIGH = replace(P, mass_heights=True)
FLAT_MOVER, HIGH_MOVER = mover(P), mover(HIGH)


def frequencies(body, n=12):
    values = scipy.linalg.eigh(body.K, body.M, eigvals_only=True)
    assert np.abs(values[:6]).max() < 1e-9 * values[-1]
    return np.sqrt(values[6 : 6 + n]) / (2 * np.pi)


def point_masses(parameters, n=3):
    """The whole mover as point masses (masses, places in three dimensions), the plate by n Gauss points an axis."""
    lumps = lumped_masses(parameters)
    t, w = np.polynomial.legendre.leggauss(n)
    h, d = parameters.side / 2, parameters.plate_thickness / 2
    x, y, z = (c.ravel() for c in np.meshgrid(h * t, h * t, d * t if parameters.mass_heights else 0 * t, indexing="ij"))
    share = np.einsum("i,j,k->ijk", w, w, w).ravel() / 8
    plate = parameters.plate_density * parameters.plate_thickness * parameters.side**2 * share
    masses = np.concatenate([lumps.masses, plate])
    places = np.vstack([np.column_stack([lumps.places, lumps.heights]), np.column_stack([x, y, z])])
    return masses, places


@pytest.mark.parametrize("parameters", [P, HIGH])
def test_mass_centre_and_inertia_are_those_of_the_point_masses(parameters):
    body, (masses, places) = mover(parameters), point_masses(parameters)
    centre = masses @ places / masses.sum()
    d = places - centre
    inertia = np.einsum("n,nij->ij", masses, (d**2).sum(axis=1)[:, None, None] * np.eye(3) - d[:, :, None] * d[:, None])
    assert body.mass == pytest.approx(masses.sum(), rel=1e-12)
    assert body.centre_of_gravity == pytest.approx(centre, abs=1e-12)
    assert body.inertia == pytest.approx(inertia, abs=1e-12)
    E = body.rigid_body_modes
    assert pytest.approx(scipy.linalg.block_diag(body.mass * np.eye(3), inertia), abs=1e-12) == E.T @ body.M @ E
    assert np.abs(body.K @ E).max() < 1e-12 * np.abs(body.K).max()


@pytest.mark.parametrize("parameters", [P, HIGH])
def test_mass_matrix_is_the_kinetic_energy_of_the_point_masses(parameters):
    body, (masses, places) = mover(parameters), point_masses(parameters, 16)
    q = np.random.default_rng(8).standard_normal(228)
    velocity = displacement_rows(body.plate, body.centre_of_gravity, places[:, :2], places[:, 2]) @ q
    assert q @ body.M @ q == pytest.approx(masses @ (velocity**2).sum(axis=1), rel=1e-12)


def test_masses_at_their_heights_lower_the_centre_and_the_frequencies():
    magnets, (_, bars) = magnet_array(P), mirror_bars(P)
    # magnets 9 mm below, bars (16 mm high, on the plate) 12 mm above the neutral plane
    wanted = (-0.009 * magnets.masses.sum() + 0.012 * bars.sum()) / FLAT_MOVER.mass
    assert HIGH_MOVER.centre_of_gravity[2] == pytest.approx(wanted, rel=1e-12)
    assert wanted == pytest.approx(-4.84e-3, abs=1e-5)
    assert FLAT_MOVER.centre_of_gravity[2] == 0.0
    assert HIGH_MOVER.centre_of_gravity[:2] == pytest.approx(FLAT_MOVER.centre_of_gravity[:2], abs=1e-15)
    flat, high = frequencies(FLAT_MOVER), frequencies(HIGH_MOVER)
    assert flat[:3] == pytest.approx([139.4, 206.5, 259.9], abs=0.06)
    assert high[:3] == pytest.approx([138.1, 201.9, 254.6], abs=0.06)
    assert np.all(high < flat)
    # the neutral plane follows a tilt about the centre of gravity by the arm: rx moves it along y, ry along -x
    c_z = HIGH_MOVER.centre_of_gravity[2]
    assert HIGH_MOVER.rigid_body_modes[:3, 3:5].tolist() == [[0.0, -c_z], [c_z, 0.0], [0.0, 0.0]]


def test_heights_couple_horizontal_motion_with_tilt():
    assert not np.any(FLAT_MOVER.M[:3, 3:])
    slope_x = HIGH_MOVER.plate.function(0.0, 1.0, 0.0)
    # sum m Z: accelerating along x turns the body about y
    assert HIGH_MOVER.M[0, 3:] @ slope_x == pytest.approx(-HIGH_MOVER.mass * HIGH_MOVER.centre_of_gravity[2], rel=1e-12)
    assert np.array_equal(HIGH_MOVER.M, HIGH_MOVER.M.T)
    assert HIGH_MOVER.M[:3, :3] == pytest.approx(FLAT_MOVER.M[:3, :3], abs=1e-14)


def test_a_payload_adds_its_kinetic_energy():
    place, m = np.array([0.11, -0.07, 0.05]), 0.7
    loaded = mover(P, payload_mass=m, payload_place=place)
    assert loaded.mass == pytest.approx(FLAT_MOVER.mass + m, rel=1e-14)
    centre = (FLAT_MOVER.mass * FLAT_MOVER.centre_of_gravity + m * place) / loaded.mass
    assert loaded.centre_of_gravity == pytest.approx(centre, abs=1e-14)
    # parallel axes: reduced mass at the distance of the two centres
    d = place - FLAT_MOVER.centre_of_gravity
    reduced = m * FLAT_MOVER.mass / loaded.mass
    assert loaded.inertia == pytest.approx(
        FLAT_MOVER.inertia + reduced * (d @ d * np.eye(3) - np.outer(d, d)), rel=1e-9
    )
    # the same motion in both coordinates: x, y refer to the plate at either centre
    rng = np.random.default_rng(5)
    q = rng.standard_normal(228) * 1e-3
    shift = loaded.centre_of_gravity - FLAT_MOVER.centre_of_gravity
    moved = q + np.concatenate([[-shift[1] * q[2], shift[0] * q[2], 0.0], np.zeros(225)])
    own = displacement_rows(FLAT_MOVER.plate, FLAT_MOVER.centre_of_gravity, place[:2], place[2]) @ q
    assert moved @ loaded.M @ moved == pytest.approx(q @ FLAT_MOVER.M @ q + m * own @ own, rel=1e-12)
    assert np.all(frequencies(loaded) < frequencies(FLAT_MOVER))  # more mass, the same stiffness


def test_a_payload_that_is_none_changes_nothing():
    same = mover(P, payload_mass=0.0, payload_place=(0.5, 0.0, 0.0))
    assert np.array_equal(same.M, FLAT_MOVER.M)
    with pytest.raises(DomainError, match=r"payload_place is \(0.2, 0.0, 0.0\), off the plate of half side 0.15 m"):
        mover(P, payload_mass=0.1, payload_place=(0.2, 0.0, 0.0))


@pytest.mark.parametrize("parameters", [P, HIGH])
def test_damping_is_given_to_the_modes_one_by_one(parameters):
    body = mover(replace(parameters, damping=(0.001, 0.002, 0.005)), damping_factor=2.0)
    eigenvalues, V = scipy.linalg.eigh(body.K, body.M)
    rates = V.T @ body.D @ V
    zeta = np.diag(rates)[6:] / (2 * np.sqrt(eigenvalues[6:]))
    assert zeta == pytest.approx([0.002, 0.004] + [0.01] * 220, rel=1e-6)
    assert np.abs(rates[:6]).max() < 1e-6
    assert np.abs(rates - np.diag(np.diag(rates))).max() < 1e-8 * rates.max()


def test_points_of_a_rigid_body_move_rigidly():
    rng = np.random.default_rng(6)
    places, heights = rng.uniform(-0.14, 0.14, (5, 2)), rng.uniform(-0.02, 0.05, 5)
    motion = rng.standard_normal(6)
    q = HIGH_MOVER.rigid_body_modes @ motion
    offsets = np.column_stack([places, heights]) - HIGH_MOVER.centre_of_gravity
    displacement = displacement_rows(HIGH_MOVER.plate, HIGH_MOVER.centre_of_gravity, places, heights) @ q
    assert displacement == pytest.approx(motion[:3] + np.cross(motion[3:], offsets), abs=1e-12)
    assert rotation_rows(HIGH_MOVER.plate, places) @ q == pytest.approx(np.tile(motion[3:], (5, 1)), abs=1e-12)
    transformed = rigid_transform(offsets) @ motion
    assert transformed[:, :3] == pytest.approx(displacement, abs=1e-12)
    assert transformed[:, 3:] == pytest.approx(np.tile(motion[3:], (5, 1)), abs=1e-15)


def test_rotation_is_the_slope_of_the_displacement():
    rng, step, plate = np.random.default_rng(7), 1e-6, FLAT_MOVER.plate
    q, at = rng.standard_normal(228), np.array([0.03, -0.02])
    up, down = (displacement_rows(plate, [0.0, 0.0], at, z) @ q for z in (step, -step))
    # a normal of the neutral plane stays one: r x e_z is its displacement per height
    r = rotation_rows(plate, at) @ q
    assert (up - down) / (2 * step) == pytest.approx(np.cross(r, [0.0, 0.0, 1.0]), rel=1e-6, abs=1e-9)
    w = [displacement_rows(plate, [0.0, 0.0], at + [s * step, 0.0])[2] @ q for s in (1, -1)]
    assert r[1] == pytest.approx(-(w[0] - w[1]) / (2 * step), rel=1e-6)
