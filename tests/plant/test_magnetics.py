"""Field and wrench of the coils: Maxwell, direct Lorentz sums, flux linkage, rigid limit, quadrature."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lpvhinf.plant.mmpa import (
    FirstHarmonicField,
    MMPAParameters,
    RitzPlate,
    SeparableWrench,
    benchmark,
    coil_layers,
    magnet_array,
)

P = MMPAParameters()
FIELD = FirstHarmonicField.from_parameters(P)
LAYERS = coil_layers(P)
COILS = SeparableWrench(field=FIELD, layers=LAYERS, degree=14)
PLATE = RitzPlate(side=0.3, stiffness=1.0, poisson=0.3, area_density=1.0, degree=14)
# the last position puts coils across the edge of the plate
POSITIONS = np.array([[0.0, 0.0], [0.013, -0.0271], [-0.06, 0.06]])


def test_published_field_strength():
    below = np.array([0.0045, 0.011])
    assert FIELD.strength(P.magnet_bottom - below) == pytest.approx([0.303, 0.153], abs=6e-4)
    assert P.layer_heights == pytest.approx(P.magnet_bottom - below)


def test_layout_of_the_magnets():
    array = magnet_array(P)
    assert len(array.masses) == 140
    assert array.masses.sum() == pytest.approx(5.51, abs=0.005)
    assert np.all(np.abs(array.centres) < 0.1351)
    assert np.allclose(array.masses @ array.centres, 0.0, atol=1e-12)
    up = array.polarization[:, 2] > 0
    k = np.pi / P.pole_pitch
    wave = np.cos(k * array.centres[:, 1]) - np.cos(k * array.centres[:, 0])
    assert np.all(wave[up] > 1.99)  # the field's upward maxima lie below the magnets that point up
    assert np.all(wave[array.polarization[:, 2] < 0] < -1.99)


def test_untapered_field_is_a_vacuum_field():
    rng, step = np.random.default_rng(2), 1e-6
    at = rng.uniform(-0.1, 0.1, (40, 3)) * [1, 1, 0.05] + [0, 0, -0.02]
    jacobian = np.stack(
        [(FIELD.at(at + step * e) - FIELD.at(at - step * e)) / (2 * step) for e in np.eye(3)], axis=-1
    )  # [point, component, axis]
    scale = np.abs(jacobian).max()
    assert np.abs(np.trace(jacobian, axis1=1, axis2=2)).max() < 1e-7 * scale
    assert np.abs(jacobian - jacobian.transpose(0, 2, 1)).max() < 1e-7 * scale


def test_field_vanishes_smoothly_at_the_edge():
    edge = np.array([[0.15, 0.0, -0.02], [0.02, -0.15, -0.02], [0.2, 0.1, -0.02]])
    assert not np.any(FIELD.at(edge))
    x = np.linspace(0.118, 0.152, 4001)
    slope = np.gradient(FIELD.edge(x), x)
    assert np.abs(np.diff(slope)).max() < 2.0  # no jump of the slope: its largest value is about 70 1/m
    assert FIELD.edge(np.array([0.12, 0.135, 0.15])) == pytest.approx([1.0, 0.5, 0.0])


def legs(layer, i, j):
    """Ends (from, to) of the straight legs of coil (i, j), counter-clockwise, with the turns they carry."""
    for a, b, share in zip(layer.half_x, layer.half_y, layer.share, strict=True):
        corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]]) + [layer.x[i], layer.y[j]]
        for z, turns in zip(layer.z, layer.turns, strict=True):
            for start, end in pairwise(corners):
                yield start, end, z, share * turns


def leg_points(start, end, p, nodes=28):
    """Gauss points (n, 2) on a leg in the mover frame and their dl (n, 3), split at the joints of the window."""
    a, b = start - p, end - p
    axis = int(np.argmax(np.abs(b - a)))
    joints = (np.array([-0.15, -0.12, 0.0, 0.12, 0.15]) - a[axis]) / (b - a)[axis]
    ends = np.sort(np.concatenate([[0.0, 1.0], joints[(joints > 0.0) & (joints < 1.0)]]))
    t, w = np.polynomial.legendre.leggauss(nodes)
    low, size = ends[:-1, None], np.diff(ends)[:, None]
    t, w = (low + size * (t + 1) / 2).ravel(), (size * w / 2).ravel()
    return a + t[:, None] * (b - a), w[:, None] * np.append(b - a, 0.0)


def direct_wrench(layer, i, j, p):
    """The Lorentz sum, leg by leg."""
    total = np.zeros(3 + PLATE.n_ritz)
    for start, end, z, turns in legs(layer, i, j):
        xy, dl = leg_points(start, end, p)
        force = -turns * np.cross(dl, FIELD.at(np.column_stack([xy, np.full(len(xy), z)])))
        inside = np.all(np.abs(xy) < 0.15, axis=1)
        xy, force = xy[inside], force[inside]
        total[:2] += force[:, :2].sum(axis=0)
        total[2] += (xy[:, 0] * force[:, 1] - xy[:, 1] * force[:, 0]).sum()
        total[3:] += force[:, 2] @ PLATE.rows(xy)
        total[3:] -= z * (force[:, 0] @ PLATE.rows(xy, (1, 0)) + force[:, 1] @ PLATE.rows(xy, (0, 1)))
    return total


@pytest.mark.parametrize(("number", "i", "j"), [(0, 8, 2), (0, 11, 1), (0, 4, 4), (1, 2, 7), (1, 3, 11), (1, 1, 5)])
def test_separable_wrench_against_the_direct_sum(number, i, j):
    layer = LAYERS[number]
    k = number * LAYERS[0].n_coils + i * len(layer.y) + j
    computed = COILS.wrench(POSITIONS)
    for p, wrench in zip(POSITIONS, computed, strict=True):
        direct = direct_wrench(layer, i, j, p)
        scale = np.maximum(np.abs(direct).max(), 1.0)
        assert np.abs(wrench[:, k] - direct).max() < 1e-10 * scale


def linkage(layer, i, j, p, z_mover=0.0, nodes=24):
    """Flux through the turns of a coil with the mover at p, lifted by z_mover."""
    t, w = np.polynomial.legendre.leggauss(nodes)
    total = 0.0
    for a, b, share in zip(layer.half_x, layer.half_y, layer.share, strict=True):
        x, y = (m.ravel() for m in np.meshgrid(layer.x[i] + a * t - p[0], layer.y[j] + b * t - p[1], indexing="ij"))
        weights = np.outer(w * a, w * b).ravel()
        for z, turns in zip(layer.z, layer.turns, strict=True):
            total += share * turns * weights @ FIELD.at(np.column_stack([x, y, np.full_like(x, z - z_mover)]))[:, 2]
    return total


@pytest.mark.parametrize(("number", "i", "j"), [(0, 7, 2), (1, 2, 8)])
def test_force_is_the_derivative_of_the_flux_linkage(number, i, j):
    # an independent route: energy, not Lorentz; it fixes every sign. Holds where the field has no divergence.
    layer, p, step = LAYERS[number], np.array([0.011, 0.006]), 1e-5
    k = number * LAYERS[0].n_coils + i * len(layer.y) + j
    wrench = COILS.wrench(p[None])[0, :, k]
    for axis, row in ((0, 0), (1, 1), (2, 3)):
        d = step * np.eye(3)[axis]
        rise = linkage(layer, i, j, p + d[:2], d[2]) - linkage(layer, i, j, p - d[:2], -d[2])
        assert wrench[row] == pytest.approx(rise / (2 * step), rel=1e-6, abs=1e-6)


def test_rigid_limit_of_the_plate_rows():
    wrench = COILS.wrench(POSITIONS)
    for k in (38, 42, 57, 118, 121):
        layer, local = (LAYERS[0], k) if k < 80 else (LAYERS[1], k - 80)
        i, j = divmod(local, len(layer.y))
        for p, computed in zip(POSITIONS, wrench[:, 3:, k], strict=True):
            force, torque = np.zeros(3), np.zeros(3)
            for start, end, z, turns in legs(layer, i, j):
                xy, dl = leg_points(start, end, p)
                r = np.column_stack([xy, np.full(len(xy), z)])
                dF = -turns * np.cross(dl, FIELD.at(r))
                force += dF.sum(axis=0)
                torque += np.cross(r, dF).sum(axis=0)
            assert computed @ PLATE.function(1, 0, 0) == pytest.approx(force[2], abs=1e-12)
            assert computed @ PLATE.function(0, 0, 1) == pytest.approx(torque[0], abs=1e-12)
            assert computed @ PLATE.function(0, -1, 0) == pytest.approx(torque[1], abs=1e-12)


def test_filaments_have_converged():
    fine = replace(P, filaments_width=16, filaments_height=6)
    finer = benchmark(fine, magnetics="first-harmonic").modal.input_gains(POSITIONS)
    change = np.abs(benchmark(P, magnetics="first-harmonic").modal.input_gains(POSITIONS) - finer)
    for rows in (slice(0, 6), slice(6, 9), slice(9, 21)):
        assert change[:, rows].max() < 1e-5 * np.abs(finer[:, rows]).max()


def test_integration_of_the_legs_has_converged(monkeypatch):
    monkeypatch.setattr("lpvhinf.plant.mmpa.magnetics.separable.TABLE_DEGREE", 95)
    finer = SeparableWrench(field=FIELD, layers=LAYERS, degree=14).wrench(POSITIONS)
    assert np.abs(COILS.wrench(POSITIONS) - finer).max() < 1e-12 * np.abs(finer).max()


def test_grids_and_single_positions_agree():
    x = np.linspace(-0.06, 0.06, 3)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    together = COILS.wrench(grid)
    assert np.allclose(together[5], COILS.wrench(grid[5:6])[0], rtol=0.0, atol=1e-12)
