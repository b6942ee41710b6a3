"""Finished designs of other studies as controlled plants, from their results folders alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.errors import StorageError
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.robustness import ControlledPlant
from lpvhinf.shaping import Scaling
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import read_arrays, read_json
from studies.codesign_folder import DESIGN, finished


@dataclass(frozen=True, kw_only=True)
class StoredDesign:
    """A finished design.

    Attributes
    ----------
    name : str
        "study/design".
    folder : Path
    summary : dict
        Its figures.
    settings : dict
        The settings of its study.
    """

    name: str
    folder: Path
    summary: dict[str, Any]
    settings: dict[str, Any]

    @property
    def fingerprint(self) -> str:
        """Key of everything that the design depends on."""
        return str(self.summary["fingerprint"])

    def subject(self) -> ControlledPlant:
        """The design's controller, with the plant that it was made for."""
        plant = decoupled_plant(
            int(self.settings["n_plant_modes"]),
            str(self.settings["magnetics"]),
            int(self.summary.get("n_flex", self.settings["n_flex"])),
            int(self.settings["degree"]),
            str(self.summary.get("input_decoupling", "extended")),
            str(self.summary.get("sensing", "all")),
        )
        stored = read_arrays(self.folder / "design.npz", DESIGN)
        names = ("output", "input", "state")
        scaling = Scaling(f_bw=stored["f_bw"], **{name: stored[f"scaling_{name}"] for name in names})
        return ControlledPlant(
            plant=plant, controller=LPVStateSpace.load(self.folder / "controller.npz"), scaling=scaling
        )


def find(results: Path, name: str) -> StoredDesign | None:
    """The design "study/design" below the folder of all results; None where it is not finished.

    A folder that does not belong to the settings of its study counts as not finished.
    """
    study, _, design = name.partition("/")
    folder = results / study / "designs" / design
    try:
        settings, key = (
            read_json(results / study / "settings.json"),
            read_json(results / study / "designs.json")[design],
        )
        if not finished(folder, key):
            return None
        summary = read_json(folder / "summary.json")
    except (StorageError, KeyError):
        return None
    return StoredDesign(name=name, folder=folder, summary=summary, settings=settings)


@lru_cache(maxsize=2)
def decoupled_plant(
    n_plant_modes: int, magnetics: str, n_flex: int, degree: int, input_decoupling: str, sensing: str
) -> DecoupledPlant:
    """The plant of several designs, made once."""
    machine = benchmark(n_flex=n_plant_modes, magnetics=magnetics)
    return decouple(machine, n_flex=n_flex, input_decoupling=input_decoupling, sensing=sensing, degree=degree)
