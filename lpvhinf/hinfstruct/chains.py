"""Structures one after another, and sums of structures."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError
from lpvhinf.hinfstruct.structures import ControllerStructure, Realization, parameter_names


class _Several:
    """Parameters, states and names of structures, one after another."""

    parts: tuple[ControllerStructure, ...]

    def _collect(self, kind: str, parts: tuple[ControllerStructure, ...]) -> None:
        if not parts:
            raise DimensionError(f"{kind} got no structure, wanted at least one.")
        self.parts = parts
        self.n_x, self.n_parameters = sum(part.n_x for part in parts), sum(part.n_parameters for part in parts)
        self._cuts = np.cumsum([part.n_parameters for part in parts])[:-1]
        self.names = tuple(f"{kind} {i}: {name}" for i, part in enumerate(parts) for name in parameter_names(part))

    def split(self, theta: Array) -> list[Array]:
        """The parameters of every part."""
        return np.split(np.asarray(theta, dtype=float), self._cuts)

    def _realized(self, theta: Array, p: Array | None) -> list[Realization]:
        return [part.realize(t, p) for part, t in zip(self.parts, self.split(theta), strict=True)]

    def initial(self, rng: np.random.Generator) -> Array:
        """The starts of the parts."""
        return np.concatenate([part.initial(rng) for part in self.parts])


class Series(_Several):
    r"""A chain of structures: the first sees y, the last drives u, :math:`K = K_m \cdots K_2 K_1`.

    Parameters
    ----------
    *stages : ControllerStructure
        In the order in which the signal passes them. theta is their parameters one after another; so are the states.

    Raises
    ------
    DimensionError
        If no stage is given, or the outputs of a stage do not fit the inputs of the next one.

    Examples
    --------
    A PD controller with a notch, on one channel:

    >>> from lpvhinf.hinfstruct.filters import Notch
    >>> from lpvhinf.hinfstruct.pid import PID
    >>> chain = Series(Notch(1, f=(80.0, 250.0)), PID(1, terms="PD", sign=-1))
    >>> chain.n_x, chain.n_parameters
    (3, 6)
    """

    def __init__(self, *stages: ControllerStructure) -> None:
        self._collect("stage", stages)
        for k, (before, after) in enumerate(pairwise(stages)):
            if before.n_u != after.n_y:
                raise DimensionError(
                    f"stage {k} has {before.n_u} outputs, but stage {k + 1} has {after.n_y} inputs. Make them equal."
                )
        self.n_y, self.n_u = stages[0].n_y, stages[-1].n_u

    @staticmethod
    def _after(first: Realization, second: Realization) -> Realization:
        A1, B1, C1, D1 = first
        A2, B2, C2, D2 = second
        A = np.block([[A1, np.zeros((A1.shape[0], A2.shape[0]))], [B2 @ C1, A2]])
        return A, np.vstack([B1, B2 @ D1]), np.hstack([D2 @ C1, C2]), D2 @ D1

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """(A, B, C, D) of the chain, A block lower triangular."""
        parts = self._realized(theta, p)
        out = parts[0]
        for part in parts[1:]:
            out = self._after(out, part)
        return out

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The pullbacks of the stages, the last product undone first."""
        stages, thetas = self._realized(theta, p), self.split(theta)
        chains = [stages[0]]
        for stage in stages[1:]:
            chains.append(self._after(chains[-1], stage))
        out = []
        for k in range(len(stages) - 1, 0, -1):
            _, _, C1, D1 = chains[k - 1]
            _, B2, _, D2 = stages[k]
            n = chains[k - 1][0].shape[0]
            own = (
                GA[n:, n:],
                GA[n:, :n] @ C1.T + GB[n:] @ D1.T,
                GC[:, n:],
                GC[:, :n] @ C1.T + GD @ D1.T,
            )
            out.append(self.parts[k].pullback(thetas[k], *own, p))
            GA, GB, GC, GD = (
                GA[:n, :n],
                GB[:n],
                B2.T @ GA[n:, :n] + D2.T @ GC[:, :n],
                B2.T @ GB[n:] + D2.T @ GD,
            )
        out.append(self.parts[0].pullback(thetas[0], GA, GB, GC, GD, p))
        return np.concatenate(out[::-1])


class Sum(_Several):
    r"""Structures with the same inputs whose outputs add up, :math:`K = K_1 + \dots + K_m`.

    Parameters
    ----------
    *terms : ControllerStructure
        All with the same n_u and n_y. theta is their parameters one after another; so are the states.

    Raises
    ------
    DimensionError
        If no term is given, or sizes disagree.

    Examples
    --------
    >>> from lpvhinf.hinfstruct import FixedOrder, StaticGain
    >>> Sum(StaticGain(1, 2), FixedOrder(2, 1, 2, strictly_proper=True)).n_parameters
    12
    """

    def __init__(self, *terms: ControllerStructure) -> None:
        self._collect("term", terms)
        for k, term in enumerate(terms):
            if (term.n_u, term.n_y) != (terms[0].n_u, terms[0].n_y):
                raise DimensionError(
                    f"term {k} is {term.n_u}x{term.n_y}, but term 0 is {terms[0].n_u}x{terms[0].n_y}. Make them equal."
                )
        self.n_u, self.n_y = terms[0].n_u, terms[0].n_y

    def realize(self, theta: Array, p: Array | None = None) -> Realization:
        """Block-diagonal A, B stacked, C side by side, the sum of D."""
        parts = self._realized(theta, p)
        A = block_diag(*[part[0] for part in parts])
        D = np.sum([part[3] for part in parts], axis=0)
        return A, np.vstack([part[1] for part in parts]), np.hstack([part[2] for part in parts]), D

    def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
        """The pullbacks of the terms' own blocks."""
        out, x = [], 0
        for part, t in zip(self.parts, self.split(theta), strict=True):
            own = slice(x, x + part.n_x)
            out.append(part.pullback(t, GA[own, own], GB[own], GC[:, own], GD, p))
            x += part.n_x
        return np.concatenate(out)
