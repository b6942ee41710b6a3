"""What a run should remember: versions, machine, seed, wall time."""

from __future__ import annotations

import os
import platform
import time
from importlib.metadata import version
from typing import Any

PACKAGES = ("lpvhinf", "numpy", "scipy", "control", "slycot", "piqp", "clarabel", "magpylib", "matplotlib")


def run_record(*, seed: int, began: float) -> dict[str, Any]:
    """For run.json."""
    return {
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "machine": platform.machine(),
        "cpus": os.cpu_count(),
        "seed": seed,
        "wall_time_s": time.time() - began,
        "finished": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime()),
    }
