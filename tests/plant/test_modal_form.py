"""Modal form against the mechanical model it comes from, on plants of a user."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from lpvhinf.errors import AssumptionError, DimensionError, DomainError, LpvHinfWarning
from lpvhinf.plant import MechanicalModel, ModalModel, modal_form

FREQUENCIES = np.array([0.3, 1.7, 2.4, 9.0])


def chain(n=5, damping=0.02):
    """Free masses and springs; the force and the sensor slide along the chain."""
    m = np.linspace(1.0, 2.0, n)
    K = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    K[0, 0] = K[-1, -1] = 1.0
    nodes = np.arange(n)

    def hat(points):
        return np.maximum(1.0 - np.abs(points * (n - 1) - nodes), 0.0)

    return MechanicalModel(
        M=np.diag(m),
        D=damping * K,
        K=K,
        input_map=lambda p: np.stack([hat(p), np.broadcast_to(nodes == 0, (len(p), n))], axis=2),
        output_map=lambda p: hat(1.0 - p)[:, None, :],
        box=[[0.0, 1.0]],
        input_names=["sliding", "fixed"],
    )


def two_axes(n=3):
    """Two uncoupled chains, of different mass: two rigid-body modes."""
    a, b = chain(n), chain(n)
    zero = np.zeros((n, n))
    return MechanicalModel(
        M=np.block([[a.M, zero], [zero, 3.0 * b.M]]),
        D=np.zeros((2 * n, 2 * n)),
        K=np.block([[a.K, zero], [zero, 1.3 * b.K]]),
        input_map=np.vstack([np.eye(n, 2), np.eye(n, 2)]),
        output_map=np.eye(2 * n)[:2],
        box=[[0.0, 1.0]],
    )


def response(system, omega):
    return np.stack([system(1j * w) for w in omega])


@pytest.mark.parametrize("p", [0.0, 0.3, 0.77, 1.0])
def test_all_modes_give_the_mechanical_response(p):
    model = chain()
    modal = modal_form(model)
    wanted = response(model.local_model([p]), FREQUENCIES)
    assert np.allclose(response(modal.local_model([p]), FREQUENCIES), wanted, rtol=1e-10, atol=1e-12)
    assert modal.local_model([p]).input_labels == ["sliding", "fixed"]


@pytest.mark.parametrize("model", [chain(), two_axes()], ids=["chain", "two axes"])
def test_mass_normalisation(model):
    modal = modal_form(model)
    V = modal.V
    assert np.allclose(V.T @ model.M @ V, np.eye(model.n_q), atol=1e-12)
    assert np.allclose(V.T @ model.K @ V, np.diag(modal.omega**2), atol=1e-12)
    assert np.all(modal.omega[: modal.n_rb] == 0.0)
    assert np.all(np.diff(modal.omega) >= 0.0)


def test_number_of_rigid_body_modes():
    assert modal_form(chain()).n_rb == 1
    assert modal_form(two_axes()).n_rb == 2
    grounded = MechanicalModel(M=[[1.0]], D=[[0.0]], K=[[4.0]], input_map=[[1.0]], output_map=[[1.0]], box=[[0.0, 1.0]])
    assert modal_form(grounded).n_rb == 0
    assert modal_form(grounded).omega[0] == pytest.approx(2.0)


def test_free_body_without_any_stiffness():
    body = MechanicalModel(
        M=np.diag([2.0, 8.0]), D=np.zeros((2, 2)), K=np.zeros((2, 2)), input_map=np.eye(2), output_map=np.eye(2),
        box=[[0.0, 1.0]],
    )  # fmt: skip
    modal = modal_form(body, rigid_body_modes=np.eye(2))
    assert (modal.n_rb, modal.n_flex) == (2, 0)
    assert np.allclose(modal.rigid_body_scaling, np.diag([2.0**-0.5, 8.0**-0.5]))
    assert modal_form(body).n_rb == 2


def test_physical_axes_are_kept():
    model = two_axes()
    E = np.kron(np.eye(2), np.ones((3, 1)))
    modal = modal_form(model, rigid_body_modes=E)
    assert np.allclose(modal.mass_matrix_rb, np.diag([4.5, 13.5]))
    assert np.allclose(modal.V[:, :2], E @ modal.rigid_body_scaling)
    assert np.allclose(modal.V.T @ model.M @ modal.V, np.eye(6), atol=1e-12)
    # a coupled mass matrix takes the symmetric root
    mixed = modal_form(model, rigid_body_modes=E @ np.array([[1.0, 0.4], [0.0, 1.0]]))
    S, M_rb = mixed.rigid_body_scaling, mixed.mass_matrix_rb
    assert np.allclose(S, S.T)
    assert np.allclose(S @ M_rb @ S, np.eye(2))


def test_truncation_keeps_the_static_compliance():
    model = chain(8)
    full, kept = modal_form(model), modal_form(model, n_modes=4)
    p = np.linspace(0.0, 1.0, 5)[:, None]
    tail = full.output_gains(p)[:, :, 4:] / full.omega[4:] ** 2 @ full.input_gains(p)[:, 4:]
    assert np.allclose(kept.compliance(p), tail, atol=1e-13)
    low = np.array([0.01])
    exact = response(model.local_model([0.3]), low)
    with_it = np.abs(response(kept.local_model([0.3]), low) - exact).max()
    without = np.abs(response(kept.local_model([0.3], compliance=False), low) - exact).max()
    assert with_it < 1e-3 * without
    bare = modal_form(model, n_modes=4, compliance=False)
    assert not np.any(bare.compliance(p))
    assert not np.any(full.compliance(p))


def test_gains_share_one_computation():
    modal = modal_form(chain(8), n_modes=4)
    p = np.linspace(0.0, 1.0, 11)[:, None]
    gains = modal.gains(p)
    assert np.allclose(gains.input_gains, modal.input_gains(p), atol=1e-14)
    assert np.allclose(gains.output_gains, modal.output_gains(p), atol=1e-14)
    assert np.allclose(gains.compliance, modal.compliance(p), atol=1e-14)


def test_batches_do_not_change_the_gains(monkeypatch):
    modal = modal_form(chain(8), n_modes=4)
    p = np.linspace(0.0, 1.0, 11)[:, None]
    whole = modal.gains(p)
    monkeypatch.setattr("lpvhinf.plant.maps.CHUNK_BYTES", 1000)
    parts = modal.gains(p)
    assert np.allclose(whole.input_gains, parts.input_gains)
    assert np.allclose(whole.compliance, parts.compliance)
    assert modal.input_gains(np.empty((0, 1))).shape == (0, 4, 2)


def test_grouping_is_the_similarity_of_eq_3():
    modal = modal_form(chain(3))
    T, n = modal.grouping(), modal.n_modes
    assert np.array_equal(T @ T.T, np.eye(2 * n))
    Omega, Z = np.diag(modal.omega), np.diag(modal.zeta)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-(Omega**2), -2 * Z @ Omega]])
    B = np.vstack([np.zeros((n, 2)), modal.input_gains([0.3])[0]])
    local = modal.local_model([0.3])
    assert np.allclose(local.A, T @ A @ T.T)
    assert np.allclose(local.B, T @ B)
    assert np.allclose(local.C @ T, np.hstack([modal.output_gains([0.3])[0], np.zeros((1, n))]))


def test_neglected_damping_is_reported():
    model = chain(4)
    d = np.array([0.0, 1.0, -1.0, 0.0])
    odd = MechanicalModel(
        M=model.M, D=np.outer(d, d), K=model.K, input_map=model.input_map, output_map=model.output_map, box=model.box
    )
    with pytest.warns(LpvHinfWarning, match="neglects damping between modes"):
        modal_form(odd)


def test_damped_rigid_body_is_rejected():
    model = chain(4)
    grounded = MechanicalModel(
        M=model.M, D=0.1 * model.M, K=model.K, input_map=model.input_map, output_map=model.output_map, box=model.box
    )
    with pytest.raises(AssumptionError, match="damps rigid-body mode 0"):
        modal_form(grounded)


def test_doubtful_rigid_body_mode_is_reported():
    model = chain(4)
    soft = MechanicalModel(
        M=model.M, D=0 * model.M, K=model.K + 1e-9 * np.eye(4), input_map=model.input_map,
        output_map=model.output_map, box=model.box,
    )  # fmt: skip
    with pytest.warns(LpvHinfWarning, match="close to the threshold"):
        modal_form(soft)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert modal_form(soft, rigid_tolerance=1e-14).n_rb == 0


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"rigid_body_modes": np.arange(5.0)[:, None]}, AssumptionError, "strains the body"),
        ({"rigid_body_modes": np.ones((5, 2))}, AssumptionError, "linearly dependent"),
        ({"rigid_body_modes": np.ones((4, 1))}, DimensionError, "rigid_body_modes has shape"),
        ({"rigid_body_modes": np.zeros((5, 0))}, AssumptionError, "K has 1 zero modes"),
        ({"n_modes": 0}, DomainError, "n_modes is 0"),
        ({"n_modes": 6}, DomainError, "n_modes is 6"),
        ({"n_modes": 2.5}, DomainError, "n_modes is 2.5"),
        ({"rigid_tolerance": -1.0}, DomainError, "rigid_tolerance"),
    ],
)
def test_bad_options_are_named(options, error, words):
    with pytest.raises(error, match=words):
        modal_form(chain(), **options)
    with pytest.raises(AssumptionError, match="2 rigid-body modes"):
        modal_form(two_axes(), n_modes=1)


def test_modal_data_of_a_user():
    modal = ModalModel.from_modal_data(
        omega=[0.0, 0.0, 30.0],
        zeta=[0.0, 0.0, 0.02],
        input_gains=lambda p: np.stack([np.ones_like(p), p, p**2], axis=1),
        output_gains=np.ones((2, 3)),
        box=[[-1.0, 1.0]],
        compliance=np.full((2, 1), 1e-3),
        output_names=["left", "right"],
    )
    assert (modal.n_rb, modal.n_flex, modal.n_u, modal.n_y) == (2, 1, 1, 2)
    gains = modal.gains([[0.5], [-0.5]])
    assert gains.input_gains[:, 2, 0].tolist() == [0.25, 0.25]
    assert gains.compliance.shape == (2, 2, 1)
    assert np.allclose(modal.local_model([0.5]).D, 1e-3)
    assert modal.local_model([0.5]).output_labels == ["left", "right"]


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"omega": [1.0, 0.0]}, AssumptionError, "flexible mode 1"),
        ({"omega": [0.0, -1.0]}, AssumptionError, "frequency above 0"),
        ({"zeta": [0.1, 0.1]}, AssumptionError, "rigid-body modes"),
        ({"zeta": -0.1}, AssumptionError, "zeta has the entry"),
        ({"zeta": [0.0, 0.1, 0.1]}, DimensionError, "zeta has shape"),
        ({"n_rb": 3}, DimensionError, "n_rb is 3"),
        ({"input_gains": np.ones((3, 1))}, DimensionError, "input gains returned shape"),
        ({"omega": [np.nan, 1.0]}, DomainError, "nan"),
        ({"rigid_body_scaling": np.eye(2)}, DimensionError, "rigid_body_scaling has shape"),
    ],
)
def test_bad_modal_data_is_named(changes, error, words):
    given = {
        "omega": [0.0, 1.0],
        "zeta": 0.01,
        "input_gains": np.ones((2, 1)),
        "output_gains": np.ones((1, 2)),
        "box": [[0.0, 1.0]],
    }
    with pytest.raises(error, match=words):
        ModalModel.from_modal_data(**(given | changes))
