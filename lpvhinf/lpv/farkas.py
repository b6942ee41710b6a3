r"""Shows that no gamma satisfies the inequalities of a problem, where that is so.

For large gamma an inequality :math:`F_0 + \gamma F_g + F y \succeq 0` with :math:`F_g \succeq 0` asks for
:math:`Q^\top (F_0 + F y) Q \succeq 0` on the null space Q of :math:`F_g`, and nothing else. The least t with

.. math:: Q_k^\top (F_{0,k} + (F y)_k) Q_k + t I \succeq 0, \quad \text{inequalities without gamma as they are,}

is therefore positive only where no gamma serves. Its multipliers :math:`M_k` are, as
:math:`\Lambda_k = Q_k M_k Q_k^\top`, the certificate, which is then checked against the original problem, whatever the
solver said.
"""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array, read_only
from lpvhinf.lpv.lmi import InfeasibilityCertificate, LMIBlock, LMIProblem, Term
from lpvhinf.lpv.operator import LMIOperator
from lpvhinf.lpv.verdict import multiplier_sums

#: Eigenvalues of Fg below this share of the largest count as zero.
NULL = 1e-12
#: A multiplier may be indefinite by this share of its norm: round-off of Q M Q'.
INDEFINITE = 1e-13
#: A certificate up to a level of this or more stands for every level.
ANY_LEVEL = 1e9


def without_gamma(problem: LMIProblem) -> tuple[LMIProblem, list[list[tuple[int, Array, int, int]]]] | None:
    """The problem in t, and for each original block where its inequalities went: (index, Q, block, place).

    None if no inequality with gamma leaves anything to ask for: then infeasibility, if any, is not of this kind.
    """
    blocks: list[LMIBlock] = []
    origin: list[list[tuple[int, Array, int, int]]] = []
    asked = False
    for block in problem.blocks:
        if block.Fg is None:
            eye = np.eye(block.size)
            origin.append([(k, eye, len(blocks), k) for k in range(block.m)])
            blocks.append(block)
            continue
        groups: dict[int, list[tuple[int, Array]]] = {}
        for k, Fg in enumerate(block.Fg):
            values, vectors = np.linalg.eigh(Fg)
            if values[0] < -NULL * values[-1]:
                return None  # a larger gamma would not always help
            Q = vectors[:, values <= NULL * values[-1]]
            if Q.shape[1]:
                groups.setdefault(Q.shape[1], []).append((k, Q))
        places = []
        for members in groups.values():
            asked = True
            index, Q = [k for k, _ in members], np.stack([Q for _, Q in members])
            QT = Q.swapaxes(1, 2)
            terms = []
            for term in block.terms:
                assert term.value is not None and term.inner is not None
                U = None if term.U is None else QT @ term.U[index]
                terms.append(Term(term.unknown, QT @ term.V[index], U, term.value[index], term.inner[index]))
            places += [(k, Q[i], len(blocks), i) for i, k in enumerate(index)]
            eye = np.tile(np.eye(Q.shape[2]), (len(index), 1, 1))
            blocks.append(LMIBlock(name=block.name, F0=QT @ block.F0[index] @ Q, Fg=eye, terms=terms))
        origin.append(places)
    return (LMIProblem(unknowns=problem.unknowns, blocks=blocks), origin) if asked else None


def certificate(problem: LMIProblem, multipliers: list[Array]) -> InfeasibilityCertificate | None:
    """The certificate that multipliers make, checked; None if they show nothing.

    Parameters
    ----------
    problem : LMIProblem
    multipliers : list of (m, s, s)
        One array a block; only their symmetric part counts.
    """
    X = []
    for given in multipliers:
        x = 0.5 * (given + given.swapaxes(1, 2))
        least = np.linalg.eigvalsh(x)[:, 0]
        size = float(np.abs(x).max(initial=0.0))
        if np.any(least < -INDEFINITE * size):
            return None
        X.append(x + np.maximum(0.0, -2.0 * least)[:, None, None] * np.eye(x.shape[1]))
    constant, weight, residual = multiplier_sums(LMIOperator(problem), X)
    if not constant < 0.0:
        return None
    return InfeasibilityCertificate(
        multipliers=tuple(read_only(x) for x in X),
        value=constant,
        gamma=-constant / weight if weight > 0.0 else np.inf,
        residual=residual,
    )


def lifted(problem: LMIProblem, found: list[Array], origin: list[list[tuple[int, Array, int, int]]]) -> list[Array]:
    """Multipliers of the original blocks from those of the problem in t."""
    out = [np.zeros_like(block.F0) for block in problem.blocks]
    for X, places in zip(out, origin):
        for k, Q, block, place in places:
            X[k] = Q @ found[block][place] @ Q.T
    return out
