"""Guards the continuous loops and the figures that are read off them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, largest_real_part, measure
from lpvhinf.errors import DomainError
from lpvhinf.robustness import Analysis, ControlledPlant, Samples, Uncertainty
from lpvhinf.robustness.closed_loop import SystemStack, close
from lpvhinf.robustness.outcomes import FIGURES
from lpvhinf.robustness.perturbed_plant import PerturbedPlants
from lpvhinf.statespace import LPVStateSpace

POINTS = np.array([[-0.1], [0.02], [0.077]])


def response(A: Array, B: Array, C: Array, D: Array, s: complex) -> Array:
    return np.asarray(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)


def test_without_perturbation_they_are_the_designs(small_design: Design, small: ControlledPlant) -> None:
    measures = measure(small_design, POINTS)
    analysis = Analysis(small, Uncertainty(delay=0.0))
    found = analysis.measure(Samples.nominal(small.plant, POINTS), exact=True)
    assert found.abscissa == pytest.approx(largest_real_part(small_design, POINTS), rel=1e-6)
    assert found.damping == pytest.approx(measures.damping, rel=1e-6)
    assert found.sensitivity == pytest.approx(measures.sensitivity_peak, rel=1e-7)
    assert found.flexible_peak == pytest.approx(measures.flexible_peak, rel=1e-7)
    assert not np.any(found.unstable)
    assert not np.any(found.unstable_sampled)


@pytest.mark.parametrize("delay", [0.0, 2e-3])
@pytest.mark.parametrize("outputs", [2, 3])
def test_transfers_are_those_of_the_block_diagram(small: ControlledPlant, delay: float, outputs: int) -> None:
    """At frequencies, with a controller that has a feed-through, and one without modal outputs."""
    n, keep = small.controller.n_x, slice(0, outputs)
    A, B, C, _ = small.controller.sample([[0.0]])
    D = 0.3 * np.sin(np.arange(3 * small.controller.n_u)).reshape(3, -1)
    D = D * small.scaling.input[:, None] * np.r_[small.scaling.output[:2], small.scaling.output]
    K = LPVStateSpace.from_coefficients(A[0], B[0], C[0][keep], D[keep], box=small.plant.box)
    subject = dataclasses.replace(small, controller=K)
    uncertainty = Uncertainty(delay=delay, delay_order=3)
    samples = uncertainty.samples(small.plant, np.random.default_rng(3).random((2, uncertainty.dimension(small.plant))))
    loops = Analysis(subject, uncertainty).continuous(samples)
    stack = PerturbedPlants(subject, 1.0).at(samples)
    assert loops.A.shape[1] == 10 + n + (3 * outputs if delay else 0)
    for k in range(2):
        for s in (2j * np.pi * np.array([1.0, 14.0, 60.0, 100.0])).tolist():
            below = s**2 + 2 * stack.zeta[k] * stack.omega[k] * s + stack.omega[k] ** 2
            G = stack.C[k] / below @ stack.B[k] + stack.D[k]
            late, n_y = np.exp(-s * delay), len(G)
            gain = response(A[0], B[0], C[0][keep], D[keep], s)
            gain = gain / small.scaling.input[keep, None] / np.r_[small.scaling.output[:2], small.scaling.output]
            K_e, K_y = gain[:, :2], gain[:, 2:]
            select, unit = np.eye(2, n_y), np.eye(n_y)
            # y = G1 late u + G3 w3, u = K_e e + K_y y, e = -(y_RB + w1)
            G1, G3 = G[:, keep] * late, G[:, 2:]
            loop = unit - G1 @ (K_y - K_e @ select)
            y1, y3 = np.linalg.solve(loop, -G1 @ K_e), np.linalg.solve(loop, G3)
            wanted = -np.hstack([y1[:2] + np.eye(2), y3[:2]])
            found = response(loops.A[k], loops.B[k], loops.C[k], loops.D[k], s)
            assert found == pytest.approx(wanted, rel=2e-4 if delay else 1e-8, abs=1e-6 if delay else 1e-9)


def test_an_algebraic_loop_is_solved() -> None:
    """Gains alone: y = 2 u, u = 0.5 e, so that e = -(y + w) = -w / 2."""
    gains = {"A": np.zeros((1, 0, 0)), "B": np.zeros((1, 0, 1)), "C": np.zeros((1, 1, 0))}
    controller = SystemStack(**{**gains, "B": np.zeros((1, 0, 2))}, D=np.array([[[0.5, 0.0]]]))
    loop = close(SystemStack(**gains, D=np.array([[[2.0]]])), controller, n_rb=1)
    assert loop.D.ravel().tolist() == [-0.5]


def test_norms_are_exact_where_asked(small: ControlledPlant, mild: Uncertainty) -> None:
    unit = np.random.default_rng(0).random((6, mild.dimension(small.plant)))
    samples, analysis = mild.samples(small.plant, unit), Analysis(small, mild)
    tracked, exact = analysis.measure(samples), analysis.measure(samples, exact=True)
    for name in ("sensitivity", "flexible_peak"):
        assert getattr(tracked, name) == pytest.approx(getattr(exact, name), rel=1e-2)
        assert np.all(getattr(tracked, name) <= getattr(exact, name) * (1.0 + 1e-7))  # of some frequencies only
    assert np.all(exact.abscissa == tracked.abscissa)


def test_figures_that_nobody_asks_for_are_left_out(small: ControlledPlant, wide: Uncertainty) -> None:
    samples = wide.samples(small.plant, np.full((1, wide.dimension(small.plant)), 0.3))
    analysis = Analysis(small, wide)
    everything = analysis.measure(samples)
    for name in FIGURES:
        found = analysis.measure(samples, [name])
        assert found.figure(name) == pytest.approx(everything.figure(name), rel=1e-6)
        assert np.isnan(found.spectral_radius).all() == (name != "spectral_radius")
    with pytest.raises(DomainError, match=r"no option 'gain'\. Known: abscissa, damping"):
        analysis.measure(samples, ["gain"])


def test_an_unstable_loop_has_no_norm(small: ControlledPlant) -> None:
    late = Uncertainty(delay=30e-3, sample_time=1e-3, delay_order=4)
    found = Analysis(small, late).measure(Samples.nominal(small.plant, [[0.0]]))
    assert found.abscissa[0] > 0.0
    assert found.least_damping[0] < 0.0
    assert np.isinf(found.sensitivity).all()
    assert np.isinf(found.flexible_peak).all()
    assert found.unstable.all()
    assert found.unstable_sampled.all()
