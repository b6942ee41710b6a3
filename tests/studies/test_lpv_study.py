"""Guards the LPV study on its tiny preset: the plants agree with the project's own problem, designs are kept."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.storage import read_json
from paper_figures import lpv_gamma
from studies import lpv as study
from studies.lpv_plants import Problem
from studies.settings import PRESETS, load_settings

TINY = load_settings(study.Settings, study.NAME, "tiny")
TEXT = (PRESETS / "lpv_tiny.toml").read_text("utf-8")
POINTS = np.array([[0.0, 0.0], [0.03, -0.05]])


@pytest.fixture(scope="module")
def problem() -> Problem:
    return study.problem_of(TINY)


class Recorder(Progress):
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.messages = list[str]()

    def log(self, message: str) -> None:
        self.messages.append(message)


def as_full_order(
    problem: Problem, theta: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The co-designed controller diag(K_RB, L, -xi), integrator, observer and band-pass as one from y - D_o u to u."""
    assembly = problem.assembly
    n_rb, n_o = assembly.plant.n_rb, problem.model.n_x
    (P,) = problem.structured(p[None])
    A_K, B_K, C_K, D_K = assembly.structure.realize(theta)
    # the observer and its band-pass, and the integrator, are the states of P that the design plant does not have
    n_added, last = problem._n_added, P.n_x - problem.model.n_u
    own = np.r_[problem.model.n_x + np.arange(n_rb), np.arange(last - n_added, last)]
    (F,) = problem.full_order(p[None])
    D_o = problem.model.D.sample(p[None])[0]
    n_out = F.n_y
    E = np.zeros((P.n_y, n_out))  # of what K reads, y - D_o u, in (e, x_I, nu, velocities)
    E[:n_rb, :n_rb] = np.eye(n_rb)
    E[2 * n_rb : 3 * n_rb, :n_rb] = -np.eye(n_rb)
    E[3 * n_rb : 2 * n_rb + n_out, n_rb:] = np.eye(n_out - n_rb)
    f_I = 2 * np.pi * assembly.filters.f_I
    A = P.A[np.ix_(own, own)]
    B_m = np.zeros((len(own), n_out))
    B_m[:n_rb, :n_rb] = np.diag(f_I)
    C_m, B_v, D_v = P.C2[:, own], P.B2[own], np.zeros((P.n_y, P.n_u))
    forces = np.r_[np.arange(n_rb), n_rb + n_o + np.arange(assembly.plant.n_flex)]
    D_v[:n_rb, forces] = -D_o[:n_rb]  # e is what is read, less D_o u
    B_v[:n_rb, forces] = -f_I[:, None] * D_o[:n_rb]
    # v = C_K x_K + D_K m, m = E y + C_m x + D_v v
    M = np.linalg.inv(np.eye(P.n_y) - D_v @ D_K)
    m = [M @ C_m, M @ D_v @ C_K, M @ E]
    v = [D_K @ m[0], C_K + D_K @ m[1], D_K @ m[2]]
    A_all = np.block([[A + B_v @ v[0], B_v @ v[1]], [B_K @ m[0], A_K + B_K @ m[1]]])
    B_all = np.vstack([B_m + B_v @ v[2], B_K @ m[2]])
    return A_all, B_all, np.hstack([v[0], v[1]])[forces], v[2][forces]


def test_a_co_design_closes_both_plants_alike(problem: Problem) -> None:
    theta = problem.assembly.start(POINTS)
    K = problem.assembly.structure.realize(theta)
    for p in POINTS:
        (P,), (F,) = problem.structured(p[None]), problem.full_order(p[None])
        wanted = hinf_norm(*P.close(*K)).norm
        assert hinf_norm(*F.close(*as_full_order(problem, theta, p))).norm == pytest.approx(wanted, rel=1e-5)


def test_the_design_plant_fits_a_synthesis(problem: Problem) -> None:
    for P in (problem.at(POINTS[1]), problem.without_compliance.at(POINTS[1])):
        assert np.max(np.abs(P.D22)) == 0.0
        assert np.linalg.matrix_rank(P.D12) == P.n_u
        assert np.linalg.matrix_rank(P.D21) == P.n_y
    (raw,) = problem.full_order(POINTS[1:])
    assert np.max(np.abs(raw.D22)) < 1e-12
    one, other = (problem.without_compliance.at(p) for p in POINTS)
    for name in ("B2", "D12", "D21"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert not np.allclose(one.C2, other.C2)


def test_truth_differs_by_the_discarded_modes_only(problem: Problem) -> None:
    (near,), (true,) = problem.full_order(POINTS[1:]), problem.full_order(POINTS[1:], truth=True)
    assert true.n_x == near.n_x + 2 * (TINY.n_plant_modes - TINY.n_flex)

    def gain(P: object, s: complex) -> np.ndarray:
        A, B, C, D = P.A, P.B2, P.C2, P.D22  # type: ignore[attr-defined]
        return np.asarray(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)

    def apart(f: float) -> float:
        s = 2j * np.pi * f
        return float(np.linalg.norm(gain(true, s) - gain(near, s)) / np.linalg.norm(gain(near, s)))

    assert apart(1.0) < 1e-3
    assert apart(problem.assembly.plant.omega[-1] / (2 * np.pi)) > 0.1


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("lpv") / "results"
    study.run(TINY, out, SILENT)
    return out


@pytest.mark.slow
def test_designs_are_judged_and_told(folder: Path) -> None:
    designs = read_json(folder / "report.json")["designs"]
    assert set(designs) == {job.name for job in study.jobs_of(TINY)}
    slow, fast = (designs[f"gridded-4-1-{speed}"] for speed in ("0", "0.3"))
    constant, bound = designs["constant-4"], designs["pointwise-4"]
    assert bound["gamma"] < slow["gamma"] <= fast["gamma"] * (1.0 + TINY.gap)
    assert fast["gamma"] <= constant["gamma"] * (1.0 + TINY.gap)
    assert fast["gamma_achieved"] <= 1.01 * TINY.backoff * fast["gamma"]
    assert designs["state-feedback"]["gamma"] < bound["gamma"]
    assert fast["true_stable"] <= fast["n_positions"] == TINY.n_truth
    for name in ("rigid-body", "output-observer"):
        assert designs[name]["gamma"] > bound["gamma"]
    fitted = LPVStateSpace.load(folder / "designs" / "gridded-4-1-0.3" / "controller.npz")
    assert fitted.n_x == fast["order"]
    assert "## Limitations" in (folder / "report.md").read_text("utf-8")


@pytest.mark.slow
def test_finished_designs_are_kept(folder: Path) -> None:
    heard = Recorder()
    study.run(TINY, folder, heard)
    assert sum("taken from the results folder" in message for message in heard.messages) == len(study.jobs_of(TINY))


@pytest.mark.slow
def test_the_figure(folder: Path, tmp_path: Path) -> None:
    pdf, png = lpv_gamma.make(folder, tmp_path)
    assert pdf.read_bytes()[:5] == b"%PDF-"
    assert matplotlib.image.imread(png).shape[1] == 2130


def test_names_are_unique_and_presets_are_valid() -> None:
    paper = load_settings(study.Settings, study.NAME, "paper", jobs=2)
    names = [job.name for job in study.jobs_of(paper)]
    assert len(set(names)) == len(names)
    assert {job.n_grid**2 for job in study.jobs_of(paper) if job.kind == "gridded"} == {9, 25}


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("grids = [2]", "grids = []", "grids is empty"),
        ("grids = [2]", "grids = [1]", "grids is 1"),
        ("speeds = [0.0, 0.3]", "speeds = [-0.1]", "speeds is .* below 0"),
        ("backoff = 1.05", "backoff = 0.9", "backoff is 0.9"),
        ('"first-harmonic"', '"dipoles"', "magnetics is 'dipoles'"),
    ],
)
def test_wrong_settings(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in TEXT
    path = tmp_path / "settings.toml"
    path.write_text(TEXT.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(DomainError, match=message):
        load_settings(study.Settings, study.NAME, str(path))
