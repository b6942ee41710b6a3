r"""What a linear matrix inequality problem is here: a description, free of any solver.

Every inequality of LPV analysis and synthesis, at a position p and a rate p', has the shape

.. math::

    Z = F_0 + \gamma F_g + \sum_t \left( U_t\, Y_t(c)\, V_t^\top + V_t\, Y_t(c)\, U_t^\top
        + V_t\, Y_t(h)\, V_t^\top \right) \succeq 0, \qquad Y(c) = \sum_i c_i Y_i

with symmetric unknown matrices :math:`Y_i`: `c` holds the basis functions at p, and `h` their derivatives along the
rate (with the sign of the term), so that a vertex of the rate box changes numbers only. All inequalities of one shape
form a `LMIBlock` of arrays with a leading axis. The problem is to

.. math:: \min_{\gamma, Y} \gamma \quad\text{subject to}\quad Z_k(\gamma, Y) \succeq 0 .

`lpvhinf.lpv.solve_lmi.solve_lmi` solves it. Instances:

- bounded-real lemma (gamma = L2 gain): `V = [I; 0; 0]`, `U = -[A B1 0]'`, `inner = -d/dt basis`;
- positive definiteness and bounds :math:`Y(p) \succeq 0`, :math:`r I - Y(p) \succeq 0`: `V = I`, no `U`,
  `inner = +- basis`;
- the coupling of output feedback: two terms, `V = [I; 0]` and `V = [0; I]`, no `U`, `F0 = [0 I; I 0]`;
- the largest margin at a fixed level: `problem.at_level(gamma)`, then a block whose `Fg` carries the margin, `-gamma`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError


@dataclass(frozen=True, kw_only=True)
class MatrixUnknown:
    """A family of symmetric unknowns Y_1, ..., Y_count, each (size, size).

    Parameters
    ----------
    name : str
    size : int
    count : int
        Number of basis functions; 1 for a constant matrix.
    bound : float
        Largest spectral norm that any Y_i of a feasible point can have, where other inequalities of the problem imply
        one. It makes the lower bound on gamma rigorous: residuals of the dual are charged with it. Infinity: none.
    unit : (count,), optional
        Coefficients with Y(p) = I at every p where :math:`Y_i = unit_i I`, for the start; default (1, 0, ..., 0).
    """

    name: str
    size: int
    count: int = 1
    bound: float = np.inf
    unit: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class Term:
    r""":math:`U Y(c) V^\top + V Y(c) U^\top + V Y(h) V^\top` in each of m inequalities of size s.

    Parameters
    ----------
    unknown : str
        Name of the `MatrixUnknown`, of size n.
    V : (m, s, n) or (s, n)
        A matrix stands for the same one in every inequality.
    U : (m, s, n) or (s, n), optional
    value : (m, count), optional
        c, one row an inequality; wanted with U. Left out: ones (for count = 1).
    inner : (m, count), optional
        h; left out: zero.
    """

    unknown: str
    V: Array
    U: Array | None = None
    value: Array | None = None
    inner: Array | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class LMIBlock:
    r"""m inequalities of one size s, :math:`Z_k \succeq 0`.

    Parameters
    ----------
    name : str
        As it is to appear in reports, such as "R" or "coupling".
    F0 : (m, s, s)
        Constant parts, symmetric.
    terms : sequence of Term
        At most one for each unknown.
    Fg : (m, s, s), optional
        Factors of gamma, symmetric; left out: zero.
    labels : sequence of str, optional
        A name for each inequality, such as the position and rate it stands for.

    Raises
    ------
    DimensionError
        If shapes disagree, or an unknown occurs in two terms.
    DomainError
        If an entry is NaN or infinite, or F0 or Fg is not symmetric.
    """

    name: str
    F0: Array
    terms: Sequence[Term]
    Fg: Array | None = None
    labels: Sequence[str] = ()

    def __post_init__(self) -> None:
        F0 = _symmetric(f"F0 of {self.name}", self.F0)
        m, s = F0.shape[:2]
        object.__setattr__(self, "F0", F0)
        if self.Fg is not None:
            Fg = _symmetric(f"Fg of {self.name}", self.Fg)
            if Fg.shape != F0.shape:
                raise DimensionError(f"Fg of {self.name} has shape {Fg.shape}, wanted {F0.shape} as F0.")
            object.__setattr__(self, "Fg", Fg)
        names = [term.unknown for term in self.terms]
        if len(set(names)) < len(names):
            raise DimensionError(f"block {self.name} has terms of {names}, wanted at most one for each unknown.")
        object.__setattr__(self, "terms", tuple(_normal_term(self.name, term, m, s) for term in self.terms))
        object.__setattr__(self, "labels", tuple(self.labels))
        if self.labels and len(self.labels) != m:
            raise DimensionError(f"block {self.name} has {len(self.labels)} labels, wanted {m} or none.")

    @property
    def m(self) -> int:
        """Number of inequalities."""
        return int(self.F0.shape[0])

    @property
    def size(self) -> int:
        """Rows of each inequality."""
        return int(self.F0.shape[1])

    def evaluate(self, unknowns: Mapping[str, Array], gamma: float) -> Array:
        """Z_k as (m, s, s) at given unknowns (count, n, n) and gamma."""
        Z = self.F0 + gamma * self.Fg if self.Fg is not None else self.F0.copy()
        for term in self.terms:
            Z = Z + term_value(term, unknowns[term.unknown])
        return Z


@dataclass(frozen=True, kw_only=True, eq=False)
class LMIProblem:
    r"""Minimise gamma subject to all blocks; see the head of this module.

    Raises
    ------
    DimensionError
        If a term names no unknown, or its sizes differ from the unknown's.

    Examples
    --------
    The L2 gain of x' = -x + w, z = 2 x is 2:

    >>> V, U = np.array([[1.0], [0.0], [0.0]]), -np.array([[-1.0], [1.0], [0.0]])
    >>> F0 = np.array([[0.0, 0, -2], [0, 0, 0], [-2, 0, 0]])
    >>> gain = LMIBlock(name="gain", F0=F0[None], Fg=np.diag([0.0, 1, 1])[None], terms=[Term("X", V, U)])
    >>> problem = LMIProblem(unknowns=[MatrixUnknown(name="X", size=1)], blocks=[gain])
    >>> problem.smallest_eigenvalues({"X": np.array([[[2.0]]])}, 2.5)["gain"] > 0
    array([ True])
    """

    unknowns: Sequence[MatrixUnknown]
    blocks: Sequence[LMIBlock]

    def __post_init__(self) -> None:
        object.__setattr__(self, "unknowns", tuple(self.unknowns))
        object.__setattr__(self, "blocks", tuple(self.blocks))
        known = {unknown.name: unknown for unknown in self.unknowns}
        if len(known) < len(self.unknowns):
            raise DimensionError(f"unknowns are {[u.name for u in self.unknowns]}, wanted different names.")
        for block in self.blocks:
            for term in block.terms:
                unknown = known.get(term.unknown)
                if unknown is None:
                    raise DimensionError(f"block {block.name} names {term.unknown!r}; the unknowns are {list(known)}.")
                assert term.value is not None and term.inner is not None
                sizes = (term.V.shape[-1], term.value.shape[1])
                if sizes != (unknown.size, unknown.count):
                    raise DimensionError(
                        f"block {block.name} takes {term.unknown} as {sizes[1]} matrices of size {sizes[0]}, "
                        f"wanted {unknown.count} of size {unknown.size}."
                    )

    @property
    def n_variables(self) -> int:
        """Number of scalar unknowns, gamma among them."""
        return 1 + sum(u.count * u.size * (u.size + 1) // 2 for u in self.unknowns)

    @property
    def n_inequalities(self) -> int:
        """Number of matrix inequalities."""
        return sum(block.m for block in self.blocks)

    def evaluate(self, unknowns: Mapping[str, Array], gamma: float) -> list[Array]:
        """Z of every block, (m, s, s) each."""
        return [block.evaluate(unknowns, gamma) for block in self.blocks]

    def smallest_eigenvalues(self, unknowns: Mapping[str, Array], gamma: float) -> dict[str, Array]:
        """Smallest eigenvalue of every inequality, (m,) for each block name (blocks of one name are joined)."""
        found: dict[str, list[Array]] = {}
        for block, Z in zip(self.blocks, self.evaluate(unknowns, gamma)):
            found.setdefault(block.name, []).append(np.asarray(np.linalg.eigvalsh(Z)[:, 0], dtype=float))
        return {name: np.concatenate(values) for name, values in found.items()}

    def at_level(self, gamma: float) -> LMIProblem:
        """The same inequalities at a fixed gamma; the scalar unknown is then free for another use."""
        return replace(
            self,
            blocks=[
                replace(block, F0=block.F0 + gamma * block.Fg, Fg=None) if block.Fg is not None else block
                for block in self.blocks
            ],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class InfeasibilityCertificate:
    r"""Multipliers :math:`\Lambda_k \succeq 0` that no gamma and no Y can satisfy all inequalities.

    For every feasible point :math:`\sum_k \langle \Lambda_k, Z_k \rangle \ge 0`. Here that sum is
    :math:`\sum \langle \Lambda_k, F_{0,k} \rangle < 0`, up to residuals, charged with the bounds of the unknowns.

    Attributes
    ----------
    multipliers : tuple of (m, s, s)
        One array a block, positive semidefinite.
    value : float
        Upper bound on the sum for gamma <= `gamma`, below zero.
    gamma : float
        Level up to which infeasibility is shown; infinity where no gamma helps.
    residual : float
        Largest nuclear norm of what the multipliers leave of an unknown matrix.
    """

    multipliers: tuple[Array, ...]
    value: float
    gamma: float
    residual: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LMISolution:
    """What a solver found; eigenvalues and bounds are recomputed from the problem, whatever the solver said.

    Attributes
    ----------
    status : str
        "optimal": all inequalities hold at `gamma`, which is within the wanted gap of its lower bound;
        "feasible": they hold, the gap is open (stopped early, or by time or round-off, see `message`);
        "infeasible": shown by `certificate`; "not solved": nothing can be said.
    unknowns : dict of name -> (count, size, size)
        Symmetric; the last iterate where nothing is feasible.
    gamma : float
        Upper bound: all inequalities hold, recomputed. Infinity if none was found.
    gamma_lower : float
        Lower bound from the dual, residuals charged with the bounds of the unknowns; -infinity if there is none.
    gap : float
        (gamma - dual estimate) / |gamma| at the end, without that charge.
    iterations : int
    eigenvalues : dict of block name -> (m,)
        Smallest eigenvalue of every inequality at `unknowns` and `gamma`.
    certificate : InfeasibilityCertificate or None
    solver : str
    message : str
        Why it ended, in a sentence.
    seconds : float
        Wall time.
    """

    status: str
    unknowns: dict[str, Array]
    gamma: float
    gamma_lower: float
    gap: float
    iterations: int
    eigenvalues: dict[str, Array]
    certificate: InfeasibilityCertificate | None = None
    solver: str = "structured"
    message: str = ""
    seconds: float = 0.0
    history: tuple[dict[str, float], ...] = field(default=(), repr=False)

    @property
    def usable(self) -> bool:
        """All inequalities hold."""
        return self.status in ("optimal", "feasible")

    @property
    def margin(self) -> float:
        """Smallest of all eigenvalues."""
        return min((float(v.min()) for v in self.eigenvalues.values()), default=-np.inf)


def combined(coefficients: Array, Y: Array) -> Array:
    """sum_i c_ki Y_i as (m, n, n)."""
    m, n = coefficients.shape[0], Y.shape[-1]
    return np.asarray((coefficients @ Y.reshape(Y.shape[0], n * n)).reshape(m, n, n))


def term_value(term: Term, Y: Array) -> Array:
    """U Y(c) V' + V Y(c) U' + V Y(h) V' as (m, s, s)."""
    assert term.value is not None and term.inner is not None
    half = term.V @ (0.5 * combined(term.inner, Y))
    if term.U is not None:
        half = half + term.U @ combined(term.value, Y)
    Z = half @ term.V.swapaxes(-1, -2)
    return np.asarray(Z + Z.swapaxes(-1, -2))


def _symmetric(name: str, value: ArrayLike) -> Array:
    array = finite_array(name, value, (None, None, None))
    if array.shape[1] != array.shape[2]:
        raise DimensionError(f"{name} has shape {array.shape}, wanted (m, s, s).")
    skew = np.abs(array - array.swapaxes(1, 2)).max(initial=0.0)
    if skew > 1e-9 * max(float(np.abs(array).max(initial=0.0)), 1e-300):
        raise DomainError(f"{name} differs from its transpose by {skew:.3g}. Pass a symmetric matrix.")
    out: Array = read_only(0.5 * (array + array.swapaxes(1, 2)))
    return out


def _normal_term(name: str, term: Term, m: int, s: int) -> Term:
    """The term with all parts stacked: V, U (m, s, n), value and inner (m, count)."""
    what = f"of {term.unknown} in block {name}"

    def stacked(label: str, value: ArrayLike, n: int | None) -> Array:
        array = np.asarray(value, dtype=float)
        if array.ndim == 2:
            array = np.broadcast_to(array, (m, *array.shape))
        array = finite_array(f"{label} {what}", array, (m, s, n))
        out: Array = read_only(array)
        return out

    V = stacked("V", term.V, None)
    U = None if term.U is None else stacked("U", term.U, V.shape[2])
    value = None if term.value is None else finite_array(f"value {what}", term.value, (m, None))
    inner = None if term.inner is None else finite_array(f"inner {what}", term.inner, (m, None))
    if value is None:
        value = np.ones((m, 1)) if U is not None else np.zeros((m, 1 if inner is None else inner.shape[1]))
    if inner is None:
        inner = np.zeros_like(value)
    if value.shape != inner.shape:
        raise DimensionError(f"value {what} has shape {value.shape} and inner {inner.shape}, wanted the same.")
    return Term(term.unknown, V, U, read_only(value), read_only(inner))
