"""What the commands that start from a design's folder have in common."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import StorageError
from lpvhinf.plant.mmpa import MMPA, benchmark
from lpvhinf.progress import Progress
from lpvhinf.stored_design import StoredDesign


def add_design(command: argparse.ArgumentParser) -> None:
    """The argument DESIGN."""
    command.add_argument("design", type=Path, metavar="DESIGN", help="folder that `lpvhinf design` or a study wrote")


def machine_of(design: StoredDesign, progress: Progress) -> tuple[MMPA, DecoupledPlant]:
    """The benchmark that a stored design was made for, and its decoupling.

    Raises
    ------
    StorageError
        If the folder does not say how its plant was built, or the plant in it has other modes.
    """
    known = design.machine
    if known is None:
        raise StorageError(
            f"{design.folder} does not say of which machine its plant is: there is no machine.json. Leave out what "
            "needs the machine (currents, the point of control), or make the design with `lpvhinf design`."
        )
    machine = benchmark(n_flex=known["plant_modes"], magnetics=known["magnetics"], progress=progress)
    options: dict[str, Any] = {name: known[name] for name in ("n_flex", "actuation", "input_decoupling")}
    plant = decouple(machine, degree=0, **options)
    at = np.mean(design.box, axis=1)[None] + 0.1 * (design.box[:, 1] - design.box[:, 0])
    stored, wanted = design.plant.C.sample(at)[0][:, 0::2], plant.sample(at).C[0]
    if stored.shape != wanted.shape or np.max(np.abs(stored - wanted)) > 1e-2 * np.max(np.abs(wanted)):
        raise StorageError(f"the plant in {design.folder} is not that of its machine.json. Make the design again.")
    return machine, plant
