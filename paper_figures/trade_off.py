"""What damping costs the rigid-body loop: crossover and left column against the damping of the mode, both observers."""

from __future__ import annotations

from pathlib import Path

from lpvhinf.errors import StorageError
from lpvhinf.plotting.style import ROLES, new_figure, save_figure, style
from lpvhinf.storage import read_json
from studies.error_observer_trade import crossover, curve, damping, left, peak

NAME = "trade_off"
OBSERVERS = (("output-observer", "output-based", "s"), ("error-observer", "error-based", "o"))
X = (
    ("worst peak of the controlled mode [dB]", peak),
    ("least damping of the controlled mode [%]", lambda d: 100.0 * damping(d)),
)
Y = (("mean crossover [Hz]", crossover), (r"$\max_p\,\|M_{\mathrm{left}}\|_\infty$", left))


def make(results: Path, out: Path) -> list[Path]:
    """Draw the figure from the summaries in a results folder of the study error_observer."""
    names = read_json(results / "designs.json")
    designs = {name: read_json(results / "designs" / name / "summary.json") for name in names}
    curves = {role: curve(designs, role) for role, _, _ in OBSERVERS}
    if not any(curves.values()):
        raise StorageError(f"{results} has no stable observer design in the trade-off. Run the study again.")
    inactive = designs["inactive"]
    with style():
        figure = new_figure(width="two", ratio=0.6)
        axes = figure.subplots(2, 2, sharex="col", sharey="row")
        for column, (x_label, x) in enumerate(X):
            for row, (y_label, y) in enumerate(Y):
                ax = axes[row, column]
                alone = ax.axhline(y(inactive), color=ROLES["rigid-body"], linestyle=(0, (4, 2)), linewidth=0.9)
                handles, labels = [alone], [f"observer inactive, peak {peak(inactive):.1f} dB"]
                for role, label, marker in OBSERVERS:
                    # by epsilon, so that the line says in which order the designs were asked for
                    points = sorted(curves[role], key=lambda d: float(d["epsilon"]))
                    (line,) = ax.plot(
                        [x(d) for d in points], [y(d) for d in points], marker=marker, color=ROLES[role], markersize=4
                    )
                    handles.append(line)
                    labels.append(label)
                    for d in points:
                        # the two observers above and below their points, so that their labels keep apart
                        above = role == "error-observer"
                        ax.annotate(
                            f"{d['epsilon']:g}",
                            (x(d), y(d)),
                            textcoords="offset points",
                            xytext=(0, 5 if above else -10),
                            ha="center",
                            fontsize=6,
                            color=ROLES[role],
                        )
                ax.margins(x=0.08, y=0.18)
                if column == 0:
                    ax.set_ylabel(y_label)
                if row == 1:
                    ax.set_xlabel(x_label)
        axes[0, 0].invert_xaxis()  # more damping to the right in both columns
        figure.legend(handles, labels, loc="outside upper center", ncols=3, title=r"numbers at the points: $\epsilon$")
        return list(save_figure(figure, out / NAME))
