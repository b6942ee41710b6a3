"""Decide whether a certificate proves its claim: docs/certificate_format.md, sections 4 to 8.

Nothing is shared with the engine, and no eigenvalue, LMI or Riccati equation occurs: symmetric matrices are shown to be
positive definite, in one of two kinds of numbers. `Floats` bound every rounding of binary64 (sums in any order, fused
operations, underflow); `Integers` are multiples of 2^-80, rounded down. What cannot harm (T, L) need not be exact.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any, ClassVar

import numpy as np

Index = tuple[int, ...]
Cell = Sequence[tuple[Fraction, Fraction]]  # centre and half width on every axis


class NotProved(Exception):
    """The claim does not follow from the file; the message says where."""


@dataclass(frozen=True)
class Enclosure:
    """All sum_k terms[k] delta^index[k] + E, |E| <= radius, for delta in [-1, 1]^n_p: (K, rows, cols), (rows, cols)."""

    index: Sequence[Index]
    terms: Any
    radius: Any


class Floats:
    """Arrays of binary64."""

    dtype: ClassVar[Any] = np.float64
    take = approximate = staticmethod(lambda x: np.asarray(x, dtype=np.float64))
    ratio = divide = staticmethod(lambda a, b: a / b)  # of Python integers it is rounded correctly
    dot = staticmethod(lambda a, b: a @ b)

    @staticmethod
    def error(bound: Any, k: int) -> Any:
        """What k roundings change in a sum of products whose sizes add up to at most `bound`.

        And what inexact factors change if `bound` counts each as at least 1. Factor 2 and 8 cover higher orders.
        """
        return bound * ((2 * k + 8) * 2.0**-53) + (k + 1) * 2.0**-1022

    @classmethod
    def grow(cls, x: Any, k: int) -> Any:
        """At least the number >= 0 of which x was computed with k roundings."""
        return x + cls.error(x, k)

    @classmethod
    def combine(cls, weights: list[list[Fraction]], stack: Any) -> tuple[Any, Any]:
        """Exact weights (I, K) times a stack (K, ...), and one error bound for all I results."""
        table = np.array([[cls.ratio(v.numerator, v.denominator) for v in row] for row in weights], dtype=cls.dtype)
        flat, largest = stack.reshape(len(stack), -1), np.maximum(abs(table).max(axis=0), cls.take(np.ones(1)))
        error = cls.error(cls.grow(cls.dot(largest[None], abs(flat)), len(stack)), len(stack) + 2)
        return cls.dot(table, flat).reshape(len(table), *stack.shape[1:]), error.reshape(stack.shape[1:])

    @classmethod
    def product(cls, x: Enclosure, y: Enclosure) -> Enclosure:
        """All x' y; the rounding of all terms is bounded at once, by the product of the sizes."""
        X, Y = (cls.grow(abs(z.terms).sum(axis=0) + z.radius, len(z.index) + 1) for z in (x, y))
        (K, c, r), (L, _, s) = x.terms.shape, y.terms.shape
        sums = [[tuple(map(int.__add__, a, b)) for a in x.index] for b in y.index]
        place = {k: i for i, k in enumerate(dict.fromkeys(itertools.chain(*sums)))}
        left, terms = x.terms.swapaxes(1, 2).reshape(K * r, c), np.zeros((len(place), r, s), dtype=cls.dtype)
        for row, factor in zip(sums, y.terms):
            terms[[place[k] for k in row]] += cls.dot(left, factor).reshape(K, r, s)
        spread = cls.grow(cls.dot(X.T, y.radius) + cls.dot(x.radius.T, Y), c + 2)
        rounding = cls.error(cls.grow(cls.dot(X.T, Y), c), c + K + L) + cls.error(0 * spread, K * L * c)
        return Enclosure(list(place), terms, cls.grow(spread + rounding, 2))

    @classmethod
    def expand(cls, c: Any, cell: Cell, degree: int, slopes: int, memory: dict[str, Any]) -> tuple[Any, Any]:
        """A Chebyshev series (k_1, ..., k_np, N) on the cell x_i = a_i + r_i delta_i, inside [-1, 1].

        Coefficients of powers of delta (indices, N); bounds (1 + slopes, N) of the rest and of derivatives to delta_i.
        """
        n_p, shape, N, every = len(cell), c.shape[:-1], c.shape[-1], indices(len(cell), degree)
        maps = [restriction(a, r, k) for (a, r), k in zip(cell, shape)]
        local = memory["local"] if memory.get("interval") == cell[0] else c
        for i, (rows, _) in enumerate(maps):
            if i > 0 or local is c:
                R = np.array([[cls.ratio(v, scale) for v in row] for row, scale in rows], dtype=cls.dtype)
                local = np.moveaxis(cls.dot(R.T, local.reshape(len(R), -1)).reshape(local.shape), 0, n_p - 1)
            memory |= {"interval": cell[0], "local": local} if i == 0 else {}  # the next cell may use it again
        zero, rest = np.zeros(N, dtype=cls.dtype), abs(local)
        kept = [k for k in every if all(map(int.__lt__, k, shape))]
        low = np.stack([local[k] if k in kept else zero for k in every])
        for k in kept:
            rest[k] = zero
        terms, wrong = cls.combine(chebyshev_to_powers(n_p, degree), low)
        many, bounds = math.prod(shape), []
        for axis in range(-1, slopes):
            left = rest if axis < 0 else rest * (np.indices(shape)[axis] ** 2).astype(cls.dtype)[..., None]
            bound = cls.grow(left.reshape(many, N).sum(axis=0) + wrong * len(every) ** 2, many + 3)
            reach = math.prod(sums[int(i == axis)] for i, (_, sums) in enumerate(maps))
            rounding = cls.error(cls.grow(abs(c).reshape(many, N).sum(axis=0) * reach, many), sum(shape) + 8 * n_p)
            small = cls.error(zero, (n_p + 1) * many * reach)  # every coefficient and every step, in absolute terms
            bounds.append(cls.grow(bound + rounding + small, 3))
        return terms, np.stack(bounds)

    @classmethod
    def positive(cls, halves: Any, radius: Any, more: Any) -> bool:
        """Whether V + V' + E > 0 for all V within `radius` of one of `halves` (., m, m), symmetric |E| <= `more`."""
        radius = cls.grow(radius + radius.T + more, 2)
        size, w, i = cls.approximate(radius), np.ones(len(radius)), np.arange(len(radius))
        for _ in range(4):  # diag(f) >= E for f = radius w / w and any w > 0; the Perron vector is best
            w = np.maximum(size @ w, 1e-4 * np.max(size @ w) + 1e-300)
            w = w / np.max(w)
        weights = cls.take(w)
        f = cls.grow(cls.divide(cls.grow(cls.dot(radius, weights[:, None])[:, 0], len(w)), weights), 2)
        for W in halves + halves.swapaxes(1, 2):
            guess = cls.approximate(W) - np.diag(cls.approximate(f))
            # any L will do: W - diag(f) = L L' + Z, and Z > 0 if it is strictly diagonally dominant
            L = cls.take(np.linalg.cholesky(guess - 1e-10 * np.max(np.abs(guess.diagonal())) * np.eye(len(w))))
            Z, bound = W - cls.dot(L, L.T), cls.grow(cls.dot(abs(L), abs(L).T), len(w)) + abs(W)
            beside, wrong = abs(Z), cls.error(bound, len(w) + 2)
            beside[i, i] = f
            if not np.all(Z[i, i] > cls.grow((beside + wrong).sum(axis=1), len(w) + 4)):
                return False
        return True


class Integers(Floats):
    """Object arrays of Python integers v, each the number v 2^-80."""

    dtype: ClassVar[Any] = object
    approximate = staticmethod(lambda x: np.asarray(x / 2**80, dtype=np.float64))
    ratio = divide = staticmethod(lambda a, b: (a << 80) // b)
    error = staticmethod(lambda bound, k: ((bound * (2 * k + 8)) >> 80) + (k + 1))

    @staticmethod
    def take(x: Any) -> Any:
        """Floating-point numbers, rounded down."""
        mantissa, exponent = np.frexp(np.asarray(x, dtype=np.float64))
        whole, shift = np.ldexp(mantissa, 53).astype(np.int64).astype(object), exponent.astype(object) + 27
        return (whole << np.maximum(shift, 0)) >> np.maximum(-shift, 0)

    @staticmethod
    def dot(a: Any, b: Any) -> Any:
        """Digits of 20 bits multiplied as floats: sums of up to 2^12 products of 40 bits are exact in binary64."""

        def digits(x: Any) -> list[Any]:  # all but the last, which has the sign, are >= 0
            n = int(np.max(abs(x), initial=0)).bit_length() // 20 + 1
            parts = [(x >> (20 * i)) & (2**20 - 1) if i < n - 1 else x >> (20 * i) for i in range(n)]
            return [part.astype(np.float64) for part in parts]

        left, right = digits(a), digits(b)
        n = max(len(left) + len(right) - 1, 4)
        level = [np.zeros((a.shape[0], b.shape[1]), dtype=np.int64) for _ in range(n)]
        for (i, x), (j, y) in itertools.product(enumerate(left), enumerate(right)):
            for start in range(0, a.shape[1] if x.any() and y.any() else 0, 2**12):
                part = slice(start, start + 2**12)
                level[i + j] += (x[:, part] @ y[part]).astype(np.int64)
        carry, out = np.zeros_like(level[0]), np.zeros(level[0].shape, dtype=object)
        for k in range(n):
            carry, level[k] = (level[k] + carry) >> 20, (level[k] + carry) & (2**20 - 1)
        for k in range(4, n, 3):  # three digits at a time; the lowest four are rounded off
            word = sum((digit << (20 * i) for i, digit in enumerate(level[k : k + 3])), np.zeros_like(carry))
            out += word.astype(object) << (20 * (k - 4))
        return out + (carry.astype(object) << (20 * (n - 4)))


@cache
def indices(n_p: int, degree: int) -> list[Index]:
    """All multi-indices with sum <= degree, ordered by (sum, index)."""
    every = (k for k in itertools.product(range(degree + 1), repeat=n_p) if sum(k) <= degree)
    return sorted(every, key=lambda k: (sum(k), k))


@lru_cache(maxsize=512)
def restriction(a: Fraction, r: Fraction, n: int) -> tuple[list[tuple[list[int], int]], list[int]]:
    """T_j(a + r t) = sum_k R_jk T_k(t), j, k < n: rows of R, denominators; bounds of sum_k k^e |R_jk|, e = 0, 2."""
    scale = math.lcm(a.denominator, r.denominator)
    A, B = int(a * scale), int(r * scale)
    rows = [[1] + [0] * n, [A, B] + [0] * (n - 1)]  # row j times scale^j, exactly
    for _ in range(n - 2):  # T_j+1 = 2 x T_j - T_j-1; t T_0 = T_1 and t T_k = (T_k-1 + T_k+1) / 2
        c, before = rows[-1], rows[-2]
        around = [u + v for u, v in zip([0, 2 * c[0], *c[1:-1]], [*c[1:], 0])]
        rows.append([2 * A * u + B * v - scale**2 * w for u, v, w in zip(c, around, before)])
    scaled = [(row[:n], scale**j) for j, row in enumerate(rows[:n])]
    return scaled, [max(1 + sum(k**e * abs(v) for k, v in enumerate(row)) // q for row, q in scaled) for e in (0, 2)]


@cache
def chebyshev_to_powers(n_p: int, d: int) -> list[list[Fraction]]:
    """Z with T_b = sum_a Z_ab delta^a over the indices up to d."""
    one = [np.polynomial.chebyshev.cheb2poly([0] * j + [1]).astype(int).tolist() + [0] * d for j in range(d + 1)]
    every = indices(n_p, d)
    return [[Fraction(math.prod(one[j][i] for i, j in zip(a, b))) for b in every] for a in every]


@cache
def bernstein(n_p: int, d: int) -> list[list[Fraction]]:
    """Weights (control points, indices) of powers of delta in the tensor Bernstein basis of degree d; sizes <= 1."""
    # the i-th control point of t^k: mean of all products of k of the numbers -1 (d - i times) and 1 (i times)
    comb, r, net = math.comb, range(d + 1), itertools.product(range(d + 1), repeat=n_p)
    one = [
        [Fraction(sum((-1) ** j * comb(d - i, j) * comb(i, k - j) for j in range(k + 1)), comb(d, k)) for k in r]
        for i in r
    ]
    return [[math.prod([one[i][k] for i, k in zip(at, c)], start=Fraction(1)) for c in indices(n_p, d)] for at in net]


def loop(F: type[Floats], it: Mapping[str, Any], cell: Cell, memory: dict[str, Any]) -> Enclosure:
    """The transpose of K (section 4) on a cell of the claim's box."""
    maps, n, m, index = [], it["n"], it["m"], indices(len(cell), it["degree"])
    for (c, h), (low, high), (first, last) in zip(cell, it["box"], it["system_box"]):
        wide = last - first
        maps.append(((low + high + c * (high - low) - first - last) / wide, h * (high - low) / wide))
    terms, radius = np.zeros((len(index), m, m), dtype=F.dtype), np.zeros((m, m), dtype=F.dtype)
    terms[0] = F.take(np.diag(np.where(np.arange(m) < n, it["decay"], -it["gamma"] / 2)))
    for name, row, column in it["blocks"]:
        shape, entries = it[f"{name}_shape"], it[f"{name}_entries"]
        if name not in memory:
            memory[name] = {"c": F.take(it[f"{name}_coefficients"]).reshape(*shape[:-2], len(entries))}
        values, bounds = F.expand(memory[name]["c"], maps, it["degree"], 0, memory[name])
        i, j = row + entries // shape[-1], column + entries % shape[-1]
        terms[:, j, i] += values
        radius[j, i] += bounds[0]
        if f"remainder_{name}" in it:
            radius[column : column + shape[-1], row : row + shape[-2]] += F.take(it[f"remainder_{name}"]).T
    return Enclosure(index, terms, F.grow(radius + F.error(abs(terms[0]), 2), 3))


def lyapunov(F: type[Floats], it: Mapping[str, Any], leaf: int, cell: Cell) -> tuple[Any, Enclosure, list[Enclosure]]:
    """S, X and half of dX/dt at every vertex of the rates, on a cell; S and X may be rounded first, being hints."""
    n, m, n_p, index = it["n"], it["m"], len(cell), indices(len(cell), it["lyapunov_degree"])
    terms, bounds = np.zeros((len(index), m, m), dtype=F.dtype), np.zeros((1 + n_p, m, m), dtype=F.dtype)
    S, (row, column), start = np.eye(m), np.tril_indices(n), 0 if it["layout"] == "cells" else n
    terms[0, start:, start:] = F.take(np.eye(m - start))
    S[:n, :n] = it["S"] if start else it["S"][leaf]
    if start == 0:
        terms[1:, row, column] = terms[1:, column, row] = F.take(it["X"][leaf])
    else:
        values, rest = F.expand(F.take(it["X"]), cell, it["lyapunov_degree"], n_p, {})
        terms[:, row, column] = terms[:, column, row] = values
        bounds[:, row, column] = bounds[:, column, row] = rest
    drifts, units = [], np.eye(n_p, dtype=int).tolist()
    for v in itertools.product(*it["rate"]):  # dX/dt = sum of v_i 2 / ((high_i - low_i) h_i) dX/ddelta_i
        speed = [a / ((high - low) * h) for a, (low, high), (_, h) in zip(v, it["box"], cell)]
        table = [[Fraction(0)] * len(index) for _ in index]
        for (a, up), (axis, unit) in itertools.product(enumerate(index), enumerate(units)):
            if up[axis]:
                table[index.index(tuple(map(int.__sub__, up, unit)))][a] += speed[axis] * up[axis]
        (moved, wrong), (rest, more) = F.combine(table, terms), F.combine([[abs(s) for s in speed]], bounds[1:])
        drifts.append(Enclosure(index, moved, F.grow(rest[0] + wrong * len(index) + more, 3)))
    return S, Enclosure(index, terms, bounds[0]), drifts


def holds(F: type[Floats], it: Mapping[str, Any], leaf: int, cell: Cell, memory: dict[str, Any]) -> bool:
    """Inequalities (1) and (2) of section 4 on one cell."""
    K, (S, X, drifts) = loop(F, it, cell, memory), lyapunov(F, it, leaf, cell)
    T = np.linalg.inv(S)
    N0 = -(S @ F.approximate(K.terms[0]).T @ T).T @ F.approximate(X.terms[0])
    scale = 1.0 / np.sqrt(2.0 * N0.diagonal())
    T = (T * scale) @ np.linalg.inv(np.linalg.cholesky((N0 + N0.T) * scale * scale[:, None])).T
    zero, place = np.zeros(S.shape, dtype=F.dtype), {k: i for i, k in enumerate(indices(len(cell), it["degree"]))}
    first, last = (Enclosure(K.index[:1], F.take(x)[None], zero) for x in (S.T, T))
    G, H = F.product(first, last), F.product(first, F.product(K, last))
    still = F.product(H, F.product(X, G))
    for drift in drifts:
        more = F.product(G, F.product(drift, G))
        index, terms = [*still.index, *more.index], np.concatenate([still.terms, more.terms])
        low = [i for i, k in enumerate(index) if k in place]
        high = terms[[i for i, k in enumerate(index) if k not in place]]
        weights = [[row[place[index[i]]] for i in low] for row in bernstein(len(cell), it["degree"])]
        net, wrong = F.combine(weights, -terms[low])
        rest = F.grow(abs(high + high.swapaxes(1, 2)).sum(axis=0), len(index))
        if not F.positive(net, F.grow(still.radius + more.radius + wrong, 2), rest):
            return False
    P = F.product(G, F.product(Enclosure(X.index[:1], X.terms[:1], X.radius), G))
    return F.positive(P.terms, P.radius, zero)


def check(it: Mapping[str, Any], *, exact: bool = False) -> None:
    """Prove the claim on all cells, or raise `NotProved`.

    `it` has the names of the format document; "box", "system_box", "rate" as rows of fractions; "m", "n" and "cells";
    "blocks": name, row and column of every matrix in K. "gamma" is 0 for stability; rows of "rate" are [0] where null.
    """
    memory: dict[str, Any] = {}
    for leaf, cell in sorted(enumerate(it["cells"]), key=lambda item: item[1][0]):
        try:
            with np.errstate(all="ignore"):
                proved = holds(Integers if exact else Floats, it, leaf, cell, memory)
        except (np.linalg.LinAlgError, OverflowError):
            proved = False
        if not proved:
            p = [float((a + b) / 2 + c * (b - a) / 2) for (c, _), (a, b) in zip(cell, it["box"])]
            raise NotProved(f"cell {leaf + 1} of {len(it['cells'])}, around p = {p}, does not pass")
