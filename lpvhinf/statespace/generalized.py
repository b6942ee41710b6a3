"""The generalized plant of H-infinity synthesis, frozen at one position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.notebook import table
from lpvhinf.statespace.interop import state_space_matrices

if TYPE_CHECKING:
    import control

NAMES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")


@dataclass(frozen=True, eq=False)
class GeneralizedPlant:
    r"""A linear time-invariant plant with disturbance, control, performance and measurement channels.

    .. math::

        \dot x = A x + B_1 w + B_2 u, \quad
        z = C_1 x + D_{11} w + D_{12} u, \quad
        y = C_2 x + D_{21} w + D_{22} u

    Parameters
    ----------
    A : (n_x, n_x)
    B1, B2 : (n_x, n_w), (n_x, n_u)
    C1, C2 : (n_z, n_x), (n_y, n_x)
    D11, D12, D21 : (n_z, n_w), (n_z, n_u), (n_y, n_w)
    D22 : (n_y, n_u), optional
        Zero if left out.

    Raises
    ------
    DimensionError
        If the sizes disagree.
    DomainError
        If an entry is NaN or infinite.

    Examples
    --------
    >>> P = GeneralizedPlant([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], [[0.0]], [[0.0]], [[0.0]])
    >>> P.n_x, P.n_w, P.n_u
    (1, 1, 1)
    """

    A: Array
    B1: Array
    B2: Array
    C1: Array
    C2: Array
    D11: Array
    D12: Array
    D21: Array
    D22: Array

    def __init__(
        self,
        A: ArrayLike,
        B1: ArrayLike,
        B2: ArrayLike,
        C1: ArrayLike,
        C2: ArrayLike,
        D11: ArrayLike,
        D12: ArrayLike,
        D21: ArrayLike,
        D22: ArrayLike | None = None,
    ) -> None:
        a = finite_array("A", A, (None, None))
        n_x = a.shape[0]
        b1, b2 = finite_array("B1", B1, (n_x, None)), finite_array("B2", B2, (n_x, None))
        c1, c2 = finite_array("C1", C1, (None, n_x)), finite_array("C2", C2, (None, n_x))
        n_w, n_u, n_z, n_y = b1.shape[1], b2.shape[1], c1.shape[0], c2.shape[0]
        if a.shape != (n_x, n_x):
            raise DimensionError(f"A has shape {a.shape}, wanted a square matrix.")
        values = (
            a,
            b1,
            b2,
            c1,
            c2,
            finite_array("D11", D11, (n_z, n_w)),
            finite_array("D12", D12, (n_z, n_u)),
            finite_array("D21", D21, (n_y, n_w)),
            np.zeros((n_y, n_u)) if D22 is None else finite_array("D22", D22, (n_y, n_u)),
        )
        for name, value in zip(NAMES, values, strict=True):
            object.__setattr__(self, name, read_only(value))

    @property
    def n_x(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    @property
    def n_w(self) -> int:
        """Number of disturbances."""
        return int(self.B1.shape[1])

    @property
    def n_u(self) -> int:
        """Number of control inputs."""
        return int(self.B2.shape[1])

    @property
    def n_z(self) -> int:
        """Number of performance outputs."""
        return int(self.C1.shape[0])

    @property
    def n_y(self) -> int:
        """Number of measurements."""
        return int(self.C2.shape[0])

    def __repr__(self) -> str:
        return f"GeneralizedPlant(n_x={self.n_x}, n_w={self.n_w}, n_u={self.n_u}, n_z={self.n_z}, n_y={self.n_y})"

    def _repr_html_(self) -> str:
        head = ["", f"x ({self.n_x})", f"w ({self.n_w})", f"u ({self.n_u})"]
        names = (
            ("x'", "A", "B1", "B2"),
            (f"z ({self.n_z})", "C1", "D11", "D12"),
            (f"y ({self.n_y})", "C2", "D21", "D22"),
        )
        # a zero block is worth knowing: D11, D22 decide what a synthesis can do
        rows = [
            [name, *(block if np.any(getattr(self, block)) else "0" for block in blocks)] for name, *blocks in names
        ]
        return table("GeneralizedPlant", [head, *rows])

    @classmethod
    def from_control(cls, P: Any, n_y: int, n_u: int) -> GeneralizedPlant:
        """Partition a system: its last `n_u` inputs are u and its last `n_y` outputs are y.

        Parameters
        ----------
        P : control.StateSpace, control.TransferFunction, scipy.signal.lti, (A, B, C, D) or a gain matrix
        n_y, n_u : int

        Raises
        ------
        DimensionError
            If P has fewer than `n_u` inputs or `n_y` outputs, or is in discrete time.
        DomainError
            If P is of another kind.
        """
        A, B, C, D = state_space_matrices(P)
        n_w, n_z = D.shape[1] - n_u, D.shape[0] - n_y
        if min(n_w, n_z) < 0 or min(n_u, n_y) < 0:
            raise DimensionError(f"P is {D.shape[0]}x{D.shape[1]}, wanted at least {n_y} outputs and {n_u} inputs.")
        return cls(
            A, B[:, :n_w], B[:, n_w:], C[:n_z], C[n_z:], D[:n_z, :n_w], D[:n_z, n_w:], D[n_z:, :n_w], D[n_z:, n_w:]
        )

    def to_control(self) -> control.StateSpace:
        """The whole plant from [w; u] to [z; y] as a `control.StateSpace`."""
        import control

        return control.ss(
            self.A,
            np.hstack([self.B1, self.B2]),
            np.vstack([self.C1, self.C2]),
            np.block([[self.D11, self.D12], [self.D21, self.D22]]),
        )

    def close(self, A: Array, B: Array, C: Array, D: Array) -> tuple[Array, Array, Array, Array]:
        r"""The closed loop from w to z with the controller u = K y, K = (A, B, C, D).

        The state is (x, x_K). With :math:`\tilde D = (I - D D_{22})^{-1} D` the loop is well posed.

        Raises
        ------
        DimensionError
            If the controller's sizes do not fit.
        AssumptionError
            If the loop is not well posed: I - D_K D22 is singular.
        """
        n_k = A.shape[0]
        if B.shape != (n_k, self.n_y) or C.shape != (self.n_u, n_k) or D.shape != (self.n_u, self.n_y):
            raise DimensionError(
                f"the controller has B {B.shape}, C {C.shape}, D {D.shape}; wanted "
                f"({n_k}, {self.n_y}), ({self.n_u}, {n_k}), ({self.n_u}, {self.n_y})."
            )
        E = np.eye(self.n_u) - D @ self.D22
        if np.linalg.cond(E) > 1e14:
            raise AssumptionError("the loop is not well posed: I - D_K D22 is singular. Use a strictly proper K.")
        # u = Uy (C2 x + D21 w) + Uk x_K, and the measurement that the controller sees, y = C2 x + D21 w + D22 u
        Uy, Uk = np.linalg.solve(E, D), np.linalg.solve(E, C)
        Yy, Yk = np.eye(self.n_y) + self.D22 @ Uy, self.D22 @ Uk
        return (
            np.block([[self.A + self.B2 @ Uy @ self.C2, self.B2 @ Uk], [B @ Yy @ self.C2, A + B @ Yk]]),
            np.vstack([self.B1 + self.B2 @ Uy @ self.D21, B @ Yy @ self.D21]),
            np.hstack([self.C1 + self.D12 @ Uy @ self.C2, self.D12 @ Uk]),
            self.D11 + self.D12 @ Uy @ self.D21,
        )
