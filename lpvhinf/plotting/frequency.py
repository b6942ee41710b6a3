"""Closed-loop magnitudes over all positions, against their bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lpvhinf.checks import Array
from lpvhinf.plotting.style import ROLES

TITLES = (
    (r"$S$", r"$S\,G_{\Delta,y u_1}$", r"$S\,G_{\Delta,y u_2}$"),
    (r"$K_{\mathrm{RB}}S$", r"$K_{\mathrm{RB}}S\,G_{\Delta,y u_1}$", r"$K_{\mathrm{RB}}S\,G_{\Delta,y u_2}$"),
)
TWO_BY_TWO_TITLES = (
    (r"$\tilde S\,G_{\Delta,y u_1}$", r"$\tilde S\,G_{\Delta,y u_2}$"),
    (r"$K_{\mathrm{RB}}\tilde S\,G_{\Delta,y u_1}$", r"$K_{\mathrm{RB}}\tilde S\,G_{\Delta,y u_2}$"),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockCurves:
    """The blocks of one design, as its results folder holds them.

    Attributes
    ----------
    label, role : str
        Text of the legend, and the key of its colour in `ROLES`.
    omega : (n_omega,) [rad/s]
    sigma : (N, 2, 3, n_omega) or (N, 2, 2, n_omega)
        Largest singular values at N positions.
    """

    label: str
    role: str
    omega: Array
    sigma: Array


def decibel(gain: Array) -> Array:
    """20 log10, of at least -400 dB."""
    return np.asarray(20.0 * np.log10(np.maximum(gain, 1e-20)))


def draw_blocks(
    figure: Figure,
    designs: list[BlockCurves],
    bounds: Array,
    omega: Array,
    *,
    titles: Sequence[Sequence[str]] = TITLES,
    every: bool = False,
) -> Any:
    """The blocks of M: the range over all positions shaded, the worst position of every block as a line.

    The worst position is the one that comes closest to the bound of the block, or exceeds it most.

    Parameters
    ----------
    designs : drawn in this order, the last on top
    bounds : (2, 3, n_omega) or (2, 2, n_omega)
        Inverse shaping filters, dotted red.
    omega : (n_omega,) [rad/s]
        Frequencies of the bounds.
    titles : the names of the blocks, as `bounds`
        `TITLES` of the six blocks, or `TWO_BY_TWO_TITLES`.
    every : bool
        Draw every position as a thin line in place of the range.
    """
    n_columns = bounds.shape[1]
    axes = figure.subplots(2, n_columns, sharex=True)
    for i in range(2):
        for j in range(n_columns):
            ax = axes[i, j]
            top = -np.inf
            for rank, design in enumerate(designs):
                hertz, color = design.omega / (2 * np.pi), ROLES[design.role]
                sigma = decibel(design.sigma[:, i, j])
                if every:
                    ax.plot(hertz, sigma.T, color=color, linewidth=0.35, alpha=0.35)
                else:
                    ax.fill_between(
                        hertz, np.min(sigma, axis=0), np.max(sigma, axis=0), color=color, alpha=0.22, linewidth=0
                    )
                bound = np.interp(np.log(design.omega), np.log(omega), decibel(bounds[i, j]))
                worst = int(np.argmax(np.max(sigma - bound, axis=1)))
                # the first one is drawn wider, so that it is seen below one that equals it
                width = 0.8 if rank else (1.1 if every else 1.6)
                ax.plot(hertz, sigma[worst], color=color, linewidth=width, label=design.label)
                top = max(top, float(np.max(sigma)))
            ax.plot(
                omega / (2 * np.pi),
                decibel(bounds[i, j]),
                color=ROLES["shaping"],
                linestyle=(0, (1, 1.2)),
                linewidth=1.2,
                label="inverse shaping filters",
            )
            ax.set_xscale("log")
            ax.set_title(titles[i][j], pad=3)
            ax.set_xlim(float(omega[0] / (2 * np.pi)), float(omega[-1] / (2 * np.pi)))
            ax.set_ylim(-70.0, 10.0 * np.ceil((top + 4.0) / 10.0))
            if i == 1:
                ax.set_xlabel("frequency [Hz]")
            if j == 0:
                ax.set_ylabel("magnitude [dB]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    order = [len(labels) - 1, *range(len(labels) - 1)]
    figure.legend(
        [handles[k] for k in order], [labels[k] for k in order], loc="outside upper center", ncols=len(labels)
    )
    return axes
