"""Certificates are changed in their meaning and sealed again: the mathematics rejects them, or they are still true.

What is accepted is compared with dense sampling of the claim itself: eigenvalues, gains over frequency, and for
trajectories the stored Lyapunov function. Changes of single bytes are caught by the seal.
"""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg

from lpvhinf.certify import reader
from lpvhinf.certify.verdict import recheck
from lpvhinf.checks import Array
from tests.certify.hand_made import (
    Members,
    certificate,
    frozen,
    header,
    matrix_members,
    oscillator,
    pack,
    planar,
    resealed,
    tensor,
    uniform,
    value,
    verdict,
    with_header,
    write,
)

N_EACH = 108  # mutations of each certificate: 540 in all


def cells_certificate() -> Members:
    """Frozen, with a decay rate close to what holds, on eight cells of one axis."""
    return frozen(oscillator(), uniform(3, 1), decay=0.12)


def planar_certificate() -> Members:
    """Frozen, two coordinates, on a part of the system's box."""
    A = planar(3)
    part = frozen(A, uniform(3, 2), box=[[-1.0, 1.0], [-1.0, 1.0]], decay=0.05)
    return resealed({**part, "box": part["box"] * 0.4})


def quadratic_certificate() -> Members:
    """One Lyapunov matrix for arbitrarily fast p."""
    A = oscillator(stiffness=0.35, damping=1.2)
    P = scipy.linalg.solve_continuous_lyapunov(A[0].T, -np.eye(2))
    return certificate({"A": A}, np.eye(2), pack(P)[None], tree=uniform(1, 1), kind="quadratic", degree=1, decay=0.1)


def rate_certificate() -> Members:
    """A Lyapunov matrix linear in p for bounded rates."""
    A = oscillator(stiffness=1.5, damping=0.8)
    low, high = (scipy.linalg.solve_continuous_lyapunov((A[0] + s * A[1]).T, -np.eye(2)) for s in (-1.0, 1.0))
    X = np.stack([pack((low + high) / 2.0), pack((high - low) / 2.0)])
    options: dict[str, Any] = {"kind": "rate", "rate": [[-0.3, 0.3]], "degree": 2, "lyapunov_degree": 1}
    return certificate({"A": A}, np.eye(2), X, tree=uniform(3, 1), **options)


def gain_certificate() -> Members:
    """The closed loop of a gain k: x'' + 1.2 x' + (4 + k + 0.35 p) x = w, y = x; frozen L2 gain."""
    A = oscillator(stiffness=0.35, damping=1.2)
    B, C, D = np.array([[[0.0], [1.0]]]), np.array([[[1.0, 0.0]]]), np.zeros((1, 1, 1))
    gamma = 0.6  # the largest gain is about 0.46
    cells = reader.leaves(np.array(uniform(3, 1), dtype=np.int8), 1)
    factors = []
    for at in value(A, np.array([[float(c) for c, _ in cell] for cell in cells])):
        weight = C[0].T @ C[0] + 0.01 * np.eye(2)
        R = scipy.linalg.solve_continuous_are(at, B[0], weight, -np.eye(1) * 0.55**2)
        factors.append(np.linalg.cholesky(R / gamma).T)
    options: dict[str, Any] = {"property": "l2-gain", "gamma": gamma, "degree": 1}
    X = np.zeros((len(cells), 0, 3))
    return certificate({"A": A, "B": B, "C": C, "D": D}, np.stack(factors), X, tree=uniform(3, 1), **options)


CERTIFICATES: dict[str, Callable[[], Members]] = {
    "cells": cells_certificate,
    "planar": planar_certificate,
    "quadratic": quadratic_certificate,
    "rate": rate_certificate,
    "gain": gain_certificate,
}


# mutations


def plant(m: Members, rng: np.random.Generator) -> Members:
    """Some coefficients of a matrix of the system are others."""
    name = str(rng.choice([k for k in "ABCD" if f"{k}_shape" in m and m[f"{k}_entries"].size]))
    c = tensor(m, name).copy()
    used = np.flatnonzero(c)
    where = rng.choice(used, size=int(rng.integers(1, 3)))
    c.flat[where] *= rng.choice([-1.0, 0.0, 0.5, 0.9, 0.99, 1.01, 1.1, 2.0, 5.0], size=len(where))
    return m | matrix_members(name, c)


def gain(m: Members, rng: np.random.Generator) -> Members:
    """Another feedback of the position and the speed."""
    c = tensor(m, "A").copy()
    c[(0,) * (c.ndim - 2)][1, :2] += rng.standard_normal(2) * rng.choice([1e-3, 0.1, 1.0, 10.0])
    return m | matrix_members("A", c)


def box(m: Members, rng: np.random.Generator) -> Members:
    """Another box, within that of the system or with it."""
    factor = float(rng.choice([0.3, 0.9, 1.05, 1.5, 2.0, 4.0]))
    return {**m, "box": np.clip(m["box"] * factor + rng.normal(0.0, 0.1), m["system_box"][0, 0], m["system_box"][0, 1])}


def claim(m: Members, rng: np.random.Generator) -> Members:
    """A bolder (or a weaker) claim: gamma, decay, rate, kind, or no remainder."""
    top = header(m)
    it = top["claim"]
    factor = float(rng.choice([0.5, 0.8, 0.9, 0.99, 1.01, 1.1, 1.5, 2.0, 10.0]))
    if it["property"] == "l2-gain":
        it["gamma"] *= 1.0 / factor
        it["kind"] = str(rng.choice(["frozen", "quadratic"]))
    elif it["kind"] == "rate" and rng.random() < 0.7:
        it["rate"] = [[low * factor, high * factor * rng.uniform(0.5, 2.0)] for low, high in it["rate"]]
    elif it["kind"] == "quadratic" and rng.random() < 0.3:
        it |= {"kind": "rate", "rate": [[-factor, factor]]}
    else:
        it["decay"] = factor * (it["decay"] + 0.02)
    if rng.random() < 0.2:
        it["remainder"] = "bounded"
        n = int(m["A_shape"][-1])
        names = "ABCD" if it["property"] == "l2-gain" else "A"
        scale = 10.0 ** rng.uniform(-6, -0.5)
        extra = {f"remainder_{k}": np.full(m[f"{k}_shape"][-2:], scale) for k in names}
        assert extra["remainder_A"].shape == (n, n)
        return with_header({**m, **extra}, top)
    return with_header(m, top)


def tree(m: Members, rng: np.random.Generator) -> Members:
    """Fewer cells, cells exchanged, or cut along another axis or at another place."""
    nodes = m["tree"].tolist()
    kind = int(rng.integers(0, 4))
    if kind == 0 and len(nodes) > 1:  # a cut is taken back: two cells become one
        pairs = [i for i in range(len(nodes) - 2) if nodes[i] >= 0 and nodes[i + 1] == nodes[i + 2] == -1]
        i = int(rng.choice(pairs))
        leaf = nodes[:i].count(-1)
        out = {**m, "tree": np.array([*nodes[:i], -1, *nodes[i + 3 :]], dtype=np.int8)}
        if m["S"].ndim == 3:
            out |= {"S": np.delete(m["S"], leaf, axis=0), "X": np.delete(m["X"], leaf, axis=0)}
        return out
    if kind == 1:
        where = int(rng.integers(len(nodes)))
        nodes[where] = int(rng.integers(-1, 3))
    if kind == 2:
        del nodes[int(rng.integers(len(nodes)))]
    if kind == 3:
        rng.shuffle(nodes)
    return {**m, "tree": np.array(nodes, dtype=np.int8)}


def lyapunov(m: Members, rng: np.random.Generator) -> Members:
    """Other Lyapunov matrices."""
    S, X = m["S"].copy(), m["X"].copy()
    kind = int(rng.integers(0, 5))
    if kind == 0:
        S *= rng.choice([-1.0, 0.0, 0.5, 3.0, 1e-6, 1e6])
    if kind == 1 or X.size == 0:
        S = S + rng.standard_normal(S.shape) * rng.choice([1e-6, 1e-3, 0.1, 1.0, 10.0]) * np.max(abs(S))
    elif kind == 2:
        X = -X
    elif kind == 3:
        X = X * rng.choice([0.3, 0.7, 1.0, 1.5], size=X.shape)
    elif kind == 4:
        X = X + rng.standard_normal(X.shape) * rng.choice([1e-6, 1e-2, 0.5]) * np.max(abs(X))
    if S.ndim == 3 and rng.random() < 0.2:
        S = S[rng.permutation(len(S))]
    return {**m, "S": S, "X": X}


KINDS = (plant, gain, box, claim, tree, lyapunov)


# truth, by sampling


def sampled(m: Members) -> bool:
    """Whether the claim holds at many positions, frequencies and deviations within the remainder."""
    it = header(m)["claim"]
    n_p = len(m["box"])
    axes = [np.linspace(low, high, 101 if n_p == 1 else 25) for low, high in m["box"]]
    p = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, n_p)
    low, high = m["system_box"].T
    x = np.clip((2.0 * p - low - high) / (high - low), -1.0, 1.0)
    A = value(tensor(m, "A"), x)
    if it["remainder"] != "none":
        corners = np.random.default_rng(0).choice([-1.0, 1.0], size=A.shape)
        A = np.concatenate([A, A + corners * m["remainder_A"]])
    if np.max(np.linalg.eigvals(A).real) >= -it["decay"]:
        return False
    if it["property"] == "l2-gain":
        B, C, D = (value(tensor(m, name), x) for name in "BCD")
        omega = np.linspace(0.0, 12.0, 121)
        inverse = np.linalg.inv(1j * omega[:, None, None, None] * np.eye(A.shape[-1]) - A[: len(x)])
        return bool(np.max(abs(C @ inverse @ B + D)) < it["gamma"])
    if it["kind"] == "frozen":
        return True
    # trajectories: the Lyapunov function of the file decreases at every position and rate
    lo, hi = m["box"].T
    local = (2.0 * p - lo - hi) / (hi - lo)
    n = int(m["A_shape"][-1])
    rows, columns = np.tril_indices(n)
    X = np.zeros((*m["X"].shape[:-1], n, n))
    X[..., rows, columns] = X[..., columns, rows] = m["X"]
    P = m["S"].T @ value(X, local) @ m["S"]
    slope = np.zeros_like(P)
    if X.shape[0] > 1:
        step = np.polynomial.chebyshev.chebder(X, axis=0) * 2.0 / (hi - lo)
        slope = m["S"].T @ value(step, local) @ m["S"]
    largest = -np.inf
    for v in np.ravel(it["rate"] or [[0.0]]):
        for at in np.split(A, len(A) // len(p)):
            N = np.swapaxes(at, 1, 2) @ P + P @ at + 2.0 * it["decay"] * P + v * slope
            largest = max(largest, float(np.max(np.linalg.eigvalsh(N))))
    return bool(largest < 0.0 and np.min(np.linalg.eigvalsh(P)) > 0.0)


@pytest.mark.parametrize("name", CERTIFICATES)
def test_the_certificates_are_proved_as_they_are(tmp_path: Path, name: str) -> None:
    members = CERTIFICATES[name]()
    assert sampled(members)
    for exact in (False, True):
        found = verdict(tmp_path / "c.npz", members, exact=exact)
        assert found.status == 0, found.message


def mutations(name: str) -> list[tuple[str, Members]]:
    """Changed certificates with fresh hashes and seals, the same in every run."""
    rng = np.random.default_rng(sorted(CERTIFICATES).index(name))
    out = []
    for number in range(N_EACH):
        change = KINDS[number % len(KINDS)]
        out.append((change.__name__, resealed(change(CERTIFICATES[name](), rng))))
    return out


@pytest.mark.parametrize("name", CERTIFICATES)
def test_what_is_accepted_is_true(tmp_path: Path, name: str) -> None:
    count: Counter[tuple[str, str]] = Counter()
    for number, (kind, members) in enumerate(mutations(name)):
        found = verdict(tmp_path / "c.npz", members)
        if found.proved:
            assert sampled(members), f"{name} {number} ({kind}) is accepted and false: {found.message}"
        count[kind, "accepted" if found.proved else "rejected"] += 1
        if number % 18 == 0:  # the slow mode finds the same, up to its smaller round-off
            exact = recheck(tmp_path / "c.npz", exact=True)
            assert exact.status == found.status, f"{name} {number} ({kind}): {found.message}; exact: {exact.message}"
    # the test would be empty if nothing were rejected, or everything
    assert sum(count[kind.__name__, "rejected"] > 0 for kind in KINDS) >= 5, count
    assert sum(count[kind.__name__, "accepted"] > 0 for kind in KINDS) >= 4, count


@pytest.mark.parametrize("name", CERTIFICATES)
def test_a_false_claim_is_never_accepted(tmp_path: Path, name: str) -> None:
    rejected = 0
    for kind, members in mutations(name):
        try:
            false = kind in ("plant", "gain", "claim") and not sampled(members)
        except np.linalg.LinAlgError:
            continue
        if false:
            assert not verdict(tmp_path / "c.npz", members).proved
            rejected += 1
    assert rejected >= 5


def test_changes_of_single_bytes_are_seen(tmp_path: Path) -> None:
    path = write(tmp_path / "c.npz", planar_certificate())
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    rng = np.random.default_rng(7)
    for _ in range(150):  # inside the members, with the archive's own check sums put right
        name = str(rng.choice(sorted(parts)))
        data = bytearray(parts[name])
        data[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
        with zipfile.ZipFile(tmp_path / "d.npz", "w") as archive:
            for other, content in parts.items():
                archive.writestr(other, bytes(data) if other == name else content)
        found = recheck(tmp_path / "d.npz")
        assert found.status == 2 or same_arrays(tmp_path / "d.npz", path), found.message
    whole = path.read_bytes()
    for _ in range(150):  # anywhere in the file: dates in the archive's directory mean nothing
        data = bytearray(whole)
        data[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
        (tmp_path / "d.npz").write_bytes(data)
        found = recheck(tmp_path / "d.npz")
        assert found.status == 2 or same_arrays(tmp_path / "d.npz", path), found.message


def same_arrays(left: Path, right: Path) -> bool:
    """Whether two archives hold the same."""
    a, b = reader.read_members(left), reader.read_members(right)
    return a.keys() == b.keys() and all(bits(a[name]) == bits(b[name]) for name in a)


def bits(array: Array) -> tuple[Any, ...]:
    return array.dtype.str, array.shape, array.tobytes()
