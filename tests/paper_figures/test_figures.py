"""Guards the paper's figures: drawn from results alone, not blank, and with the curves that they claim to show."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lpvhinf.checks import Array
from lpvhinf.plotting.frequency import BlockCurves, draw_blocks
from lpvhinf.plotting.style import RC, ROLES, WIDTHS, new_figure, style
from lpvhinf.storage import read_arrays, read_json, write_json
from paper_figures import block_diagram, damping_trade
from paper_figures.__main__ import FIGURES as FIGURES_OF
from paper_figures.__main__ import main

FIGURES = FIGURES_OF["output_observer"]
OMEGA = 2 * np.pi * np.geomspace(1.0, 1000.0, 40)
BOUND = np.outer(np.arange(1.0, 7.0), np.ones(40)).reshape(2, 3, 40)


def check_picture(pdf: Path, png: Path, width: float, height: float) -> None:
    """Of the wanted size in inches, with ink all over it."""
    assert pdf.read_bytes().startswith(b"%PDF-")
    assert pdf.stat().st_size > 5_000
    pixels = np.asarray(matplotlib.image.imread(png))[:, :, :3]
    dots = RC["savefig.dpi"]
    assert pixels.shape[:2] == pytest.approx((height * dots, width * dots), abs=1)
    halves = [pixels[:, : pixels.shape[1] // 2], pixels[:, pixels.shape[1] // 2 :], pixels[: pixels.shape[0] // 2]]
    assert all(np.std(half) > 0.02 for half in halves)
    assert np.mean(pixels) > 0.5  # a white page


def test_all_figures_of_a_study(tiny_results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--from", str(tiny_results), "--out", str(tmp_path)]) == 0
    made = {path.name for path in tmp_path.iterdir()}
    assert made == {f"{name}.{ending}" for name in FIGURES for ending in ("pdf", "png")}
    assert [Path(line).name for line in capsys.readouterr().out.split()] == [
        "damping_trade.pdf", "damping_trade.png", "six_block.pdf", "six_block.png",
    ]  # fmt: skip
    for name, ratio in (("six_block", 0.56), ("damping_trade", 0.33)):
        check_picture(tmp_path / f"{name}.pdf", tmp_path / f"{name}.png", WIDTHS["two"], ratio * WIDTHS["two"])


def test_one_figure_and_the_same_bytes_again(tiny_results: Path, tmp_path: Path) -> None:
    for folder in ("one", "two"):
        assert main(["damping_trade", "--from", str(tiny_results), "--out", str(tmp_path / folder)]) == 0
    assert sorted(path.name for path in (tmp_path / "one").iterdir()) == ["damping_trade.pdf", "damping_trade.png"]
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()


def test_the_six_blocks_of_the_study_keep_their_promise(tiny_results: Path) -> None:
    """No block exceeds its bound by more than gamma, at the positions that the figure shows."""
    folder = tiny_results / "designs" / "observer"
    data = read_arrays(folder / "responses.npz", "lpvhinf.Responses")
    gamma = read_json(folder / "summary.json")["gamma_worst"]
    assert np.all(data["sigma"] <= 1.02 * gamma * data["bounds"][None])
    assert np.max(data["sigma"] / data["bounds"]) > 0.5 * gamma


@pytest.mark.parametrize("name", [None, *sorted(FIGURES)])
def test_a_missing_folder(name: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [] if name is None else [name]
    assert main([*given, "--from", str(tmp_path / "none"), "--out", str(tmp_path / "figures")]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert str(tmp_path / "none") in error
    assert "run" in error.lower()
    assert not (tmp_path / "figures").exists()


def test_an_unknown_figure(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["seven_block", "--from", "results", "--out", "figures"])
    assert end.value.code == 2
    assert "six_block" in capsys.readouterr().err


def test_a_damaged_response(tiny_results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = Path(shutil.copytree(tiny_results, tmp_path / "copy"))
    (copy / "designs/observer/responses.npz").write_bytes(b"cut off")
    assert main(["six_block", "--from", str(copy), "--out", str(tmp_path / "figures")]) == 1
    assert "responses.npz cannot be read as arrays" in capsys.readouterr().err


def summary(name: str, **values: Any) -> dict[str, Any]:
    architecture = "rigid-body" if name == "conventional" else "output-observer"
    figures = {"mode_peak_dB": 30.0, "flexible_peak_dB": 31.0, "gamma": 2.5, "discarded_damping_min": 0.004}
    fixed = {"name": name, "architecture": architecture, "sensing": "all", "epsilon": 0.1, "damping_min": [0.01]}
    return {**fixed, **figures, **values}


def test_damping_trade_leaves_out_other_sensing_and_unbounded_peaks(tmp_path: Path) -> None:
    """An unstable position leaves None in a summary: a gap in the curve, not an error."""
    summaries = (
        summary("conventional"),
        summary("observer"),
        summary("observer-epsilon-1", epsilon=1.0, mode_peak_dB=None, gamma=None),
        summary("observer-Ty", sensing="rigid-body", gamma=1e9),
    )
    write_json(tmp_path / "designs.json", {one["name"]: "key" for one in summaries})
    for one in summaries:
        write_json(tmp_path / "designs" / one["name"] / "summary.json", one)
    pdf, png = damping_trade.make(tmp_path, tmp_path / "figures")
    check_picture(pdf, png, WIDTHS["two"], 0.33 * WIDTHS["two"])


def curves(label: str, role: str, worst: int, height: float) -> BlockCurves:
    """Flat responses at four positions, of which `worst` is at `height` times the bound in every block."""
    sigma = np.full((4, 2, 3, 40), 0.1)
    sigma[worst] = height * BOUND
    sigma[(worst + 1) % 4, :, :, :5] = 0.9 * height * BOUND[:, :, :5]
    return BlockCurves(label=label, role=role, omega=OMEGA, sigma=sigma)


@pytest.fixture
def drawn() -> tuple[Figure, Any]:
    with style():
        figure = new_figure(width="two", ratio=0.56)
        designs = [curves("first", "rigid-body", 2, 3.0), curves("second", "output-observer", 0, 0.5)]
        return figure, draw_blocks(figure, designs, BOUND, OMEGA)


def line(ax: Any, label: str) -> Line2D:
    (found,) = [one for one in ax.get_lines() if one.get_label() == label]
    assert isinstance(found, Line2D)
    return found


def decibel(gain: Array) -> Array:
    return np.asarray(20 * np.log10(gain))


def test_six_axes_with_bounds(drawn: tuple[Figure, Any]) -> None:
    figure, axes = drawn
    assert axes.shape == (2, 3)
    assert len(figure.axes) == 6
    for ax, bound in zip(axes.ravel(), BOUND.reshape(6, 40), strict=True):
        dotted = line(ax, "inverse shaping filters")
        assert dotted.get_color() == ROLES["shaping"]
        assert dotted.is_dashed()
        assert np.allclose(dotted.get_xdata(), OMEGA / (2 * np.pi))
        assert np.allclose(dotted.get_ydata(), decibel(bound))
        assert ax.get_xscale() == "log"
    assert len({ax.get_title() for ax in axes.ravel()}) == 6


@pytest.mark.parametrize(
    ("label", "role", "height"), [("first", "rigid-body", 3.0), ("second", "output-observer", 0.5)]
)
def test_the_line_is_the_worst_position(drawn: tuple[Figure, Any], label: str, role: str, height: float) -> None:
    for ax, bound in zip(drawn[1].ravel(), BOUND.reshape(6, 40), strict=True):
        curve = line(ax, label)
        assert curve.get_color() == ROLES[role]
        assert np.allclose(curve.get_ydata(), decibel(height * bound))


def test_the_worst_position_is_judged_against_the_bound_not_by_size() -> None:
    """The larger response lies where the bound is far above it."""
    bound = np.where(np.arange(40) < 20, 100.0, 1.0) * np.ones((2, 3, 1))
    sigma = np.full((2, 2, 3, 40), 0.1)
    sigma[0, :, :, 0], sigma[1, :, :, -1] = 50.0, 0.9
    one = BlockCurves(label="one", role="rigid-body", omega=OMEGA, sigma=sigma)
    for ax in draw_blocks(Figure(), [one], bound, OMEGA).ravel():
        assert np.allclose(line(ax, "one").get_ydata(), decibel(sigma[1, 0, 0]))


def test_the_band_holds_every_position(drawn: tuple[Figure, Any]) -> None:
    bands = [item for item in drawn[1][0, 0].collections if isinstance(item, PolyCollection)]
    assert len(bands) == 2
    heights = np.asarray(bands[0].get_paths()[0].vertices)[:, 1]
    assert np.min(heights) == pytest.approx(-20.0)
    assert np.max(heights) == pytest.approx(decibel(np.array(3.0)))
    assert tuple(np.asarray(bands[0].get_facecolor())[0][:3]) == to_rgba(ROLES["rigid-body"])[:3]


def test_every_curve_is_in_sight_and_in_the_legend(drawn: tuple[Figure, Any]) -> None:
    figure, axes = drawn
    assert all(ax.get_ylim()[1] >= 20 * np.log10(3.0 * k) for k, ax in enumerate(axes.ravel(), start=1))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["inverse shaping filters", "first", "second"]


def test_the_block_diagram(tmp_path: Path) -> None:
    assert block_diagram.main(["--out", str(tmp_path)]) == 0
    check_picture(
        tmp_path / "block_diagram.pdf", tmp_path / "block_diagram.png", WIDTHS["two"], 20.4 / 35.5 * WIDTHS["two"]
    )
