"""Random LMI problems with known properties."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.lpv.lmi import LMIBlock, LMIProblem, MatrixUnknown, Term


def positive_stack(rng: np.random.Generator, m: int, s: int) -> Array:
    factor = rng.normal(size=(m, s, s))
    return np.asarray(factor @ factor.swapaxes(1, 2) + 0.1 * np.eye(s))


def random_problem(seed: int = 0) -> LMIProblem:
    """Two families of different size and number, every kind of term; nothing is promised about its solution."""
    rng = np.random.default_rng(seed)
    draw = rng.normal

    def symmetric(m: int, s: int) -> Array:
        M = draw(size=(m, s, s))
        return np.asarray(M + M.swapaxes(1, 2))

    return LMIProblem(
        unknowns=[MatrixUnknown(name="R", size=4, count=2), MatrixUnknown(name="S", size=3, count=3)],
        blocks=[
            LMIBlock(
                name="full",
                F0=symmetric(5, 6),
                Fg=symmetric(5, 6),
                terms=[
                    Term("R", draw(size=(5, 6, 4)), draw(size=(5, 6, 4)), draw(size=(5, 2)), draw(size=(5, 2))),
                    Term("S", draw(size=(5, 6, 3)), draw(size=(5, 6, 3)), draw(size=(5, 3)), draw(size=(5, 3))),
                ],
            ),
            LMIBlock(
                name="mixed",
                F0=symmetric(2, 7),
                terms=[
                    Term("S", draw(size=(2, 7, 3)), inner=draw(size=(2, 3))),
                    Term("R", draw(size=(2, 7, 4)), draw(size=(2, 7, 4)), draw(size=(2, 2)), draw(size=(2, 2))),
                ],
            ),
            LMIBlock(name="inner", F0=symmetric(3, 4), terms=[Term("R", np.eye(4), inner=draw(size=(3, 2)))]),
        ],
    )


def gain_problem(A: Array, B: Array, C: Array, bound: float = 1e4) -> LMIProblem:
    """The L2 gain of a system by the bounded-real lemma, with 0 <= X <= bound I."""
    n, n_w, n_z = A.shape[0], B.shape[1], C.shape[0]
    s = n + n_w + n_z
    V, U, F0, Fg = np.zeros((s, n)), np.zeros((s, n)), np.zeros((s, s)), np.zeros((s, s))
    V[:n], U[:n], U[n : n + n_w] = np.eye(n), -A.T, -B.T
    F0[:n, n + n_w :], F0[n + n_w :, :n] = -C.T, -C
    Fg[n:, n:] = np.eye(n_w + n_z)
    one = np.ones((1, 1))
    return LMIProblem(
        unknowns=[MatrixUnknown(name="X", size=n, bound=bound)],
        blocks=[
            LMIBlock(name="gain", F0=F0[None], Fg=Fg[None], terms=[Term("X", V, U)]),
            LMIBlock(name="positive", F0=-1e-3 * np.eye(n)[None], terms=[Term("X", np.eye(n), inner=one)]),
            LMIBlock(name="bound", F0=bound * np.eye(n)[None], terms=[Term("X", np.eye(n), inner=-one)]),
        ],
    )
