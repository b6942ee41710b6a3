"""The exact form of a polynomial system in a certificate, and its hash (docs/certificate_format.md, section 2)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpvhinf.checks import Array, read_only
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace import LPVStateSpace

STABILITY = "stability"
L2_GAIN = "l2-gain"


@dataclass(frozen=True, eq=False, kw_only=True)
class CanonicalMatrix:
    """A polynomial matrix without what does not change it.

    Attributes
    ----------
    shape : (k_1, ..., k_np, rows, cols)
    entries : (N,)
        Indices in the flattened matrix of the entries that are not zero for all p, increasing.
    coefficients : (k_1 ... k_np, N)
        Chebyshev coefficients of these entries.
    """

    shape: tuple[int, ...]
    entries: NDArray[np.int64]
    coefficients: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class CanonicalSystem:
    """What a claim speaks of: the matrices it needs, over the system's box.

    Attributes
    ----------
    box : (n_p, 2)
    matrices : dict
        "A" for stability; "A", "B", "C", "D" for an L2 gain.
    """

    box: Array
    matrices: dict[str, CanonicalMatrix]

    @property
    def n_p(self) -> int:
        """Number of scheduling coordinates."""
        return len(self.box)

    @property
    def n_x(self) -> int:
        """Number of states."""
        return self.matrices["A"].shape[-1]

    @property
    def hash(self) -> str:
        """SHA-256 of the canonical bytes, in hexadecimal."""
        digest = hashlib.sha256(b"lpvhinf.system 1\n")
        digest.update(np.array(self.n_p, dtype="<i8").tobytes())
        digest.update(np.ascontiguousarray(self.box, dtype="<f8").tobytes())
        for name in sorted(self.matrices):
            matrix = self.matrices[name]
            digest.update(name.encode("ascii"))
            digest.update(np.array(matrix.shape, dtype="<i8").tobytes())
            digest.update(np.array(len(matrix.entries), dtype="<i8").tobytes())
            digest.update(np.ascontiguousarray(matrix.entries, dtype="<i8").tobytes())
            digest.update(np.ascontiguousarray(matrix.coefficients, dtype="<f8").tobytes())
        return digest.hexdigest()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The members of the certificate's file that hold the system."""
        out: dict[str, NDArray[np.generic]] = {"system_box": np.asarray(self.box)}
        for name, matrix in self.matrices.items():
            out[f"{name}_shape"] = np.array(matrix.shape, dtype=np.int64)
            out[f"{name}_entries"] = np.asarray(matrix.entries, dtype=np.int64)
            out[f"{name}_coefficients"] = np.ascontiguousarray(matrix.coefficients)
        return out


def canonical_matrix(matrix: ChebyshevMatrix) -> CanonicalMatrix:
    """`matrix` with trailing zero degrees cut, zero entries left out and no negative zero."""
    c = matrix.trimmed(0.0).coefficients + 0.0  # adding zero turns a negative zero into zero
    flat = c.reshape(-1, c.shape[-2] * c.shape[-1])
    entries = np.flatnonzero(np.any(flat != 0.0, axis=0))
    return CanonicalMatrix(
        shape=tuple(int(k) for k in c.shape),
        entries=read_only(entries, np.int64),
        coefficients=read_only(flat[:, entries]),
    )


def canonical_system(system: LPVStateSpace, claimed: str) -> CanonicalSystem:
    """The canonical form of what a claim about `claimed` ("stability" or "l2-gain") needs of a system.

    Examples
    --------
    >>> G = LPVStateSpace.from_coefficients([[[-2.0]], [[1.0]], [[0.0]]], [[1.0]], [[1.0]], [[0.0]], box=[[-1, 1]])
    >>> canonical_system(G, "stability").matrices["A"].shape
    (2, 1, 1)
    """
    names = "A" if claimed == STABILITY else "ABCD"
    matrices = {name: canonical_matrix(getattr(system, name)) for name in names}
    return CanonicalSystem(box=system.box, matrices=matrices)
