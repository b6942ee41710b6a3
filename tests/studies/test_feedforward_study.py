"""Guards the study of feedforward on its tiny preset: its claim, its tables, its figures, and what is kept."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from lpvhinf.decoupling import decouple
from lpvhinf.errors import DomainError
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.progress import SILENT, Progress
from lpvhinf.simulation import FourthOrderStep, step_error
from lpvhinf.storage import read_arrays, read_json
from paper_figures.__main__ import FIGURES
from studies import feedforward as study
from studies.__main__ import STUDIES
from studies.plant_results import ARRAYS
from studies.settings import PRESETS, load_settings

TINY = load_settings(study.Settings, study.NAME, "tiny")
TEXT = (PRESETS / "feedforward_tiny.toml").read_text("utf-8")


class Recorder(Progress):
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.messages = list[str]()

    def log(self, message: str) -> None:
        self.messages.append(message)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("feedforward") / "results"
    study.run(TINY, out, SILENT)
    return out


@pytest.mark.slow
def test_the_claim_holds_and_the_report_tells_it(folder: Path) -> None:
    report = read_json(folder / "report.json")
    (claim,) = report["claims"]
    assert claim["holds"] is True
    plants = report["parts"]["excitation"]["plants"]
    assert np.max(plants["extended"]["relative"]) < 1e-10 < 0.1 < np.max(plants["rigid-body"]["relative"])
    assert 1e-5 < np.max(plants["misaligned-extended"]["relative"]) < 0.1 * np.max(plants["rigid-body"]["relative"])
    assert plants["extended"]["not_cancelled"] < 1e-10 < 0.01 < plants["full-1"]["not_cancelled"]
    text = (folder / "report.md").read_text("utf-8")
    assert claim["value"] in text
    assert [line[3:] for line in text.splitlines() if line.startswith("## ")] == [
        "Claims", "Excitation", "Other plants", "Steps", "What it buys", "Notes", "Run",
    ]  # fmt: skip


@pytest.mark.slow
def test_anyone_can_recompute_the_steps(folder: Path) -> None:
    data = read_arrays(folder / "parts" / "steps-1" / "arrays.npz", ARRAYS)
    plant = decouple(benchmark(n_flex=TINY.n_plant_modes, magnetics=TINY.magnetics), n_flex=1, degree=0)
    step = FourthOrderStep(distance=TINY.distances[2], snap_time=TINY.snap_times[0])
    found = step_error(plant, step, data["points"], settle=TINY.settle)
    assert np.allclose(np.max(found.after[:, 2, 2]), data["extended_sensors_after"][0, 2, 2], rtol=1e-9)
    assert np.max(data["extended_sensors_after"][0, 3, 3]) < 0.5 * np.max(data["rigid-body_sensors_after"][0, 3, 3])


@pytest.mark.slow
def test_finished_parts_are_kept(folder: Path) -> None:
    heard = Recorder()
    study.run(TINY, folder, heard)
    assert sum("taken from the results folder" in message for message in heard.messages) == len(study.parts_of(TINY))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FIGURES["feedforward"]))
def test_figures(folder: Path, tmp_path: Path, name: str) -> None:
    pdf, png = FIGURES["feedforward"][name].make(folder, tmp_path)
    assert pdf.read_bytes()[:5] == b"%PDF-"
    picture = matplotlib.image.imread(png)
    assert picture.shape[1] == 2130
    assert np.std(picture[..., :3]) > 0.02


def test_the_study_is_listed_and_its_presets_are_valid() -> None:
    assert STUDIES["feedforward"] is study
    assert load_settings(study.Settings, study.NAME, "paper", jobs=7).jobs == 7


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('"first-harmonic"', '"dipoles"', "magnetics is 'dipoles'"),
        ("n_flexes = [1]", "n_flexes = [9]", "n_flexes has 9, wanted at most n_plant_modes = 5"),
        ("snap_times = [5e-3]", "snap_times = []", "snap_times is empty"),
        ("snap_times = [5e-3]", "snap_times = [-5e-3]", "snap_times is .* wanted values above 0"),
        ("distances = [1e-3,", "distances = [0.0,", "distances is .* wanted values above 0"),
        ("settle = 0.04", "settle = 0.0", "settle is 0.0"),
        ("map_grid = 7", "map_grid = 1", "map_grid is 1"),
    ],
)
def test_wrong_settings(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in TEXT
    path = tmp_path / "settings.toml"
    path.write_text(TEXT.replace(before, after), encoding="utf-8")
    with pytest.raises(DomainError, match=message):
        load_settings(study.Settings, study.NAME, str(path))
