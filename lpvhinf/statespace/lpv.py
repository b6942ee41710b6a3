"""A linear parameter-varying state space: the thing that flows through the whole house."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.fitting import MatrixFit, interpolate, least_squares
from lpvhinf.polynomial import ChebyshevMatrix, power_to_chebyshev
from lpvhinf.statespace import interconnect
from lpvhinf.statespace.interconnect import Matrices
from lpvhinf.statespace.interop import state_space_matrices
from lpvhinf.storage import read_arrays, write_arrays

if TYPE_CHECKING:
    import control

KIND = "lpvhinf.LPVStateSpace"


@dataclass(frozen=True, eq=False)
class LPVStateSpace:
    r"""A state space whose matrices are polynomials in p over the box P.

    .. math:: \dot x = A(p) x + B(p) u, \quad y = C(p) x + D(p) u, \quad p \in P

    p is treated as exogenous, also where it is a state of the real machine.

    Parameters
    ----------
    A, B, C, D : ChebyshevMatrix
        (n_x, n_x), (n_x, n_u), (n_y, n_x), (n_y, n_u), all over the same box; plain arrays are
        constants where at least one is a `ChebyshevMatrix`.

    Raises
    ------
    DimensionError
        If shapes or boxes disagree.

    Examples
    --------
    >>> G = LPVStateSpace.from_coefficients(
    ...     [[[-1.0]], [[0.5]]], [[1.0]], [[1.0]], [[0.0]], box=[[-1.0, 1.0]], basis="power"
    ... )
    >>> A, B, C, D = G.sample([[0.0], [1.0]])
    >>> A[:, 0, 0].tolist()
    [-1.0, -0.5]
    """

    A: ChebyshevMatrix
    B: ChebyshevMatrix
    C: ChebyshevMatrix
    D: ChebyshevMatrix

    def __init__(
        self,
        A: ChebyshevMatrix | ArrayLike,
        B: ChebyshevMatrix | ArrayLike,
        C: ChebyshevMatrix | ArrayLike,
        D: ChebyshevMatrix | ArrayLike,
    ) -> None:
        given = (A, B, C, D)
        box = next((m.box for m in given if isinstance(m, ChebyshevMatrix)), None)
        if box is None:
            raise DimensionError("A, B, C, D are plain arrays and name no box. Use from_coefficients(..., box=...).")
        anchor = ChebyshevMatrix(np.zeros((0, 0)), box)
        a, b, c, d = (anchor._like(m) for m in given)
        (n_x, n_u), n_y = b.shape, c.shape[0]
        for name, matrix, shape in (("A", a, (n_x, n_x)), ("C", c, (n_y, n_x)), ("D", d, (n_y, n_u))):
            if matrix.shape != shape:
                raise DimensionError(f"{name} has shape {matrix.shape}, wanted {shape} to fit B and C.")
        for name, matrix in zip("ABCD", (a, b, c, d), strict=True):
            object.__setattr__(self, name, matrix)

    @classmethod
    def from_coefficients(
        cls,
        A: ArrayLike,
        B: ArrayLike,
        C: ArrayLike,
        D: ArrayLike,
        *,
        box: ArrayLike,
        basis: str = "chebyshev",
    ) -> LPVStateSpace:
        """From coefficient arrays (k_1, ..., k_np, rows, cols); a 2-D array is a constant.

        Parameters
        ----------
        basis : "chebyshev" or "power"
            Chebyshev polynomials of p scaled to [-1, 1] on the box, or powers of p itself.
        """
        if basis not in ("chebyshev", "power"):
            raise DomainError(f"basis is {basis!r}, wanted 'chebyshev' or 'power'.")
        matrices = []
        for value in (A, B, C, D):
            array = np.asarray(value, dtype=float)
            if basis == "power" and array.ndim > 2:
                array = power_to_chebyshev(array, box)
            matrices.append(ChebyshevMatrix(array, box))
        return cls(*matrices)

    @classmethod
    def from_system(cls, system: Any, box: ArrayLike) -> LPVStateSpace:
        """A constant system (control.StateSpace, TransferFunction, scipy.signal, (A, B, C, D), gain) over a box."""
        return cls(*(ChebyshevMatrix(m, box) for m in state_space_matrices(system)))

    @classmethod
    def interpolate(
        cls,
        function: Callable[[Array], tuple[Array, Array, Array, Array]],
        *,
        box: ArrayLike,
        degree: int | Sequence[int],
    ) -> LPVFit:
        """Interpolate sampled matrices, (N, n_p) -> stacked (A, B, C, D), on a Chebyshev grid."""
        shapes: list[tuple[int, int]] = []

        def flat(points: Array) -> Array:
            matrices = [np.asarray(m, dtype=float) for m in function(points)]
            shapes[:] = [(int(m.shape[1]), int(m.shape[2])) for m in matrices]
            return np.concatenate([m.reshape(len(points), 1, -1) for m in matrices], axis=2)

        return _split(cls, interpolate(flat, box=box, degree=degree), shapes)

    @classmethod
    def fit(
        cls,
        points: ArrayLike,
        samples: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike],
        *,
        box: ArrayLike,
        degree: int | Sequence[int],
    ) -> LPVFit:
        """Fit samples (A, B, C, D), each (N, rows, cols) at scattered positions, by least squares."""
        matrices = [np.asarray(m, dtype=float) for m in samples]
        joined = np.concatenate([m.reshape(len(m), 1, -1) for m in matrices], axis=2)
        fitted = least_squares(points, joined, box=box, degree=degree)
        return _split(cls, fitted, [(int(m.shape[1]), int(m.shape[2])) for m in matrices])

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2)."""
        return self.A.box

    @property
    def n_p(self) -> int:
        """Number of scheduling coordinates."""
        return self.A.n_p

    @property
    def n_x(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def n_u(self) -> int:
        """Number of inputs."""
        return self.B.shape[1]

    @property
    def n_y(self) -> int:
        """Number of outputs."""
        return self.C.shape[0]

    def at(self, p: ArrayLike) -> control.StateSpace:
        """The frozen (local) system at one position; a `DomainError` outside the box."""
        import control

        return control.ss(*(m.at(p) for m in self.matrices), remove_useless_states=False)

    @property
    def matrices(self) -> Matrices:
        """(A, B, C, D)."""
        return Matrices(self.A, self.B, self.C, self.D)

    def sample(self, points: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """(A, B, C, D) at positions (N, n_p), stacked as (N, rows, cols); constants are broadcast views."""
        a, b, c, d = (m.sample(points) for m in self.matrices)
        return a, b, c, d

    def derivative(self, axis: int) -> LPVStateSpace:
        """The partial derivatives of all four matrices to p_axis, as a state space of the same sizes."""
        return LPVStateSpace(*(m.derivative(axis) for m in self.matrices))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the system to an .npz file, atomically: "box", and for each matrix M of A, B, C, D three arrays.

        "M_shape" is (k_1, ..., k_np, rows, cols); "M_entries" names the entries of the flattened (rows, cols) matrix
        that are not zero for all p, and "M_coefficients" (k_1 ... k_np, n_entries) holds their Chebyshev coefficients.
        """
        arrays: dict[str, Any] = {"box": self.box}
        for name, matrix in self._named():
            flat = matrix.coefficients.reshape(-1, matrix.shape[0] * matrix.shape[1])
            entries = np.flatnonzero(np.any(flat != 0.0, axis=0))
            arrays |= {
                f"{name}_shape": np.array(matrix.coefficients.shape),
                f"{name}_entries": entries,
                f"{name}_coefficients": flat[:, entries],
            }
        write_arrays(path, KIND, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LPVStateSpace:
        """Read what `save` wrote; a `StorageError` if the file is damaged or of another kind."""
        data = read_arrays(path, KIND)
        matrices = []
        for name in "ABCD":
            shape = tuple(int(n) for n in data[f"{name}_shape"])
            flat = np.zeros((int(np.prod(shape[:-2])), shape[-2] * shape[-1]))
            flat[:, data[f"{name}_entries"]] = data[f"{name}_coefficients"]
            matrices.append(ChebyshevMatrix(flat.reshape(shape), data["box"]))
        return cls(*matrices)

    def _named(self) -> list[tuple[str, ChebyshevMatrix]]:
        return list(zip("ABCD", self.matrices, strict=True))

    def series(self, after: LPVStateSpace) -> LPVStateSpace:
        """`after` following this system: y = after(self(u))."""
        return LPVStateSpace(*interconnect.series(self.matrices, after.matrices))

    def append(self, other: LPVStateSpace) -> LPVStateSpace:
        """Both systems side by side: diag(self, other)."""
        return LPVStateSpace(*interconnect.append(self.matrices, other.matrices))

    def parallel(self, other: LPVStateSpace) -> LPVStateSpace:
        """The sum of two systems with the same inputs and outputs."""
        return LPVStateSpace(*interconnect.parallel(self.matrices, other.matrices))

    def feedback(self, other: LPVStateSpace, sign: int = -1) -> LPVStateSpace:
        """The loop u = r + sign * other(y), from r to y."""
        return LPVStateSpace(*interconnect.feedback(self.matrices, other.matrices, sign))

    def lft(self, controller: LPVStateSpace) -> LPVStateSpace:
        """The lower linear fractional transformation: last outputs to `controller`, its outputs to the last inputs."""
        return LPVStateSpace(*interconnect.lft(self.matrices, controller.matrices))

    def __repr__(self) -> str:
        degree = tuple(max(d) for d in zip(*(m.degree for m in self.matrices), strict=True))
        return (
            f"LPVStateSpace(n_x={self.n_x}, n_u={self.n_u}, n_y={self.n_y}, degree {degree}, box {self.box.tolist()})"
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{name}</th><td>{m.shape[0]} x {m.shape[1]}</td><td>{m.degree}</td></tr>"
            for name, m in self._named()
        )
        head = "<tr><th></th><th>size</th><th>degree</th></tr>"
        return f"<b>LPVStateSpace</b> over {self.box.tolist()}<table>{head}{rows}</table>"


@dataclass(frozen=True, eq=False)
class LPVFit:
    """A fitted `LPVStateSpace` with the measured largest error of every matrix entry.

    Attributes
    ----------
    system : LPVStateSpace
    errors : dict of "A", "B", "C", "D" to arrays
        Largest absolute deviation of each entry at the test positions.
    n_test : int
    """

    system: LPVStateSpace
    errors: dict[str, Array]
    n_test: int


def _split(cls: type[LPVStateSpace], fitted: MatrixFit, shapes: Sequence[tuple[int, int]]) -> LPVFit:
    """Cut a row of all entries into the four matrices again."""
    box, start = box_array(fitted.matrix.box), 0
    matrices, errors = [], {}
    for name, (rows, cols) in zip("ABCD", shapes, strict=True):
        cut = slice(start, start + rows * cols)
        c = fitted.matrix.coefficients[..., 0, cut]
        # entries whose variation is round-off are constants: a sparse matrix stays sparse and cheap
        round_off = 1e-15 * float(np.max(np.abs(c), initial=0.0))
        matrices.append(ChebyshevMatrix(c.reshape(*c.shape[:-1], rows, cols), box).trimmed(round_off))
        errors[name] = fitted.error[0, cut].reshape(rows, cols)
        start += rows * cols
    return LPVFit(cls(*matrices), errors, fitted.n_test)
