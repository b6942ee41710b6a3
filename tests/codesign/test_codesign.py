"""Guards the co-design: norms that others compute too, parameters in physical units, starts, and refusals."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from typing import Any

import control
import numpy as np
import pytest
import scipy.optimize

from lpvhinf.checks import Array
from lpvhinf.codesign import Design, Specification, codesign
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.codesign import _initial, _translated
from lpvhinf.codesign.positions import norms_at
from lpvhinf.controllers import RigidBodyGains
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import DimensionError, DomainError, LpvHinfWarning, SynthesisError
from lpvhinf.fitting import interpolate
from lpvhinf.plant import ModalModel

QUICK: dict[str, Any] = {"n_positions": 3, "starts": 1, "max_iterations": 1, "exchange_rounds": 0, "n_search": 1}
HERTZ = np.geomspace(0.1, 2000.0, 400)


def four_block(design: Design, p: Array, omega: float) -> float:
    """Largest singular value of the paper's 4-block M at j omega, from modal sums and K_RB in physical units."""
    plant, wanted = design.assembly.plant, design.specification
    n, s = plant.n_rb, 1j * omega
    gains = plant.sample(p[None])
    G = gains.D[0, :n, :n] + np.eye(n) / s**2
    for b, c, w, z in zip(gains.B[0, n:], gains.C[0].T[n:], plant.omega[n:], plant.zeta[n:], strict=True):
        G = G + np.outer(c[:n], b[:n]) / (s**2 + 2 * z * w * s + w**2)
    f = wanted.bandwidths(n)
    error, force = wanted.errors(n), (2 * np.pi * f) ** 2 * wanted.errors(n)
    K = np.diag(design.K_RB.response([omega])[0] * error / force)  # scaled
    G = G * force / error[:, None]
    W_1 = wanted.K_s * (s + 2 * np.pi * f / 4) / s
    W_2 = wanted.K_r * (s + 2 * np.pi * 4 * f) / (s / wanted.alpha + 2 * np.pi * 4 * f)
    S = np.linalg.inv(np.eye(n) + G @ K)
    columns = np.hstack([S, S @ G])
    return float(np.linalg.norm(np.vstack([W_1[:, None] * columns, W_2[:, None] * (K @ columns)]), 2))


def test_gamma_is_the_peak_of_the_formula(rigid: Design) -> None:
    assert rigid.stabilizing
    near = [w * np.linspace(0.97, 1.03, 61) for w in (60.0, 110.0, 240.0)]
    grid = np.unique(np.concatenate([[1e-3], HERTZ, *near]))
    for p, gamma in zip(rigid.positions, rigid.gammas, strict=True):
        values = np.array([four_block(rigid, p, 2 * np.pi * f) for f in grid])
        tops = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1
        peak = float(np.max(values))
        for k in tops[values[tops] > 0.95 * peak]:
            fine = scipy.optimize.minimize_scalar(
                lambda f, p=p: -four_block(rigid, p, 2 * np.pi * f), bounds=grid[[k - 1, k + 1]], method="bounded"
            )
            peak = max(peak, -float(fine.fun))
        assert peak == pytest.approx(gamma, rel=1e-6)
    assert rigid.gamma == np.max(rigid.gammas) <= rigid.gamma_worst


@pytest.mark.parametrize("name", ["rigid", "observer"])
def test_gammas_are_slicots(name: str, request: pytest.FixtureRequest) -> None:
    design: Design = request.getfixturevalue(name)
    n_w = 2 * design.assembly.plant.n_rb + (design.assembly.plant.n_flex if name == "observer" else 0)
    for (A, B, C, D), gamma in zip(design.frozen(design.positions, weighted=True), design.gammas, strict=True):
        assert np.max(np.linalg.eigvals(A).real) < 0.0
        norm, _ = control.linfnorm(control.ss(A, B[:, :n_w], C, D[:, :n_w]))
        assert norm == pytest.approx(gamma, rel=1e-6)


def test_the_observer_pays(rigid: Design, observer: Design) -> None:
    """The norm of six blocks with an observer lies below that without one, where w3 counts as well."""
    plants = [control.ss(*system) for system in rigid.frozen(observer.positions, weighted=True)]
    without = max(control.linfnorm(system)[0] for system in plants)
    assert observer.gamma < 0.8 * without
    assert observer.xi is not None
    assert np.all(observer.xi > 0.0)


def test_without_damping_six_blocks_hold_the_four(rigid: Design, observer: Design) -> None:
    """With xi = 0 the observer acts on nothing: four of the blocks are those of the same K_RB alone."""
    theta = observer.parameters.copy()
    theta[-1] = 0.0
    K, L, xi = observer.assembly.split(theta)
    assert (K.shape, L.shape, xi.tolist()) == ((10,), (6, 3), [0.0])
    assert np.array_equal(np.concatenate([K, L.ravel(), -xi]), theta)
    six, four = norms_at(observer.assembly, theta, rigid.positions), norms_at(rigid.assembly, K, rigid.positions)
    assert np.all(six >= four * (1.0 - 1e-8))
    assert np.all(np.isfinite(six))


@pytest.mark.parametrize("name", ["rigid", "observer"])
def test_the_controller_has_the_gains_that_are_read(name: str, request: pytest.FixtureRequest) -> None:
    design: Design = request.getfixturevalue(name)
    frozen = design.controller.at([0.03])
    response = frozen(2j * np.pi * HERTZ)[:2, :2]
    K = design.K_RB.response(2 * np.pi * HERTZ)
    for i in range(2):
        assert np.max(np.abs(response[i, i] / K[:, i] - 1.0)) < 1e-9
        assert np.max(np.abs(response[i, 1 - i])) < 1e-9 * np.max(np.abs(K[:, i]))
    assert np.max(np.abs(frozen(2j * np.pi * HERTZ)[:2, 2:])) < 1e-9 * np.max(np.abs(K))  # u_RB knows y by e alone
    assert frozen.nstates == (6 if name == "rigid" else 14)


def test_L_and_xi_are_physical(observer: Design) -> None:
    """The observer's equations in physical units, from (e, y) to u_FM, at a position between the nodes."""
    plant, p, f = observer.assembly.plant, np.array([0.037]), 47.0
    s, w, z = 2j * np.pi * f, plant.omega[:3], plant.zeta[:3]
    assert observer.L is not None
    assert observer.xi is not None
    A, B, C = np.zeros((6, 6)), np.zeros((6, 3)), np.zeros((3, 6))
    for i in range(3):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-(w[i] ** 2), -2 * z[i] * w[i]]]
        B[2 * i + 1, i] = 1.0
    C[:2, [0, 2]], C[:, 4] = np.eye(2), plant.fit["C"].matrix.at(p)[:, 0]
    D = interpolate(plant.static_correction, box=plant.box, degree=plant.degree).matrix.at(p)
    inverse = np.linalg.inv(s * np.eye(6) - A + observer.L @ C)[5]  # the velocity of the controlled mode
    Q, w_flex = observer.specification.Q, w[2]
    K_FM = observer.xi[0] * (w_flex / Q * s) / (s**2 + w_flex / Q * s + w_flex**2)
    from_u, K = inverse @ (B - observer.L @ D), np.diag(observer.K_RB.response([abs(s)])[0])
    # u_FM = -K_FM (from_u [K e; u_FM] + inverse L y)
    wanted = -K_FM * np.concatenate([from_u[:2] @ K, inverse @ observer.L]) / (1.0 + K_FM * from_u[2])
    found = observer.controller.at(p)(s)[2]
    assert np.max(np.abs(found - wanted)) < 1e-9 * np.max(np.abs(wanted))


# Starts


def test_a_finished_design_is_its_own_start(rigid: Design, observer: Design) -> None:
    for design in (rigid, observer):
        (start,) = _initial(design.assembly, design.positions, design, None, 2)
        assert np.allclose(start, design.parameters, rtol=1e-12, atol=1e-12)
        (start,) = _initial(design.assembly, design.positions, design.parameters.tolist(), None, 2)
        assert np.array_equal(start, design.parameters)


def test_an_observer_starts_from_the_conventional_gains(rigid: Design, observer: Design) -> None:
    by_design = _initial(observer.assembly, rigid.positions, rigid, None, 2)
    by_gains = _initial(observer.assembly, rigid.positions, None, rigid.parameters, 2)
    assert len(by_design) == 2
    for one, other in zip(by_design, by_gains, strict=True):
        assert np.allclose(one, other, rtol=1e-12, atol=1e-12)
        assert np.allclose(one[:10], rigid.parameters, rtol=1e-12, atol=1e-12)
        assert one[-1] < 0.0  # damps


def test_going_on_is_never_worse(small_plant: DecoupledPlant, rigid: Design, wanted: Specification) -> None:
    better = codesign(
        small_plant, "rigid-body", wanted, positions=rigid.positions, warm_start=rigid, **QUICK | {"n_positions": 9}
    )
    assert better.gamma <= rigid.gamma * (1.0 + 1e-9)
    assert np.array_equal(better.positions, rigid.positions)


def test_gains_are_round_tripped(rigid: Design) -> None:
    assert isinstance(rigid.K_RB, RigidBodyGains)
    assert np.allclose(rigid.assembly.rigid_body.parameters(rigid.K_RB), rigid.parameters, rtol=1e-12)


def test_gains_are_kept_for_another_bandwidth(small_plant: DecoupledPlant, rigid: Design) -> None:
    """Parameters are relative to the bandwidth; a start is the same controller all the same."""
    slower = dataclasses.replace(rigid.specification, f_bw=[6.0, 7.5])
    assembly = Assembly(plant=small_plant, specification=slower, architecture="rigid-body")
    start = assembly.rigid_body.gains(_translated(assembly, rigid))
    assert np.allclose(start.gain, rigid.K_RB.gain, rtol=1e-12)
    assert np.allclose(start.f_d, rigid.K_RB.f_d, rtol=1e-12)


# Refusals


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"architecture": "modal"}, DomainError, "architecture is 'modal', wanted one of rigid-body, output-observer"),
        ({"positions": [[0.0], [0.2]]}, DomainError, r"positions = \[0\.2\] is outside the box"),
        ({"positions": [[0.0, 0.0]]}, DimensionError, "positions has shape"),
        ({"positions": [[np.nan]]}, DomainError, r"positions\[0, 0\] is nan"),
        (
            {"warm_start": np.zeros(29)},
            DimensionError,
            r"warm_start has shape \(29,\), wanted \(29|warm_start has shape",
        ),
        ({"warm_start": np.full(10, np.nan)}, DomainError, r"warm_start\[0\] is nan"),
        ({"rigid_start": np.zeros(9)}, DimensionError, r"rigid_start has shape \(9,\), wanted \(10\)"),
        ({"rigid_start": np.full(10, np.inf)}, DomainError, r"rigid_start\[0\] is inf"),
        ({"max_iterations": 0}, DomainError, "max_iterations is 0"),
        ({"exchange_rounds": -1}, DomainError, "exchange_rounds is -1"),
        ({"n_positions": 2.5}, DomainError, "n_positions is 2.5"),
        ({"n_search": 0}, DomainError, "n_search is 0"),
        ({"starts": -1}, DomainError, "starts is -1"),
        ({"exchange_tolerance": np.nan}, DomainError, "exchange_tolerance is nan"),
        ({"jobs": 0}, DomainError, "jobs is 0"),
        ({"time_limit": -1.0}, DomainError, "time_limit is -1.0"),
        ({"tolerance": 0.0}, DomainError, "tolerance is 0.0"),
    ],
)
def test_wrong_arguments(
    small_plant: DecoupledPlant, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        codesign(small_plant, **{"architecture": "rigid-body", **QUICK, **options})


def test_an_observer_needs_a_controlled_mode(small_modal: ModalModel) -> None:
    with pytest.raises(DomainError, match="n_flex is 0, wanted at least 1 preserved flexible mode"):
        codesign(decouple(small_modal, n_flex=0, degree=4), "output-observer")


def test_values_for_another_number_of_axes(small_plant: DecoupledPlant) -> None:
    with pytest.raises(DomainError, match="f_bw has 3 values, wanted 1 or 2"):
        codesign(small_plant, "rigid-body", Specification(f_bw=[10.0, 10.0, 10.0]), **QUICK)


def _end_of(work: Callable[[], Design]) -> Design | SynthesisError:
    """What a design that may well be impossible ends with."""
    try:
        return work()
    except SynthesisError as error:
        return error


def test_a_bandwidth_in_the_band_of_a_discarded_mode_warns(small_plant: DecoupledPlant) -> None:
    demanding = Specification(f_bw=[10.0, 300.0])
    with pytest.warns(LpvHinfWarning, match=r"f_bw = 300\.0 Hz is above the first discarded mode at 110\.0 Hz"):
        _end_of(lambda: codesign(small_plant, "rigid-body", demanding, time_limit=2.0, **QUICK))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        codesign(small_plant, "rigid-body", Specification(f_bw=10.0), **QUICK)
