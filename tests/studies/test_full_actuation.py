"""Guards the study of fully actuated plants on its tiny preset, and its measure of how two loops are coupled."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from lpvhinf.codesign import Design, Specification, codesign
from lpvhinf.decoupling import decouple
from lpvhinf.errors import DomainError
from lpvhinf.plant import ModalModel
from lpvhinf.progress import SILENT, Progress
from lpvhinf.storage import read_json
from paper_figures.__main__ import FIGURES
from studies import full_actuation as study
from studies.__main__ import STUDIES
from studies.full_actuation_coupling import damping, loop_coupling, with_Q
from studies.settings import PRESETS, load_settings

TINY = load_settings(study.Settings, study.NAME, "tiny")
TEXT = (PRESETS / "full_actuation_tiny.toml").read_text("utf-8")
NAMES = [job.name for stage in study.jobs_of(TINY) for job in stage]


class Recorder(Progress):
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.messages = list[str]()

    def log(self, message: str) -> None:
        self.messages.append(message)


# The coupling of two loops


@pytest.fixture(scope="module", params=["over", "full"])
def design(request: pytest.FixtureRequest, small_modal: ModalModel) -> Design:
    """A few steps of a design for the small plant."""
    plant = decouple(small_modal, n_flex=1, actuation=request.param, degree=8)
    rough = {"n_positions": 2, "starts": 1, "exchange_rounds": 0, "n_search": 2, "max_iterations": 2}
    return codesign(plant, "output-observer", Specification(f_bw=20.0), **rough)  # type: ignore[arg-type]


def without_K_FM(design: Design) -> Design:
    """The same design with xi = 0, the last of its parameters."""
    parameters = np.array(design.parameters)
    parameters[-design.assembly.plant.n_flex :] = 0.0
    return dataclasses.replace(design, parameters=parameters)


def test_without_K_FM_nothing_is_coupled(design: Design) -> None:
    found = loop_coupling(without_K_FM(design), design.positions)
    assert np.max(found.plant_change) < 1e-7
    assert np.max(found.reaction) == 0.0


def test_the_change_of_the_plant_is_that_of_two_loops_of_the_same_K_RB(design: Design) -> None:
    """With K_RB closed: S^-1 - S_0^-1 is the change of the plant times K_RB."""
    found, p = loop_coupling(design, design.positions[:1]), design.positions[:1]
    n_rb, k = design.assembly.plant.n_rb, int(np.argmax(loop_coupling(design, design.positions[:1]).plant_change[0]))
    s = 1j * found.omega[k]

    def gains(one: Design) -> tuple[np.ndarray, np.ndarray]:
        A, B, C, D = one.frozen(p)[0]
        T = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
        return -T[:n_rb, :n_rb], -T[:n_rb, n_rb : 2 * n_rb]  # S, and S G

    (S, SG), (S_0, SG_0) = gains(design), gains(without_K_FM(design))
    G, G_0 = np.linalg.solve(S, SG), np.linalg.solve(S_0, SG_0)
    wanted = np.linalg.norm((G - G_0) @ np.linalg.inv(G_0), 2)
    assert found.plant_change[0, k] == pytest.approx(wanted, rel=1e-5)


def test_another_Q_changes_the_loop_and_its_norms(design: Design) -> None:
    same, wide = with_Q(design, design.specification.Q), with_Q(design, 0.1)
    assert np.allclose(same.gammas, design.gammas, rtol=1e-6)
    assert wide.specification.Q == 0.1
    assert not np.allclose(wide.gammas, design.gammas, rtol=1e-6)
    narrow = with_Q(design, 10.0)
    some = design.positions
    assert np.max(loop_coupling(narrow, some).reaction_in_band) < np.max(loop_coupling(wide, some).reaction_in_band)
    assert damping(design, some).shape == (len(some), 1)


# The study


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("full") / "results"
    study.run(TINY, out, SILENT)
    return out


@pytest.mark.slow
def test_every_design_is_there_with_its_figures(folder: Path) -> None:
    assert {path.name for path in (folder / "designs").iterdir()} == set(NAMES)
    report = read_json(folder / "report.json")
    assert set(report["designs"]) == set(NAMES)
    over, full = (report["designs"][f"{plant}-start"] for plant in ("over", "full-1"))
    assert over["channels"]["rigid"] < 1e-9 < 0.01 < full["channels"]["rigid"]
    assert full["plant_change"] > over["plant_change"] > 0.0  # shared forces couple the loops
    for one in (over, full):
        wide, narrow = one["held"]
        assert wide["Q"] < narrow["Q"]
        assert wide["reaction"] > narrow["reaction"]
    text = (folder / "report.md").read_text("utf-8")
    assert text.count("| fully actuated, rho 1 |") == 1 + 3 + 2
    assert text.count("| over-actuated |") == 1 + 3 + 2


@pytest.mark.slow
def test_finished_designs_are_kept_and_a_new_plant_is_added(folder: Path) -> None:
    heard = Recorder()
    study.run(TINY, folder, heard)
    assert sum("taken from the results folder" in message for message in heard.messages) == len(NAMES)
    more = dataclasses.replace(TINY, mode_weights=(1.0, 2.0), jobs=3)
    jobs = {job.name: job for stage in study.jobs_of(more) for job in stage}
    for stage in study.jobs_of(TINY):
        for job in stage:
            assert study.key_of(more, jobs[job.name]) == study.key_of(TINY, job)


@pytest.mark.slow
def test_the_figure(folder: Path, tmp_path: Path) -> None:
    (module,) = FIGURES["full_actuation"].values()
    pdf, png = module.make(folder, tmp_path)
    assert pdf.read_bytes()[:5] == b"%PDF-"
    assert matplotlib.image.imread(png).shape[1] == 2130


def test_the_study_is_listed_and_its_presets_are_valid() -> None:
    assert STUDIES["full_actuation"] is study
    assert load_settings(study.Settings, study.NAME, "paper", jobs=7).jobs == 7


def test_stages_begin_with_what_the_one_before_found() -> None:
    before: set[str] = set()
    for stage in study.jobs_of(TINY):
        assert all(job.start is None or job.start in before for job in stage)
        before |= {job.name for job in stage}
    assert len(before) == 8


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("mode_weights = [1.0]", "mode_weights = [-1.0]", "mode_weights is .* above 0"),
        ("Qs = [1.0, 3.0]", "Qs = []", "Qs is .* at least one value"),
        ("Qs = [1.0, 3.0]", "Qs = [1.0, 1.0]", "Qs is .* different values"),
        ('"first-harmonic"', '"dipoles"', "magnetics is 'dipoles'"),
        ("tolerance = 1e-2", "tolerance = 0.0", "tolerance is 0.0"),
        ("n_positions = 3", "n_positions = 0", "n_positions is 0"),
    ],
)
def test_wrong_settings(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in TEXT
    path = tmp_path / "settings.toml"
    path.write_text(TEXT.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(DomainError, match=message):
        load_settings(study.Settings, study.NAME, str(path))
