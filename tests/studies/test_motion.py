"""Guards the study of motion on its tiny preset: its table, its figure, what is kept, and what is missing."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from lpvhinf.codesign import Design, Specification
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.decoupling import decouple
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.hinfstruct import Evaluations
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.progress import SILENT, Progress
from lpvhinf.storage import read_json, write_json
from paper_figures.__main__ import FIGURES
from studies import motion as study
from studies.__main__ import STUDIES
from studies.settings import PRESETS, load_settings

TINY = load_settings(study.Settings, study.NAME, "tiny")
TEXT = (PRESETS / "motion_tiny.toml").read_text("utf-8")


class Recorder(Progress):
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.messages = list[str]()

    def log(self, message: str) -> None:
        self.messages.append(message)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The designs by rule of thumb, in a folder like that of their study."""
    results = tmp_path_factory.mktemp("motion")
    plant = decouple(benchmark(n_flex=3, magnetics="first-harmonic"), n_flex=1, degree=12)
    write_json(
        results / "output_observer" / "settings.json", {"magnetics": "first-harmonic", "n_plant_modes": 3, "n_flex": 1}
    )
    for name, architecture in (("conventional", "rigid-body"), ("observer", "output-observer")):
        assembly = Assembly(plant=plant, specification=Specification(f_bw=20.0), architecture=architecture)
        centre = np.zeros(2)
        design = Design(
            assembly=assembly, parameters=assembly.start(np.vstack([centre, plant.box.T])), positions=centre[None],
            gammas=np.ones(1), gamma_worst=1.0, worst_position=centre, optimality=np.nan, status="given", seconds=0.0,
            evaluations=Evaluations(trials=0, exact=0, every_model=0),
        )  # fmt: skip
        at = results / "output_observer" / "designs" / name
        plant.system.save(at / "plant.npz")
        design.controller.save(at / "controller.npz")
        write_json(at / "summary.json", {"fingerprint": name, "input_decoupling": "extended"})
    study.run(TINY, results / "motion", SILENT)
    return results / "motion"


@pytest.mark.slow
def test_the_report_compares_with_the_first_design(folder: Path) -> None:
    report = read_json(folder / "report.json")
    assert {row["scenario"] for row in report["factors"]} == set(study.SCENARIOS)
    for row in report["factors"]:
        assert row["design"] == "output_observer/observer"
        parts = [report["parts"][f"output_observer-{name}"]["rows"] for name in ("conventional", "observer")]
        plain, ours = (next(r for r in rows if r["scenario"] == row["scenario"]) for rows in parts)
        assert row["whole"][2] == pytest.approx(plain["whole"]["MSD"][2] / ours["whole"]["MSD"][2])
        assert ours["status"] == "completed"
        assert ours["flexible"]["MSD"][2] <= ours["flexible"]["rms"][2] + ours["flexible"]["peak"][2]
    text = (folder / "report.md").read_text("utf-8")
    assert [line[3:] for line in text.splitlines() if line.startswith("## ")] == [
        "Tracking", "Disturbed", "Effort", "Notes", "Run",
    ]  # fmt: skip


@pytest.mark.slow
def test_finished_parts_are_kept_and_the_figure_is_drawn(folder: Path, tmp_path: Path) -> None:
    heard = Recorder()
    study.run(TINY, folder, heard)
    assert sum("taken from the results folder" in message for message in heard.messages) == 2
    pdf, png = FIGURES["motion"]["motion"].make(folder, tmp_path)
    assert pdf.read_bytes()[:5] == b"%PDF-"
    assert np.std(matplotlib.image.imread(png)[..., :3]) > 0.02


def test_a_missing_design_is_named(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="conventional holds no finished design"):
        study.run(TINY, tmp_path / "motion", SILENT)


def test_the_study_is_listed_and_its_presets_are_valid() -> None:
    assert STUDIES["motion"] is study
    assert load_settings(study.Settings, study.NAME, "paper", jobs=7).jobs == 7


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("centres = [0.02]", "centres = []", "designs or centres is empty"),
        ("output_observer/observer", "observer", "designs has 'observer'"),
        ("output_observer/observer", "output_observer/conventional", "wanted every design once"),
        ("noise = 3e-10", "noise = -1.0", "noise is -1.0"),
        ("lines = 1", "lines = 0", "lines is 0"),
        ("velocity = 0.2", "velocity = 0.0", "velocity is 0.0"),
    ],
)
def test_wrong_settings(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in TEXT
    path = tmp_path / "settings.toml"
    path.write_text(TEXT.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(DomainError, match=message):
        load_settings(study.Settings, study.NAME, str(path))
