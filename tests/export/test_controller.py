"""Guards sampled controllers: Tustin's transformation at frozen p, the trapezoidal rule along p, and their checks."""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np
import pytest
import scipy.signal

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.export import SampledController, sampled, sampled_from_function
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace import LPVStateSpace
from tests.export.systems import BOX, KINDS, PERIOD, observer_like

Make = Callable[[str], SampledController]


@pytest.mark.parametrize("form", ["trapezoidal", "discrete"])
@pytest.mark.parametrize("varying", [True, False])
def test_a_frozen_step_is_tustins_transformation(form: str, varying: bool) -> None:
    G = observer_like(varying=varying)
    K = sampled(G, form=form, degree=(8, 12) if varying else None)
    assert K.form == (form if varying else "discrete")
    for p in ([0.0, 0.0], [-0.06, 0.07], [0.031, -0.02]):
        z = np.exp(1j * np.array([10.0, 300.0, 900.0, 5e3]) * PERIOD)
        s = 2.0 / PERIOD * (z - 1.0) / (z + 1.0)
        for zi, si in zip(z, s, strict=True):
            found, wanted = K.at(p)(zi), G.at(p)(si)
            assert np.allclose(found, wanted, rtol=0, atol=1e-9 * np.max(np.abs(wanted)))
    assert K.fit_error < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_one_position_is_the_response_of_the_frozen_step(
    kind: str, make: Make, signals: Callable[..., tuple[Array, Array | None]]
) -> None:
    K = make(kind)
    u, _ = signals(K, 60)
    p = np.array([0.02, -0.01]) if K.scheduled else None
    A, B, C, D = K.step_matrices(p)
    x, wanted = np.zeros(K.n_x), []
    for value in u:
        wanted.append(C @ x + D @ value)
        x = A @ x + B @ value
    assert np.allclose(K.simulate(u, p), wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))
    single = K.simulate(u, p, dtype=np.float32)
    assert single.dtype == np.float32
    assert np.allclose(single, wanted, rtol=0, atol=1e-4 * np.max(np.abs(wanted)))


def test_a_step_may_begin_in_any_state(make: Make, signals: Callable[..., tuple[Array, Array | None]]) -> None:
    K = make("six axes")
    u, _ = signals(K, 20)
    B = K.step_matrices()[1]
    assert np.allclose(K.simulate(u[1:], state=B @ u[0]), K.simulate(u)[1:], rtol=1e-12)


def test_along_p_the_trapezoidal_form_is_of_second_order() -> None:
    G = observer_like()
    errors = []
    for period in (4e-4, 2e-4, 2.5e-5):  # the last one is the reference
        t = period * np.arange(round(0.05 / period) + 1)
        p = np.stack([0.05 * np.sin(40.0 * t), 0.05 * np.cos(40.0 * t)], axis=1)
        u = np.stack([np.sin(200.0 * t) ** 2, 1.0 - np.cos(100.0 * t)], axis=1)
        errors.append(sampled(G, period=period).simulate(u, p)[-1])
    order = np.log2(np.linalg.norm(errors[0] - errors[2]) / np.linalg.norm(errors[1] - errors[2]))
    assert 1.8 < order < 2.3


def test_a_constant_A_leaves_polynomials_that_are_exact() -> None:
    K = sampled(observer_like(varying=False))
    assert K.A.is_constant
    assert K.C.degree == (2, 3)
    assert K.fit_error == 0.0


def test_the_error_of_a_fit_is_measured() -> None:
    coarse, fine = (sampled(observer_like(), form="discrete", degree=d) for d in (1, 5))
    where = np.array([0.04, -0.03])
    truth = sampled(observer_like()).step_matrices(where)
    for K in (coarse, fine):
        seen = max(
            np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in zip(K.step_matrices(where), truth, strict=True)
        )
        assert 0.0 < seen < 2.0 * K.fit_error
    assert fine.fit_error < 1e-2 * coarse.fit_error


def test_a_function_of_p_is_fitted() -> None:
    exact = sampled(observer_like())

    def matrices(points: Array) -> tuple[Array, Array, Array, Array]:
        rows = [exact.step_matrices(p) for p in points]
        A, B, C, D = (np.stack([row[i] for row in rows]) for i in range(4))
        return A, B, C, D

    K = sampled_from_function(matrices, box=BOX, degree=6, period=PERIOD)
    for found, wanted in zip(K.step_matrices([0.01, 0.02]), exact.step_matrices([0.01, 0.02]), strict=True):
        assert np.allclose(found, wanted, atol=1e-6 * np.max(np.abs(wanted)))
    with pytest.raises(DimensionError, match="other shapes"):
        sampled_from_function(lambda points: tuple(m[0] for m in matrices(points)), box=BOX, degree=1)  # type: ignore[arg-type,return-value]


def test_systems_of_other_packages() -> None:
    discrete = scipy.signal.dlti([1.0, 0.2], [1.0, -0.5], dt=1e-3)
    assert sampled(discrete, period=1e-3).A.at([0.0]).tolist() == [[0.5]]
    with pytest.raises(DomainError, match=r"Pass period=0\.001"):
        sampled(discrete)
    K = sampled(control.tf([1.0], [1.0, 100.0]))
    assert K.at()(1.0) == pytest.approx(0.01, rel=1e-12)


def test_bad_input_is_named(make: Make) -> None:
    scheduled, gain = make("scheduled"), make("gain")
    with pytest.raises(DimensionError, match="p is missing"):
        scheduled.simulate(np.ones((3, 2)))
    with pytest.raises(DomainError, match="outside the box"):
        scheduled.simulate(np.ones((3, 2)), [0.1, 0.0])
    with pytest.raises(DimensionError, match="p has 4 positions"):
        scheduled.simulate(np.ones((3, 2)), np.zeros((4, 2)))
    with pytest.raises(DimensionError, match="Leave it out"):
        gain.simulate(np.ones((3, 2)), [0.0, 0.0])
    with pytest.raises(DimensionError, match="u has shape"):
        gain.simulate(np.ones((3, 3)))
    with pytest.raises(DomainError, match="degree is None"):
        sampled(observer_like(), form="discrete")
    with pytest.raises(DomainError, match="form is 'euler'"):
        sampled(2.0, form="euler")
    with pytest.raises(DomainError, match="name is"):
        sampled(2.0, name="my controller")
    with pytest.raises(DimensionError, match="inputs has 2 names"):
        sampled(2.0, inputs=["a", "b"])
    with pytest.raises(DomainError, match="period"):
        sampled(2.0, period=-1.0)
    with pytest.raises(AssumptionError, match=r"a pole at 2/T = 2e\+04 rad/s"):
        sampled(([[2e4]], [[1.0]], [[1.0]], [[0.0]]))
    unstable = LPVStateSpace.from_coefficients(
        np.reshape([2e4, 1.0], (2, 1, 1)), [[1.0]], [[1.0]], [[0.0]], box=[[-1.0, 1.0]]
    )
    with pytest.raises(AssumptionError, match="a pole at"):
        sampled(unstable)
    M, N = ChebyshevMatrix([[1.0]], [[-1.0, 1.0]]), ChebyshevMatrix([[1.0]], [[-2.0, 1.0]])
    with pytest.raises(DimensionError, match="different boxes"):
        SampledController(A=M, B=M, C=M, D=N, period=1.0)
    with pytest.raises(DimensionError, match="D has shape"):
        SampledController(A=M, B=M, C=M, D=ChebyshevMatrix([[1.0, 2.0]], M.box), period=1.0)


def test_it_says_what_it_is(make: Make) -> None:
    assert repr(make("six axes")).startswith("SampledController('six_axes', discrete, n_x=12, n_u=6, n_y=6")
    assert "scheduled by p (n_p=2)" in repr(make("scheduled"))
    assert "A (2, 3), B (0, 0)" in make("scheduled")._repr_html_()
