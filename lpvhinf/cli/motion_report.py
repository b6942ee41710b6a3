"""Measures of a simulated motion, and the few lines that say them."""

from __future__ import annotations

from typing import Any

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.cli.motion_settings import MotionSettings
from lpvhinf.simulation import Motion, rms_and_peak, settling_time, window_errors
from lpvhinf.stored_design import StoredDesign

AXES = ("x", "y", "z", "rx", "ry", "rz")


def measures_of(settings: MotionSettings, motion: Motion, error: Array, windows: Array) -> dict[str, Any]:
    """MA, MSD, peak and rms of the error (N, n) in the windows, settling time, effort; of what was not stopped."""
    rms, peak = rms_and_peak(motion.feedback)
    out: dict[str, Any] = {
        "status": motion.status,
        "stopped": motion.stopped,
        "samples": len(motion.times),
        "peak_anywhere": np.max(np.abs(error), axis=0),
        "feedback_rms": rms,
        "feedback_peak": peak,
        "peak_current": float(np.max(motion.peak_current)),
        "saturated_samples": int(np.count_nonzero(motion.saturated)),
    }
    if motion.stopped is not None:
        return out
    lengths = windows[:, 1] - windows[:, 0]
    period = settings.loop["period"]
    inside = windows[lengths > 1.5 * period].copy()
    if len(inside):  # of a move without a rest nothing is left
        inside[:, 1] = np.minimum(inside[:, 1], motion.times[-1])
        width = min(settings.measures["width"], float(np.min(inside[:, 1] - inside[:, 0])))
        found = window_errors(motion.times, error, inside, width)
        out |= {
            "width": width, "MA": found.moving_average, "MSD": found.moving_deviation, "peak": found.peak,
            "rms": found.rms,
        }  # fmt: skip
        begin, end = inside[0]
        if settings.trajectory["kind"] == "scan":
            begin -= settings.trajectory["settle_time"]
        part = (motion.times >= begin - 0.5 * period) & (motion.times <= end + 0.5 * period)
        out["settling"] = settling_time(
            motion.times[part], error[part], settings.measures["tolerance"], after=float(motion.times[part][0])
        )
    return out


def report_lines(design: StoredDesign, settings: MotionSettings, motion: Motion, measures: dict[str, Any]) -> list[str]:
    """The report as Markdown."""
    n = len(measures["peak_anywhere"])
    names = AXES if n == len(AXES) else tuple(f"axis {i + 1}" for i in range(n))
    kind = settings.trajectory["kind"]
    lines = [
        f"{design.name} ({design.architecture}), {kind}: {len(motion.times)} samples at "
        f"{1e-3 / settings.loop['period']:g} kHz, feedforward {settings.loop['feedforward']}, error at the "
        f"{settings.measures['at'].replace('-', ' ')}",
        f"{measures['status']}",
    ]
    if "MA" not in measures:
        return lines
    lines += [
        "",
        f"| {'lines of the scan' if kind == 'scan' else 'rest after the move'} | MA | MSD | peak | rms | settling ms |",
        "|---|---|---|---|---|---|",
    ]
    for i, name in enumerate(names):
        unit, scale = ("nrad", 1e9) if name.startswith("r") else ("nm", 1e9)
        cells = [f"{scale * measures[key][i]:.3g}" for key in ("MA", "MSD", "peak", "rms")]
        settling = measures["settling"][i]
        cells.append(f"{1e3 * settling:.1f}" if np.isfinite(settling) else "never")
        lines.append(f"| {name} {unit} | " + " | ".join(cells) + " |")
    lines += ["", f"MA and MSD over {1e3 * measures['width']:g} ms; settling to {settings.measures['tolerance']:g}."]
    if measures["peak_current"] > 0.0:
        lines.append(f"Peak current {measures['peak_current']:.3g} A.")
    return lines
