"""The Ritz plate against published and independent eigenfrequencies."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.plant.mmpa import MMPAParameters, RitzPlate, magnet_array
from lpvhinf.plant.mmpa.magnets import mirror_bars


def eigenfrequencies(plate, n):
    values = scipy.linalg.eigh(plate.K, plate.M, eigvals_only=True)
    assert np.abs(values[:3]).max() < 1e-9 * values[-1]
    return np.sqrt(values[3 : 3 + n])


def free_plate(degree=14, **changes):
    given = {"side": 1.0, "stiffness": 1.0, "poisson": 0.3, "area_density": 1.0, "degree": degree}
    return RitzPlate(**(given | changes))


# lambda = omega a^2 sqrt(rho h / D) of a free square plate, nu = 0.3, to the digits given
TABLE = [13.4682, 19.5961, 24.2702, 34.8009, 34.8009, 61.0932, 61.0932, 63.686, 69.265, 77.172]
DIGITS = [4, 4, 4, 4, 4, 4, 4, 3, 3, 3]
LEISSA_1973 = [13.489, 19.789, 24.432, 35.024, 35.024]  # Journal of Sound and Vibration 31; an upper bound by Ritz


def test_free_plate_table():
    values = eigenfrequencies(free_plate(), 10)
    for value, wanted, digits in zip(values, TABLE, DIGITS, strict=True):
        assert abs(value - wanted) <= 0.51 * 10.0**-digits


def test_leissa_lies_up_to_one_percent_above():
    ratio = np.array(LEISSA_1973) / eigenfrequencies(free_plate(), 5)
    assert np.all((ratio > 1.0) & (ratio < 1.01))


def test_ritz_converges_from_above():
    coarse, fine, finest = (eigenfrequencies(free_plate(n), 10) for n in (10, 14, 20))
    assert np.all(coarse >= fine * (1 - 1e-10))
    assert np.max(np.abs(fine / finest - 1.0)) < 1e-6
    assert np.max(np.abs(fine / finest - 1.0)) < 0.1 * np.max(np.abs(coarse / finest - 1.0))


def test_scale_of_the_plate():
    reference = eigenfrequencies(free_plate(10), 3)
    scaled = eigenfrequencies(free_plate(10, side=0.3, stiffness=3352.0, area_density=21.6), 3)
    assert np.allclose(scaled, reference * np.sqrt(3352.0 / 21.6) / 0.09, rtol=1e-10)


def finite_elements(side, stiffness, poisson, area_density, n, masses=(), places=()):
    """Frequencies of the same plate by Argyris elements, lumped masses interpolated."""
    skfem = pytest.importorskip("skfem")
    from skfem.helpers import dd, ddot, trace

    grid = np.linspace(-side / 2, side / 2, n + 1)
    basis = skfem.Basis(skfem.MeshTri.init_tensor(grid, grid), skfem.ElementTriArgyris())

    @skfem.BilinearForm
    def bending(u, v, _):
        return stiffness * ((1 - poisson) * ddot(dd(u), dd(v)) + poisson * trace(dd(u)) * trace(dd(v)))

    @skfem.BilinearForm
    def inertia(u, v, _):
        return area_density * u * v

    K, M = bending.assemble(basis).tocsc(), inertia.assemble(basis).tocsc()
    if len(masses):
        P = basis.probes(np.asarray(places).T)
        M = (M + P.T @ scipy.sparse.diags(masses) @ P).tocsc()
    # scaled by its diagonal: the degrees of freedom are values, slopes and curvatures
    s = scipy.sparse.diags(1.0 / np.sqrt(K.diagonal() + M.diagonal()))
    shift = -0.1 * (10.0 / side**2) ** 2 * stiffness / area_density
    values = scipy.sparse.linalg.eigsh(
        (s @ K @ s).tocsc(), k=13, M=(s @ M @ s).tocsc(), sigma=shift, which="LM", return_eigenvectors=False
    )
    return np.sqrt(np.abs(np.sort(values)))[3:]


def test_agrees_with_finite_elements():
    fem = finite_elements(1.0, 1.0, 0.3, 1.0, 5)
    assert np.max(np.abs(fem / eigenfrequencies(free_plate(), 10) - 1.0)) < 1e-4


def test_mover_with_lumped_masses_agrees_with_finite_elements():
    p = MMPAParameters()
    magnets, (points, bars) = magnet_array(p), mirror_bars(p)
    masses, places = np.concatenate([magnets.masses, bars]), np.concatenate([magnets.centres, points])
    given = (p.side, p.bending_stiffness, p.poisson_ratio, p.plate_density * p.plate_thickness)
    fem = finite_elements(*given, 8, masses, places)
    ritz = eigenfrequencies(RitzPlate(**dict(zip(("side", "stiffness", "poisson", "area_density"), given, strict=True)),
                                      degree=14, masses=masses, places=places), 10)  # fmt: skip
    assert np.max(np.abs(fem / ritz - 1.0)) < 1e-3


def test_rows_are_values_and_derivatives():
    plate = free_plate(6, side=0.4)
    c = plate.function(0.3, -2.0, 5.0)
    at = np.array([[0.1, -0.2], [0.2, 0.05]])
    assert np.allclose(plate.rows(at) @ c, 0.3 - 2.0 * at[:, 0] + 5.0 * at[:, 1])
    assert np.allclose(plate.rows(at, (1, 0)) @ c, -2.0)
    assert np.allclose(plate.rows(at, (0, 1)) @ c, 5.0)
    assert np.allclose(plate.K @ c, 0.0, atol=1e-9 * np.abs(plate.K).max())
    rng, step = np.random.default_rng(1), 1e-6
    shape, here = rng.standard_normal(plate.n_ritz), np.array([0.03, -0.07])
    slope = (plate.rows(here + [0, step]) - plate.rows(here - [0, step])) @ shape / (2 * step)
    assert plate.rows(here, (0, 1)) @ shape == pytest.approx(slope, rel=1e-6)
    curvature = (plate.rows(here + [step, 0], (1, 0)) - plate.rows(here - [step, 0], (1, 0))) @ shape / (2 * step)
    assert plate.rows(here, (2, 0)) @ shape == pytest.approx(curvature, rel=1e-6)


def test_lumped_mass_of_a_rigid_motion():
    plate = free_plate(4, masses=[2.0, 3.0], places=[[0.5, 0.0], [0.0, -0.5]])
    one, x = plate.function(1, 0, 0), plate.function(0, 1, 0)
    assert one @ plate.M @ one == pytest.approx(6.0)
    assert one @ plate.M @ x == pytest.approx(1.0)
    assert x @ plate.M @ x == pytest.approx(1.0 / 12.0 + 0.5)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"side": 0.0}, DomainError, "side is 0.0"),
        ({"poisson": 0.5}, DomainError, "poisson"),
        ({"degree": 1}, DomainError, "degree is 1"),
        ({"masses": [-1.0], "places": [[0.0, 0.0]]}, DomainError, "masses"),
        ({"masses": [1.0], "places": [[0.6, 0.0]]}, DomainError, "places reach"),
        ({"masses": [1.0], "places": [0.0, 0.0]}, DimensionError, "places has shape"),
    ],
)
def test_bad_plates_are_named(changes, error, words):
    with pytest.raises(error, match=words):
        free_plate(**({"degree": 4} | changes))


def test_a_place_off_the_plate_is_rejected():
    with pytest.raises(DomainError, match="off the plate"):
        free_plate(4).rows([[0.51, 0.0]])
    with pytest.raises(DimensionError, match="wanted"):
        free_plate(4).rows([[0.1, 0.0, 0.0]])
