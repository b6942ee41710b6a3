"""Guards the study of the plant on its tiny preset: tables follow from arrays, and anyone can recompute those."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.decoupling import decouple
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.plant.mmpa import MMPA, Effects, MMPAParameters, benchmark
from lpvhinf.progress import SILENT, Progress
from lpvhinf.storage import read_arrays, read_json, write_json
from studies import plant as study
from studies.__main__ import main
from studies.plant import Settings, parts_of
from studies.plant_effects import cases
from studies.plant_report import write_report
from studies.plant_results import ARRAYS
from studies.plant_settings import actuator, windowed
from studies.plant_validation import field_difference
from studies.settings import PRESETS, load_settings

TINY = load_settings(Settings, study.NAME, "tiny")
TEXT = (PRESETS / "plant_tiny.toml").read_text("utf-8")
TITLES = ["Summary", "Modes", "Validation", "Polynomial model", "Windows", "Effects", "Fully actuated", "Run"]
ROOT = Path(__file__).resolve().parents[2]


class Recorder(Progress):
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.stages, self.messages = list[str](), list[str]()

    def stage(self, name: str, total: int | None = None) -> None:
        self.stages.append(name)

    def log(self, message: str) -> None:
        self.messages.append(message)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("plant") / "results"
    study.run(TINY, out, SILENT)
    return out


@pytest.fixture(scope="module")
def plant() -> MMPA:
    return actuator(TINY)


def arrays(folder: Path, part: str) -> dict[str, Any]:
    return read_arrays(folder / "parts" / part / "arrays.npz", ARRAYS)


def values(folder: Path, part: str) -> dict[str, Any]:
    return dict(read_json(folder / "parts" / part / "summary.json"))


# The folder


def test_the_folder_is_complete(folder: Path) -> None:
    files = {"parts", "parts.json", "report.md", "report.json", "run.json", "settings.json"}
    assert {path.name for path in folder.iterdir()} == files
    names = {path.name for path in (folder / "parts").iterdir()}
    assert names == set(parts_of(TINY)) == set(read_json(folder / "parts.json"))
    for name in names:
        assert {path.name for path in (folder / "parts" / name).iterdir()} == {"arrays.npz", "summary.json"}


def test_json_files_hold_no_NaN(folder: Path) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    for path in folder.rglob("*.json"):
        json.loads(path.read_text("utf-8"), parse_constant=refuse)


def test_the_run_is_recorded(folder: Path) -> None:
    record, settings = read_json(folder / "run.json"), read_json(folder / "settings.json")
    assert {"python", "numpy", "scipy", "lpvhinf", "magpylib"} <= set(record["versions"])
    assert settings["study"] == "plant"
    assert settings["degrees"] == list(TINY.degrees)


def test_the_page_has_the_sections_that_others_quote(folder: Path) -> None:
    spec = importlib.util.spec_from_file_location("docs_build", ROOT / "docs/build.py")
    assert spec is not None
    assert spec.loader is not None
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    text = (folder / "report.md").read_text("utf-8")
    assert re.findall(r"^## (.+)$", text, re.MULTILINE) == TITLES
    for title in TITLES[:-1]:
        table = [line for line in build.section(text, title).splitlines() if line.startswith("|")]
        assert len(table) > 3
    # every row of a table has as many cells as its head
    for block in re.findall(r"(?:^\|.*\|\n)+", text, re.MULTILINE):
        assert len({line.count("|") for line in block.splitlines()}) == 1


# Summary


def test_currents_are_those_that_the_plant_commands(folder: Path, plant: MMPA) -> None:
    found = arrays(folder, "summary")
    some = slice(0, None, 4)
    for k, direction in enumerate([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]):
        currents = plant.levitation_current(found["points"][some], (10.0 * direction[0], 10.0 * direction[1], 0.0))
        assert np.allclose(found["largest_current"][k, some], np.abs(currents).max(axis=1), rtol=1e-10)
        assert np.allclose(found["copper_loss"][k, some], 1.2 * (currents**2).sum(axis=1), rtol=1e-10)


def test_the_summary_follows_from_its_arrays(folder: Path, plant: MMPA) -> None:
    told, found = values(folder, "summary"), arrays(folder, "summary")
    for name in ("condition_6", "condition_11"):
        assert (told[f"{name}_min"], told[f"{name}_max"]) == (found[name].min(), found[name].max())
    for load, largest, loss in zip(told["loads"], found["largest_current"], found["copper_loss"], strict=True):
        assert load["largest_A"] == largest.max()
        assert load["share_above"] == np.mean(largest > 4.0)
        assert load["loss_mean_W"] == pytest.approx(loss.mean())
    level = found["copper_loss"][0]
    assert np.allclose(found["levitation_rms"], np.sqrt(level / 1.2 / 40), rtol=1e-12)
    assert told["n_points"] == 25 == len(found["points"])
    text = (folder / "report.md").read_text("utf-8")
    assert f"| mass | {plant.mass:.3f} kg | 8.25 kg |" in text
    assert f"| {told['condition_11_min']:.2f}-{told['condition_11_max']:.2f} | at most 4 |" in text
    assert f"{told['loads'][3]['largest_A']:.2f} A (mean over P" in text


def test_position_dependence_in_the_signs_of_the_page(folder: Path) -> None:
    told = values(folder, "summary")
    assert told["torsion_z1"] == pytest.approx([0.77, 0.04], abs=0.006)
    assert told["torsion_point_of_control"] == pytest.approx([0.02, 0.66], abs=0.006)
    assert max(told["umbrella_per_newton"]) < -0.1


# Validation


def test_validation_reaches_what_it_must(folder: Path) -> None:
    told, found = values(folder, "validation"), arrays(folder, "validation")
    assert np.max(np.abs(found["plate"] / found["plate_published"] - 1.0)) == told["plate_error"] < 1e-5
    assert np.max(found["frf_all_modes"]) < 1e-6
    assert [row["kept_modes"] for row in told["responses"]] == found["frf_kept_modes"].tolist()
    assert found["frf_kept_modes"][0] < 1e-6  # far below the modes that are left out
    assert np.all(found["power_dissipated"] > 0.0)
    power = np.abs(found["power_supplied"] / found["power_dissipated"] - 1.0)
    assert np.max(power) == told["power_error"] < 1e-6


def test_the_difference_of_two_fields_is_seen(plant: MMPA) -> None:
    class Doubled:
        """Twice the field: decoupled inputs do the same."""

        n_coils = 160

        def wrench(self, points: Array) -> Array:
            return 2.0 * plant.mechanical.input_map.coils.wrench(points)  # type: ignore[attr-defined]

    rows = field_difference(benchmark(magnetics=Doubled(), n_flex=6), np.array([[0.0, 0.0], [0.02, -0.03]]))
    assert [row["difference"] for row in rows[:-1]] == pytest.approx([0.5] * 6)
    assert all(row["exact"] == pytest.approx(2.0 * row["first_harmonic"]) for row in rows[:-1])
    assert rows[-1]["difference"] < 1e-9


# Polynomial model and windows


@pytest.mark.parametrize("n_flex", TINY.n_flexes)
def test_errors_of_the_polynomial_model(folder: Path, plant: MMPA, n_flex: int) -> None:
    told, found = values(folder, f"polynomial-{n_flex}"), arrays(folder, f"polynomial-{n_flex}")
    shares = np.max(found["errors"], axis=1) / np.where(found["scales"] > 0.0, found["scales"], 1.0)
    assert np.allclose(told["errors"], shares, rtol=1e-12)
    assert np.all(shares[1, :3] <= shares[0, :3])
    assert np.all(shares[:, :2] > 1e-3)  # low degrees: the errors are there to be seen
    assert np.all(shares[1, 3:] < 1e-9)  # sensors are polynomials of degree 14
    assert told["nodes"] == [49, 225]
    # by another way: the state space of the fit against frozen plants
    points = found["points"][:3]
    assert np.all(np.abs(points) <= 0.06)
    model = decouple(plant, n_flex=n_flex, degree=TINY.degrees[0])
    fitted = model.system.sample(points)[1]
    for k, frozen in enumerate(model.frozen(points)):
        B = np.abs(fitted[k] - frozen.sample(points[:1])[1][0])[13::2]
        assert np.max(B[:, :3]) == pytest.approx(found["errors"][0, k, 0], rel=1e-9)
        assert np.max(B[:, 3:6]) == pytest.approx(found["errors"][0, k, 1], rel=1e-9)


def test_the_benchmark_is_the_first_row_of_the_windows(folder: Path, plant: MMPA) -> None:
    found, summary = arrays(folder, "windows"), arrays(folder, "summary")
    for preset in ("tiny", "paper"):
        first = load_settings(Settings, study.NAME, preset).windows[0]
        assert windowed(first) == MMPAParameters()
    assert np.allclose(found["largest_current"][0], summary["largest_current"], rtol=1e-12)
    assert np.array_equal(found["active"][0], summary["active"])


def test_windows_trade_current_for_nothing_when_they_are_narrow(folder: Path) -> None:
    told, found = values(folder, "windows"), arrays(folder, "windows")
    for k, row in enumerate(told["rows"]):
        assert row["levitation_A"] == found["largest_current"][k, 0].max()
        assert row["acceleration_A"] == found["largest_current"][k, 1:].max()
        assert max(row["errors"]) == pytest.approx(np.max(found["errors"][k].max(axis=0) / found["scales"][k]))
        assert (row["active_min"], row["active_max"]) == (found["active"][k].min(), found["active"][k].max())
    benchmark_row, narrow = told["rows"]
    assert narrow["active_max"] < benchmark_row["active_max"]
    assert narrow["levitation_A"] > benchmark_row["levitation_A"]
    assert narrow["levitation_loss_W"] > benchmark_row["levitation_loss_W"]


# Effects


def test_effects_follow_from_their_arrays(folder: Path) -> None:
    told, found = values(folder, "effects"), arrays(folder, "effects")
    assert [row["name"] for row in told["rows"]] == found["names"].tolist()
    for k, row in enumerate(told["rows"]):
        for name in ("input", "output", "excitation"):
            assert row[name] == found[name][k].max()
        assert row["worst_position"] == found["points"][np.argmax(found["input"][k])].tolist()
    assert told["left_out"] == [case.name for case in cases(0) if case.needs_exact_field]
    assert all(name in (folder / "report.md").read_text("utf-8") for name in told["left_out"])


def test_effects_have_the_sizes_that_they_must_have(folder: Path) -> None:
    rows = {row["name"]: row for row in values(folder, "effects")["rows"]}
    assert max(rows["none"][name] for name in ("input", "output", "excitation")) < 1e-10
    weaker = rows["all magnets 1 % weaker"]
    assert weaker["input"] == pytest.approx(0.01)
    assert max(weaker["output"], weaker["excitation"]) < 1e-10
    small, large = (rows[f"commutation misaligned by {size}"] for size in ("5 um along x and y", "50 um"))
    assert large["input"] == pytest.approx(10.0 * small["input"], rel=0.02)
    wave_number = np.pi / MMPAParameters().pole_pitch
    assert large["input"] > wave_number * 50e-6  # forces turn by this angle
    beams = rows["horizontal beams 0.1 mm too high *".removesuffix(" *")]
    # tilt reads as translation: 0.1 mm over the radius of gyration
    assert beams["output"] == pytest.approx(1e-4 / np.sqrt(0.0624 / 8.251), rel=0.01)
    assert beams["input"] < 1e-10
    assert rows["an eighth of the damping (0.1 %)"]["mode_damping"] == pytest.approx(0.001)
    assert rows["payload of 0.1 kg at (100, 100) mm"]["mode_hertz"] < 0.995 * rows["none"]["mode_hertz"]


def test_an_effect_by_the_measures_of_the_decoupled_plant(folder: Path) -> None:
    found = arrays(folder, "effects")
    k = found["names"].tolist().index("commutation misaligned by 50 um")
    machine = benchmark(magnetics="first-harmonic", n_flex=6, effects=Effects(commutation_misalignment=(50e-6, 50e-6)))
    decoupled = decouple(machine, n_flex=1)
    assert found["input"][k].max() == pytest.approx(decoupled.verify(found["points"]).rigid_gain, rel=1e-9)
    assert found["excitation"][k].max() == pytest.approx(decoupled.coupling(found["points"]).excitation[0], rel=0.02)


def test_phase_of_delay_and_current_loop(folder: Path) -> None:
    told = values(folder, "effects")["dynamics"]
    for hertz, phase in zip(told["hertz"], told["phase_deg"], strict=True):
        s = 1j * hertz / 3000.0
        wanted = -360.0 * hertz * 150e-6 - np.angle(1.0 + np.sqrt(2.0) * s + s**2, deg=True)
        assert phase == pytest.approx(wanted, abs=0.1)  # the delay is a Padé approximation


# Fully actuated


def test_coupling_of_the_fully_actuated_plant(folder: Path, plant: MMPA) -> None:
    told, found = values(folder, "full-actuation"), arrays(folder, "full-actuation")
    over, *full = told["rows"]
    assert over["mode_weight"] is None
    assert max(over["rigid"], over["excitation"], over["modal_to_rigid"]) < 1e-9
    assert over["own_gain_min"] == pytest.approx(1.0)
    assert [row["mode_weight"] for row in full] == list(TINY.mode_weights)
    for k, row in enumerate(told["rows"]):
        for name in ("rigid", "excitation", "modal_to_rigid", "own_gain_min", "own_gain_max"):
            assert row[name] == found[name][k, 0]
    # b the largest force on the mode: rho^2 b^2 / (1 + rho^2 b^2) of a rigid direction is lost, 1 / (...) excites
    points = found["points"]
    conventional = decouple(plant, n_flex=1, input_decoupling="rigid-body")
    S = plant.modal.rigid_body_scaling
    b = np.linalg.norm(conventional.sample(points).B[:, 6, :6] @ S, axis=1)
    for row in full:
        share = (row["mode_weight"] * b) ** 2 / (1.0 + (row["mode_weight"] * b) ** 2)
        assert row["rigid"] == pytest.approx(share.max(), rel=1e-6)
        assert row["own_gain_min"] == pytest.approx(share.min(), rel=1e-6)
        assert row["excitation"] == pytest.approx(np.max((1.0 - share) * b) / b.max(), rel=1e-6)


# Arrays of the figures


@pytest.mark.parametrize(("name", "kind"), [("conventional", "rigid-body"), ("extended", "extended")])
def test_responses_are_those_of_the_equations_of_motion(folder: Path, plant: MMPA, name: str, kind: str) -> None:
    found = arrays(folder, "responses")
    p, model = found["points"][1:2], plant.mechanical
    T_y, T_u = (m[0] for m in decouple(plant, n_flex=TINY.n_flex, input_decoupling=kind).matrices(p))
    for k in (0, 40, 120):
        omega = found["omega"][k]
        dynamic = model.K + 1j * omega * model.D - omega**2 * model.M
        motion = np.linalg.solve(dynamic, model.input_map_at(p)[0] @ T_u)
        outputs = T_y @ model.output_map_at(p)[0] @ motion
        point = (plant.point_of_control(p)[0] @ motion)[2, 2]
        wanted = np.abs([outputs[2, 2], outputs[3, 3], outputs[4, 4], point])
        assert np.allclose(found[name][1, :, k], wanted, rtol=2e-3)
    # frequencies reach beyond the modes that are kept: not compared there
    assert found["omega"][120] < 2 * np.pi * 150.0


def test_extended_decoupling_leaves_the_controlled_modes_alone(folder: Path) -> None:
    found = arrays(folder, "responses")
    at = np.argmin(np.abs(found["omega"] - found["modes"][6]))  # the torsion mode, seen in rx and ry
    gain = {name: found[name][:, 1, at] * found["omega"][at] ** 2 for name in ("conventional", "extended")}
    assert np.max(np.abs(gain["extended"] - 1.0)) < 0.2
    assert np.max(gain["conventional"]) > 2.0


def test_maps_and_summary_tell_the_same(folder: Path, plant: MMPA) -> None:
    maps, told = arrays(folder, "maps"), values(folder, "summary")
    corner = len(maps["points"]) - 1
    centre = corner // 2
    assert np.array_equal(maps["points"][[centre, corner]], [[0.0, 0.0], [0.06, 0.06]])
    assert maps["mode_at_z1"][[centre, corner], 0] == pytest.approx(told["torsion_z1"])
    assert maps["mode_at_point_of_control"][[centre, corner], 0] == pytest.approx(told["torsion_point_of_control"])
    # mode shapes in the figure are those that the beam sees: z1 at (80, 80) mm
    shapes = arrays(folder, "geometry")
    i = np.argmin(np.abs(shapes["shape_axis"] - 0.08))
    near = shapes["shapes"][0, i - 1 : i + 2, i - 1 : i + 2]
    assert near.min() < told["torsion_z1"][0] < near.max()
    currents = plant.levitation_current(maps["position"][None], (0.0, 10.0, 0.0))[0]
    assert np.allclose(maps["currents_at"][3], currents, rtol=1e-10, atol=1e-12)


# Again, and with mistakes


def test_a_second_run_keeps_what_is_finished(folder: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(folder, tmp_path / "copy"))
    (copy / "parts/geometry/arrays.npz").write_bytes(b"cut off")
    (copy / "parts/maps/summary.json").write_text('{"fingerprint": "other"}', encoding="utf-8")
    listener = Recorder()
    study.run(TINY, copy, listener)
    kept = {message.split(":")[0] for message in listener.messages if message.endswith("taken from the results folder")}
    assert kept == set(parts_of(TINY)) - {"geometry", "maps"}
    assert {stage.split(":")[0] for stage in listener.stages} == {"geometry", "maps"}
    assert np.array_equal(arrays(copy, "maps")["largest_current"], arrays(folder, "maps")["largest_current"])


def test_a_report_needs_every_part_of_the_same_settings(folder: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(folder, tmp_path / "copy"))
    keys = read_json(copy / "parts.json")
    write_json(copy / "parts.json", keys | {"summary": study.key_of(dataclasses.replace(TINY, seed=1), "summary")})
    with pytest.raises(StorageError, match=r"'summary' in .* comes from other settings"):
        write_report(copy)
    write_json(copy / "parts.json", keys)
    (copy / "parts/effects/summary.json").unlink()
    with pytest.raises(StorageError, match=r"effects/summary\.json cannot be read"):
        write_report(copy)


def test_the_command_writes_the_report_anew(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = Path(shutil.copytree(folder, tmp_path / "copy"))
    (copy / "report.md").unlink()
    assert main(["report", str(copy)]) == 0
    assert (copy / "report.md").read_text("utf-8") == (folder / "report.md").read_text("utf-8")
    write_json(copy / "settings.json", {"study": "other"})
    assert main(["report", str(copy)]) == 1
    assert "names the study 'other', wanted one of output_observer, " in capsys.readouterr().err


def test_only_the_number_of_processes_may_differ() -> None:
    assert study.key_of(dataclasses.replace(TINY, jobs=2), "summary") == study.key_of(TINY, "summary")
    for change in ({"seed": 1}, {"grid": 6}, {"magnetics": "exact"}, {"acceleration": 9.0}):
        assert study.key_of(dataclasses.replace(TINY, **change), "summary") != study.key_of(TINY, "summary")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"first-harmonic"', '"dipoles"', "magnetics is 'dipoles', wanted one of exact, first-harmonic"),
        ("n_plant_modes = 6", "n_plant_modes = 3", "n_plant_modes is 3, wanted a whole number of at least 6"),
        ("n_flexes = [0, 1]", "n_flexes = [0, 7]", "n_flexes is (0, 7), wanted at most n_plant_modes = 6"),
        ("degrees = [6, 14]", "degrees = []", "degrees is (), wanted a list of at least one value"),
        ("degrees = [6, 14]", "degrees = 6", "degrees is 6, wanted a list of at least one value"),
        ("degrees = [6, 14]", "degrees = [6, 1.5]", "degrees is 1.5, wanted a whole number of at least 0"),
        ("mode_weights = [0.3, 3.0]", "mode_weights = [0.3, 0.0]", "mode_weights is (0.3, 0.0), wanted values above 0"),
        ("0.230, 0.160, 0.240, 2]", "0.500, 0.160, 0.240, 2]", "window_short reaches 0.5 m"),
        ("0.230, 0.160, 0.240, 2]", "0.230, 0.160, 0.240]", "windows is not an array of real numbers"),
        ("position = [0.035, -0.025]", "position = [0.035]", "position has shape (1,)"),
        ("position = [0.035, -0.025]", "position = [0.065, 0.0]", "position = [0.065, 0.0] is outside the box"),
        ("acceleration = 10.0", "acceleration = 0.0", "acceleration is 0.0, wanted a finite number above 0 m/s2"),
        ("grid = 5 ", "grid = 1 ", "grid is 1, wanted a whole number of at least 2"),
        ("seed = 0", "seed = -1", "seed is -1, wanted a whole number of at least 0"),
        ("seed = 0", "speed = 0", "no option 'speed'"),
    ],
)
def test_wrong_settings(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    old: str,
    new: str,
    message: str,
) -> None:
    def refuse(*_: Any) -> None:
        raise AssertionError("the run was started")

    monkeypatch.setattr(study, "run", refuse)
    assert old in TEXT
    path = tmp_path / "settings.toml"
    path.write_text(TEXT.replace(old, new), encoding="utf-8")
    assert main(["run", "plant", "--preset", str(path), "--out", str(tmp_path / "out")]) == 1
    assert message in capsys.readouterr().err


def test_the_presets_differ_in_their_field() -> None:
    assert (TINY.magnetics, load_settings(Settings, study.NAME, "paper").magnetics) == ("first-harmonic", "exact")
    with pytest.raises(DomainError, match="wanted one of paper, tiny"):
        load_settings(Settings, study.NAME, "huge")
