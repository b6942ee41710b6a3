"""Mechanical equations of motion with position-dependent actuation and sensing (paper eq. 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array, finite_array, points_in_box, read_only
from lpvhinf.errors import AssumptionError, DimensionError
from lpvhinf.plant.maps import PositionMap, as_map, evaluate

if TYPE_CHECKING:
    import control

SYMMETRY = 1e-9  # largest relative asymmetry that is taken for round-off, and then removed
SEMIDEFINITE = 1e-10  # a negative eigenvalue below this share of the largest one is round-off


def symmetric_matrix(name: str, value: ArrayLike, n_q: int | None = None) -> Array:
    """`value` as a symmetric (n_q, n_q) read-only array; round-off asymmetry is averaged out.

    Raises
    ------
    DimensionError
        If it is not square, or not (n_q, n_q).
    AssumptionError
        If it is not symmetric.
    DomainError
        If an entry is not finite.
    """
    matrix = finite_array(name, value, (n_q, n_q))
    if matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        raise DimensionError(f"{name} has shape {matrix.shape}, wanted a square matrix.")
    gap = np.abs(matrix - matrix.T)
    if gap.max() > SYMMETRY * np.abs(matrix).max(initial=0.0):
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(gap)), gap.shape))
        raise AssumptionError(
            f"{name} is not symmetric: {name}[{i}, {j}] = {matrix[i, j]:.6g}, {name}[{j}, {i}] = {matrix[j, i]:.6g}. "
            f"Check the assembly; for round-off pass 0.5 * ({name} + {name}.T)."
        )
    return np.asarray(read_only(0.5 * (matrix + matrix.T)))


def check_semidefinite(name: str, matrix: Array, meaning: str) -> None:
    """Raise an `AssumptionError` if a symmetric matrix has an eigenvalue below zero, beyond round-off."""
    eigenvalues = np.linalg.eigvalsh(matrix)
    if eigenvalues[0] < -SEMIDEFINITE * max(float(np.abs(eigenvalues).max()), np.finfo(float).tiny):
        raise AssumptionError(
            f"{name} has the eigenvalue {eigenvalues[0]:.6g} (largest {eigenvalues[-1]:.6g}), "
            f"wanted a positive semidefinite matrix: {meaning}"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class MechanicalModel:
    r"""A moving body with actuators and sensors that do not move along with it (paper eq. 1).

    .. math::

        M \ddot q + D \dot q + K q = \Phi_a(p)\, u, \qquad y = \Phi_s(p)\, q

    Parameters
    ----------
    M : (n_q, n_q)
        Mass matrix, symmetric positive definite [kg, kg m2, ...].
    D : (n_q, n_q)
        Damping matrix, symmetric positive semidefinite [N s/m, ...].
    K : (n_q, n_q)
        Stiffness matrix, symmetric positive semidefinite [N/m, ...]; its null space holds the rigid-body motions.
    input_map : (n_q, n_u) array or callable
        :math:`\Phi_a`. A callable takes positions (N, n_p) and returns (N, n_q, n_u). It may offer
        ``left_project(V)``, the map of :math:`V^\top \Phi_a(p)`, to spare forming the full matrix.
    output_map : (n_y, n_q) array or callable
        :math:`\Phi_s`, likewise (N, n_y, n_q), with ``right_project(V)``.
    box : (n_p, 2)
        Lower and upper bound of every coordinate of the position p, often [m].
    input_names, output_names : sequence of str, optional
        Labels of u and y; ``u1, u2, ...`` and ``y1, y2, ...`` if left out.

    Raises
    ------
    AssumptionError
        If M is not positive definite, D or K has a negative eigenvalue, or one of them is not symmetric.
    DimensionError
        If sizes disagree.
    DomainError
        If a number is not finite, or the box is empty.

    Notes
    -----
    Arrays are copied and read-only. The maps are tried at the centre of the box when the model is built.

    Examples
    --------
    Two masses with a spring between them; the force moves from the first to the second mass.

    >>> model = MechanicalModel(
    ...     M=np.eye(2), D=np.zeros((2, 2)), K=[[1.0, -1.0], [-1.0, 1.0]],
    ...     input_map=lambda p: np.stack([1.0 - p, p], axis=1), output_map=[[1.0, 0.0]], box=[[0.0, 1.0]])
    >>> model.n_q, model.n_u, model.n_y
    (2, 1, 1)
    >>> model.input_map_at([[0.25]]).ravel().tolist()
    [0.75, 0.25]
    """

    M: Array
    D: Array
    K: Array
    input_map: PositionMap
    output_map: PositionMap
    box: Array
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        put("M", symmetric_matrix("M", self.M))
        n_q = self.M.shape[0]
        put("D", symmetric_matrix("D", self.D, n_q))
        put("K", symmetric_matrix("K", self.K, n_q))
        try:
            np.linalg.cholesky(self.M)
        except np.linalg.LinAlgError:
            smallest = float(np.linalg.eigvalsh(self.M)[0])
            raise AssumptionError(
                f"M has the eigenvalue {smallest:.6g}, wanted a positive definite mass matrix. "
                "Every coordinate of q needs mass: eliminate the massless ones, or check signs and units."
            ) from None
        check_semidefinite("K", self.K, "a negative stiffness is unstable. Check signs; add the stabilising stiffness.")
        check_semidefinite("D", self.D, "negative damping adds energy. Check its sign.")
        put("box", box_array(self.box))
        put("input_map", as_map("input_map", self.input_map))
        put("output_map", as_map("output_map", self.output_map))
        centre = self.box.mean(axis=1)[None, :]
        n_u = evaluate("input_map", self.input_map, centre, n_q, None).shape[2]
        n_y = evaluate("output_map", self.output_map, centre, None, n_q).shape[1]
        put("input_names", names("input_names", self.input_names, n_u, "u"))
        put("output_names", names("output_names", self.output_names, n_y, "y"))

    @property
    def n_q(self) -> int:
        """Number of coordinates q."""
        return int(self.M.shape[0])

    @property
    def n_u(self) -> int:
        """Number of inputs u."""
        return len(self.input_names)

    @property
    def n_y(self) -> int:
        """Number of outputs y."""
        return len(self.output_names)

    @property
    def n_p(self) -> int:
        """Number of position coordinates p."""
        return int(self.box.shape[0])

    def __repr__(self) -> str:
        return f"MechanicalModel(n_q={self.n_q}, n_u={self.n_u}, n_y={self.n_y}, box={self.box.tolist()})"

    def input_map_at(self, points: ArrayLike) -> Array:
        r""":math:`\Phi_a(p)` at the positions `points` (N, n_p), as (N, n_q, n_u).

        Raises
        ------
        DomainError
            If a position is outside the box, or the map returns NaN there.
        DimensionError
            If the map returns a wrong shape.
        """
        return evaluate("input_map", self.input_map, points_in_box(points, self.box), self.n_q, self.n_u)

    def output_map_at(self, points: ArrayLike) -> Array:
        r""":math:`\Phi_s(p)` at the positions `points` (N, n_p), as (N, n_y, n_q); raises as `input_map_at`."""
        return evaluate("output_map", self.output_map, points_in_box(points, self.box), self.n_y, self.n_q)

    def local_model(self, p: ArrayLike) -> control.StateSpace:
        """The time-invariant model at the frozen position `p` (n_p,), with the state (q, q').

        Raises
        ------
        DimensionError
            If `p` is not one position.
        DomainError
            If `p` is outside the box.
        """
        import control

        point = one_point(p, self.box)
        n_q, n_u, n_y = self.n_q, self.n_u, self.n_y
        factor = scipy.linalg.cho_factor(self.M)
        zero, eye = np.zeros((n_q, n_q)), np.eye(n_q)
        A = np.block([[zero, eye], [-scipy.linalg.cho_solve(factor, np.hstack([self.K, self.D]))]])
        B = np.vstack([np.zeros((n_q, n_u)), scipy.linalg.cho_solve(factor, self.input_map_at(point)[0])])
        C = np.hstack([self.output_map_at(point)[0], np.zeros((n_y, n_q))])
        return control.ss(A, B, C, np.zeros((n_y, n_u)), inputs=list(self.input_names), outputs=list(self.output_names))


def one_point(p: ArrayLike, box: Array) -> Array:
    """One position as (1, n_p), inside the box; a `DimensionError` if several are given."""
    point = points_in_box(p, box)
    if len(point) != 1:
        raise DimensionError(f"p holds {len(point)} positions, wanted one. Call once for each position.")
    return point


def names(argument: str, given: Sequence[str], n: int, letter: str) -> tuple[str, ...]:
    """`given` as a tuple of n distinct labels, or letter1, letter2, ... if it is empty."""
    if not given:
        return tuple(f"{letter}{i + 1}" for i in range(n))
    labels = tuple(str(name) for name in given)
    if len(labels) != n or len(set(labels)) != n:
        raise DimensionError(f"{argument} has {len(set(labels))} distinct labels, wanted {n}.")
    return labels
