"""The commands on a tiny design: from settings to certificate, motion, controller files and page."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from lpvhinf.cli.main import main

SETTINGS = """\
f_bw = 20.0
[plant]
plant_modes = 2
magnetics = "first-harmonic"
degree = 8
[search]
architecture = "rigid-body"
n_positions = 3
starts = 1
exchange_rounds = 0
n_search = 4
max_iterations = 5
"""


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a design made by the command."""
    folder = tmp_path_factory.mktemp("cli")
    (folder / "settings.toml").write_text(SETTINGS)
    assert main(["design", str(folder / "settings.toml"), "--out", str(folder / "design")]) == 0
    return folder / "design"


def test_a_design_can_be_certified_and_checked_again(design: Path) -> None:
    assert main(["certify", str(design), "--kind", "frozen"]) == 0
    file = design / "certificates" / "frozen.npz"
    assert main(["check", str(file)]) == 0
    file.with_name("cut.npz").write_bytes(file.read_bytes()[:-100])
    assert main(["check", str(file.with_name("cut.npz"))]) == 2


def test_a_motion_is_simulated_and_measured(design: Path) -> None:
    assert main(["simulate", str(design)]) == 0
    record = json.loads((design / "motion" / "motion.json").read_text())
    assert record["architecture"] == "rigid-body"
    assert record["measures"]


def test_a_controller_is_exported(design: Path) -> None:
    assert main(["export", str(design)]) == 0
    assert {".c", ".h", ".json", ".m", ".mat"} == {f.suffix for f in (design / "export").iterdir()}


def test_the_page_is_one_small_file_that_asks_for_nothing(design: Path) -> None:
    assert main(["view", str(design), "--grid", "3"]) == 0
    text = (design / "view.html").read_text(encoding="utf-8")
    assert len(text) < 5e6
    assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)


def test_a_folder_without_a_design_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(tmp_path)]) == 1
    assert str(tmp_path) in capsys.readouterr().err


def test_an_unknown_setting_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "s.toml").write_text("f_bww = 20.0\n")
    assert main(["design", str(tmp_path / "s.toml"), "--out", str(tmp_path / "d")]) == 1
    assert "f_bww" in capsys.readouterr().err
