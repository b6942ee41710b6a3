"""Guards the study of certificates: what it proves, refutes and leaves open, its report, figure, and what is kept."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from lpvhinf.certify.verdict import recheck
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.progress import SILENT, Progress
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import read_json, write_json
from paper_figures import certify_cells
from studies import certify as study
from studies.settings import PRESETS, load_settings

TEXT = (PRESETS / "certify_quick.toml").read_text("utf-8")
SQUARE = [[-1.0, 1.0], [-1.0, 1.0]]


class Recorder(Progress):
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.messages = list[str]()

    def log(self, message: str) -> None:
        self.messages.append(message)


def spring(stiffness: float, damping: float) -> LPVStateSpace:
    """q'' + damping q' + (1 - stiffness (p_1 + p_2) / 2) q = u, y = q."""
    A = np.zeros((2, 2, 2, 2))
    A[0, 0] = [[0.0, 1.0], [-1.0, -damping]]
    A[1, 0, 1, 0] = A[0, 1, 1, 0] = 0.5 * stiffness
    return LPVStateSpace.from_coefficients(A, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], box=SQUARE, basis="power")


def make_source(folder: Path) -> Path:
    """A results folder with a stable design, one that is unstable at a corner, and one that is not finished."""
    for name, loop in (("stable", spring(0.6, 0.4)), ("unstable", spring(1.1, 0.4))):
        design = folder / "designs" / name
        design.mkdir(parents=True)
        loop.save(design / "closed_loop.npz")
        loop.save(design / "performance_loop.npz")
        summary = {"fingerprint": "k", "fit_error": {"B": 5e-4}, "largest_real_part": -0.2}
        write_json(design / "summary.json", summary)
    write_json(folder / "designs.json", {"stable": "k", "unstable": "k", "waiting": "k"})
    return folder


def settings_for(source: Path, **changes: Any) -> study.Settings:
    settings = load_settings(study.Settings, study.NAME, "quick", sources=(str(source),), jobs=1)
    return dataclasses.replace(settings, **changes)


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> tuple[study.Settings, Path]:
    folder = tmp_path_factory.mktemp("certify")
    settings = settings_for(
        make_source(folder / "springs"),
        claims=study.KINDS,
        rates=(0.05,),
        fastest=(0.05, 0.1),
        box_steps=3,
        gain_factor=1.5,
        time_limit=20.0,
    )
    study.run(settings, folder / "out", SILENT)
    return settings, folder / "out"


def claim(out: Path, design: str, kind: str) -> Any:
    return read_json(out / "claims" / "springs" / design / kind / "summary.json")


def test_every_claim_has_the_right_outcome(everything: tuple[study.Settings, Path]) -> None:
    _, out = everything
    for kind in ("frozen", "rate-0.05", "fastest", "quadratic", "gain"):
        found = claim(out, "stable", kind)
        assert found["outcome"] == "proved", kind
        assert found["certificate"]["confirmed"]
        loop = "performance_loop.npz" if kind == "gain" else "closed_loop.npz"
        where = out / "claims" / "springs" / "stable" / kind / "certificate.npz"
        assert recheck(where, system=out.parent / "springs" / "designs" / "stable" / loop).proved
    limit = 0.4 * np.sqrt(1.0 - 0.04) / 0.6  # circle criterion; p_1 and p_2 at their limits together
    assert 0.5 * limit < claim(out, "stable", "quadratic")["value"] < limit
    gain = claim(out, "stable", "gain")
    # largest in the corner with the softest spring k = 0.4: 1 / (c sqrt(k - c^2 / 4))
    assert gain["found"] == pytest.approx(1.0 / (0.4 * np.sqrt(0.4 - 0.04)), rel=1e-6)
    assert gain["value"] == pytest.approx(1.5 * gain["found"])
    assert claim(out, "unstable", "frozen")["outcome"] == "refuted"
    for kind in ("rate-0.05", "fastest", "gain"):
        found = claim(out, "unstable", kind)
        assert found["outcome"] in ("refuted", "undecided")
        assert found["certificate"] is None


def test_the_report_tells_it(everything: tuple[study.Settings, Path]) -> None:
    _, out = everything
    text = (out / "report.md").read_text("utf-8")
    assert "Conditional on the plant's polynomial fit" in text
    assert "| springs/stable | B 5.0e-04 | -0.2 |" in text
    assert "springs/unstable: refuted: eigenvalue" in text
    assert "left out: springs/waiting" in text
    assert next(line[3:] for line in text.splitlines() if line.startswith("## ")) == "Stable at every frozen position"
    assert len(read_json(out / "report.json")["claims"]) == 10


def test_finished_claims_are_kept_and_damaged_ones_made_anew(everything: tuple[study.Settings, Path]) -> None:
    settings, out = everything
    damaged = out / "claims" / "springs" / "stable" / "frozen" / "certificate.npz"
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[:-10])
    heard = Recorder()
    study.run(settings, out, heard)
    assert sum("taken from the results folder" in message for message in heard.messages) == 9
    assert recheck(damaged).proved


def test_a_changed_loop_is_certified_anew(tmp_path: Path) -> None:
    source = make_source(tmp_path / "springs")
    settings = settings_for(source, designs=("stable",))
    study.run(settings, tmp_path / "out", SILENT)
    spring(1.1, 0.4).save(source / "designs" / "stable" / "closed_loop.npz")
    study.run(settings, tmp_path / "out", SILENT)
    assert claim(tmp_path / "out", "stable", "frozen")["outcome"] == "refuted"
    assert not (tmp_path / "out" / "claims" / "springs" / "stable" / "frozen" / "certificate.npz").exists()


def test_the_figure_shows_the_cells(everything: tuple[study.Settings, Path], tmp_path: Path) -> None:
    pdf, png = certify_cells.make(everything[1], tmp_path)
    assert pdf.read_bytes()[:5] == b"%PDF-"
    assert np.std(matplotlib.image.imread(png)[..., :3]) > 0.02


def test_the_figure_needs_a_proof(tmp_path: Path) -> None:
    settings = settings_for(make_source(tmp_path / "springs"), designs=("unstable",))
    study.run(settings, tmp_path / "out", SILENT)
    with pytest.raises(StorageError, match="no proved claim"):
        certify_cells.make(tmp_path / "out", tmp_path)


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = make_source(tmp_path / "springs"), tmp_path / "out"
    assert study.main(["--from", str(source), "--out", str(out), "--jobs", "1"]) == 0
    assert (out / "report.md").is_file()
    assert study.main(["--from", str(tmp_path / "none"), "--out", str(out)]) == 1
    assert "holds no designs.json. Run the study of its designs first" in capsys.readouterr().err


def test_sources_without_finished_designs(tmp_path: Path) -> None:
    source = make_source(tmp_path / "springs")
    with pytest.raises(DomainError, match="which no source has finished"):
        study.jobs_of(settings_for(source, designs=("other",)))
    write_json(source / "designs.json", {"waiting": "k"})
    with pytest.raises(DomainError, match="no design is finished"):
        study.jobs_of(settings_for(source))


@pytest.mark.parametrize("preset", ["quick", "full"])
def test_presets_are_valid(preset: str) -> None:
    assert load_settings(study.Settings, study.NAME, preset, jobs=7).jobs == 7


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('claims = ["frozen"]', 'claims = ["stable"]', r"claims is \['stable'\], wanted some of frozen, rate"),
        ('claims = ["frozen"]', "claims = []", "claims is"),
        ("designs = []", "designs = 3", "designs is 3, wanted a list of words"),
        ("rates = [0.1]", "rates = [0.0]", "rates is .* wanted speeds above 0"),
        ("fastest = [0.1, 1.0]", "fastest = [1.0, 0.1]", "fastest is"),
        ("gain_factor = 1.05", "gain_factor = 1.0", "gain_factor is 1.0, wanted above 1"),
        ("gain_grid = 5", "gain_grid = 1", "gain_grid is 1"),
        ("time_limit = 300.0", "time_limit = 0.0", "time_limit is 0.0"),
        ('"results/error_observer"', '"old/output_observer"', "wanted results folders with different names"),
    ],
)
def test_wrong_settings(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in TEXT
    path = tmp_path / "settings.toml"
    path.write_text(TEXT.replace(before, after), encoding="utf-8")
    with pytest.raises(DomainError, match=message):
        load_settings(study.Settings, study.NAME, str(path))
