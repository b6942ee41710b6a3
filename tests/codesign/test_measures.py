"""Guards the measures: crossovers, peaks and damping of loops whose answer is computed in another way."""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np
import pytest
import scipy.optimize

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, Specification, largest_real_part, measure
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.measures import block_responses, bounds, mode_damping, peak_near
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.hinfstruct.response import Response
from lpvhinf.progress import Progress

POINTS = np.array([[-0.08], [0.011], [0.06]])
Make = Callable[[Assembly, Array], Design]


def plant_response(design: Design, p: Array, s: complex) -> Array:
    """The decoupled plant in physical units, from modal sums."""
    plant = design.assembly.plant
    gains, n = plant.sample(p[None]), plant.n_rb
    G = gains.D[0].astype(complex)
    G[:n, :n] += np.eye(n) / s**2
    for b, c, w, z in zip(gains.B[0, n:], gains.C[0].T[n:], plant.omega[n:], plant.zeta[n:], strict=True):
        G = G + np.outer(c, b) / (s**2 + 2 * z * w * s + w**2)
    return np.asarray(G)


def test_crossover_of_the_conventional_loop(rigid: Design) -> None:
    measures = measure(rigid, POINTS)
    for p, found in zip(POINTS, measures.crossover, strict=True):
        for i in range(2):

            def gain(f: float, p: Array = p, i: int = i) -> float:
                w = 2 * np.pi * f
                K = rigid.K_RB.response([w])[0]
                return float(np.log(np.abs(plant_response(rigid, p, 1j * w)[i, i] * K[i])))

            assert gain(3.0) > 0.0 > gain(40.0)
            assert found[i] == pytest.approx(scipy.optimize.brentq(gain, 3.0, 40.0), rel=1e-3)


def test_crossover_is_where_the_rule_of_thumb_puts_it(small_plant: DecoupledPlant, with_parameters: Make) -> None:
    """|K G| = 1 at f_bw for 1/s^2; the flexible modes change it a little, and three times slower is three times."""
    for f_bw in (12.0, 4.0):
        assembly = Assembly(plant=small_plant, specification=Specification(f_bw=f_bw), architecture="rigid-body")
        measures = measure(with_parameters(assembly, assembly.start(POINTS)), POINTS)
        assert measures.crossover == pytest.approx(np.full((3, 2), f_bw), rel=0.15 * (f_bw / 12.0) ** 2)


def test_there_may_be_no_crossover(rigid: Design, with_parameters: Make) -> None:
    theta = rigid.parameters.copy()
    theta[0] = -30.0  # no gain on the first axis
    measures = measure(with_parameters(rigid.assembly, theta), POINTS[:1])
    assert np.isnan(measures.crossover[0, 0])
    assert np.isfinite(measures.crossover[0, 1])


def test_the_peak_of_the_sensitivity(rigid: Design) -> None:
    measures = measure(rigid, POINTS)
    omega = 2 * np.pi * np.unique(np.concatenate([np.geomspace(0.5, 500.0, 1000), np.linspace(59.0, 61.0, 100)]))
    error, K = rigid.specification.errors(2), rigid.K_RB.response(omega)
    for p, peak in zip(POINTS, measures.sensitivity_peak, strict=True):
        sizes = []
        for w, k in zip(omega, K, strict=True):
            S = np.linalg.inv(np.eye(2) + plant_response(rigid, p, 1j * w)[:2, :2] * k)
            sizes.append(np.linalg.norm(S * error / error[:, None], 2))
        assert max(sizes) <= peak * (1.0 + 1e-9)
        assert max(sizes) == pytest.approx(peak, rel=2e-3)


@pytest.mark.parametrize("name", ["rigid", "observer"])
def test_peaks_of_the_flexible_modes(name: str, request: pytest.FixtureRequest) -> None:
    design: Design = request.getfixturevalue(name)
    measures = measure(design, POINTS)
    for k, (A, B, C, D) in enumerate(design.frozen(POINTS)):
        poles = np.abs(np.linalg.eigvals(A))  # lightly damped modes have peaks between the points of a grid
        around = (poles[:, None] * np.linspace(0.99, 1.01, 41)).ravel()
        omega = np.unique(np.concatenate([2 * np.pi * np.geomspace(5.0, 1000.0, 4000), around]))
        own = (omega > 2 * np.pi * 60.0 / np.sqrt(2)) & (omega < 2 * np.pi * 60.0 * np.sqrt(2))
        gains = np.linalg.norm(Response(A, B[:, 4:], C[:2], D[:2, 4:]).at(omega)[:, :, 0], axis=1)
        assert np.max(gains) == pytest.approx(measures.flexible_peak[k, 0], rel=0.05)
        assert np.max(gains) <= measures.flexible_peak[k, 0] * (1.0 + 1e-8)
        assert np.max(gains[own]) == pytest.approx(measures.mode_peak[k, 0], rel=0.02)
    assert np.all(measures.mode_peak <= measures.flexible_peak * (1.0 + 1e-8))


def test_a_peak_near_a_frequency() -> None:
    """Two resonances of gain 1/(2 zeta): the one asked for is found, however narrow, and no other."""
    systems = [control.tf([1.0], [1 / w**2, 2 * z / w, 1.0]) for w, z in ((100.0, 1e-4), (1000.0, 1e-2))]
    system = control.ss(control.append(*(control.ss(one) for one in systems)))
    response = Response(system.A, system.B, system.C, system.D)
    assert peak_near(response, 0, 100.0) == pytest.approx(5000.0, rel=1e-3)
    assert peak_near(response, 1, 1000.0) == pytest.approx(50.0, rel=1e-3)
    assert peak_near(response, 1, 100.0) < 1.1


def test_without_feedback_the_dampings_are_the_plants(small_plant: DecoupledPlant, with_parameters: Make) -> None:
    wanted = Specification(f_bw=[12.0, 15.0], expected_error=[2e-6, 5e-5])
    for architecture in ("rigid-body", "output-observer"):
        assembly = Assembly(plant=small_plant, specification=wanted, architecture=architecture)
        theta = assembly.start(POINTS, xi=0.0)
        theta[:10:5] = -20.0  # gains of e^-20
        for A, _, _, _ in with_parameters(assembly, theta).frozen(POINTS):
            controlled, discarded = mode_damping(with_parameters(assembly, theta), A)
            assert controlled == pytest.approx([0.01], rel=1e-5)
            assert discarded == pytest.approx(0.008, rel=1e-5)


def test_damping_grows_with_xi(observer: Design, with_parameters: Make) -> None:
    """Without a damping force only the spill-over of K_RB moves the pole."""
    theta = observer.parameters.copy()
    found = []
    for factor in (0.0, 0.5, 1.0):
        theta[-1] = factor * observer.parameters[-1]
        found.append(measure(with_parameters(observer.assembly, theta), POINTS).damping[:, 0])
    assert found[0] == pytest.approx(np.full(3, 0.01), rel=0.05)
    assert np.all(found[0] < found[1])
    assert np.all(found[1] < found[2])


def test_largest_real_part(rigid: Design, observer: Design, with_parameters: Make) -> None:
    for design in (rigid, observer):
        found = largest_real_part(design, POINTS)
        wanted = [np.max(np.linalg.eigvals(A).real) for A, _, _, _ in design.frozen(POINTS)]
        assert found == pytest.approx(wanted)
        assert np.all(found < 0.0)
    wild = rigid.parameters.copy()
    wild[0] += 6.0
    assert np.min(largest_real_part(with_parameters(rigid.assembly, wild), POINTS)) > 0.0


@pytest.mark.parametrize("name", ["rigid", "observer"])
def test_six_blocks_and_their_bounds(name: str, request: pytest.FixtureRequest) -> None:
    design: Design = request.getfixturevalue(name)
    omega = 2 * np.pi * np.array([1.0, 13.0, 60.0, 200.0])
    sigma = block_responses(design, POINTS, omega).sigma
    assert sigma.shape == (3, 2, 3, 4)
    for k, (A, B, C, D) in enumerate(design.frozen(POINTS)):
        for m, w in enumerate(omega):
            T = C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D
            for i in range(2):
                for j, columns in enumerate((slice(0, 2), slice(2, 4), slice(4, 5))):
                    block = T[2 * i : 2 * i + 2, columns]
                    assert sigma[k, i, j, m] == pytest.approx(np.linalg.norm(block, 2), rel=1e-8)
    limit, filters = bounds(design, omega), design.assembly.filters
    assert limit.shape == (2, 3, 4)
    assert limit[0, 0] == pytest.approx(1.0 / np.max(np.abs(filters.W_z1(omega)), axis=1))
    assert limit[1, 2] == pytest.approx(
        1.0 / np.max(np.abs(filters.W_z2(omega)), axis=1) / np.abs(filters.W_w3(omega))[:, 0]
    )


def test_progress_hears_every_position(rigid: Design) -> None:
    class Counter(Progress):
        count = 0

        def update(self, advance: int = 1, **values: float) -> None:
            self.count += advance

    counter = Counter()
    measure(rigid, POINTS, progress=counter)
    largest_real_part(rigid, POINTS, progress=counter)
    assert counter.count == 6
