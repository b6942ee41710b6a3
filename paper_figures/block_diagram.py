"""Block diagram of the output-based modal observer loop as a six-block generalized plant.

The interconnection behind the norm that is minimised (Broens, Butler, Toth, arXiv 2209.06554, the
structured co-design of the output-based modal observer). Three details decide the closed loop:

* w1 is added to y after the point where the observer measures y;
* w2 is added to u_RB before the branch to plant and observer: the observer knows it;
* w3 is added to u_FM after the branch to the observer: the observer does not know it.

Run ``python -m paper_figures.block_diagram --out docs/images``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyArrowPatch, FancyBboxPatch, Rectangle

from lpvhinf.plotting.style import BLACK, BLUE, GREY, ORANGE, VERMILION, new_figure, save_figure, style

TUNED = "#F8DCA0"  # a tint of the palette's orange that stays light in grey print
FILTER = "#EEF2F5"
WIRE = 0.9
Point = tuple[float, float]


class Canvas:
    """Blocks, junctions and wires on axes whose unit is a fifth of an inch."""

    def __init__(self, ax: Axes) -> None:
        self.ax = ax

    def block(self, centre: Point, size: Point, text: str = "", *, fill: str = "white", edge: str = BLACK) -> None:
        """A rectangular block, with its name in the middle."""
        (x, y), (width, height) = centre, size
        corner = (x - width / 2, y - height / 2)
        self.ax.add_patch(Rectangle(corner, width, height, facecolor=fill, edgecolor=edge, lw=1.0, zorder=3))
        self.text(centre, text, size=10)

    def chip(self, centre: Point, size: Point, text: str) -> None:
        """A tuned parameter inside a block."""
        (x, y), (width, height) = centre, size
        corner = (x - width / 2, y - height / 2)
        box = FancyBboxPatch(
            corner, width, height, boxstyle="round,pad=0,rounding_size=0.3", fc=TUNED, ec=ORANGE, lw=0.9, zorder=4
        )
        self.ax.add_patch(box)
        self.text(centre, text, size=10)

    def junction(self, centre: Point, radius: float = 0.42) -> None:
        """A circle where signals are added."""
        self.ax.add_patch(Circle(centre, radius, facecolor="white", edgecolor=BLACK, lw=0.9, zorder=3))

    def dot(self, centre: Point) -> None:
        """A branch of a wire."""
        self.ax.add_patch(Circle(centre, 0.13, facecolor=BLACK, edgecolor="none", zorder=4))

    def wire(self, *points: Point, colour: str = BLACK, arrow: bool = True) -> None:
        """A wire through `points`, with an arrow head at the last one."""
        start, end = points[:-1], points[-2:]
        if len(points) > 2:
            xs, ys = zip(*start, strict=True)
            self.ax.plot(xs, ys, color=colour, lw=WIRE, solid_joinstyle="miter", solid_capstyle="butt", zorder=2)
        head = "-|>,head_length=4.2,head_width=1.7" if arrow else "-"
        arrow_patch = FancyArrowPatch(
            *end, arrowstyle=head, color=colour, lw=WIRE, shrinkA=0, shrinkB=0, joinstyle="miter", zorder=2
        )
        self.ax.add_patch(arrow_patch)

    def hop(self, start: Point, end: Point, crossing: float, *, colour: str = BLACK) -> None:
        """A vertical wire that hops over a horizontal one at height `crossing`."""
        radius, x = 0.34, start[0]
        self.wire(start, (x, crossing + radius), colour=colour, arrow=False)
        self.ax.add_patch(Arc((x, crossing), 2 * radius, 2 * radius, theta1=-90, theta2=90, color=colour, lw=WIRE))
        self.wire((x, crossing - radius), end, colour=colour)

    def text(self, at: Point, text: str, *, size: float = 9, colour: str = BLACK, ha: str = "center") -> None:
        """A label, centred in height."""
        self.ax.text(*at, text, fontsize=size, color=colour, ha=ha, va="center", zorder=5)


def draw() -> Figure:
    """The diagram as a figure, two columns wide."""
    with style(axes_grid=False):
        fig = new_figure(width="two", ratio=20.4 / 35.5, layout="none")
        ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
        ax.set_axis_off()
        ax.set_xlim(-0.2, 35.3)
        ax.set_ylim(-9.1, 11.3)
        canvas = Canvas(ax)
        _weights(canvas)
        _rigid_body_loop(canvas)
        _equivalent_plant(canvas)
        _legend(canvas)
    return fig


MAIN, FLEX, TOP, RETURN = 4.0, 0.9, 8.1, -8.5  # heights: u_RB, u_FM, the filters, the feedback
SUM_E, SUM_2, SUM_3, SUM_1 = 2.3, 12.2, 23.6, 32.9  # where e, w2, w3 and w1 are added
TAP_E, TAP_U, TAP_1, TAP_F, TAP_Y = 3.9, 9.2, 14.5, 22.2, 30.0  # branches of e, u_RB, u_RB + w2, u_FM and y
RADIUS = 0.42


def _weights(canvas: Canvas) -> None:
    """The five shaping filters in one row, disturbances downwards and performance channels upwards."""
    size = (2.5, 1.9)
    low, high, label = TOP - size[1] / 2, TOP + size[1] / 2, 10.6
    for x, name in ((TAP_E, "1"), (TAP_U, "2")):
        canvas.block((x, TOP), size, rf"$W_{{\mathrm{{z}}_{name}}}$", fill=FILTER)
        canvas.wire((x, high), (x, label - 0.5), colour=VERMILION)
        canvas.text((x, label), rf"$\tilde z_{name}$", size=11, colour=VERMILION)
    for x, name in ((SUM_2, "2"), (SUM_3, "3"), (SUM_1, "1")):
        canvas.block((x, TOP), size, rf"$W_{{\mathrm{{w}}_{name}}}$", fill=FILTER)
        canvas.wire((x, label - 0.5), (x, high), colour=BLUE)
        canvas.text((x, label), rf"$\tilde w_{name}$", size=11, colour=BLUE)
    canvas.dot((TAP_E, MAIN))
    canvas.wire((TAP_E, MAIN), (TAP_E, low))
    canvas.dot((TAP_U, MAIN))
    canvas.wire((TAP_U, MAIN), (TAP_U, low))
    canvas.wire((SUM_2, low), (SUM_2, MAIN + RADIUS))
    canvas.hop((SUM_3, low), (SUM_3, FLEX + RADIUS), MAIN)
    canvas.wire((SUM_1, low), (SUM_1, MAIN + RADIUS))


def _rigid_body_loop(canvas: Canvas) -> None:
    """Error, rigid-body controller, and the way back of the output."""
    canvas.junction((SUM_E, MAIN))
    canvas.junction((SUM_2, MAIN))
    canvas.junction((SUM_1, MAIN))
    canvas.text((0.15, MAIN), r"$r$", size=10)
    canvas.wire((0.5, MAIN), (SUM_E - RADIUS, MAIN))
    canvas.text((SUM_E - 0.75, MAIN + 0.5), "$+$", size=8)
    canvas.text((SUM_E + 0.5, MAIN - 0.85), "$-$", size=8)
    canvas.block((6.3, MAIN), (2.9, 2.2), r"$K_{\mathrm{RB}}$", fill=TUNED, edge=ORANGE)
    canvas.wire((SUM_E + RADIUS, MAIN), (4.85, MAIN))
    canvas.text((3.3, MAIN + 0.55), "$e$", size=10)
    canvas.wire((7.75, MAIN), (SUM_2 - RADIUS, MAIN))
    canvas.text((8.45, MAIN - 0.7), r"$u_{\mathrm{RB}}$")
    canvas.wire((SUM_1 + RADIUS, MAIN), (34.7, MAIN), (34.7, RETURN), (SUM_E, RETURN), (SUM_E, MAIN - RADIUS))


def _equivalent_plant(canvas: Canvas) -> None:
    """Plant, observer and flexible-mode controller, as one plant in the dashed frame."""
    left, right, bottom, top = 13.4, 31.1, -7.3, 6.0
    frame = Rectangle(
        (left, bottom), right - left, top - bottom, facecolor="none", edgecolor=GREY, lw=1.0, ls=(0, (5, 3)), zorder=1
    )
    canvas.ax.add_patch(frame)
    canvas.text((left + 0.35, top - 0.75), r"$G_\Delta(p)$", size=11, colour="#555555", ha="left")

    # plant
    canvas.block((27.2, (MAIN + FLEX) / 2), (3.6, 5.0))
    canvas.text((27.2, 2.45), r"$\tilde{G}(p)$", size=11)
    canvas.wire((SUM_2 + RADIUS, MAIN), (25.4, MAIN))
    canvas.wire((SUM_3 + RADIUS, FLEX), (25.4, FLEX))
    canvas.junction((SUM_3, FLEX))
    canvas.wire((29.0, MAIN), (SUM_1 - RADIUS, MAIN))
    canvas.text((29.6, MAIN + 0.5), "$y$", size=10)

    # observer
    canvas.block((25.4, -4.2), (7.2, 3.8))
    canvas.text((25.4, -3.35), r"observer $O(p)$", size=10)
    canvas.chip((25.4, -4.95), (1.9, 1.15), "$L$")
    canvas.dot((TAP_1, MAIN))
    canvas.wire((TAP_1, MAIN), (TAP_1, -5.5), (21.8, -5.5))
    canvas.dot((TAP_F, FLEX))
    canvas.wire((TAP_F, FLEX), (TAP_F, -2.3))
    canvas.dot((TAP_Y, MAIN))
    canvas.wire((TAP_Y, MAIN), (TAP_Y, -4.2), (29.0, -4.2))

    # flexible-mode controller
    canvas.block((18.15, -3.1), (4.7, 3.0))
    canvas.text((18.15, -2.45), r"$-K_{\mathrm{FM}}$", size=10)
    canvas.chip((16.65, -3.8), (1.1, 1.0), r"$\xi_i$")
    canvas.text((17.4, -3.8), r"$\times$ band-pass", size=8, ha="left")
    canvas.wire((21.8, -3.1), (20.5, -3.1))
    canvas.text((21.2, -2.4), r"$\hat{\dot\eta}$", size=10)
    canvas.wire((15.8, -3.1), (15.2, -3.1), (15.2, FLEX), (SUM_3 - RADIUS, FLEX))
    canvas.text((17.0, FLEX + 0.55), r"$u_{\mathrm{FM}}$")


def _legend(canvas: Canvas) -> None:
    """What the colours mean."""
    canvas.chip((3.4, -6.0), (1.1, 0.8), "")
    canvas.text((4.3, -6.0), "tuned", size=8, ha="left")
    canvas.block((3.4, -7.2), (1.1, 0.8), fill=FILTER)
    canvas.text((4.3, -7.2), "shaping filter", size=8, ha="left")


def main(argv: Sequence[str] | None = None) -> int:
    """Write block_diagram.pdf and block_diagram.png."""
    parser = argparse.ArgumentParser(prog="python -m paper_figures.block_diagram", description=draw.__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/images"), help="folder to write to")
    save_figure(draw(), parser.parse_args(argv).out / "block_diagram")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
