"""The switchable effects: each changes what it should, by a hand formula, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant.mmpa import Amplifier, Effects, MMPAParameters, SensorErrors, benchmark, coil_layers, magnet_array
from lpvhinf.plant.mmpa.imperfections import deviating_magnets, misplaced_layers

P = MMPAParameters()
EDGE = np.array([[0.06, -0.06], [0.0, 0.0], [-0.0123, 0.031]])
INSIDE = EDGE[1:]
AXIS = np.linspace(-0.05, 0.05, 7)
GRID = np.stack(np.meshgrid(AXIS, AXIS, indexing="ij"), axis=-1).reshape(-1, 2)


def build(effects=None, **options):
    return benchmark(**({"magnetics": "first-harmonic", "n_flex": 5, "effects": effects} | options))


@pytest.fixture(scope="module")
def nominal():
    return build()


def same_modes(one, other):
    return np.array_equal(one.omega, other.omega) and np.array_equal(one.zeta, other.zeta)


def same_inputs(one, other):
    return np.array_equal(one.input_gains(EDGE), other.input_gains(EDGE))


def same_outputs(one, other):
    return np.array_equal(one.output_gains(EDGE), other.output_gains(EDGE))


def rigid_outputs(modal, points=EDGE):
    """Readings per unit of (x, y, z, rx, ry, rz) about the centre of gravity."""
    return modal.output_gains(points)[:, :, :6] @ np.linalg.inv(modal.rigid_body_scaling)


def test_nothing_deviates_by_default(nominal):
    assert nominal.known is nominal.modal
    assert nominal.known_mover is nominal.mover
    assert not nominal.effects.deviates


def test_amplifier_delay_and_sensors_leave_the_modal_model_alone():
    quiet = Effects(amplifier=Amplifier(), delay=150e-6, sensors=SensorErrors(noise_rms=1e-9))
    plant = build(quiet)
    assert plant.known is plant.modal
    assert not quiet.deviates


@pytest.mark.parametrize(
    "changes",
    [
        {"commutation_misalignment": (0.0, 1e-6)},
        {"coil_position_rms": 1e-6},
        {"magnet_strength": -0.01},
        {"magnet_strength_rms": 0.01},
        {"beam_height_error": 1e-4},
        {"mirror_slope_x": (0.0, 1e-5)},
        {"mirror_slope_y": (1e-5, 0.0)},
        {"mirror_slope_z": (0.0, 1e-5)},
        {"damping_factor": 1.1},
        {"payload_mass": 0.1},
    ],
)
def test_what_deviates_is_told(changes):
    assert Effects(**changes).deviates


# Commutation


def test_misalignment_shifts_what_the_commutation_knows_and_nothing_else(nominal):
    delta = np.array([3e-4, -2e-4])
    plant = build(Effects(commutation_misalignment=tuple(delta)))
    assert same_modes(plant.modal, nominal.modal)
    assert same_inputs(plant.modal, nominal.modal)
    assert same_outputs(plant.modal, nominal.modal)
    assert same_modes(plant.known, nominal.known)
    assert same_outputs(plant.known, nominal.known)
    assert np.array_equal(plant.known.input_gains(INSIDE), nominal.modal.input_gains(INSIDE + delta))
    assert np.array_equal(plant.coil_weights(INSIDE), nominal.coil_weights(INSIDE + delta))
    # at the edge of P it looks beyond
    corner = np.array([[0.06, 0.06]])
    outside = nominal.mechanical.input_map(corner + delta)
    wanted = nominal.modal.V.T @ outside
    assert plant.known.input_gains(corner) == pytest.approx(wanted, abs=1e-12)
    assert not np.allclose(plant.known.input_gains(corner), nominal.known.input_gains(corner), atol=1e-3)


def test_misalignment_pulls_the_mover_sideways():
    # The lifting currents are a wave under the mover, of wave number k along x and y. In a field that falls off as
    # exp(kz) the vertical stiffness is -k F_z, and div grad of the energy is zero: together the horizontal ones are
    # k F_z. Believing the mover at p + delta, it is -delta away from where the wave does not pull.
    step = 5e-6
    k, weight = np.pi / P.pole_pitch, build().mass * P.gravity
    pull = np.zeros((2, len(GRID)))
    for axis in range(2):
        delta = np.zeros(2)
        for sign in (1.0, -1.0):
            delta[axis] = sign * step
            plant = build(Effects(commutation_misalignment=tuple(delta)))
            wrench = np.einsum("nij,nj->ni", plant.wrench_matrix(GRID), plant.levitation_current(GRID))
            assert wrench[:, 2] == pytest.approx(np.full(len(GRID), weight), rel=1e-3)
            pull[axis] += sign * wrench[:, axis] / (2 * step)
    assert np.all(pull < 0.0)
    assert pull.sum(axis=0) / (-k * weight) == pytest.approx(np.ones(len(GRID)), abs=0.08)


def test_the_commutation_may_know_another_field(nominal):
    class Doubled:
        """Twice the field."""

        n_coils = 160

        def wrench(self, points):
            return 2.0 * nominal.mechanical.input_map.coils.wrench(points)

    plant = build(magnetics=Doubled(), commutation="first-harmonic")
    assert same_inputs(plant.known, nominal.known)
    assert same_outputs(plant.known, nominal.known)
    assert plant.modal.input_gains(EDGE) == pytest.approx(2.0 * nominal.modal.input_gains(EDGE), rel=1e-12)
    lift = np.einsum("nij,nj->ni", plant.wrench_matrix(EDGE), plant.levitation_current(EDGE))[:, 2]
    assert lift == pytest.approx(np.full(3, 2.0 * nominal.mass * 9.81), rel=1e-12)
    one = Doubled()
    for same in (build(magnetics=one, commutation=one), build(commutation="first-harmonic")):
        assert same.known is same.modal


def test_fields_that_do_not_fit_are_named(nominal):
    class Few:
        """A stator of three coils."""

        n_coils = 3

        def wrench(self, points):
            return nominal.mechanical.input_map.coils.wrench(points)[:, :, :3]

    with pytest.raises(DimensionError, match="commutation knows 3 coils, magnetics has 160"):
        build(commutation=Few())
    for effects in (Effects(coil_position_rms=1e-5), Effects(magnet_strength_rms=0.01)):
        with pytest.raises(AssumptionError, match='magnetics="exact"'):
            build(effects)
        with pytest.raises(AssumptionError, match='magnetics="exact"'):
            build(effects, magnetics=Few())


# Coils and magnets


def test_magnet_strength_scales_the_true_forces_and_nothing_else(nominal):
    plant = build(Effects(magnet_strength=-0.02))
    assert plant.modal.input_gains(EDGE) == pytest.approx(0.98 * nominal.modal.input_gains(EDGE), abs=1e-10)
    assert same_inputs(plant.known, nominal.known)
    for modal in (plant.modal, plant.known):
        assert same_modes(modal, nominal.modal)
        assert same_outputs(modal, nominal.modal)
    wrench = np.einsum("nij,nj->ni", plant.wrench_matrix(EDGE), plant.levitation_current(EDGE))
    assert wrench[:, 2] == pytest.approx(np.full(3, 0.98 * nominal.mass * P.gravity), rel=1e-9)


def test_deviations_are_random_and_reproducible():
    layers, magnets = coil_layers(P), magnet_array(P)
    given = Effects(coil_position_rms=20e-6, magnet_strength_rms=0.01, magnet_strength=0.03, seed=4)
    errors = np.concatenate([layer.errors for layer in misplaced_layers(layers, given)])
    assert errors.shape == (160, 2)
    assert errors.std(axis=0) == pytest.approx([20e-6, 20e-6], rel=0.2)
    assert np.abs(errors.mean(axis=0)).max() < 5e-6
    assert np.array_equal(misplaced_layers(layers, given)[1].errors, errors[80:])
    assert not np.allclose(misplaced_layers(layers, replace(given, seed=5))[1].errors, errors[80:], atol=1e-6)
    # one effect does not change the draw of the other
    alone = misplaced_layers(layers, Effects(coil_position_rms=40e-6, seed=4))
    assert alone[1].errors == pytest.approx(2.0 * errors[80:], rel=1e-12)
    ratio = np.linalg.norm(deviating_magnets(magnets, given).polarization, axis=1) / P.remanence
    assert ratio.std() == pytest.approx(0.0103, rel=0.2)
    assert ratio.mean() == pytest.approx(1.03, abs=0.003)
    assert deviating_magnets(magnets, Effects()) is magnets
    assert misplaced_layers(layers, Effects()) == layers


@pytest.fixture(scope="module")
def exact():
    return build(magnetics="exact")


@pytest.mark.slow
def test_coil_errors_shift_each_coil_in_the_exact_field(exact):
    plant = build(Effects(coil_position_rms=50e-6, seed=1), magnetics="exact")
    assert same_inputs(plant.known, exact.known)
    assert same_outputs(plant.modal, exact.modal)
    assert same_modes(plant.modal, exact.modal)
    errors = np.concatenate([layer.errors for layer in plant.layers])
    p = INSIDE[1]
    true = plant.modal.input_gains(p)[0]
    for k in (37, 41, 118, 123):  # a coil that lies e further sees the mover e closer
        shifted = exact.modal.input_gains(p - errors[k])[0, :, k]
        assert true[:, k] == pytest.approx(shifted, abs=1e-9)
        assert not np.allclose(true[:, k], exact.modal.input_gains(p)[0, :, k], atol=1e-4)


@pytest.mark.slow
def test_magnet_deviations_add_up_in_the_exact_field(exact):
    one, two = (build(Effects(magnet_strength_rms=rms), magnetics="exact") for rms in (0.01, 0.02))
    base = exact.modal.input_gains(EDGE)
    first, second = (plant.modal.input_gains(EDGE) - base for plant in (one, two))
    assert second == pytest.approx(2.0 * first, abs=1e-9 * np.abs(base).max())
    # 1 % of single magnets is less than 1 % of the whole force
    force = np.abs(base[:, 2]).max()
    assert 1e-4 * force < np.abs(first[:, 2]).max() < 0.01 * force
    assert same_inputs(one.known, exact.known)
    assert same_outputs(one.modal, exact.modal)
    assert same_modes(one.modal, exact.modal)


@pytest.mark.slow
def test_the_exact_mover_is_commutated_on_the_first_harmonic(exact, nominal):
    plant = build(magnetics="exact", commutation="first-harmonic")
    assert same_inputs(plant.modal, exact.modal)
    assert same_inputs(plant.known, nominal.known)
    lift = np.einsum("nij,nj->ni", plant.wrench_matrix(GRID), plant.levitation_current(GRID))
    off = lift - np.array([0.0, 0.0, plant.mass * P.gravity, 0.0, 0.0, 0.0])
    assert 1e-3 < np.abs(off[:, :3]).max() / (plant.mass * P.gravity) < 0.2
    full = np.einsum("nij,nj->ni", exact.wrench_matrix(GRID), exact.levitation_current(GRID))
    assert full[:, 2] == pytest.approx(np.full(len(GRID), plant.mass * P.gravity), rel=1e-9)


# Sensors


def hit_points(plant):
    """Where each beam meets the mover, from the centre of gravity, (N, 9, 3), by the description of the sensors."""
    s, a, h = 0.08, 0.15, plant.parameters.sensor_height + plant.effects.beam_height_error
    c, out = plant.centre_of_gravity, np.zeros((len(EDGE), 9, 3))
    for n, p in enumerate(EDGE):
        out[n, :4] = [[x - p[0], y - p[1], 0.004] for x, y in ((s, s), (-s, s), (-s, -s), (s, -s))]
        out[n, 4:7] = [[a, y - p[1], h] for y in (s, 0.0, -s)]
        out[n, 7:] = [[x - p[0], a, h] for x in (s, -s)]
    return out - c


def readings(plant, normals):
    """n . (t + r x d) for the six rigid motions."""
    d = hit_points(plant)
    turns = np.stack([np.cross(e, d) for e in np.eye(3)], axis=-1)  # (N, 9, 3, 3)
    moved = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=-1)
    return np.einsum("ki,nkij->nkj", normals, moved)


def test_beam_height_reads_tilt_as_translation(nominal):
    error = 3e-4
    plant = build(Effects(beam_height_error=error))
    assert same_inputs(plant.modal, nominal.modal)
    assert same_modes(plant.modal, nominal.modal)
    assert same_outputs(plant.known, nominal.known)
    change = rigid_outputs(plant.modal) - rigid_outputs(nominal.modal)
    wanted = np.zeros((3, 9, 6))
    wanted[:, 4:7, 4] = error  # x-beams: a turn about y moves the higher point along x
    wanted[:, 7:, 3] = -error
    assert change == pytest.approx(wanted, abs=1e-14)
    # flexible modes: the slope at the mirror times the error
    V = nominal.modal.V[3:, 6:]
    ordinate = 0.08 - EDGE[0, 1]
    slope = nominal.plate.rows([0.15, ordinate], (1, 0)) @ V
    flexible = (plant.modal.output_gains(EDGE) - nominal.modal.output_gains(EDGE))[0, :, 6:]
    assert flexible[4] == pytest.approx(-error * slope, abs=1e-12)
    assert not np.any(flexible[:4])


@pytest.mark.parametrize(
    ("mirror", "rows", "axes"),
    [("x", slice(4, 7), (1, 2)), ("y", slice(7, 9), (0, 2)), ("z", slice(0, 4), (0, 1))],
)
def test_a_sloping_mirror_reads_along_its_normal(nominal, mirror, rows, axes):
    slopes = (2e-4, -3e-4)
    plant = build(Effects(**{f"mirror_slope_{mirror}": slopes}))
    assert same_inputs(plant.modal, nominal.modal)
    assert same_modes(plant.modal, nominal.modal)
    assert same_outputs(plant.known, nominal.known)
    normals = np.zeros((9, 3))
    normals[:4, 2] = normals[4:7, 0] = normals[7:, 1] = 1.0
    assert rigid_outputs(nominal.modal) == pytest.approx(readings(nominal, normals), abs=1e-12)
    normals[rows, axes[0]], normals[rows, axes[1]] = slopes
    assert rigid_outputs(plant.modal) == pytest.approx(readings(plant, normals), abs=1e-12)
    others = [k for k in range(9) if k not in range(9)[rows]]
    changed = plant.modal.output_gains(EDGE) - nominal.modal.output_gains(EDGE)
    assert not np.any(changed[:, others])
    assert np.all(np.abs(changed[:, rows, :6]).max(axis=2) > 0.0)


def test_a_sloping_mirror_sees_the_deflection():
    # the x-mirror leans towards z: its beams read w of the edge, times the slope
    plant, nominal = build(Effects(mirror_slope_x=(0.0, 1e-3))), build()
    change = (plant.modal.output_gains(EDGE) - nominal.modal.output_gains(EDGE))[:, 4, 6:]
    edge = np.column_stack([np.full(3, 0.15), 0.08 - EDGE[:, 1]])
    assert change == pytest.approx(1e-3 * nominal.plate.rows(edge) @ nominal.modal.V[3:, 6:], abs=1e-12)


def test_beams_that_miss_the_mirror_are_named():
    with pytest.raises(DomainError, match=r"beam_height_error is 0.009 m: the horizontal beams run 0.021 m"):
        build(Effects(beam_height_error=0.009))
    with pytest.raises(DomainError, match="miss the mirrors"):
        build(Effects(beam_height_error=-0.02))


# Mover


def test_damping_factor_scales_the_true_damping_and_nothing_else(nominal):
    plant = build(Effects(damping_factor=0.25))
    assert plant.modal.zeta[6:] == pytest.approx(np.full(5, 0.002), rel=1e-6)
    assert plant.known.zeta[6:] == pytest.approx(np.full(5, 0.008), rel=1e-6)
    assert np.array_equal(plant.modal.omega, nominal.modal.omega)
    assert same_inputs(plant.modal, nominal.modal)
    assert same_outputs(plant.modal, nominal.modal)


@pytest.mark.parametrize("mass_heights", [False, True])
def test_payload_changes_the_true_mover_only(mass_heights):
    parameters = replace(P, mass_heights=mass_heights)
    nominal = build(parameters=parameters)
    m, place = 0.5, np.array([0.1, -0.05, 0.03])
    plant = build(Effects(payload_mass=m, payload_place=tuple(place)), parameters=parameters)
    for same in (same_modes, same_inputs, same_outputs):
        assert same(plant.known, nominal.known)
    assert plant.known_mover.mass == nominal.mass
    assert plant.mass == pytest.approx(nominal.mass + m, rel=1e-14)
    shift = plant.centre_of_gravity - nominal.centre_of_gravity
    assert shift == pytest.approx(m * (place - nominal.centre_of_gravity) / plant.mass, abs=1e-14)
    # the same forces, with torques about another point; the height counts
    true, known = plant.wrench_matrix(EDGE), nominal.wrench_matrix(EDGE)
    force = known[:, :3]
    assert true[:, :3] == pytest.approx(force, abs=1e-11)
    moved = known[:, 3:] - np.cross(shift, force.transpose(0, 2, 1)).transpose(0, 2, 1)
    assert true[:, 3:] == pytest.approx(moved, abs=1e-11)
    # the same beams, which see a motion about the new centre
    transfer = np.eye(6)
    transfer[:3, 3:] = np.array([np.cross(e, -shift) for e in np.eye(3)]).T
    assert rigid_outputs(plant.modal) == pytest.approx(rigid_outputs(nominal.modal) @ transfer, abs=1e-12)
    assert np.all(plant.modal.omega[6:] < nominal.modal.omega[6:])


def test_a_payload_at_a_height_couples_sideways_force_with_tilt(nominal):
    # pushed at the old centre of gravity, the mover turns about y: T_y = -shift_z F_x
    plant = build(Effects(payload_mass=0.5, payload_place=(0.0, 0.0, 0.1)))
    inputs = np.linalg.pinv(nominal.wrench_matrix(EDGE))[:, :, 0]  # one newton along x, no torque
    wrench = np.einsum("nij,nj->ni", plant.wrench_matrix(EDGE), inputs)
    c_z = 0.5 * 0.1 / plant.mass
    assert plant.centre_of_gravity[2] == pytest.approx(c_z)
    assert wrench[:, 0] == pytest.approx(np.ones(3), abs=1e-9)
    assert wrench[:, 4] == pytest.approx(np.full(3, -c_z), abs=1e-9)


def test_modes_of_a_loaded_mover_keep_their_signs(nominal):
    # the saddle has two equal entries of opposite sign: 20 g decide which one is larger
    for place in ((0.1, 0.1, 0.0), (-0.1, 0.02, 0.0), (0.03, -0.1, 0.0)):
        plant = build(Effects(payload_mass=0.02, payload_place=place))
        overlap = nominal.modal.V.T @ nominal.mechanical.M @ plant.modal.V
        assert np.all(np.diag(overlap)[6:9] > 0.9)
        V, M = plant.modal.V, plant.mechanical.M
        assert np.allclose(V.T @ M @ V, np.eye(11), atol=1e-10)


# Before and after the plant


def test_input_dynamics_are_current_loop_and_delay():
    effects = Effects(amplifier=Amplifier(bandwidth_hz=2000.0), delay=150e-6)
    system = effects.input_dynamics(3)
    assert system.ninputs == system.noutputs == 3
    s = 2j * np.pi * 300.0
    response = system(s)
    w = 2 * np.pi * 2000.0
    wanted = w**2 / (s**2 + np.sqrt(2) * w * s + w**2) * np.exp(-150e-6 * s)
    assert response == pytest.approx(wanted * np.eye(3), abs=2e-5)
    assert np.linalg.eigvals(system.A).real.max() < 0.0
    assert Effects().input_dynamics() is None
    assert Effects(amplifier=Amplifier(bandwidth_hz=None)).input_dynamics() is None
    assert Effects(delay=1e-4).input_dynamics(delay_order=3).nstates == 3
    assert Effects(amplifier=Amplifier(order=1)).input_dynamics(2).nstates == 2
    with pytest.raises(DomainError, match="n_inputs is 0"):
        effects.input_dynamics(0)
    with pytest.raises(DomainError, match="delay_order is 0"):
        effects.input_dynamics(delay_order=0)


def test_realistic_effects_are_those_of_the_description():
    effects = Effects.realistic(seed=3)
    assert effects.seed == 3
    assert effects.commutation_misalignment == (5e-6, 5e-6)
    assert (effects.coil_position_rms, effects.magnet_strength_rms, effects.delay) == (20e-6, 0.01, 150e-6)
    assert effects.amplifier == Amplifier(
        current_limit=4.0, voltage=48.0, bandwidth_hz=3000.0, bits=16, noise_rms=100e-6
    )
    assert effects.sensors == SensorErrors(noise_rms=0.3e-9, quantisation=0.15e-9)
    assert not effects.changes_mover
    assert not effects.changes_sensors
    assert effects.deviates


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"commutation_misalignment": (5.0, 0.0)}, r"commutation_misalignment is \(5.0, 0.0\) m, wanted values from"),
        ({"coil_position_rms": -1e-6}, "coil_position_rms is -1e-06 m"),
        ({"coil_position_rms": 20.0}, "overlap"),
        ({"magnet_strength": 1.01}, "relative deviation"),
        ({"magnet_strength_rms": np.nan}, "magnet_strength_rms"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 0.5}, "seed is 0.5"),
        ({"beam_height_error": 1.0}, "miss the mirror"),
        ({"mirror_slope_y": (0.1, 0.0)}, "first order"),
        ({"damping_factor": -1.0}, "damping_factor is -1.0"),
        ({"payload_mass": -0.1}, "payload_mass is -0.1 kg"),
        ({"payload_place": (0.0, 0.0, 50.0)}, "payload_place"),
        ({"delay": 150.0}, "delay is 150.0 s"),
        ({"amplifier": 3000.0}, "amplifier is 3000.0, wanted an Amplifier"),
        ({"sensors": 1e-9}, "sensors is 1e-09, wanted SensorErrors"),
    ],
)
def test_bad_effects_are_named(changes, words):
    with pytest.raises(DomainError, match=words):
        Effects(**changes)


def test_bad_sizes_and_combinations_are_named():
    with pytest.raises(DimensionError, match="mirror_slope_x has shape"):
        Effects(mirror_slope_x=1e-5)
    with pytest.raises(DomainError, match=r"wanted less than half the pole pitch, 0.015 m"):
        build(Effects(commutation_misalignment=(0.02, 0.0)))
