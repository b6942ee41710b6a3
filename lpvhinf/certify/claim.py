"""What is claimed, and the three things a claim can turn out to be."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpvhinf.certify.system import STABILITY
from lpvhinf.checks import Array
from lpvhinf.storage import write_arrays

KIND = "lpvhinf.Certificate"
FORMAT = 1


@dataclass(frozen=True, eq=False, kw_only=True)
class Claim:
    """A claim about a system for every p in a box.

    Attributes
    ----------
    property : "stability" or "l2-gain"
    kind : "frozen", "quadratic" or "rate"
    box : (n_p, 2)
    decay : [1/s]
    gamma : bound of the L2 gain, or None
    rate : (n_p, 2) lowest and highest dp/dt, or None
    remainder : "none", "bounded" or "sampled"
        Whether the matrices may deviate from the polynomials, and whether the size of that is proved.
    """

    property: str
    kind: str
    box: Array
    decay: float = 0.0
    gamma: float | None = None
    rate: Array | None = None
    remainder: str = "none"

    def __str__(self) -> str:
        where = " x ".join(f"[{low:g}, {high:g}]" for low, high in self.box.tolist())
        if self.property == STABILITY:
            what = "exponential stability" if self.kind != "frozen" else "all eigenvalues"
            what += f" with decay rate above {self.decay:g} 1/s" if self.kind != "frozen" else ""
            what += f" have real part below {-self.decay + 0.0:g} 1/s" if self.kind == "frozen" else ""
        else:
            what = f"stability and L2 gain below {self.gamma:g}"
        how = {"frozen": "at every frozen p", "quadratic": "for arbitrarily fast p(t)", "rate": "for p(t) with dp/dt"}
        text = f"{what} {how[self.kind]}"
        if self.rate is not None:
            text += " in " + " x ".join(f"[{low:g}, {high:g}]" for low, high in self.rate.tolist())
        text += f", p in {where}"
        return text + ("; conditional on the sampled remainder" if self.remainder == "sampled" else "")

    def header(self) -> dict[str, Any]:
        """The claim as it stands in the file's header; the box is an array of its own."""
        return {
            "property": self.property,
            "kind": self.kind,
            "decay": self.decay,
            "gamma": self.gamma,
            "rate": None if self.rate is None else self.rate.tolist(),
            "remainder": self.remainder,
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class Certificate:
    """A claim that is proved for every p in its box, round-off included.

    Attributes
    ----------
    claim : Claim
    n_cells : int
        Cells into which the box was cut.
    margin : float
        Proved lower bound, over all cells, of the smallest eigenvalue of the scaled Lyapunov inequality, which is 1
        at a cell's centre by the scaling.
    cells : (n_cells, n_p, 2)
        Their bounds in p.
    margins : (n_cells,)
        Margin of every cell.
    cpu_time : [s] of this process
    """

    claim: Claim
    n_cells: int
    margin: float
    cells: Array
    margins: Array
    cpu_time: float
    header: dict[str, Any] = field(repr=False)
    members: dict[str, NDArray[Any]] = field(repr=False)

    @property
    def box(self) -> Array:
        """The box, (n_p, 2)."""
        return self.claim.box

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the certificate (docs/certificate_format.md), atomically."""
        text = json.dumps(self.header, sort_keys=True, allow_nan=False)
        members = {"header": np.frombuffer(text.encode("utf-8"), dtype=np.uint8), **self.members}
        members["seal"] = seal({"__kind__": np.array(KIND), "__format__": np.array(FORMAT), **members})
        write_arrays(path, KIND, members)


def seal(members: dict[str, NDArray[Any]]) -> NDArray[np.uint8]:
    """SHA-256 of all members by name, type, shape and bytes."""
    digest = hashlib.sha256()
    for name in sorted(members):
        array = members[name]
        shape = ",".join(str(k) for k in array.shape)
        digest.update(f"{name}\0{array.dtype.str}\0{shape}\0".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)


@dataclass(frozen=True, eq=False, kw_only=True)
class Refutation:
    """A claim that is proved to be false.

    Attributes
    ----------
    claim : Claim
    evidence : object
        An `UnstablePosition`, a `LargeGain` or `Multipliers`: it says which p, and why.
    """

    claim: Claim
    evidence: Any

    @property
    def box(self) -> Array:
        """The box, (n_p, 2)."""
        return self.claim.box


@dataclass(frozen=True, eq=False, kw_only=True)
class Undecided:
    """A claim that is neither proved nor refuted.

    Attributes
    ----------
    claim : Claim
    reason : why the search ended
    remaining : (N, n_p, 2)
        Bounds in p of the cells that are not proved.
    proved : (M, n_p, 2)
        Bounds in p of the proved cells.
    proved_share : share of the box's volume that is proved
    cpu_time : [s]
    """

    claim: Claim
    reason: str
    remaining: Array
    proved: Array
    proved_share: float
    cpu_time: float

    @property
    def box(self) -> Array:
        """The box, (n_p, 2)."""
        return self.claim.box
