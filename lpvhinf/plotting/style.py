"""One look for every figure: palette, type sizes, widths, and files written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal

import matplotlib as mpl
from cycler import cycler
from matplotlib.figure import Figure

from lpvhinf.checks import positive
from lpvhinf.errors import DomainError
from lpvhinf.storage import atomic

# Okabe and Ito's palette: told apart by readers with any common colour vision, and in grey print.
BLACK: Final = "#000000"
ORANGE: Final = "#E69F00"
SKY: Final = "#56B4E9"
GREEN: Final = "#009E73"
YELLOW: Final = "#F0E442"
BLUE: Final = "#0072B2"
VERMILION: Final = "#D55E00"
PURPLE: Final = "#CC79A7"
GREY: Final = "#7F7F7F"
RED: Final = "#C8102E"  # for bounds only, which are dotted: red in the paper, and told apart by the dots
PALETTE: Final = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)

# The same thing has the same colour in every figure.
ROLES: Final = {
    "rigid-body": BLACK,
    "output-observer": BLUE,
    "error-observer": GREEN,
    "shaping": RED,
    "tuned": ORANGE,
}

# Widths of a conference paper on US letter, in inches.
WIDTHS: Final = {"one": 3.4, "two": 7.1}

RC: Final[dict[Any, Any]] = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "axes.grid": True,
    "grid.linewidth": 0.3,
    "grid.color": "#D0D0D0",
    "axes.axisbelow": True,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "axes.prop_cycle": cycler(color=PALETTE),
    "image.cmap": "viridis",
    "figure.constrained_layout.use": True,
    "figure.dpi": 120.0,
    "savefig.dpi": 300.0,
    "pdf.fonttype": 42,  # TrueType, as publishers ask
    "svg.hashsalt": "lpvhinf",
}


@contextmanager
def style(**changes: Any) -> Iterator[None]:
    """Draw in the house's style inside a `with` block; settings outside stay as they were.

    Parameters
    ----------
    **changes
        Further entries of `matplotlib.rcParams`, with `_` for `.` in their names: ``axes_grid=False``.

    Examples
    --------
    >>> from lpvhinf.plotting.style import new_figure, style
    >>> with style(axes_grid=False):
    ...     axes = new_figure(width="one").subplots()
    """
    known: dict[str, Any] = {name.replace(".", "_"): name for name in mpl.rcParams}
    for name in changes:
        if name not in known:
            raise DomainError(
                f"style has no setting {name!r}. Take a name of matplotlib.rcParams, with _ for each dot."
            )
    with mpl.rc_context(RC | {known[name]: value for name, value in changes.items()}):
        yield


def new_figure(*, width: Literal["one", "two"] = "one", ratio: float = 0.62, **options: Any) -> Figure:
    """An empty figure, `width` columns wide and `ratio` times as high; no window is opened.

    Parameters
    ----------
    width : {"one", "two"}
        Columns of a two-column page.
    ratio : float
        Height over width.
    **options
        Passed to `matplotlib.figure.Figure`.

    Raises
    ------
    DomainError
        If `width` is unknown or `ratio` is not above zero.
    """
    if width not in WIDTHS:
        raise DomainError(f"width is {width!r}, wanted one of {', '.join(sorted(WIDTHS))}.")
    inches = WIDTHS[width]
    return Figure(figsize=(inches, inches * positive("ratio", ratio)), **options)


def save_figure(fig: Figure, path: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Write `fig` as PDF and PNG; a file appears complete or stays as it was.

    The files carry no date and no version, so that the same figure gives the same bytes.

    Parameters
    ----------
    fig : matplotlib.figure.Figure
    path : path
        Where to write; an ending .pdf or .png is replaced by each of the two, its folder is made if need be.

    Returns
    -------
    tuple of Path
        The PDF and the PNG.
    """
    target = Path(path)
    stem = target.with_suffix("") if target.suffix in {".pdf", ".png"} else target
    pdf, png = stem.with_name(stem.name + ".pdf"), stem.with_name(stem.name + ".png")
    no_date: dict[str, Any] = {"CreationDate": None, "Producer": None, "Creator": None}
    with mpl.rc_context({key: RC[key] for key in ("pdf.fonttype", "savefig.dpi")}):
        with atomic(pdf) as partial:
            fig.savefig(partial, format="pdf", metadata=no_date)
        with atomic(png) as partial:
            fig.savefig(partial, format="png", metadata={"Software": None})
    return pdf, png
