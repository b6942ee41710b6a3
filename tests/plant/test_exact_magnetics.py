"""The exact magnetics against magpylib's forces, the linked flux, shifted coils and scaled magnets."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import magpylib
import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.plant.mmpa import MMPAParameters, RitzPlate, coil_layers, magnet_array
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.magnetics import TabulatedWrench, coil_wrench
from lpvhinf.plant.mmpa.magnetics.single_magnet import MagnetKind, Winding, single_magnet_wrench
from lpvhinf.plant.mmpa.magnets import MagnetArray

P = MMPAParameters()
LAYERS = coil_layers(P)
MAGNETS = magnet_array(P)
TURN = Rotation.from_euler("z", -45, degrees=True)
Z = P.magnet_bottom + P.magnet_height / 2
# offsets of a coil from the mover: somewhere off the table's grid, near the centre, across the edge
OFFSETS = np.array([[0.0313, 0.0871], [-0.0066, 0.0121], [0.1433, -0.1012]])
PLATE = RitzPlate(side=P.side, stiffness=P.bending_stiffness, poisson=0.33, area_density=21.6, degree=P.ritz_degree)


@pytest.fixture(scope="module")
def coils() -> TabulatedWrench:
    made = coil_wrench(P, LAYERS, MAGNETS)
    assert isinstance(made, TabulatedWrench)
    return made


def assembly(magnets: MagnetArray, lift: Array | None = None, slopes: Array | None = None) -> list[object]:
    """The magnets of magpylib, each raised by `lift` and turned with the slope of the plate."""
    n = len(magnets.masses)
    lift, slopes = np.zeros(n) if lift is None else lift, np.zeros((n, 2)) if slopes is None else slopes
    made = []
    for c, size, pol, up, (w_x, w_y) in zip(
        magnets.centres, magnets.sizes, magnets.polarization, lift, slopes, strict=True
    ):
        turn = Rotation.from_rotvec([w_y, -w_x, 0.0])
        place = np.array([*c, up]) + turn.apply([0.0, 0.0, Z])  # about the neutral plane
        made.append(magpylib.magnet.Cuboid(polarization=pol, dimension=size, position=place, orientation=turn * TURN))
    return made


def filaments(layer: CoilLayer, offset: Array) -> list[object]:
    """The coil as closed wires of magpylib, each with its share of one ampere."""
    made = []
    for z, turns in zip(layer.z, layer.turns, strict=True):
        for a, b, share in zip(layer.half_x, layer.half_y, layer.share, strict=True):
            corners = np.array([[-a, -b, z], [a, -b, z], [a, b, z], [-a, b, z], [-a, -b, z]])
            made.append(magpylib.current.Polyline(current=turns * share, vertices=corners + [*offset, 0.0]))
    return made


def wrench_at(coils: TabulatedWrench, layer: int, offsets: Array) -> Array:
    """Wrench rows (n, rows) of a coil of a layer at offsets from the mover."""
    return coils.tables[layer].values(offsets)


@pytest.mark.parametrize("layer", [0, 1])
@pytest.mark.parametrize("offset", OFFSETS)
def test_force_against_the_direct_force_of_the_magnets_on_the_coil(coils: TabulatedWrench, layer: int, offset: Array):
    wires = filaments(LAYERS[layer], offset)
    force, torque = np.zeros(3), np.zeros(3)
    magnets = magpylib.Collection(assembly(MAGNETS))
    for wire in wires:
        F, T = np.asarray(magpylib.getFT(magnets, wire, pivot=(0.0, 0.0, 0.0), meshing=400)).reshape(2, 3)
        force, torque = force - F, torque - T
    row = wrench_at(coils, layer, offset[None])[0]
    n = P.ritz_degree + 1
    # Ritz functions 1, y and x: the vertical force and the tilting torques T_x and -T_y
    ours = np.array([row[0], row[1], row[3], row[3 + 1] * P.side / 2, -row[3 + n] * P.side / 2, row[2]])
    direct = np.array([*force, *torque])
    largest = np.abs(coils.tables[layer].coefficients).max((0, 1))
    scale = np.array([largest[0], largest[1], largest[3], 0.15 * largest[4], 0.15 * largest[3 + n], largest[2]])
    assert np.max(np.abs(ours - direct) / scale) < 5e-4


@pytest.mark.parametrize("index", [5, 60, 139])
def test_action_and_reaction_on_one_magnet(index: int):
    # the force on the magnet in the field of the coil: another field, another integral
    winding, layer = Winding.of(LAYERS[0]), LAYERS[0]
    size, pol = MAGNETS.sizes[index], MAGNETS.polarization[index]
    strength = float(np.linalg.norm(pol))
    kind = MagnetKind(size=tuple(size), direction=tuple(pol / strength), height=Z)
    x, y = np.array([-0.02, 0.005, 0.03]), np.array([-0.05, 0.0125, 0.06])
    table = strength * single_magnet_wrench(kind, winding, x, y)
    magnet = magpylib.magnet.Cuboid(polarization=pol, dimension=size, position=(0, 0, Z), orientation=TURN)
    for i, j in ((0, 1), (1, 2)):
        coil = magpylib.Collection(filaments(layer, np.array([x[i], y[j]])))
        direct = np.asarray(magpylib.getFT(coil, magnet, pivot=(0.0, 0.0, 0.0), meshing=1000)).ravel()
        scale = np.repeat([np.abs(table[..., :3]).max(), np.abs(table[..., 3:]).max()], 3)
        assert np.max(np.abs(table[i, j] - direct) / scale) < 3e-3


def linked_flux(layer: CoilLayer, offset: Array, magnets: list[object]) -> float:
    """Flux of the magnets through all turns of the coil [V s]."""
    (s, w_s), (t, w_t) = np.polynomial.legendre.leggauss(16), np.polynomial.legendre.leggauss(32)
    if layer.half_x[0] > layer.half_y[0]:
        (s, w_s), (t, w_t) = (t, w_t), (s, w_s)
    places, weights = [], []
    for z, turns in zip(layer.z, layer.turns, strict=True):
        for a, b, share in zip(layer.half_x, layer.half_y, layer.share, strict=True):
            X, Y = np.meshgrid(offset[0] + a * s, offset[1] + b * t, indexing="ij")
            places.append(np.stack([X, Y, np.full_like(X, z)], -1).reshape(-1, 3))
            weights.append(turns * share * a * b * np.outer(w_s, w_t).ravel())
    B = magpylib.getB(magnets, np.concatenate(places), sumup=True)
    return float(np.concatenate(weights) @ B[:, 2])


@pytest.mark.parametrize(("layer", "offset"), [(0, OFFSETS[0]), (1, OFFSETS[2])])
def test_modal_force_is_the_derivative_of_the_linked_flux(coils: TabulatedWrench, layer: int, offset: Array):
    # without iron the generalised force is i d(flux)/dq: an energy balance of coil and mover
    _, V = scipy.linalg.eigh(PLATE.K, PLATE.M)
    row = wrench_at(coils, layer, offset[None])[0, 3:]
    everywhere = coils.tables[layer].coefficients[::4, ::4, 3:].reshape(-1, V.shape[0])
    for mode in (3, 5, 8, 12):
        shape = V[:, mode]
        lift = PLATE.rows(MAGNETS.centres) @ shape
        slopes = np.stack([PLATE.rows(MAGNETS.centres, d) @ shape for d in ((1, 0), (0, 1))], axis=-1)
        q = 2e-6 / np.abs(lift).max()
        plus, minus = (linked_flux(LAYERS[layer], offset, assembly(MAGNETS, s * lift, s * slopes)) for s in (q, -q))
        energy = (plus - minus) / (2 * q)
        largest = np.abs(everywhere @ shape).max()
        assert abs(row @ shape - energy) < 1e-3 * largest  # wanted: 1e-2
        assert abs(energy) > 0.02 * largest  # the comparison says something


def test_positions_shift_the_coils(coils: TabulatedWrench):
    p = np.array([[0.0121, -0.0333]])
    wrench = coils.wrench(p)
    assert wrench.shape == (1, 3 + PLATE.n_ritz, 160)
    for layer, start in ((0, 0), (1, 80)):
        offsets = LAYERS[layer].centres - p
        assert pytest.approx(wrench_at(coils, layer, offsets), abs=1e-12) == wrench[0, :, start : start + 80].T


def test_coils_far_from_the_mover_do_nothing(coils: TabulatedWrench):
    assert not wrench_at(coils, 0, np.array([[0.5, 0.0], [0.0, -0.6]])).any()


def test_strength_of_the_magnets_is_a_factor(coils: TabulatedWrench):
    p = np.array([[0.01, 0.02]])
    stronger = replace(MAGNETS, polarization=1.01 * MAGNETS.polarization)
    assert coil_wrench(P, LAYERS, stronger).wrench(p) == pytest.approx(1.01 * coils.wrench(p), rel=1e-9, abs=1e-12)


def test_misplaced_coils(coils: TabulatedWrench):
    error = np.full((80, 2), [20e-6, -30e-6])
    moved = tuple(replace(layer, errors=error) for layer in LAYERS)
    p = np.array([[0.01, 0.02]])
    expected = coils.wrench(p - error[:1])
    assert coil_wrench(P, moved, MAGNETS).wrench(p) == pytest.approx(expected, abs=1e-12)
    with pytest.raises(AssumptionError, match="magnetics"):
        coil_wrench(P, moved, MAGNETS, kind="first-harmonic")


def test_tables_are_shared_while_they_are_in_use(coils: TabulatedWrench):
    again = coil_wrench(P, LAYERS, MAGNETS)
    assert isinstance(again, TabulatedWrench)
    assert again.tables[0] is coils.tables[0]


def test_first_harmonic_lies_near(coils: TabulatedWrench):
    # the next harmonics have 17 % and 7 % of the field; the first harmonic's edge is a model
    p = np.array([[0.0, 0.0]])
    exact, first = coils.wrench(p), coil_wrench(P, LAYERS, MAGNETS, kind="first-harmonic").wrench(p)
    inner = np.flatnonzero(np.max(np.abs(np.vstack([la.centres for la in LAYERS])), axis=1) < 0.1)
    for r in (0, 1, 3):
        difference = np.abs(exact[0, r, inner] - first[0, r, inner]).max() / np.abs(exact[0, r, inner]).max()
        assert 0.01 < difference < 0.25


def test_bad_input():
    with pytest.raises(DomainError, match="magnetics is 'exakt'"):
        coil_wrench(P, LAYERS, MAGNETS, kind="exakt")
    with pytest.raises(DomainError, match="jobs"):
        coil_wrench(P, LAYERS, MAGNETS, jobs=0)
    shifted = replace(MAGNETS, centres=MAGNETS.centres + 1e-3)
    with pytest.raises(AssumptionError, match="lattice"):
        coil_wrench(P, LAYERS, shifted)


def test_wires_close():
    # a mistake in the filaments of this file would make the comparisons above meaningless
    for wire in filaments(LAYERS[0], OFFSETS[0]):
        assert all(np.count_nonzero(b - a) == 1 for a, b in pairwise(wire.vertices))
        assert wire.vertices[0] == pytest.approx(wire.vertices[-1])
