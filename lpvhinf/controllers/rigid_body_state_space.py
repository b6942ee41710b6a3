"""A free-order K_RB in physical units: one state space per rigid axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError

NAMES = ("A", "B", "C")


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBodyStateSpace:
    r"""K_RB as one strictly proper state space per rigid axis, its integrator apart.

    .. math:: \dot x = A_i x + B_i \begin{bmatrix} e \\ \int e \end{bmatrix}, \quad u = C_i x

    Attributes
    ----------
    A : (n_rb, order, order) [1/s]
    B : (n_rb, order, 2)
        Columns for the error e [m, rad] and for its integral [m s, rad s].
    C : (n_rb, order)
        To the acceleration u [m/s^2, rad/s^2].

    Raises
    ------
    DimensionError
        If sizes disagree.
    DomainError
        If an entry is not finite.

    Examples
    --------
    >>> K = RigidBodyStateSpace(A=[[[-2.0]]], B=[[[1.0, 0.0]]], C=[[6.0]])
    >>> complex(K.response([2.0])[0, 0])  # 6 / (s + 2)
    (1.5-1.5j)
    """

    A: Array
    B: Array
    C: Array

    def __post_init__(self) -> None:
        C = finite_array("C", self.C, (None, None))
        n_rb, order = C.shape
        if order < 1:
            raise DimensionError("C has no columns, wanted at least one state per axis.")
        object.__setattr__(self, "A", read_only(finite_array("A", self.A, (n_rb, order, order))))
        object.__setattr__(self, "B", read_only(finite_array("B", self.B, (n_rb, order, 2))))
        object.__setattr__(self, "C", read_only(C))

    @property
    def n_rb(self) -> int:
        """Number of axes."""
        return len(self.C)

    @property
    def order(self) -> int:
        """States per axis, the integrator not counted."""
        return int(self.C.shape[1])

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles of every axis without the integrator, (n_rb, order) [rad/s]."""
        return np.linalg.eigvals(self.A).astype(complex)

    def response(self, omega: ArrayLike) -> Array:
        """K_i(j omega) of every axis, (n_omega, n_rb), the integrator included."""
        s = 1j * np.asarray(omega, dtype=float)[:, None, None, None]
        b = self.B[..., :1] + self.B[..., 1:] / s
        x = np.linalg.solve(s * np.eye(self.order) - self.A, b)
        return np.asarray((self.C[:, None, :] @ x)[..., 0, 0])

    def arrays(self) -> dict[str, Array]:
        """The matrices by name, for files and reports."""
        return {name: getattr(self, name) for name in NAMES}

    def table(self, names: Sequence[str]) -> list[str]:
        """One line an axis: the poles, a pair by its frequency and damping ratio."""
        lines = [f"  axis   K_RB of order {self.order}: poles in Hz (damping ratio)"]
        for name, poles in zip(names, self.poles, strict=True):
            upper = sorted((pole for pole in poles if pole.imag >= 0.0), key=abs)
            each = [f"{abs(s) / (2 * np.pi):.1f} ({-s.real / max(abs(s), 1e-300):.2f})" for s in upper]
            lines.append(f"  {name:6s} {', '.join(each)}")
        return lines
