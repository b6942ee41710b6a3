"""Guards the figures of the study of the error-based observer: what they draw, from stored results alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from lpvhinf.plotting.frequency import TWO_BY_TWO_TITLES, BlockCurves, draw_blocks
from lpvhinf.plotting.style import RC, ROLES, WIDTHS, new_figure, style
from lpvhinf.storage import read_json, write_json
from paper_figures.__main__ import main

OMEGA = 2 * np.pi * np.geomspace(1.0, 1000.0, 40)


def test_all_figures_of_the_study(tiny_error_results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--from", str(tiny_error_results), "--out", str(tmp_path)]) == 0
    assert [Path(line).name for line in capsys.readouterr().out.split()] == [
        "trade_off.pdf", "trade_off.png", "two_by_two.pdf", "two_by_two.png",
    ]  # fmt: skip
    for name in ("trade_off", "two_by_two"):
        pixels = np.asarray(matplotlib.image.imread(tmp_path / f"{name}.png"))[:, :, :3]
        inches = np.array([0.6, 1.0]) * WIDTHS["two"]
        assert pixels.shape[:2] == pytest.approx(tuple(inches * RC["savefig.dpi"]), abs=1)
        half = pixels.shape[1] // 2
        assert min(np.std(pixels[:, :half]), np.std(pixels[:, half:])) > 0.02
        # green for the error-based observer is there, and the page is white
        green = np.array([int(ROLES["error-observer"][k : k + 2], 16) / 255 for k in (1, 3, 5)])
        assert np.sum(np.max(np.abs(pixels - green), axis=-1) < 0.02) > 200
        assert np.mean(pixels) > 0.5


def test_the_trade_off_needs_a_stable_observer(
    tiny_error_results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = Path(shutil.copytree(tiny_error_results, tmp_path / "copy"))
    for path in (copy / "designs").glob("*-epsilon-*/summary.json"):
        write_json(path, read_json(path) | {"largest_real_part": 1.0})
    assert main(["trade_off", "--from", str(copy), "--out", str(tmp_path / "figures")]) == 1
    assert "no stable observer design" in capsys.readouterr().err


def test_every_position_is_a_line_and_the_worst_is_named() -> None:
    bound = np.ones((2, 2, 40))
    sigma = np.full((4, 2, 2, 40), 0.1)
    sigma[2] = 3.0
    sigma[1, :, :, 7] = 2.0
    with style():
        figure = new_figure(width="two", ratio=0.6)
        one = BlockCurves(label="one", role="error-observer", omega=OMEGA, sigma=sigma)
        axes = draw_blocks(figure, [one], bound, OMEGA, titles=TWO_BY_TWO_TITLES, every=True)
    assert axes.shape == (2, 2)
    for ax, title in zip(axes.ravel(), np.ravel(TWO_BY_TWO_TITLES), strict=True):
        assert ax.get_title() == title
        assert len(ax.get_lines()) == 4 + 1 + 1  # positions, the worst of them, the bound
        assert not [item for item in ax.collections if isinstance(item, PolyCollection)]
        (named,) = [line for line in ax.get_lines() if line.get_label() == "one"]
        assert np.allclose(named.get_ydata(), 20 * np.log10(3.0))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["inverse shaping filters", "one"]
