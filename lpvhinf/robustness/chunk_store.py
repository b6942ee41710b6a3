"""Outcomes on disk in chunks, each file whole or not there, so that an interrupted run goes on where it was."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.fitting import spread_points
from lpvhinf.robustness.controlled_plant import ControlledPlant
from lpvhinf.robustness.outcomes import Outcomes
from lpvhinf.robustness.uncertainty import Uncertainty
from lpvhinf.storage import make_folder, read_arrays, read_json, write_arrays, write_json

KIND = "lpvhinf.Outcomes"
N_CHECKED = 4  # positions whose gains stand for a plant and its controller
DIGITS = 8  # significant ones that count: the last ones depend on the processor


def fingerprint(subject: ControlledPlant, uncertainty: Uncertainty, seed: int) -> str:
    """A key of all that the outcomes depend on, but for their number."""
    plant, points = subject.plant, spread_points(subject.plant.box, N_CHECKED)
    gains = plant.sample(points)
    numbers = [plant.omega, plant.zeta, plant.box, gains.B, gains.C, gains.D, *subject.controller.sample(points)]
    numbers += [subject.scaling.output, subject.scaling.input, subject.scaling.f_bw]
    digest = hashlib.sha256(f"{uncertainty!r} {seed} {plant.n_flex} {plant.actuation}".encode())
    for values in numbers:
        size = float(np.max(np.abs(values), initial=0.0))
        rounded = np.round(values / (size or 1.0), DIGITS) + 0.0  # no negative zeros
        digest.update(f"{values.shape} {size:.{DIGITS}g}".encode() + rounded.tobytes())
    return digest.hexdigest()


@dataclass(frozen=True, kw_only=True)
class ChunkStore:
    """A folder of chunks of one run; make one with `open`."""

    folder: Path
    key: str

    @classmethod
    def open(cls, folder: Path, key: str) -> ChunkStore:
        """The store in a folder, which is made if it is not there.

        Raises
        ------
        StorageError
            If the folder belongs to another plant, controller, uncertainty or seed, or cannot be made.
        """
        head = make_folder(folder) / "monte_carlo.json"
        if head.exists():
            found = read_json(head)
            if not isinstance(found, dict) or found.get("key") != key:
                raise StorageError(
                    f"store {folder} holds outcomes of another plant, controller, uncertainty or seed. "
                    "Choose another folder, or delete this one."
                )
        else:
            write_json(head, {"key": key})
        return cls(folder=folder, key=key)

    def path(self, chunk: int) -> Path:
        """The file of a chunk."""
        return self.folder / f"chunk-{chunk:05d}.npz"

    def write(self, chunk: int, outcomes: Outcomes) -> None:
        """Store a chunk."""
        write_arrays(self.path(chunk), KIND, {**outcomes.arrays(), "key": np.array(self.key)})

    def read(self, chunk: int, length: int) -> Outcomes | None:
        """The first `length` outcomes of a chunk; None if it is not there, too short, damaged or another run's."""
        if not self.path(chunk).is_file():
            return None
        try:
            data: dict[str, Array] = read_arrays(self.path(chunk), KIND)
        except StorageError:
            return None  # it is computed once more
        if str(data.pop("key", "")) != self.key or len(data.get("abscissa", ())) < length:
            return None
        return Outcomes(**{name: values[:length] for name, values in data.items()})
