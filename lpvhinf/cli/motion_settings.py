"""Settings of the command `simulate`: tables of a TOML file, into a set-point and a loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lpvhinf.checks import Array, positive, whole_number
from lpvhinf.cli.settings_file import only, take_table
from lpvhinf.errors import DomainError
from lpvhinf.simulation import MotionLimits, Trajectory, point_to_point, scan

KINDS = ("scan", "point-to-point")
PLACES = ("sensors", "point-of-control")
TABLES: dict[str, dict[str, Any]] = {
    "trajectory": {
        "kind": "scan", "start": None, "end": None, "axis": None, "length": None, "velocity": 0.2, "lines": 1,
        "step": None, "settle_time": 0.02,
    },
    "limits": {"velocity": 1.0, "acceleration": 5.0, "jerk": 500.0, "snap": 1e5},
    "loop": {
        "period": 1e-4, "delay": 1.5e-4, "settle": 0.05, "feedforward": "rigid-body", "noise": 0.0,
        "quantisation": 0.0, "current_limit": None, "error_bound": 1e-2, "seed": 0,
    },
    "disturbance": {"floor_velocity": 0.0, "floor_band": [2.0, 100.0]},
    "measures": {"width": 0.02, "tolerance": 1e-7, "at": "sensors"},
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class MotionSettings:
    """Checked settings, a dictionary for each table of the file."""

    trajectory: dict[str, Any]
    limits: dict[str, Any]
    loop: dict[str, Any]
    disturbance: dict[str, Any]
    measures: dict[str, Any]

    @classmethod
    def read(cls, settings: dict[str, Any]) -> MotionSettings:
        """From the content of a TOML file; what is not there has its default.

        Raises
        ------
        DomainError
            If a table or a setting is unknown, or a word is none of those known.
        """
        rest = dict(settings)
        tables = {name: defaults | take_table(rest, name, defaults) for name, defaults in TABLES.items()}
        only(rest, "simulate", TABLES)
        for table, name, words in (("trajectory", "kind", KINDS), ("measures", "at", PLACES)):
            if tables[table][name] not in words:
                raise DomainError(f"{name} is {tables[table][name]!r}, wanted one of {', '.join(words)}.")
        whole_number("seed", tables["loop"]["seed"], 0)
        for name in ("width", "tolerance"):
            positive(name, tables["measures"][name])
        return cls(**tables)


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A set-point, and where its error counts.

    Attributes
    ----------
    trajectory : Trajectory
    windows : (lines, 2) [s]
        Lines of a scan; of a move the rest after it, which is empty without one.
    scanning : bool
    """

    trajectory: Trajectory
    windows: Array
    scanning: bool


def planned(settings: MotionSettings, box: Array, n_axes: int) -> Path:
    """The set-point of the settings, checked against P.

    Where the file gives no place, it is a scan over half of P along its last coordinate, through the centre.

    Raises
    ------
    DomainError, DimensionError
        If the set-point cannot be planned, or leaves P.
    """
    wanted, period = settings.trajectory, settings.loop["period"]
    limits = MotionLimits(**settings.limits)
    middle, width = np.mean(box, axis=1), box[:, 1] - box[:, 0]
    start = np.zeros(n_axes)
    start[: len(box)] = middle
    if wanted["kind"] == "point-to-point":
        end = start.copy()
        end[: len(box)] += 0.25 * width
        first, last = (default if wanted[n] is None else wanted[n] for n, default in (("start", start), ("end", end)))
        move = point_to_point(first, last, limits, period=period, box=box)
        stop = float(move.knots[-1])
        return Path(trajectory=move, windows=np.array([[stop, stop + settings.loop["settle"]]]), scanning=False)
    axis = len(box) - 1 if wanted["axis"] is None else whole_number("axis", wanted["axis"], 0)
    length = 0.5 * width[min(axis, len(box) - 1)] if wanted["length"] is None else wanted["length"]
    if wanted["start"] is None and axis < len(box):
        start[axis] -= 0.5 * length
    made = scan(
        start if wanted["start"] is None else wanted["start"],
        axis=axis,
        length=length,
        velocity=wanted["velocity"],
        limits=limits,
        lines=whole_number("lines", wanted["lines"], 1),
        step=wanted["step"],
        settle_time=wanted["settle_time"],
        period=period,
        box=box,
    )
    return Path(trajectory=made.trajectory, windows=made.windows, scanning=True)
