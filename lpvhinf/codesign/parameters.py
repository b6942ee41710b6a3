"""How theta is laid out: the parameters of K_RB, L and xi one after another, each constant or a polynomial of p."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct import BlockDiagonal, ControllerStructure, Scheduled
from lpvhinf.hinfstruct.scheduled import PolynomialBasis
from lpvhinf.polynomial import ChebyshevMatrix


class ParameterLayout:
    r"""The tuned parts side by side, those that are scheduled with coefficients of polynomials as parameters.

    .. math:: \vartheta(p) = \sum_k \theta_k \phi_k(p)

    with Chebyshev polynomials up to a total degree over the box (`PolynomialBasis`). The first coefficients are the
    constant ones: a theta without schedule is one with all further coefficients zero.

    Parameters
    ----------
    parts : mapping of str to ControllerStructure
        In their order.
    schedule : mapping of str to int
        Degrees of the scheduled parts; names of parts that there are not are left out of account.
    box : (n_p, 2)

    Examples
    --------
    >>> from lpvhinf.hinfstruct import StaticGain
    >>> layout = ParameterLayout({"L": StaticGain(1, 1), "xi": StaticGain(1, 1)}, {"L": 1}, [[-1.0, 1.0]])
    >>> theta = np.array([2.0, 0.5, 3.0])
    >>> {name: value.tolist() for name, value in layout.frozen(theta, np.array([0.2])).items()}
    {'L': [2.1], 'xi': [3.0]}
    """

    def __init__(self, parts: Mapping[str, ControllerStructure], schedule: Mapping[str, int], box: Array) -> None:
        self.box = np.asarray(box, dtype=float)
        self.inner = dict(parts)
        self.basis = {name: PolynomialBasis(box, degree) for name, degree in schedule.items() if name in parts}
        self.parts: dict[str, ControllerStructure] = {
            name: Scheduled(part, self.basis[name]) if name in self.basis else part for name, part in parts.items()
        }
        blocks = list(self.parts.values())
        self.structure = blocks[0] if len(blocks) == 1 else BlockDiagonal(*blocks)

    @property
    def scheduled(self) -> bool:
        """Whether any part depends on p."""
        return bool(self.basis)

    @property
    def degrees(self) -> dict[str, int]:
        """Degrees of the scheduled parts."""
        return {name: basis.degree for name, basis in self.basis.items()}

    def coefficients(self, theta: Array) -> dict[str, Array]:
        """The parameters of every part, (number of functions, n_inner): one row where it is constant."""
        out, end = {}, 0
        for name, part in self.parts.items():
            out[name] = np.asarray(theta)[end : end + part.n_parameters].reshape(-1, self.inner[name].n_parameters)
            end += part.n_parameters
        return out

    def frozen(self, theta: Array, p: Array) -> dict[str, Array]:
        """The parameters of every part at p, (n_inner,)."""
        found = self.coefficients(theta)
        return {name: self.basis[name](p) @ rows if name in self.basis else rows[0] for name, rows in found.items()}

    def polynomial(self, name: str, theta: Array) -> ChebyshevMatrix:
        """The parameters of a scheduled part as polynomials, (n_inner, 1)."""
        basis, rows = self.basis[name], self.coefficients(theta)[name]
        dense = np.zeros((*[basis.degree + 1] * len(self.box), rows.shape[1], 1))
        for index, row in zip(basis.indices, rows, strict=True):
            dense[index] = row[:, None]
        return ChebyshevMatrix(dense, self.box)

    def expanded(self, constant: Array) -> Array:
        """The theta of parameters that do not depend on p, one after another as without schedule."""
        out, end = [], 0
        for name, part in self.inner.items():
            rows = np.zeros((self.parts[name].n_parameters // part.n_parameters, part.n_parameters))
            rows[0] = constant[end : end + part.n_parameters]
            out.append(rows.ravel())
            end += part.n_parameters
        return np.concatenate(out)

    def converted(self, other: ParameterLayout, theta: Array) -> Array:
        """The theta here of one of another layout with the same parts, whose degrees may be lower.

        Raises
        ------
        DomainError
            If a part has a higher degree there.
        """
        out = []
        for name, rows in other.coefficients(theta).items():
            theirs = other.basis[name].indices if name in other.basis else ((0,) * len(self.box),)
            ours = self.basis[name].indices if name in self.basis else ((0,) * len(self.box),)
            if not set(theirs) <= set(ours):
                raise DomainError(
                    f"{name} of the design to start from has degree {other.basis[name].degree} in p, wanted at most "
                    f"{self.basis[name].degree if name in self.basis else 0}. Raise it in the schedule."
                )
            placed = np.zeros((len(ours), rows.shape[1]))
            placed[[ours.index(index) for index in theirs]] = rows
            out.append(placed.ravel())
        return np.concatenate(out)
