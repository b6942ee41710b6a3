"""One look for every figure."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import pytest

from lpvhinf.errors import DomainError
from lpvhinf.plotting import WIDTHS, new_figure, save_figure, style
from paper_figures import block_diagram


def test_style_ends_with_its_block() -> None:
    before = dict(mpl.rcParams)
    with style(axes_grid=False):
        assert mpl.rcParams["axes.grid"] is False
        assert mpl.rcParams["mathtext.fontset"] == "stix"
    assert dict(mpl.rcParams) == before


def test_unknown_setting_is_an_error() -> None:
    with pytest.raises(DomainError, match="axis_grid"), style(axis_grid=False):
        pass


@pytest.mark.parametrize("width", ["one", "two"])
def test_width(width: str) -> None:
    fig = new_figure(width=width, ratio=0.5)  # type: ignore[arg-type]
    assert tuple(fig.get_size_inches()) == (WIDTHS[width], WIDTHS[width] / 2)


def test_unknown_width_is_an_error() -> None:
    with pytest.raises(DomainError, match="three"):
        new_figure(width="three")  # type: ignore[arg-type]


def test_figures_are_written_as_pdf_and_png_with_the_same_bytes_each_time(tmp_path: Path) -> None:
    with style():
        fig = new_figure()
        fig.subplots().plot([0.0, 1.0], [1.0, 0.0])
        first = [path.read_bytes() for path in save_figure(fig, tmp_path / "a" / "gamma_1.5.png")]
        second = [path.read_bytes() for path in save_figure(fig, tmp_path / "a" / "gamma_1.5")]
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    # "gamma_1.5" has no ending of a figure, so nothing of its name is lost
    assert names == ["gamma_1.5.pdf", "gamma_1.5.png"]
    assert first == second
    assert first[0].startswith(b"%PDF")
    assert first[1].startswith(b"\x89PNG")


def test_a_failed_save_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fig = new_figure()
    pdf, png = save_figure(fig, tmp_path / "figure")
    before = pdf.read_bytes(), png.read_bytes()

    def fail(*args: object, **kwargs: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(fig, "savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        save_figure(fig, tmp_path / "figure")
    assert (pdf.read_bytes(), png.read_bytes()) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["figure.pdf", "figure.png"]


def test_labels_of_the_block_diagram_do_not_overlap() -> None:
    fig = block_diagram.draw()
    fig.draw_without_rendering()
    labels = [label for label in fig.axes[0].texts if label.get_text()]
    boxes = [label.get_window_extent() for label in labels]
    overlaps = [
        (a.get_text(), b.get_text())
        for i, a in enumerate(labels)
        for j, b in enumerate(labels[:i])
        if boxes[i].overlaps(boxes[j])
    ]
    assert not overlaps
    page = fig.bbox
    assert all(page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1 for box in boxes)


def test_block_diagram_command(tmp_path: Path) -> None:
    assert block_diagram.main(["--out", str(tmp_path)]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["block_diagram.pdf", "block_diagram.png"]
