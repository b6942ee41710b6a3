"""A controller that can be implemented: matrices polynomial in p, a sampling period, and one step."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, points_in_box, positive
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.fitting import spread_points
from lpvhinf.notebook import properties
from lpvhinf.polynomial import ChebyshevMatrix, nodes

if TYPE_CHECKING:
    import control

FORMS = ("discrete", "trapezoidal")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")  # a name in C and, with "load_" before it, in MATLAB
CHUNK = 4_000_000  # numbers of the matrices of the samples that are evaluated at once: 32 MB

Matrices = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledController:
    r"""A discrete-time controller whose matrices are polynomial in the position p over the box P, or constant.

    The form "discrete" is a step by itself,

    .. math:: x_{k+1} = A(p_k) x_k + B(p_k) u_k, \quad y_k = C(p_k) x_k + D(p_k) u_k .

    The form "trapezoidal" has the matrices of the continuous-time controller and solves one linear system each step,

    .. math::

        (I - \tfrac T2 A(p_k))\, x_k = \xi_k + \tfrac T2 B(p_k) u_k, \quad y_k = C(p_k) x_k + D(p_k) u_k, \quad
        \xi_{k+1} = 2 x_k - \xi_k,

    which at frozen p is Tustin's transformation, exactly, and for moving p the trapezoidal rule, of second order in T.
    Both start from zero: rest, with a zero input before the first sample.

    Parameters
    ----------
    A, B, C, D : ChebyshevMatrix
        (n_x, n_x), (n_x, n_u), (n_y, n_x), (n_y, n_u) over one box, which means nothing if all are constant.
    period : float
        Sampling period T [s].
    form : "discrete" or "trapezoidal"
    name : str
        Prefix of everything in C, part of file names: a letter, then at most 39 letters, digits or underscores.
    inputs, outputs : tuple of str
        What the channels are, with units; for readers.
    fit_error : float
        Largest deviation of a matrix from what it was fitted to, relative to its largest entry; 0 where nothing was.

    Raises
    ------
    DimensionError
        If sizes or boxes disagree.
    DomainError
        If form, period or name are not as said.
    AssumptionError
        If a trapezoidal step is singular: a pole at 2/T.

    Examples
    --------
    >>> from lpvhinf.export import sampled
    >>> K = sampled(([[-100.0]], [[1.0]], [[50.0]], [[0.0]]), period=1e-3, name="filter")
    >>> K.simulate(np.ones((3, 1))).ravel()
    array([0.02380952, 0.069161  , 0.11019328])
    """

    A: ChebyshevMatrix
    B: ChebyshevMatrix
    C: ChebyshevMatrix
    D: ChebyshevMatrix
    period: float
    form: str = "discrete"
    name: str = "controller"
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    fit_error: float = 0.0

    def __post_init__(self) -> None:
        for label, matrix in zip("ABCD", self.matrices, strict=True):
            object.__setattr__(self, label, matrix.trimmed())
        (n_x, n_u), n_y = self.B.shape, self.C.shape[0]
        for label, matrix, shape in (("A", self.A, (n_x, n_x)), ("C", self.C, (n_y, n_x)), ("D", self.D, (n_y, n_u))):
            if matrix.shape != shape:
                raise DimensionError(f"{label} has shape {matrix.shape}, wanted {shape} to fit B and C.")
        if any(not np.array_equal(matrix.box, self.A.box) for matrix in self.matrices):
            raise DimensionError("A, B, C and D are over different boxes. Use one box.")
        positive("period", self.period, "s")
        if self.form not in FORMS:
            raise DomainError(f"form is {self.form!r}, wanted one of {', '.join(FORMS)}.")
        if not isinstance(self.name, str) or not NAME.fullmatch(self.name):
            raise DomainError(
                f"name is {self.name!r}, wanted a letter and then at most 39 letters, digits or underscores."
            )
        for label, names, count in (("inputs", self.inputs, n_u), ("outputs", self.outputs, n_y)):
            if names and len(names) != count:
                raise DimensionError(f"{label} has {len(names)} names, the controller has {count} {label}.")
        if n_x == 0:  # both forms are the gain D(p)
            object.__setattr__(self, "form", "discrete")
        if self.form == "trapezoidal":
            self._check_regular()

    @property
    def matrices(self) -> tuple[ChebyshevMatrix, ChebyshevMatrix, ChebyshevMatrix, ChebyshevMatrix]:
        """(A, B, C, D) of the form."""
        return self.A, self.B, self.C, self.D

    @property
    def box(self) -> Array:
        """The box P, (n_p, 2)."""
        return self.A.box

    @property
    def scheduled(self) -> bool:
        """Whether a matrix depends on p."""
        return not all(matrix.is_constant for matrix in self.matrices)

    @property
    def n_p(self) -> int:
        """Number of scheduling coordinates; 0 if nothing depends on p."""
        return len(self.box) if self.scheduled else 0

    @property
    def n_x(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def n_u(self) -> int:
        """Number of the controller's inputs."""
        return self.B.shape[1]

    @property
    def n_y(self) -> int:
        """Number of the controller's outputs."""
        return self.C.shape[0]

    def step_matrices(self, p: ArrayLike | None = None) -> Matrices:
        """(A, B, C, D) of the step x+ = A x + B u, y = C x + D u at one position p (n_p,), whatever the form."""
        where = self._positions(p, 1)
        A, B, C, D = (stack[0] for stack in self._steps(where))
        return A, B, C, D

    def at(self, p: ArrayLike | None = None) -> control.StateSpace:
        """The step at one position as a `control.StateSpace` with the sampling time."""
        import control

        return control.ss(*self.step_matrices(p), self.period, remove_useless_states=False)

    def simulate(
        self, u: ArrayLike, p: ArrayLike | None = None, *, state: ArrayLike | None = None, dtype: Any = np.float64
    ) -> Array:
        """Outputs (N, n_y) for inputs (N, n_u) along positions (N, n_p), or at one position (n_p,).

        Parameters
        ----------
        u : (N, n_u)
        p : (N, n_p) or (n_p,)
            Left out where nothing depends on p.
        state : (n_x,), optional
            x of the form "discrete", xi of "trapezoidal"; zero if left out.
        dtype : numpy.float64 or numpy.float32
            Arithmetic of the steps.

        Raises
        ------
        DimensionError
            If the numbers of samples, inputs or coordinates disagree.
        DomainError
            If a position is outside P, or `u` is not finite.
        AssumptionError
            If a step is singular: at its position the controller has a pole at 2/T.
        """
        inputs = finite_array("u", u, (None, self.n_u)).astype(dtype)
        where = self._positions(p, len(inputs))
        x = np.zeros(self.n_x, dtype) if state is None else finite_array("state", state, (self.n_x,)).astype(dtype)
        out = np.zeros((len(inputs), self.n_y), dtype)
        half, eye = dtype(0.5 * self.period), np.eye(self.n_x, dtype=dtype)
        for k, (A, B, C, D) in enumerate(self._sampled(where, len(inputs), dtype)):
            if self.form == "discrete":
                out[k] = C @ x + D @ inputs[k]
                x = A @ x + B @ inputs[k]
            else:
                try:
                    now = np.linalg.solve(eye - half * A, x + half * (B @ inputs[k]))
                except np.linalg.LinAlgError:
                    raise _pole(self.period, f" in sample {k}") from None
                out[k] = C @ now + D @ inputs[k]
                x = 2 * now - x
        return out

    def _sampled(self, where: Array, count: int, dtype: Any) -> Iterator[Matrices]:
        if len(where) == 1:
            A, B, C, D = (m.sample(where)[0].astype(dtype) for m in self.matrices)
            for _ in range(count):
                yield A, B, C, D
            return
        chunk = max(1, CHUNK // max(1, (self.n_x + self.n_y) * (self.n_x + self.n_u)))
        for begin in range(0, count, chunk):
            a, b, c, d = (m.sample(where[begin : begin + chunk]).astype(dtype) for m in self.matrices)
            yield from zip(a, b, c, d, strict=True)

    def _check_regular(self) -> None:
        """No pole at 2/T: I - (T/2) A is regular, and its determinant has one sign, at many positions."""
        grid = nodes([2 * d + 1 for d in self.A.degree], self.box)
        A = self.A.sample(np.vstack([grid, spread_points(self.box, 64)]))
        left = np.eye(self.n_x) - 0.5 * self.period * A
        _regular(left, self.period)
        if len(np.unique(np.linalg.slogdet(left).sign)) > 1:
            raise _pole(self.period)

    def _steps(self, where: Array) -> Matrices:
        A, B, C, D = (np.asarray(matrix.sample(where)) for matrix in self.matrices)
        return (A, B, C, D) if self.form == "discrete" else tustin(A, B, C, D, self.period)

    def _positions(self, p: ArrayLike | None, count: int) -> Array:
        """Positions (N, n_p), or one of them (1, n_p) that serves all samples."""
        if not self.scheduled:
            if p is not None and np.size(p):
                raise DimensionError(f"p is given, but nothing in {self.name} depends on it. Leave it out.")
            return np.asarray(np.mean(self.box, axis=1)[None])
        if p is None:
            raise DimensionError(f"p is missing: {self.name} depends on {self.n_p} coordinates of it.")
        where = points_in_box(p, self.box)
        if len(where) not in (1, count):
            raise DimensionError(f"p has {len(where)} positions, wanted {count}: one a sample.")
        return where

    def __repr__(self) -> str:
        kind = f"{self.form}, scheduled by p (n_p={self.n_p})" if self.scheduled else self.form
        return f"SampledController({self.name!r}, {kind}, {self._sizes}, period={self.period:g})"

    @property
    def _sizes(self) -> str:
        return f"n_x={self.n_x}, n_u={self.n_u}, n_y={self.n_y}"

    def _repr_html_(self) -> str:
        degrees = ", ".join(f"{label} {m.degree}" for label, m in zip("ABCD", self.matrices, strict=True))
        values = [
            ("form", self.form),
            ("sizes", self._sizes),
            ("period", f"{self.period:g} s"),
            ("degree in p", degrees if self.scheduled else "constant"),
            ("relative error of the fit", f"{self.fit_error:.2g}"),
        ]
        return properties(f"SampledController {self.name}", values)


def tustin(A: Array, B: Array, C: Array, D: Array, period: float) -> Matrices:
    r"""Tustin's transformation of stacks (N, ., .) of continuous-time matrices, in the state xi.

    .. math:: (2 F - I, \; T F B, \; C F, \; D + \tfrac T2 C F B), \quad F = (I - \tfrac T2 A)^{-1}

    Raises
    ------
    AssumptionError
        If I - (T/2) A is singular.
    """
    half, eye = 0.5 * period, np.eye(A.shape[-1])
    left = eye - half * A
    _regular(left, period)
    F = np.linalg.inv(left)
    # xi+ = 2 x - xi with x = F (xi + T/2 B u)
    return 2.0 * F - eye, period * (F @ B), C @ F, D + half * (C @ F @ B)


def _regular(left: Array, period: float) -> None:
    sizes = np.linalg.svd(left, compute_uv=False) if left.size else np.ones((1, 1))
    if np.any(sizes[:, -1] < 1e-14 * np.maximum(1.0, sizes[:, 0])):
        raise _pole(period)


def _pole(period: float, when: str = "") -> AssumptionError:
    return AssumptionError(
        f"I - (T/2) A is singular{when}: the controller has a pole at 2/T = {2.0 / period:.4g} rad/s. "
        "Take a shorter period."
    )
