"""Guards the command lines: what they list, their exit status, and messages that name the remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import lpvhinf
from lpvhinf.cli.main import main as console
from lpvhinf.cli.settings_file import read_settings
from studies import output_observer
from studies.__main__ import STUDIES, main
from studies.settings import PRESETS, load_settings

TINY = (PRESETS / "output_observer_tiny.toml").read_text("utf-8")


@pytest.fixture(autouse=True)
def _no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """A command line that lets wrong settings through must not start a long run."""

    def refuse(*_: Any) -> None:
        raise AssertionError("the run was started")

    monkeypatch.setattr(output_observer, "run", refuse)


def run_with(text: str, tmp_path: Path, *options: str) -> int:
    path = tmp_path / "settings.toml"
    path.write_text(text, encoding="utf-8")
    return main(["run", "output_observer", "--preset", str(path), "--out", str(tmp_path / "out"), *options])


def test_list_names_the_studies(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert set(lines) == set(STUDIES)
    assert {"output_observer", "error_observer", "plant"} <= set(lines)
    assert "6-block" in lines[output_observer.NAME]


def test_an_unknown_preset_names_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "output_observer", "--preset", "huge"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: preset is 'huge', wanted one of paper, tiny or the path of a .toml file")


def test_a_preset_that_is_no_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["run", "output_observer", "--preset", str(tmp_path / "none.toml")]) == 1
    assert "wanted one of paper, tiny" in capsys.readouterr().err


def test_an_unknown_study_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["run", "other"])
    assert end.value.code == 2
    assert "output_observer" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TINY + "bandwidth = 3\n", "no option 'bandwidth'. Known: degree, epsilon"),
        (TINY.replace("f_bw = 40.0", ""), "the settings lack f_bw. Take a preset"),
        ("", "the settings lack f_bw, n_flex,"),
        ("f_bw = = 3", "is not valid TOML"),
        (TINY.replace("f_bw = 40.0", "f_bw = -1.0"), "f_bw is -1.0, wanted a finite number above 0"),
        (TINY.replace("f_bw = 40.0", 'f_bw = "40"'), "f_bw is '40', wanted a finite number above 0"),
        (TINY.replace("f_bw = 40.0", "f_bw = nan"), "f_bw is nan"),
        (TINY.replace("epsilons = [0.1]", "epsilons = [0.1, 0.0]"), "wanted values above 0"),
        (TINY.replace("epsilons = [0.1]", "epsilons = 0.1"), "epsilons has shape ()"),
        (TINY.replace("n_positions = 7", "n_positions = 0"), "n_positions is 0, wanted a whole number"),
        (TINY.replace("n_positions = 7", "n_positions = 5.5"), "n_positions is 5.5, wanted a whole number"),
        (TINY.replace("stability_grid = 15", "stability_grid = 0"), "stability_grid is 0, wanted a whole number"),
        (TINY.replace("degree = 20", "degree = -1"), "degree is -1, wanted a whole number of at least 0"),
        (TINY.replace("with_Ty = false", 'with_Ty = "no"'), "with_Ty is 'no', wanted true or false"),
        (TINY.replace('"first-harmonic"', '"dipoles"'), "magnetics is 'dipoles', wanted one of exact, first-harmonic"),
        (TINY.replace("starts = 1", "starts = 0"), "starts is 0, wanted a whole number of at least 1"),
    ],
)
def test_wrong_settings(capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, message: str) -> None:
    assert text != TINY
    assert run_with(text, tmp_path) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_wrong_jobs(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_with(TINY, tmp_path, "--jobs", "0") == 1
    assert "jobs is 0, wanted a whole number of at least 1" in capsys.readouterr().err


@pytest.mark.parametrize("preset", ["tiny", "paper"])
def test_presets_are_valid_and_options_win_over_them(preset: str) -> None:
    settings = load_settings(output_observer.Settings, "output_observer", preset, jobs=7)
    assert settings.jobs == 7
    assert load_settings(output_observer.Settings, "output_observer", preset, jobs=None).jobs != 7
    assert settings.f_bw == 40.0
    assert isinstance(settings.epsilons, tuple)


def test_an_interrupt_ends_with_130(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(output_observer, "run", interrupted)
    assert run_with(TINY, tmp_path) == 130
    assert "run the same command again to go on" in capsys.readouterr().err


def test_a_report_of_nothing(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["report", str(tmp_path)]) == 1
    assert "settings.json cannot be read as JSON" in capsys.readouterr().err
    (tmp_path / "settings.json").write_text("{}", encoding="utf-8")
    assert main(["report", str(tmp_path)]) == 1
    assert f"names the study None, wanted one of {', '.join(STUDIES)}" in capsys.readouterr().err
    (tmp_path / "settings.json").write_text('{"study": "output_observer"}', encoding="utf-8")
    assert main(["report", str(tmp_path)]) == 1
    assert "designs.json cannot be read as JSON" in capsys.readouterr().err


# The console script


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        console(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out.strip() == f"lpvhinf {lpvhinf.__version__}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bandwidth = 40.0", "no option 'bandwidth'. Known: K_r, K_s"),
        ("f_bw = ", "cannot be read as TOML"),
        ("f_bw = -40.0", "f_bw is -40.0, wanted values above 0"),
        ("f_bw = [40.0, inf]", "wanted a finite number"),
    ],
)
def test_wrong_specifications(capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "wanted.toml"
    path.write_text(text, encoding="utf-8")
    assert console(["design", str(path), "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error
    assert not (tmp_path / "out").exists()


def test_a_missing_specification(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert console(["design", str(tmp_path / "none.toml"), "--out", str(tmp_path / "out")]) == 1
    assert "none.toml cannot be read as TOML" in capsys.readouterr().err


def test_a_specification_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "wanted.toml"
    path.write_text("f_bw = [30, 30, 40, 40, 40, 40]\nepsilon = 0.1\n", encoding="utf-8")
    assert lpvhinf.Specification.from_mapping(read_settings(path)) == lpvhinf.Specification(
        f_bw=(30, 30, 40, 40, 40, 40), epsilon=0.1
    )
    assert lpvhinf.Specification.from_mapping(read_settings(None)) == lpvhinf.Specification()
