"""PID, filters, chains, patterns, schedules and user maps: transfer functions, derivatives, bad arguments."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct import hinfstruct
from lpvhinf.hinfstruct.chains import Series, Sum
from lpvhinf.hinfstruct.compose import BlockDiagonal, Constant, Scaled
from lpvhinf.hinfstruct.filters import FirstOrderLowPass, Lead, LowPass, Notch
from lpvhinf.hinfstruct.fixed_order import FixedOrder
from lpvhinf.hinfstruct.gains import DiagonalGain, StaticGain
from lpvhinf.hinfstruct.pid import PID, TERMS
from lpvhinf.hinfstruct.ranges import LogRange
from lpvhinf.hinfstruct.scheduled import PolynomialBasis, Scheduled
from lpvhinf.hinfstruct.smooth_map import SmoothMap
from lpvhinf.hinfstruct.sparsity import AffineGain, band_mask, block_mask, pattern_gain
from lpvhinf.hinfstruct.structures import ControllerStructure, check_structure, report_structure
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace

P = np.array([0.3, -0.2])
BOX = [[-1.0, 1.0], [-0.5, 0.5]]


def lag(theta: Any, p: Any) -> tuple[Any, Any, Any, Any]:
    k, w = theta[0], np.exp(theta[1])
    return np.array([[-w]]), np.array([[w, 0.5 * w]]), np.array([[k]]), np.array([[k * w, k**2]])


def rounds_down(theta: Any, p: Any) -> tuple[Any, Any, Any, Any]:
    D = np.zeros((1, 1))
    D[0] = np.asarray(theta[0]).astype(float)
    return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), D


def response(structure: ControllerStructure, theta: Array, s: complex, p: Array | None = None) -> Array:
    A, B, C, D = structure.realize(theta, p)
    return np.asarray(C @ np.linalg.solve(s * np.eye(structure.n_x) - A, B) + D)


STRUCTURES = [
    *[PID(2, terms=terms, sign=-1, gain=(0.01, 100.0)) for terms in TERMS],
    PID(3, f_d=(10.0, 100.0), f_unit=20.0),
    PID(1, sign=1),
    Lead(2, f=(1.0, 50.0)),
    Lead(1, ratio=None),
    FirstOrderLowPass(2, f=(5.0, np.inf)),
    LowPass(2, f=(0.0, 80.0)),
    Notch(2, f=(80.0, 200.0)),
    Series(Notch(2, f=(1.0, 2.0)), PID(2, f_unit=1.0), LowPass(2, f=(3.0, 5.0))),
    Series(StaticGain(3, 2), FixedOrder(2, 1, 3), FixedOrder(3, 2, 1, stable=True), FixedOrder(1, 4, 2)),
    Series(Constant([[-1.0]], [[1.0]], [[2.0]], [[0.5]]), DiagonalGain(1, sign=-1)),
    Sum(StaticGain(2, 3), FixedOrder(2, 2, 3, strictly_proper=True), FixedOrder(1, 2, 3)),
    BlockDiagonal(Series(Lead(1, f=(1.0, 2.0)), StaticGain(1, 1)), Scaled(PID(1), 2.0)),
    FixedOrder(3, 2, 2, stable=True),
    FixedOrder(4, 1, 2, form="tridiagonal", stable=True, decay=0.1, strictly_proper=True),
    FixedOrder(0, 1, 2, stable=True),
    AffineGain([np.eye(2), [[0.0, 1.0], [0.0, 0.0]]], offset=[[0.0, 1.0], [2.0, 0.0]]),
    pattern_gain([[1, 0, -2], [2, 1, 0]]),
    StaticGain(3, 3, mask=block_mask([1, 2], [2, 1], shape="lower")),
    StaticGain(4, 4, mask=band_mask(4, 4)),
    Scheduled(FixedOrder(1, 1, 2, stable=True), PolynomialBasis(BOX, 2)),
    Scheduled(Series(Notch(1, f=(1.0, 2.0)), PID(1, sign=-1)), PolynomialBasis(BOX, 1)),
    SmoothMap(lag, 2, n_u=1, n_y=2, n_x=1),
    SmoothMap(lag, 2, n_u=1, n_y=2, n_x=1, derivative="complex"),
]


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: type(s).__name__)
def test_protocol_and_pullback(structure: ControllerStructure) -> None:
    assert isinstance(structure, ControllerStructure)
    theta = structure.initial(np.random.default_rng(1))
    assert theta.shape == (structure.n_parameters,)
    assert len(structure.names) == structure.n_parameters  # type: ignore[attr-defined]
    assert check_structure(structure, p=P) < 1e-7
    copy = pickle.loads(pickle.dumps(structure))
    for ours, theirs in zip(structure.realize(theta, P), copy.realize(theta, P), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_pid_is_its_formula() -> None:
    pid = PID(2, f_unit=3.0)
    theta = pid.parameters(k_P=[1.0, -2.0], k_I=0.5, k_D=[0.1, 0.2], f_d=50.0)
    s, w = 7.0j, 6.0 * np.pi
    wanted = [k + 0.5 * w / s + d * (s / w) / (1.0 + s / (100.0 * np.pi)) for k, d in ((1.0, 0.1), (-2.0, 0.2))]
    np.testing.assert_allclose(response(pid, theta, s), np.diag(wanted), rtol=1e-12)
    assert pid.physical(theta)["k_P"].tolist() == [1.0, -2.0]


def test_filters_are_their_formulas() -> None:
    f, s = 30.0, 100.0j
    w = 2.0 * np.pi * f
    notch, low, first, lead = (kind(1, f=(1.0, 100.0)) for kind in (Notch, LowPass, FirstOrderLowPass, Lead))
    n = s / w
    for structure, theta, wanted in (
        (notch, notch.parameters(f=f, zeta=0.4, depth=0.2), (n**2 + 0.16 * n + 1.0) / (n**2 + 0.8 * n + 1.0)),
        (low, low.parameters(f=f, zeta=0.7), 1.0 / (n**2 + 1.4 * n + 1.0)),
        (first, first.parameters(f=f), 1.0 / (n + 1.0)),
        (lead, lead.parameters(f=f, ratio=4.0), (1.0 + 2.0 * n) / (1.0 + 0.5 * n)),
    ):
        assert response(structure, theta, s)[0, 0] == pytest.approx(wanted, rel=1e-12)


def test_bounds_hold_for_every_parameter() -> None:
    notch = Notch(1, f=(80.0, 200.0), zeta=(0.1, 1.0))
    for theta in (np.full(3, -30.0), np.full(3, 30.0), np.zeros(3)):
        values = notch.physical(theta)
        assert 80.0 <= values["f"][0] <= 200.0 * (1.0 + 1e-12)
        assert 0.1 * (1.0 - 1e-12) <= values["zeta"][0] <= 1.0 + 1e-12


@pytest.mark.parametrize("bounds", [(0.0, np.inf), (2.0, np.inf), (0.0, 5.0), (2.0, 5.0)])
def test_ranges_and_their_slopes(bounds: tuple[float, float]) -> None:
    unit = LogRange(*bounds)
    x = np.linspace(-3.0, 3.0, 7)
    np.testing.assert_allclose(unit.inverse(unit.value(x)), x, atol=1e-9)
    np.testing.assert_allclose(unit.slope(x), (unit.value(x + 1e-6) - unit.value(x - 1e-6)) / 2e-6, rtol=1e-8)
    assert np.all(np.diff(unit.value(x)) > 0.0)


def test_chains_and_sums_are_products_and_sums_of_responses() -> None:
    first, second = FixedOrder(2, 3, 2), FixedOrder(3, 1, 3)
    rng = np.random.default_rng(0)
    t1, t2 = first.initial(rng), second.initial(rng)
    K1, K2 = response(first, t1, 2.0j), response(second, t2, 2.0j)
    np.testing.assert_allclose(response(Series(first, second), np.concatenate([t1, t2]), 2.0j), K2 @ K1, rtol=1e-10)
    other = FixedOrder(1, 3, 2)
    t3 = other.initial(rng)
    both = response(Sum(first, other), np.concatenate([t1, t3]), 2.0j)
    np.testing.assert_allclose(both, K1 + response(other, t3, 2.0j), rtol=1e-10)


@pytest.mark.parametrize("form", ["full", "tridiagonal"])
def test_stable_form_decays_and_reaches_every_stable_controller(form: str) -> None:
    structure = FixedOrder(4, 1, 1, form=form, stable=True, decay=0.3)
    rng = np.random.default_rng(0)
    for _ in range(20):
        A = structure.realize(10.0 * rng.standard_normal(structure.n_parameters))[0]
        assert np.max(np.linalg.eigvals(A).real) <= -0.3 + 1e-9
    full = FixedOrder(4, 2, 3, stable=True, decay=0.3)
    free = FixedOrder(4, 2, 3)
    given = free.initial(rng)
    A, B, C, D = free.realize(given)
    A = A - (np.max(np.linalg.eigvals(A).real) + 0.5) * np.eye(4)
    theta = full.parameters(A, B, C, D)
    wanted = C @ np.linalg.solve(1.5j * np.eye(4) - A, B) + D
    np.testing.assert_allclose(response(full, theta, 1.5j), wanted, rtol=1e-9)
    np.testing.assert_allclose(free.parameters(*free.realize(given)), given)


def test_schedules() -> None:
    inner = StaticGain(1, 2)
    K = Scheduled(inner, PolynomialBasis(BOX, 2))
    assert K.basis.indices[0] == (0, 0)
    assert K.n_parameters == 6 * 2
    theta = K.constant([1.0, 2.0])
    np.testing.assert_allclose(K.realize(theta, P)[3], [[1.0, 2.0]])
    theta[2 * K.basis.indices.index((1, 1))] = 1.0
    np.testing.assert_allclose(K.realize(theta, P)[3], [[1.0 + 0.3 * -0.4, 2.0]])
    with pytest.raises(DimensionError, match="scheduled"):
        K.realize(theta)
    with pytest.raises(DomainError, match="outside the box"):
        K.realize(theta, np.array([2.0, 0.0]))


def test_report_names_the_wrong_parameters() -> None:
    class Wrong(PID):
        def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
            out = super().pullback(theta, GA, GB, GC, GD, p)
            out[1] *= 1.5
            return out

    report = report_structure(Wrong(1), points=4)
    assert not report.passed
    assert report.errors.shape == (4, 4)
    assert report.table().count("\n") == 0
    assert "k_I" in report.table()
    with pytest.raises(AssumptionError, match=r"pullback\[1\] \(Wrong\[0\]\.k_I\)"):
        check_structure(Wrong(1))


def test_complex_steps_that_would_be_lost_are_refused() -> None:
    with pytest.raises(AssumptionError, match="complex parameters"):
        check_structure(SmoothMap(rounds_down, 1, n_u=1, n_y=1, derivative="complex"))
    assert check_structure(SmoothMap(rounds_down, 1, n_u=1, n_y=1)) < 1e-6


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PID(1, terms="DP"), "terms"),
        (lambda: PID(1, sign=2), "sign"),
        (lambda: PID(1, gain=(0.0, 1.0)), "without sign"),
        (lambda: PID(1, terms="PI", f_d=(0.0, 1.0)), "f_d"),
        (lambda: PID(0), "n is 0"),
        (lambda: Notch(1, f=(2.0, 1.0)), "f is"),
        (lambda: Notch(1, f=3.0), "f is"),  # type: ignore[arg-type]
        (lambda: Lead(1, f=(1.0, 2.0)).parameters(f=3.0, ratio=2.0), "strictly between"),
        (lambda: Lead(1).parameters(f=3.0), "Name every"),
        (lambda: LogRange(-1.0, 1.0), "wanted 0 <= low < high"),
        (lambda: FixedOrder(2, 1, 1, decay=1.0), "without stable"),
        (lambda: FixedOrder(2, 1, 1, stable=True, decay=-1.0), "decay"),
        (lambda: pattern_gain([[1, 3]]), "without gaps"),
        (lambda: block_mask([1], [1], shape="cross"), "shape"),
        (lambda: PolynomialBasis(BOX, -1), "degree"),
        (lambda: SmoothMap(lag, 2, n_u=1, n_y=1, derivative="symbolic"), "derivative"),
    ],
)
def test_bad_values(make: Any, message: str) -> None:
    with pytest.raises(DomainError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Series(StaticGain(2, 1), StaticGain(1, 3)), "stage 0 has 2 outputs"),
        (lambda: Sum(StaticGain(2, 1), StaticGain(1, 1)), "term 1"),
        (lambda: Sum(), "at least one"),
        (lambda: Notch(2).parameters(f=[1.0, 2.0, 3.0], zeta=1.0, depth=0.5), "f has shape"),
        (lambda: AffineGain(np.zeros((0, 1, 1))), "basis"),
        (lambda: block_mask([1], [1, 2]), "blocks"),
    ],
)
def test_bad_sizes(make: Any, message: str) -> None:
    with pytest.raises(DimensionError, match=message):
        make()


def test_controllers_outside_the_form_are_refused() -> None:
    with pytest.raises(AssumptionError, match="independent"):
        AffineGain([np.eye(2), 2.0 * np.eye(2)])
    with pytest.raises(AssumptionError, match="right of"):
        FixedOrder(1, 1, 1, stable=True).parameters([[1.0]], [[1.0]], [[1.0]], [[0.0]])
    with pytest.raises(AssumptionError, match="not free"):
        FixedOrder(1, 1, 1, strictly_proper=True).parameters([[-1.0]], [[1.0]], [[1.0]], [[1.0]])


def noisy_integrator(gain: float = 1.0) -> GeneralizedPlant:
    """x' = w1 + g u, z = (x, g u), y = x + w2: with g u = -sqrt(2) y the norm is sqrt 2, the least."""
    return GeneralizedPlant(
        *([[0.0]], [[1.0, 0.0]], [[gain]], [[1.0], [0.0]], [[1.0]], np.zeros((2, 2)), [[0.0], [gain]], [[0.0, 1.0]])
    )


def test_a_proportional_controller_is_tuned_to_its_known_optimum() -> None:
    pid = PID(1, terms="P", sign=-1, gain=(0.1, 50.0))
    result = hinfstruct(noisy_integrator(), pid, starts=1)
    assert result.gamma == pytest.approx(np.sqrt(2.0), rel=1e-6)
    assert pid.physical(result.parameters)["k_P"][0] == pytest.approx(np.sqrt(2.0), rel=1e-5)


def test_a_chain_is_tuned_and_stays_in_its_bounds() -> None:
    chain = Series(PID(1, terms="PD", sign=-1, f_d=(0.5, 50.0)), FirstOrderLowPass(1, f=(5.0, 20.0)))
    # x'' = w1 + u, z = (x, u), y = x + w2
    plant = GeneralizedPlant(
        [[0.0, 1.0], [0.0, 0.0]],
        [[0.0, 0.0], [1.0, 0.0]],
        [[0.0], [1.0]],
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0, 0.0]],
        np.zeros((2, 2)),
        [[0.0], [1.0]],
        [[0.0, 1.0]],
    )
    result = hinfstruct(plant, chain, starts=2)
    assert result.stabilizing
    low_pass = chain.parts[1]
    assert isinstance(low_pass, FirstOrderLowPass)
    assert 5.0 <= low_pass.physical(chain.split(result.parameters)[1])["f"][0] <= 20.0
    assert result.gamma < 10.0


def test_a_schedule_reaches_the_optimum_at_every_position() -> None:
    # the plant's gain is 1/(1 + p/2), so the best controller is linear in p
    points = np.array([[-1.0], [0.0], [1.0]])
    plants = [noisy_integrator(1.0 / (1.0 + 0.5 * p)) for p in points[:, 0]]
    K = Scheduled(StaticGain(1, 1), PolynomialBasis([[-1.0, 1.0]], 1))
    result = hinfstruct(plants, K, points=points, starts=1)
    np.testing.assert_allclose(result.gammas, np.sqrt(2.0), rtol=1e-5)
    np.testing.assert_allclose(result.parameters, [-np.sqrt(2.0), -np.sqrt(0.5)], rtol=1e-3)
    assert isinstance(result.controller, LPVStateSpace)
    for p in (-1.0, 0.3, 1.0):
        np.testing.assert_allclose(result.controller.at([p]).D, K.realize(result.parameters, np.array([p]))[3])


def test_a_scheduled_controller_of_logarithms_is_interpolated() -> None:
    K = Scheduled(Series(Notch(1, f=(1.0, 2.0)), PID(1, sign=-1)), PolynomialBasis(BOX, 1))
    theta = K.initial(np.random.default_rng(1))
    theta[K.structure.n_parameters :] = 0.1
    over_box = K.over_box(theta)
    for p in np.array([[-0.9, 0.4], [0.2, 0.1], [1.0, -0.5]]):
        for got, wanted in zip(over_box.sample(p[None]), K.realize(theta, p), strict=True):
            np.testing.assert_allclose(
                got[0], wanted, rtol=1e-8, atol=1e-8 * max(1.0, np.max(np.abs(wanted), initial=0))
            )
