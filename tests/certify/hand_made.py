"""Certificates made by hand, without the engine: small systems, Lyapunov matrices from SciPy, the file's members."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

from lpvhinf.certify import reader
from lpvhinf.certify.verdict import Verdict, recheck
from lpvhinf.checks import Array

Members = dict[str, Any]


def matrix_members(name: str, coefficients: Array) -> Members:
    """A tensor (k_1, ..., k_np, rows, cols) of Chebyshev coefficients in canonical form."""
    flat = coefficients.reshape(-1, coefficients.shape[-2] * coefficients.shape[-1])
    every = np.arange(flat.shape[1], dtype=np.int64)
    shape, entries, c = reader.canonical(coefficients.shape, every, flat)
    return {f"{name}_shape": np.array(shape, dtype=np.int64), f"{name}_entries": entries, f"{name}_coefficients": c}


def tensor(members: Members, name: str) -> Array:
    """The dense coefficients of a matrix."""
    shape = tuple(members[f"{name}_shape"].tolist())
    flat = np.zeros((int(np.prod(shape[:-2])), shape[-2] * shape[-1]))
    flat[:, members[f"{name}_entries"]] = members[f"{name}_coefficients"]
    return flat.reshape(shape)


def header(members: Members) -> dict[str, Any]:
    """The header as an object."""
    return dict(json.loads(members["header"].tobytes()))


def with_header(members: Members, top: dict[str, Any]) -> Members:
    """The members with another header."""
    return {**members, "header": np.frombuffer(json.dumps(top).encode(), dtype=np.uint8)}


def resealed(members: Members) -> Members:
    """With the hash of the system that is in there, and with a fresh seal: nothing but the mathematics can tell."""
    top = header(members)
    names = "ABCD" if top["claim"]["property"] == "l2-gain" else "A"
    parts = ("shape", "entries", "coefficients")
    matrices = {name: tuple(members[f"{name}_{part}"] for part in parts) for name in names}
    plain = {name: (tuple(shape.tolist()), entries, c) for name, (shape, entries, c) in matrices.items()}
    out = with_header(members, {**top, "system": reader.system_hash(members["system_box"], plain)})
    return {**out, "seal": np.frombuffer(reader.seal(out), dtype=np.uint8)}


def certificate(
    matrices: dict[str, Array],
    S: Array,
    X: Array,
    *,
    tree: Sequence[int] = (-1,),
    box: Sequence[Sequence[float]] = ((-1.0, 1.0),),
    system_box: Sequence[Sequence[float]] | None = None,
    degree: int = 2,
    lyapunov_degree: int = 0,
    **claim: Any,
) -> Members:
    """All members; `claim` overrides the claim that every frozen A(p) is Hurwitz."""
    stated = {"property": "stability", "kind": "frozen", "decay": 0.0, "gamma": None, "rate": None, "remainder": "none"}
    layout = "cells" if S.ndim == 3 else "global"
    top = {
        "format": 1,
        "claim": stated | claim,
        "system": "",
        "proof": {"layout": layout, "degree": degree, "lyapunov_degree": lyapunov_degree},
        "producer": {"program": "by hand"},
    }
    members: Members = {
        "__kind__": np.array("lpvhinf.Certificate"),
        "__format__": np.array(1, dtype=np.int64),
        "header": np.frombuffer(json.dumps(top).encode(), dtype=np.uint8),
        "box": np.array(box, dtype=float),
        "system_box": np.array(box if system_box is None else system_box, dtype=float),
        "tree": np.array(tree, dtype=np.int8),
        "S": S,
        "X": X,
    }
    for name, coefficients in matrices.items():
        members |= matrix_members(name, coefficients)
    return resealed(members)


def pack(matrix: Array) -> Array:
    """The lower triangle of a symmetric matrix, row by row."""
    return np.asarray(matrix[np.tril_indices(len(matrix))])


def value(c: Array, x: Array) -> Array:
    """A tensor of Chebyshev coefficients at positions (N, n_p) of [-1, 1]^n_p."""
    out = np.broadcast_to(c, (len(x), *c.shape))
    for axis in range(x.shape[1]):
        basis = np.polynomial.chebyshev.chebvander(x[:, axis], c.shape[axis] - 1)
        out = np.einsum("nk,nk...->n...", basis, out)
    return np.asarray(out)


def lyapunov_factor(A: Array, decay: float = 0.0) -> Array:
    """S with S'S the solution of A'P + PA + 2 decay P = -I."""
    n = len(A)
    P = scipy.linalg.solve_continuous_lyapunov((A + decay * np.eye(n)).T, -np.eye(n))
    return np.asarray(np.linalg.cholesky((P + P.T) / 2.0).T)


def uniform(depth: int, n_p: int) -> list[int]:
    """The tree of 2^depth equal cells, cut along the axes in turn."""
    tree = [-1]
    for level in range(depth):
        tree = [(depth - 1 - level) % n_p, *tree, *tree]
    return tree


def frozen(A: Array, tree: Sequence[int], *, decay: float = 0.0, **options: Any) -> Members:
    """Layout "cells" with a constant Lyapunov matrix on every cell of the system's own box."""
    n_p = A.ndim - 2
    cells = reader.leaves(np.array(tree, dtype=np.int8), n_p)
    centres = np.array([[float(c) for c, _ in cell] for cell in cells])
    S = np.stack([lyapunov_factor(at, decay) for at in value(A, centres)])
    X = np.zeros((len(cells), 0, A.shape[-1] * (A.shape[-1] + 1) // 2))
    return certificate({"A": A}, S, X, tree=tree, decay=decay, **options)


def write(path: Path, members: Members) -> Path:
    """The file."""
    with path.open("wb") as stream:
        np.savez(stream, **members)
    return path


def verdict(path: Path, members: Members, *, exact: bool = False) -> Verdict:
    """Write and check."""
    return recheck(write(path, members), exact=exact)


def oscillator(stiffness: float = 1.5, damping: float = 0.4) -> Array:
    """x'' + damping x' + (4 + stiffness p) x = 0 over [-1, 1], lightly damped."""
    return np.array([[[0.0, 1.0], [-4.0, -damping]], [[0.0, 0.0], [-stiffness, 0.0]]])


def planar(seed: int = 0) -> Array:
    """Three states, two coordinates, degrees (2, 1)."""
    rng = np.random.default_rng(seed)
    A = 0.25 * rng.standard_normal((3, 2, 3, 3))
    A[0, 0] = [[-1.0, 2.0, 0.0], [-2.0, -1.0, 0.3], [0.0, -0.3, -1.5]]
    return A
