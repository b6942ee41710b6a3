"""Guards the sampled loop: closed forms against matrix exponentials, poles against a loop that is stepped through."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

from lpvhinf.checks import Array
from lpvhinf.robustness import Analysis, ControlledPlant, Samples, Uncertainty
from lpvhinf.robustness.closed_loop import SystemStack
from lpvhinf.robustness.continuous_loop import continuous_plant
from lpvhinf.robustness.perturbed_plant import ModalStack, PerturbedPlants
from lpvhinf.robustness.sampled_loop import sampled_plant, transition, tustin

T = 1e-3


@pytest.fixture(scope="module")
def modes(small: ControlledPlant) -> ModalStack:
    samples = Samples.nominal(small.plant, [[0.02], [-0.1]])
    return PerturbedPlants(small, 0.0).at(dataclasses.replace(samples, zeta=np.array([[0.0, 0.3, 0.9]] * 2)))


def held(A: Array, B: Array, t: float) -> tuple[Array, Array]:
    """e^(A t) and its integral times B, by one exponential of both."""
    n, m = B.shape
    joined = np.zeros((n + m, n + m))
    joined[:n, :n], joined[:n, n:] = A * t, B * t
    both = scipy.linalg.expm(joined)
    return both[:n, :n], both[:n, n:]


@pytest.mark.parametrize("t", [1e-6, 1e-4, 3e-3])
def test_transition(modes: ModalStack, t: float) -> None:
    plant = continuous_plant(modes, n_u=3, n_rb=3, delay=0.0, delay_order=1)
    Phi, Gamma = transition(modes, t)
    for k in range(2):
        A, B = held(plant.A[k], plant.B[k], t)
        assert scipy.linalg.block_diag(*Phi[k]) == pytest.approx(A, rel=1e-10, abs=1e-12)
        assert Gamma[k] == pytest.approx(B, rel=1e-9, abs=1e-12 * np.max(np.abs(B)))


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 1e-3, 1.5e-3, 2.2e-3, 3e-3])
def test_a_plant_with_any_delay(modes: ModalStack, delay: float) -> None:
    """Its output at the sampling instants, to a random input that is held and arrives later."""
    rng = np.random.default_rng(0)
    inputs = rng.standard_normal((8, 3))
    found = sampled_plant(modes, n_u=3, sample_time=T, delay=delay)
    plant = continuous_plant(modes, n_u=3, n_rb=3, delay=0.0, delay_order=1)
    A, B = held(plant.A[0], plant.B[0], 1e-4)  # a tenth of a sample: all delays here are whole ones of it
    late, x, z = round(delay / 1e-4), np.zeros(len(A)), np.zeros(found.A.shape[1])
    assert late * 1e-4 == pytest.approx(delay)
    for k in range(8):
        for j in range(10):
            i = 10 * k + j - late
            u = inputs[i // 10] if i >= 0 else np.zeros(3)
            if j == 0:
                y = plant.C[0] @ x + plant.D[0] @ u
                assert found.C[0] @ z + found.D[0] @ inputs[k] == pytest.approx(y, rel=1e-9, abs=1e-12)
            x = A @ x + B @ u
        z = found.A[0] @ z + found.B[0] @ inputs[k]
        assert z[: len(x)] == pytest.approx(x, rel=1e-9, abs=1e-12)


def test_tustin_is_that_of_scipy() -> None:
    rng = np.random.default_rng(1)
    one = [rng.standard_normal(shape) for shape in ((4, 4), (4, 2), (3, 4), (3, 2))]
    found = tustin(SystemStack(**{name: m[None] for name, m in zip("ABCD", one, strict=True)}), 0.2)
    A, B, C, D, _ = scipy.signal.cont2discrete(one, 0.2, method="bilinear")
    for matrix, wanted in ((found.A, A), (found.B, B), (found.C, C), (found.D, D)):
        assert matrix[0] == pytest.approx(wanted, rel=1e-10, abs=1e-12)


def test_poles_of_the_loop_are_those_of_one_that_is_stepped_through(small: ControlledPlant) -> None:
    """Half a sample at a time, with the controller's difference equation written out."""
    uncertainty = Uncertainty(delay=1.5 * T, sample_time=T)
    samples = Samples.nominal(small.plant, [[0.05]])
    analysis = Analysis(small, uncertainty)
    plant = continuous_plant(PerturbedPlants(small, 0.0).at(samples), n_u=3, n_rb=2, delay=0.0, delay_order=1)
    K = small.controller.at([0.05])
    inputs, outputs = 1.0 / np.r_[small.scaling.output[:2], small.scaling.output], 1.0 / small.scaling.input
    scaled = (K.A, K.B * inputs, outputs[:, None] * K.C, outputs[:, None] * K.D * inputs)
    Ad, Bd, Cd, Dd, _ = scipy.signal.cont2discrete(scaled, T, method="bilinear")
    Phi, Gamma = held(plant.A[0], plant.B[0][:, :3], T / 2)
    n, n_k, n_y = len(Phi), len(Ad), plant.C.shape[1]

    def step(state: Array) -> Array:
        x, oldest, newest, x_k = np.split(state, [n, n + 3, n + 6])
        y = plant.C[0] @ x + plant.D[0][:, :3] @ oldest
        seen = np.concatenate([-y[:2], y])
        u = Cd @ x_k + Dd @ seen
        x = Phi @ (Phi @ x + Gamma @ oldest) + Gamma @ newest
        return np.concatenate([x, newest, u, Ad @ x_k + Bd @ seen])

    A = np.column_stack([step(column) for column in np.eye(n + 6 + n_k)])
    assert n_y == small.plant.n_out
    radius = float(np.max(np.abs(np.linalg.eigvals(A))))
    assert analysis.measure(samples, ["spectral_radius"]).spectral_radius[0] == pytest.approx(radius, abs=1e-9)
    assert analysis.sampled(samples).A[0] == pytest.approx(A, rel=1e-8, abs=1e-10 * np.max(np.abs(A)))


def test_a_fast_sampled_loop_is_the_continuous_one(small: ControlledPlant) -> None:
    """log(radius) / T comes to the largest real part as T falls, at the rate of the delay of a held input, T / 2."""
    samples, gaps = Samples.nominal(small.plant, [[0.0], [0.08]]), []
    for T in (2e-4, 1e-4, 5e-5):
        found = Analysis(small, Uncertainty(delay=T, sample_time=T)).measure(samples, ["spectral_radius"])
        exact = Analysis(small, Uncertainty(delay=1.5 * T, delay_order=3)).measure(samples, ["abscissa"])
        gaps.append(np.max(np.abs(np.log(found.spectral_radius) / T / exact.abscissa - 1.0)))
    assert gaps[2] < 1e-4
    assert gaps[0] / gaps[2] > 4.0  # at least of first order; the half sample is in the delay already
