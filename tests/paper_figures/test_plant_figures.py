"""Guards the figures of the plant: drawn from results alone, labels apart, with the values that they claim to show."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from matplotlib.axis import Tick
from matplotlib.collections import PatchCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.text import Text

from lpvhinf.plotting.style import RC, WIDTHS
from lpvhinf.progress import SILENT
from lpvhinf.storage import write_json
from paper_figures.__main__ import FIGURES, main
from paper_figures.plant_results import arrays
from studies import plant
from studies.settings import load_settings

NAMES = sorted(FIGURES["plant"])


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The parts of the tiny study that the figures read."""
    folder = tmp_path_factory.mktemp("plant")
    settings = load_settings(plant.Settings, plant.NAME, "tiny")
    write_json(folder / "settings.json", {"study": plant.NAME})
    for part in ("geometry", "maps", "responses"):
        plant.run_part(settings, part, folder, SILENT)
    return folder


@pytest.fixture(scope="module")
def drawn(results: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Any]:
    """Each figure once: the figure itself, its files, and the boxes of its texts while its style holds."""
    out, made = tmp_path_factory.mktemp("figures"), dict[str, Any]()

    def draw(name: str) -> Any:
        if name not in made:
            module, kept = FIGURES["plant"][name], dict[str, Any]()
            save = module.save_figure

            def keep(figure: Figure, path: Path) -> Any:
                files = save(figure, path)
                kept.update(figure=figure, texts=texts(figure))
                return files

            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(module, "save_figure", keep)
                made[name] = {"files": module.make(results, out), **kept}
        return made[name]

    return draw


def texts(figure: Figure) -> list[tuple[str, Any]]:
    """Every text that is drawn, and its box in dots."""
    figure.draw_without_rendering()
    of_ticks = {id(label) for tick in figure.findobj(Tick) for label in (tick.label1, tick.label2)}
    found = [text for text in figure.findobj(Text) if id(text) not in of_ticks]
    found = [text for text in found if text.axes is None or text.axes.get_visible()]
    for ax in figure.axes:
        # matplotlib keeps ticks that are out of use, and labels those beyond the limits without drawing them
        if ax.get_visible():
            found += [text for text in ax.get_xticklabels() + ax.get_xticklabels(minor=True) if within(text, ax, "x")]
            found += [text for text in ax.get_yticklabels() + ax.get_yticklabels(minor=True) if within(text, ax, "y")]
    return [(text.get_text(), text.get_window_extent()) for text in found if text.get_visible() and text.get_text()]


def within(text: Any, ax: Any, along: str) -> bool:
    """Whether the label of a tick belongs to a place inside its axes."""
    box, area = text.get_window_extent(), ax.get_window_extent()
    middle = {"x": (box.x0 + box.x1) / 2, "y": (box.y0 + box.y1) / 2}[along]
    low, high = {"x": (area.x0, area.x1), "y": (area.y0, area.y1)}[along]
    return bool(low - 1 <= middle <= high + 1)


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_of_full_width_with_ink_all_over(drawn: Callable[[str], Any], name: str) -> None:
    pdf, png = drawn(name)["files"]
    assert (pdf.name, png.name) == (f"{name}.pdf", f"{name}.png")
    assert pdf.read_bytes().startswith(b"%PDF-")
    pixels = np.asarray(matplotlib.image.imread(png))[:, :, :3]
    assert pixels.shape[1] == pytest.approx(WIDTHS["two"] * RC["savefig.dpi"], abs=1)
    half = pixels.shape[0] // 2
    assert all(np.std(part) > 0.02 for part in (pixels[:half], pixels[half:], pixels[:, : pixels.shape[1] // 2]))
    assert np.mean(pixels) > 0.5  # a white page


@pytest.mark.parametrize("name", NAMES)
def test_labels_do_not_overlap_and_stay_on_the_page(drawn: Callable[[str], Any], name: str) -> None:
    one = drawn(name)
    page = one["figure"].bbox
    outside = [text for text, box in one["texts"] if box.x0 < page.x0 - 1 or box.x1 > page.x1 + 1]
    assert not outside
    overlaps = [
        (a, b)
        for i, (a, first) in enumerate(one["texts"])
        for b, second in one["texts"][:i]
        if first.shrunk(0.98, 0.98).overlaps(second.shrunk(0.98, 0.98))
    ]
    assert not overlaps
    assert len(one["texts"]) > 15  # there is something to compare


def test_the_top_view_shows_the_weights_of_both_layers(drawn: Callable[[str], Any], results: Path) -> None:
    data = arrays(results, "geometry")
    axes = drawn("plant_top_view")["figure"].axes
    assert np.any(data["weights"] == 0.0)
    for layer in (0, 1):
        (coils,) = [item for item in axes[layer].collections if isinstance(item, PatchCollection)]
        assert np.array_equal(np.asarray(coils.get_array()), data["weights"][data["coil_layer"] == layer])
    magnets = [item for item in axes[2].collections if isinstance(item, PatchCollection)]
    counts = [len(item.get_paths()) for item in magnets]
    assert sum(counts) == len(data["magnet_centres"]) == 140
    assert abs(counts[0] - counts[1]) <= 8  # as many up as down, but for the rim


def test_arrows_point_to_magnets_that_are_polarized_down(drawn: Callable[[str], Any], results: Path) -> None:
    """So the flux gathers below the array, where the coils are."""
    data = arrays(results, "geometry")
    (quiver,) = [c for c in drawn("plant_top_view")["figure"].axes[2].collections if type(c).__name__ == "Quiver"]
    places = 1e-3 * np.asarray(quiver.get_offsets()) - data["position"]
    ahead = places + 0.02 * np.column_stack([quiver.U, quiver.V])
    vertical = data["magnet_polarization"][:, 2] != 0.0
    distance = np.linalg.norm(ahead[:, None] - data["magnet_centres"][vertical], axis=2)
    inner = np.min(distance, axis=1) < 0.004
    towards = data["magnet_polarization"][vertical][np.argmin(distance, axis=1), 2][inner]
    assert np.count_nonzero(inner) > 50
    assert np.all(towards < 0.0)


def test_mode_shapes_are_scaled_by_their_largest(drawn: Callable[[str], Any], results: Path) -> None:
    data = arrays(results, "geometry")
    figure = drawn("plant_mode_shapes")["figure"]
    meshes = [item for ax in figure.axes[:6] for item in ax.collections if isinstance(item, QuadMesh)]
    for mesh, shape, hertz, ax in zip(meshes, data["shapes"], data["shape_hertz"], figure.axes, strict=False):
        peak = np.max(np.abs(shape))
        assert np.allclose(np.asarray(mesh.get_array()), shape.T / peak)
        assert f"{hertz:.1f} Hz, largest {peak:.2f}" in ax.get_title()


def test_gains_of_a_kind_share_their_scale(drawn: Callable[[str], Any], results: Path) -> None:
    data = arrays(results, "maps")
    figure = drawn("plant_modal_gains")["figure"]
    n_modes, n = len(data["mode_hertz"]), len(data["axis"])
    maps = [[item for item in ax.collections if isinstance(item, QuadMesh)] for ax in figure.axes[: 9 * n_modes]]
    for mode in range(n_modes):
        for column in range(6):
            (mesh,) = maps[9 * mode + column]
            wanted = data["mode_force"][:, mode, column].reshape(n, n)
            assert np.allclose(np.asarray(mesh.get_array()), wanted.T)
        assert np.allclose(np.asarray(maps[9 * mode + 7][0].get_array()), data["mode_at_z1"][:, mode].reshape(n, n).T)
    scales = [one[0].get_clim() for one in maps if one]
    assert len(scales) == 8 * n_modes
    assert len(set(scales)) == 2
    assert max(high for _, high in scales) >= np.max(np.abs(data["mode_at_z1"]))


def test_currents_are_those_of_the_marked_position(drawn: Callable[[str], Any], results: Path) -> None:
    data, place = arrays(results, "maps"), arrays(results, "geometry")
    axes = drawn("plant_coil_currents")["figure"].axes
    for row, load in enumerate((0, 1, 3)):
        for layer in (0, 1):
            coils = [item for item in axes[3 * row + layer].collections if isinstance(item, PatchCollection)]
            assert np.array_equal(
                np.asarray(coils[0].get_array()), data["currents_at"][load][place["coil_layer"] == layer]
            )
        (mesh,) = [item for item in axes[3 * row + 2].collections if isinstance(item, QuadMesh)]
        assert np.max(np.asarray(mesh.get_array())) == np.max(data["largest_current"][load])
        low, high = mesh.get_clim()
        assert low <= np.min(data["largest_current"][load]) <= np.max(data["largest_current"][load]) <= high


def test_responses_are_accelerations(drawn: Callable[[str], Any], results: Path) -> None:
    data = arrays(results, "responses")
    axes = drawn("plant_frf")["figure"].axes
    shown = data["omega"] >= 2 * np.pi * 50.0
    for row, name in enumerate(("conventional", "extended")):
        for column in range(4):
            curves = axes[4 * row + column].get_lines()
            assert len(curves) == len(data["points"]) + 2
            wanted = 20 * np.log10(data[name][0, column] * data["omega"] ** 2)[shown]
            assert np.allclose(curves[0].get_ydata(), wanted)
            # at 50 Hz the rigid body decides, so the scale is right
            assert np.max(np.abs([curve.get_ydata()[0] for curve in curves])) < 0.5


def test_the_command_draws_one_figure_with_the_same_bytes_again(
    results: Path, drawn: Callable[[str], Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plant_top_view", "--from", str(results), "--out", str(tmp_path)]) == 0
    made = [Path(line) for line in capsys.readouterr().out.split()]
    assert sorted(tmp_path.iterdir()) == sorted(made)
    for path, other in zip(made, drawn("plant_top_view")["files"], strict=True):
        assert path.read_bytes() == other.read_bytes()


def test_all_figures_of_the_folder_s_study(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[tuple[str, Path]] = []
    for name, module in FIGURES["plant"].items():
        monkeypatch.setattr(module, "make", lambda source, out, name=name: asked.append((name, source)) or [out / name])
    assert main(["--from", str(results), "--out", str(tmp_path)]) == 0
    assert asked == [(name, results) for name in NAMES]
    assert len(capsys.readouterr().out.split()) == 5


def test_a_figure_of_another_study(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["six_block", "--from", str(results), "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    assert "no data for the figure 'six_block', only for plant_coil_currents, plant_frf" in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("settings", [{}, {"study": "other"}, [1]], ids=str)
def test_a_folder_of_no_study(settings: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_json(tmp_path / "settings.json", settings)
    assert main(["--from", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "wanted one of output_observer, " in capsys.readouterr().err


def test_damaged_arrays(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = Path(shutil.copytree(results, tmp_path / "copy"))
    (copy / "parts/geometry/arrays.npz").write_bytes(b"cut off")
    assert main(["plant_top_view", "--from", str(copy), "--out", str(tmp_path / "out")]) == 1
    assert "arrays.npz cannot be read as arrays" in capsys.readouterr().err
