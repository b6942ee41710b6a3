r"""The matrix K(p) of a claim, and its enclosures on cells (docs/certificate_format.md, section 4).

.. math:: K = A + \alpha I \quad\text{or}\quad
    K = \begin{bmatrix} A & B & 0 \\ 0 & -\tfrac{\gamma}{2} I & 0 \\ C & D & -\tfrac{\gamma}{2} I \end{bmatrix}
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpvhinf.certify.cells import Cell, Point
from lpvhinf.certify.enclosure import ChebyshevEntries, in_system_coordinates
from lpvhinf.certify.positive_definite import U
from lpvhinf.certify.system import CanonicalSystem
from lpvhinf.checks import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalLoop:
    """K on a cell.

    Attributes
    ----------
    terms : (n_terms, m, m)
        Coefficients of delta^a in the order of `multi_indices`.
    remainder : (m, m)
        Entrywise bound of everything else.
    """

    terms: Array
    remainder: Array


class LoopMatrix:
    """K(p) over the claim's box.

    Parameters
    ----------
    system : CanonicalSystem
    box : (n_p, 2)
        The claim's box, inside the system's.
    decay : alpha [1/s]
    gamma : bound of the L2 gain, or None for a claim of stability
    remainder : dict
        Entrywise bounds of what the polynomials leave out, by the matrix's letter.
    """

    def __init__(
        self,
        system: CanonicalSystem,
        box: Array,
        *,
        decay: float = 0.0,
        gamma: float | None = None,
        remainder: dict[str, Array] | None = None,
    ) -> None:
        self.system, self.box, self.decay, self.gamma = system, box, decay, gamma
        n = system.n_x
        n_u = system.matrices["B"].shape[-1] if gamma is not None else 0
        n_y = system.matrices["C"].shape[-2] if gamma is not None else 0
        self.n_x, self.n_u, self.n_y = n, n_u, n_y
        self.size = m = n + n_u + n_y
        corner = {"A": (0, 0), "B": (0, n), "C": (n + n_u, 0), "D": (n + n_u, n)}
        degree = tuple(np.max([matrix.shape[:-2] for matrix in system.matrices.values()], axis=0))
        self.constant = np.zeros((m, m))
        self.extra = np.zeros((m, m))
        rows, cols, blocks = [], [], []
        for name, matrix in system.matrices.items():
            top, left = corner[name]
            r, c = np.divmod(matrix.entries, max(matrix.shape[-1], 1))
            varying = np.any(matrix.coefficients[1:] != 0.0, axis=0)
            fixed = ~varying
            self.constant[top + r[fixed], left + c[fixed]] = matrix.coefficients[0, fixed]
            rows.append(top + r[varying])
            cols.append(left + c[varying])
            block = np.zeros((*degree, int(varying.sum())))
            block[tuple(slice(k) for k in matrix.shape[:-2])] = matrix.coefficients[:, varying].reshape(
                *matrix.shape[:-2], -1
            )
            blocks.append(block)
            if remainder is not None and name in remainder:
                height, width = remainder[name].shape
                self.extra[top : top + height, left : left + width] = remainder[name]
        self.rows, self.cols = np.concatenate(rows), np.concatenate(cols)
        self.entries = ChebyshevEntries(np.concatenate(blocks, axis=-1))
        diagonal = np.arange(m)
        if gamma is not None:
            self.constant[diagonal[n:], diagonal[n:]] -= 0.5 * gamma
        self.constant[diagonal[:n], diagonal[:n]] += decay
        # adding decay to a diagonal entry rounds
        self.extra[diagonal, diagonal] += 2.0 * U * np.abs(np.diag(self.constant)) * (1.0 if decay else 0.0)

    def local(self, cell: Cell | Point, degree: int) -> LocalLoop:
        """K on a cell, to total degree `degree`."""
        centre, radius = in_system_coordinates(cell, self.box, self.system.box)
        part = self.entries.local(centre, radius, degree)
        terms = np.zeros((len(part.terms), self.size, self.size))
        terms[:, self.rows, self.cols] = part.terms
        bound = self.extra.copy()
        bound[self.rows, self.cols] += part.remainder
        bound += 2.0 * U * np.abs(self.constant)  # the sum below rounds where an entry has both parts
        bound[self.rows, self.cols] += 2.0 * U * np.abs(part.terms[0])
        terms[0] += self.constant
        return LocalLoop(terms=terms, remainder=bound * (1.0 + 1e-12))
