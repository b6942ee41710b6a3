"""A design as a folder holds it: what certificates, simulations, exports and the viewer start from."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array, read_only
from lpvhinf.errors import StorageError
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.storage import read_arrays, read_json

KIND = "lpvhinf.Design"  # of design.npz, as lpvhinf.codesign writes it
MACHINE = "machine.json"
STUDY = "settings.json"


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredDesign:
    """The folder of one design, as `Design.save` writes it; systems are read when they are asked for.

    Attributes
    ----------
    folder : Path
    arrays : dict
        Of design.npz: parameters, positions, norms, scalings, gains.
    """

    folder: Path
    arrays: dict[str, NDArray[Any]]

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> StoredDesign:
        """The design in a folder.

        Raises
        ------
        StorageError
            If the folder holds no finished design.
        """
        folder = Path(path)
        if not (folder / "design.npz").is_file():
            raise StorageError(
                f"{folder} holds no finished design: there is no design.npz. Give a folder that `lpvhinf design`, "
                "Design.save or a study has written."
            )
        return cls(folder=folder, arrays=read_arrays(folder / "design.npz", KIND))

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.resolve().name

    @property
    def architecture(self) -> str:
        """The architecture: "rigid-body", "output-observer" or "error-observer"."""
        return str(self.arrays["architecture"])

    @property
    def gamma(self) -> float:
        """Largest exact norm of M at the design positions."""
        return float(np.max(self.arrays["gammas"]))

    @property
    def f_bw(self) -> Array:
        """Target bandwidths of the rigid axes (n_rb,) [Hz]."""
        return np.asarray(self.arrays["f_bw"])

    @cached_property
    def plant(self) -> LPVStateSpace:
        """The decoupled plant, polynomial in p."""
        return self.system("plant")

    @cached_property
    def controller(self) -> LPVStateSpace:
        """The controller from (e, y) to (u_RB, u_FM)."""
        return self.system("controller")

    @cached_property
    def closed_loop(self) -> LPVStateSpace:
        """The unweighted loop from (w1, w2, w3) to (e, u_RB, u_FM), physical units."""
        return self.system("closed_loop")

    @cached_property
    def performance_loop(self) -> LPVStateSpace:
        """The weighted loop from w to z."""
        return self.system("performance_loop")

    def system(self, name: str) -> LPVStateSpace:
        """One of the systems in the folder: plant, controller, closed_loop or performance_loop."""
        return LPVStateSpace.load(self.folder / f"{name}.npz")

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2) [m]."""
        return np.asarray(read_only(self.closed_loop.box))

    @cached_property
    def machine(self) -> dict[str, Any] | None:
        """How the plant was built, where the folder or the settings of its study say so; else None.

        Keys: "magnetics", "plant_modes", "n_flex", "actuation", "input_decoupling".
        """
        own = self.folder / MACHINE
        if own.is_file():
            return dict(read_json(own)["plant"])
        study = self.folder.resolve().parent.parent / STUDY
        if not study.is_file():
            return None
        known = read_json(study)
        if not isinstance(known, dict) or not {"magnetics", "n_plant_modes"} <= known.keys():
            return None
        summary = read_json(self.folder / "summary.json") if (self.folder / "summary.json").is_file() else {}
        return {
            "magnetics": known["magnetics"],
            "plant_modes": int(known["n_plant_modes"]),
            "n_flex": int(known.get("n_flex", 1)),
            "actuation": str(summary.get("actuation", "over")),
            "input_decoupling": str(summary.get("input_decoupling", "extended")),
        }


def designs_in(path: str | os.PathLike[str]) -> list[StoredDesign]:
    """The designs of a results folder: the folder's own, or the finished ones in its folder `designs`, by name.

    Raises
    ------
    StorageError
        If there is none.
    """
    folder = Path(path)
    if (folder / "design.npz").is_file():
        return [StoredDesign.open(folder)]
    # a study's folder, or a folder of designs side by side
    for parent in (folder / "designs", folder):
        found = sorted(file.parent for file in parent.glob("*/design.npz"))
        if found:
            return [StoredDesign.open(each) for each in found]
    raise StorageError(
        f"{folder} holds no finished design: no design.npz in it, in designs/* or in folders below it. Give a design's "
        "folder or a study's results folder."
    )
