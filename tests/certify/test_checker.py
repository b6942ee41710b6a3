"""Guards the checker: its arithmetic against exact rationals, its verdicts on certificates made by hand."""

from __future__ import annotations

import ast
import contextlib
import itertools
import subprocess
import sys
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.certify import checker, reader
from lpvhinf.certify.__main__ import main
from lpvhinf.certify.checker import Enclosure, Floats, Integers
from lpvhinf.certify.verdict import recheck
from lpvhinf.statespace import LPVStateSpace
from tests.certify.hand_made import (
    Members,
    certificate,
    frozen,
    header,
    lyapunov_factor,
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

FIELDS = [Floats, Integers]
ROOT = Path(checker.__file__).parent
QUARTERS = (0, 0, -1, -1, 0, -1, -1)
both = pytest.mark.parametrize("F", FIELDS)
modes = pytest.mark.parametrize("exact", [False, True])


def exactly(F: type[Floats], x: Any) -> Any:
    """The rational numbers that an array means."""
    one = Fraction(1) if F is Floats else Fraction(1, 2**80)
    return np.vectorize(lambda v: Fraction(v) * one, otypes=[object])(np.asarray(x))


def numbers(seed: int, *shape: int) -> Any:
    """Numbers of very different sizes."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) * 10.0 ** rng.integers(-9, 6, shape)


# arithmetic


@both
@pytest.mark.parametrize("seed", range(5))
def test_products_of_enclosures_hold_all_products(F: type[Floats], seed: int) -> None:
    rng = np.random.default_rng(seed)
    index = [(0, 0), (0, 1), (1, 0), (1, 1)]
    radii = [abs(numbers(seed + i, 4, 4)) * 1e-6 for i in range(2)]
    x, y = (Enclosure(index, F.take(numbers(seed + 9 * i, 4, 4, 4)), F.take(radii[i])) for i in range(2))
    xy = F.product(x, y)
    for delta in itertools.product((Fraction(-1), Fraction(1, 3), Fraction(1)), repeat=2):

        def at(z: Enclosure, edge: Any, delta: tuple[Fraction, ...] = delta) -> Any:
            powers = [delta[0] ** k[0] * delta[1] ** k[1] for k in z.index]
            return sum(p * t for p, t in zip(powers, exactly(F, z.terms))) + edge * exactly(F, z.radius)

        left, right = (at(z, np.sign(rng.standard_normal((4, 4))).astype(int)) for z in (x, y))
        assert np.all(abs(left.T @ right - at(xy, 0)) <= exactly(F, xy.radius))
    narrow = F.product(*(Enclosure(z.index, z.terms, z.radius * 0) for z in (x, y)))
    assert np.all(F.approximate(narrow.radius) < 1e-12 * (F.approximate(xy.radius).max() * 1e6 + 1.0))


def test_integer_products_are_exact_but_for_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    for bits in (1, 19, 20, 21, 90, 300):
        a, b = (
            np.array(
                [[int(rng.integers(-9, 9)) * 2**bits + int(rng.integers(-9, 9)) for _ in range(7)] for _ in range(7)]
            )
            .astype(object)
            .reshape(7, 7)
            for _ in range(2)
        )
        assert np.all(Integers.dot(a, b) == (a @ b) // 2**80)
    largest = np.full((2, 5000), 2**80 - 1, dtype=object)
    assert np.all(Integers.dot(largest, -largest.T) == -5000 * (2**80 - 1) ** 2 // 2**80)


def test_floats_become_integers_rounded_down() -> None:
    given = np.array([0.0, 1.0, -1.0, 2.0**-80, -(2.0**-81), 1e300, 5e-324, -1e-30, 0.1])
    assert Integers.take(given).tolist() == [int(Fraction(v) * 2**80 // 1) for v in given.tolist()]


@both
@pytest.mark.parametrize("seed", range(4))
def test_local_expansion_encloses_the_series_and_its_derivatives(F: type[Floats], seed: int) -> None:
    rng = np.random.default_rng(seed)
    c = rng.standard_normal((5, 7, 3)) * 0.5 ** np.add.outer(np.arange(5), np.arange(7))[..., None]
    cell = [(Fraction(1, 4), Fraction(1, 4)), (Fraction(-2, 3), Fraction(1, 3))]
    terms, bounds = F.expand(F.take(c), cell, 3, 2, {})
    terms, bounds = exactly(F, terms), exactly(F, bounds)
    assert np.all(bounds < 1.0)

    def chebyshev(n: int, x: Fraction) -> Fraction:
        one, two = Fraction(1), x
        for _ in range(n):
            one, two = two, 2 * x * two - one
        return one

    def slope(n: int, x: Fraction) -> Fraction:  # T_n' = n U_(n-1)
        one, two = Fraction(0), Fraction(1)
        for _ in range(n):
            one, two = two, 2 * x * two - one
        return n * one

    given, index = exactly(Floats, c), checker.indices(2, 3)
    for delta in itertools.product((Fraction(-1), Fraction(-1, 7), Fraction(1, 2), Fraction(1)), repeat=2):
        x = [a + r * d for (a, r), d in zip(cell, delta)]
        for axis in (None, 0, 1):
            parts = [
                [(slope if axis == i else chebyshev)(n, x[i]) * (cell[i][1] if axis == i else 1) for n in range(k)]
                for i, k in enumerate((5, 7))
            ]
            exact = sum(parts[0][i] * parts[1][j] * given[i, j] for i in range(5) for j in range(7))
            powers = [
                [Fraction(k[i]) * delta[i] ** max(k[i] - 1, 0) if axis == i else delta[i] ** k[i] for i in range(2)]
                for k in index
            ]
            kept = sum(p[0] * p[1] * t for p, t in zip(powers, terms))
            assert np.all(abs(exact - kept) <= bounds[0 if axis is None else axis + 1])


def test_control_points_are_those_of_the_power_basis() -> None:
    for d in (1, 2, 4, 8):
        table = checker.bernstein(2, d)
        net = list(itertools.product(range(d + 1), repeat=2))
        assert all(abs(v) <= 1 for row in table for v in row)
        for t in ((Fraction(1, 3), Fraction(-1, 5)), (Fraction(-1), Fraction(1))):
            s = [(1 + v) / 2 for v in t]
            basis = [
                np.prod([checker.math.comb(d, i) * s[k] ** i * (1 - s[k]) ** (d - i) for k, i in enumerate(at)])
                for at in net
            ]
            for number, k in enumerate(checker.indices(2, d)):
                assert sum(w * row[number] for w, row in zip(basis, table)) == t[0] ** k[0] * t[1] ** k[1]


@both
def test_positive_definite_up_to_the_round_off_and_never_beyond(F: type[Floats]) -> None:
    rng = np.random.default_rng(1)
    n = 12
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    nothing = F.take(np.zeros((n, n)))
    for least, wanted in ((1e-8, True), (-1e-15, False), (-1e-9, False), (0.0, False)):
        V = Q @ np.diag([least, *np.linspace(0.5, 1.0, n - 1)]) @ Q.T / 2.0
        with np.errstate(all="ignore"):
            try:
                found = F.positive(F.take(V)[None], nothing, nothing)
            except np.linalg.LinAlgError:
                found = False
        assert found == wanted
    # the radius counts: the identity minus a matrix of ones of size r is positive definite for n r < 1 only
    half = F.take(np.eye(n) / 2.0)[None]
    for r, wanted in ((0.99 / n, True), (1.01 / n, False)):
        ones = F.take(np.full((n, n), r))
        with np.errstate(all="ignore"):
            try:
                found = F.positive(half, nothing, ones)
            except np.linalg.LinAlgError:
                found = False
        assert found == wanted


@both
def test_no_singular_matrix_is_called_positive_definite(F: type[Floats]) -> None:
    rng = np.random.default_rng(2)
    for _ in range(100):  # exactly singular, or exactly indefinite, in small integers
        n = int(rng.integers(1, 6))
        B = rng.integers(-4, 5, (n, max(1, n - 1))).astype(float)
        V = (B @ B.T if n > 1 else np.zeros((1, 1))) * 2.0 ** int(rng.integers(-60, 60))
        nothing = F.take(np.zeros((n, n)))
        with np.errstate(all="ignore"), contextlib.suppress(np.linalg.LinAlgError):
            assert not F.positive(F.take(V)[None], nothing, nothing)


@both
def test_nan_proves_nothing(F: type[Floats]) -> None:
    if F is Floats:
        with np.errstate(all="ignore"):
            for bad in (np.nan, np.inf, -np.inf):
                V = np.eye(3) * 0.5
                V[1, 1] = bad
                try:
                    assert not F.positive(V[None], np.zeros((3, 3)), np.zeros((3, 3)))
                    assert not F.positive(np.eye(3)[None], V, np.zeros((3, 3)))
                except np.linalg.LinAlgError:
                    pass
    else:
        with pytest.raises(OverflowError):
            F.approximate(np.array([2**2000], dtype=object))


# certificates made by hand


def frozen_oscillator(**options: Any) -> Members:
    return frozen(oscillator(), QUARTERS, **options)


def gain_certificate(gamma: float) -> Members:
    """x' = (-2 + p) x + u, y = x over [-1, 1]: the largest gain is 1 at p = 1."""
    one = np.ones((1, 1, 1))
    matrices = {"A": np.array([[[-2.0]], [[1.0]]]), "B": one, "C": one, "D": 0.0 * one}
    S = np.ones((1, 1))
    # at p = 1 the inequality is [-2P, P, 1; P, -gamma, 0; 1, 0, -gamma] < 0: P = 1 does for gamma > 1
    return certificate(
        matrices, S, np.ones((1, 1)), tree=QUARTERS, property="l2-gain", kind="quadratic", gamma=gamma, degree=1
    )


def moving(rate: float) -> Members:
    """x' = -x in coordinates z = x / sqrt(P), P = 2 + p: stable for slow p only as far as this P can tell."""
    A = np.array([[[-1.0]], [[0.0]]])[:1]
    X = np.array([[2.0], [1.0]])  # P = 2 + p >= 1, P' = dp/dt; -2 P + |dp/dt| < 0 for |dp/dt| < 2 at p = -1
    return certificate(
        {"A": A}, np.ones((1, 1)), X, kind="rate", rate=[[-rate, rate]], degree=1, lyapunov_degree=1, tree=(0, -1, -1)
    )


@modes
def test_a_frozen_claim_is_proved(tmp_path: Path, exact: bool) -> None:
    found = verdict(tmp_path / "c.npz", frozen_oscillator(), exact=exact)
    assert found.status == 0, found.message
    assert "4 cells" in found.message
    assert found.message.count("\n") == 0


@modes
def test_two_coordinates_and_a_decay_rate(tmp_path: Path, exact: bool) -> None:
    A = planar()
    tree = uniform(5, 2)
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * 2), axis=-1).reshape(-1, 2)
    slowest = -np.max(np.linalg.eigvals(value(A, grid)).real)
    assert slowest > 0.1
    for share, wanted in ((0.3, 0), (1.01, 1)):
        members = frozen(A, tree, decay=0.0, box=[[-1, 1], [2, 5]])
        top = header(members)
        top["claim"]["decay"] = share * slowest
        found = verdict(tmp_path / "c.npz", resealed(with_header(members, top)), exact=exact)
        assert found.status == wanted, found.message


@modes
@pytest.mark.parametrize(("gamma", "status"), [(1.001, 0), (1.0 + 1e-6, 0), (1.0, 1), (0.999, 1)])
def test_the_gain_is_proved_down_to_the_largest_gain(tmp_path: Path, exact: bool, gamma: float, status: int) -> None:
    assert verdict(tmp_path / "c.npz", gain_certificate(gamma), exact=exact).status == status


@modes
@pytest.mark.parametrize(("rate", "status"), [(0.0, 0), (1.0, 0), (2.0 - 1e-6, 0), (2.0, 1), (3.0, 1)])
def test_the_rate_is_proved_as_far_as_its_lyapunov_matrix_goes(
    tmp_path: Path, exact: bool, rate: float, status: int
) -> None:
    assert verdict(tmp_path / "c.npz", moving(rate), exact=exact).status == status


@modes
def test_a_stability_boundary_is_met_from_inside_only(tmp_path: Path, exact: bool) -> None:
    for edge, status in ((1.0 - 1e-6, 0), (1.0, 1), (1.0 + 1e-6, 1)):  # x' = (p - 1) x over [-1, edge]
        A = np.array([[[-1.0]], [[1.0]]])
        members = certificate({"A": A}, np.ones((1, 1, 1)), np.zeros((1, 0, 1)), system_box=[[-1, 1]], degree=1)
        members["box"] = np.array([[-1.0, min(edge, 1.0)]])
        if edge > 1.0:
            members |= {"system_box": np.array([[-1.0, edge]]), "box": np.array([[-1.0, edge]])}
        assert verdict(tmp_path / "c.npz", resealed(members), exact=exact).status == status


@modes
def test_a_remainder_is_counted(tmp_path: Path, exact: bool) -> None:
    A = np.array([[[-1.0]]])
    for bound, status in ((0.999, 0), (1.0, 1)):
        members = certificate({"A": A}, np.ones((1, 1, 1)), np.zeros((1, 0, 1)), remainder="sampled")
        members["remainder_A"] = np.array([[bound]])
        found = verdict(tmp_path / "c.npz", resealed(members), exact=exact)
        assert found.status == status
        assert status or "conditional on the remainder" in found.message


def test_an_unstable_pocket_is_found(tmp_path: Path) -> None:
    # x' = a(p) x with a = -0.01 + 0.02 exp(-(p / 0.001)^2), as a polynomial: a spike 1e-3 of the box wide
    nodes = np.cos(np.pi * (np.arange(129) + 0.5) / 129)
    for depth, status in ((0.0, 0), (0.0103, 1)):
        spike = np.polynomial.chebyshev.chebfit(nodes, -0.01 + depth * (abs(nodes) < 1e-3), 128)
        A = np.zeros((129, 1, 1))
        A[:, 0, 0] = spike
        members = (
            frozen(A, (0, -1, -1))
            if status == 0
            else certificate({"A": A}, np.ones((2, 1, 1)), np.zeros((2, 0, 1)), tree=(0, -1, -1))
        )
        assert verdict(tmp_path / "c.npz", members).status == status


def test_a_negative_lyapunov_matrix_of_an_unstable_system_proves_nothing(tmp_path: Path) -> None:
    A = np.array([[[1.0]]])  # A'P + PA < 0 with P = -1
    members = certificate({"A": A}, np.ones((1, 1)), -np.ones((1, 1)))
    assert verdict(tmp_path / "c.npz", members).status == 1


# what is no certificate


def changed(**members: Any) -> Members:
    return resealed({**frozen_oscillator(), **members})


def rewritten(path: tuple[str, ...], new: Any) -> Members:
    members = frozen_oscillator()
    top = header(members)
    place = top
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = new
    return resealed(with_header(members, top))


BAD: dict[str, Members] = {
    "inverted box": changed(box=np.array([[1.0, -1.0]])),
    "empty box": changed(box=np.array([[1.0, 1.0]])),
    "box outside": changed(box=np.array([[-1.0, 1.5]])),
    "NaN": changed(S=np.full((4, 2, 2), np.nan)),
    "infinity": changed(box=np.array([[-np.inf, 1.0]])),
    "tree too short": changed(tree=np.array(QUARTERS[:-1], dtype=np.int8)),
    "tree too long": changed(tree=np.array([*QUARTERS, -1], dtype=np.int8)),
    "unknown axis": changed(tree=np.array([1, *QUARTERS[1:]], dtype=np.int8)),
    "empty tree": changed(tree=np.array([], dtype=np.int8)),
    "other leaves": changed(tree=np.array([0, -1, -1], dtype=np.int8)),
    "endless tree": changed(tree=np.array([0, -1] * 90 + [-1], dtype=np.int8)),
    "version": changed(__format__=np.array(2)),
    "kind": changed(__kind__=np.array("lpvhinf.Something")),
    "object array": changed(extra=np.zeros(3)),
    "complex": changed(S=np.ones((4, 2, 2), dtype=complex)),
    "big-endian": changed(S=np.ones((4, 2, 2), dtype=">f8")),
    "header format": rewritten(("format",), True),
    "header key": rewritten(("surplus",), 1),
    "property": rewritten(("claim", "property"), "beauty"),
    "negative decay": rewritten(("claim", "decay"), -1.0),
    "infinite decay": rewritten(("claim", "decay"), float("inf")),
    "decay of text": rewritten(("claim", "decay"), "0"),
    "gamma without gain": rewritten(("claim", "gamma"), 3.0),
    "rate without kind": rewritten(("claim", "rate"), [[-1, 1]]),
    "quadratic cells": rewritten(("claim", "kind"), "quadratic"),
    "rate cells": rewritten(("claim", "kind"), "rate"),
    "remainder without bound": rewritten(("claim", "remainder"), "bounded"),
    "degree": rewritten(("proof", "degree"), 99),
    "degree of float": rewritten(("proof", "degree"), 2.0),
    "Lyapunov degree": rewritten(("proof", "lyapunov_degree"), 2),
    "zero coefficients": changed(A_coefficients=np.array([[0.0, 1.0, 1.0], [0.0, 1.0, 1.0]])),
    "negative zero": changed(A_coefficients=np.array([[1.0, -4.0, -0.4], [-0.0, -1.5, 0.0]])),
    "entries twice": changed(A_entries=np.array([1, 1, 3])),
    "entry outside": changed(A_entries=np.array([1, 2, 4])),
    "shape": changed(A_shape=np.array([2, 2, 3])),
    "negative length": changed(A_shape=np.array([2, -2, -2])),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_malformed_is_no_certificate(tmp_path: Path, name: str) -> None:
    found = verdict(tmp_path / "c.npz", BAD[name])
    assert found.status == 2, found.message
    assert found.message.startswith("not a certificate: ")
    assert "\n" not in found.message


def test_damage_is_seen(tmp_path: Path) -> None:
    members = frozen_oscillator()
    assert verdict(tmp_path / "c.npz", {**members, "S": members["S"] * 2.0}).message.endswith("damaged")
    del members["tree"]
    assert verdict(tmp_path / "c.npz", members).status == 2
    assert verdict(tmp_path / "c.npz", resealed(members)).status == 2
    whole = write(tmp_path / "c.npz", frozen_oscillator()).read_bytes()
    for length in (0, 1, 100, len(whole) // 2, len(whole) - 1):
        (tmp_path / "short.npz").write_bytes(whole[:length])
        assert recheck(tmp_path / "short.npz").status == 2
    assert recheck(tmp_path / "nothing.npz").status == recheck(tmp_path).status == 2


def test_another_systems_hash_does_not_fit(tmp_path: Path) -> None:
    members = frozen_oscillator()
    top = header(members)
    members = with_header(members, {**top, "system": "0" * 64})
    members["seal"] = np.frombuffer(reader.seal(members), dtype=np.uint8)
    assert "hash" in verdict(tmp_path / "c.npz", members).message


def test_the_system_beside_the_file_counts(tmp_path: Path) -> None:
    write(tmp_path / "c.npz", frozen_oscillator())
    for stiffness, status in ((1.5, 0), (1.4, 1)):
        A = np.concatenate([oscillator(stiffness), np.zeros((2, 2, 2))])  # a zero degree changes nothing
        system = LPVStateSpace.from_coefficients(A, np.ones((2, 1)), np.ones((1, 2)), [[0.0]], box=[[-1, 1]])
        system.save(tmp_path / "system.npz")
        assert recheck(tmp_path / "c.npz", system=tmp_path / "system.npz").status == status
    assert recheck(tmp_path / "c.npz", system=tmp_path / "c.npz").status == 2


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    for number, size in ((1, 3 * 10**9), (30, 10**8)):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for k in range(number):
                archive.writestr(f"m{k}.npy", b"\0" * 10_000)
                archive.infolist()[-1].file_size = size
        assert "unpacked" in recheck(path).message
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(2000):
            archive.writestr(f"m{k}.npy", b"")
    assert "members" in recheck(path).message


def test_an_array_that_claims_to_be_huge_is_not_made(tmp_path: Path) -> None:
    path = write(tmp_path / "c.npz", frozen_oscillator())
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    huge = np.lib.format.magic(1, 0)
    text = b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000, 1000000, 1000), }\n"
    parts["S.npy"] = huge + len(text).to_bytes(2, "little") + text + b"\0" * 64
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    assert "another length than stated" in recheck(path).message


@pytest.mark.parametrize("dtype", [object, "M8[s]", [("a", "<f8")]])
def test_only_plain_numbers_are_read(tmp_path: Path, dtype: Any) -> None:
    members = frozen_oscillator()
    members["S"] = np.zeros((4, 2, 2), dtype=dtype)
    path = tmp_path / "c.npz"
    with path.open("wb") as stream:
        np.savez(stream, **members)
    assert recheck(path).status == 2


def test_work_beyond_the_limits_is_refused(tmp_path: Path) -> None:
    n = 401
    A = -np.eye(n)[None]
    members = certificate({"A": A}, np.eye(n, dtype=np.float32)[None], np.zeros((1, 0, n * (n + 1) // 2)))
    assert verdict(tmp_path / "c.npz", members).status == 2
    deep = -np.eye(100)[None, None, None, None]
    members = certificate(
        {"A": deep},
        np.eye(100),
        np.ones((1, 1, 1, 1, 5050)),
        box=[[-1, 1]] * 4,
        tree=(-1,),
        degree=8,
        lyapunov_degree=8,
    )
    found = verdict(tmp_path / "c.npz", members)
    assert found.status == 2
    assert "limits" in found.message
    many = np.zeros((129, 129, 12, 12))  # a short file whose cells would cost a lot of time
    many[-1, -1] = many[0, 0] = -1.0
    tree = uniform(16, 2)
    cells = certificate({"A": many}, np.eye(12), np.ones((1, 1, 78)), box=[[-1, 1]] * 2, tree=tree, degree=8)
    assert "limits" in verdict(tmp_path / "c.npz", cells).message


# the program


def test_the_command_line_says_it_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = write(tmp_path / "good.npz", frozen_oscillator())
    bad = write(tmp_path / "bad.npz", resealed({**frozen_oscillator(), "S": np.ones((4, 2, 2))}))
    (tmp_path / "no.npz").write_text("text")
    for arguments, status in (([good], 0), ([good, "--exact"], 0), ([bad], 1), ([tmp_path / "no.npz"], 2)):
        assert main(["check", *map(str, arguments)]) == status
        assert capsys.readouterr().out.count("\n") == 1
    run = subprocess.run(
        [sys.executable, "-m", "lpvhinf.certify", "check", str(bad)], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stderr, run.stdout.count("\n")) == (1, "", 1)


def test_the_checker_is_small_and_stands_alone() -> None:
    for name in ("checker.py", "reader.py"):
        text = (ROOT / name).read_text("utf-8")
        assert len(text.splitlines()) < 300
        imports = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
        modules = {getattr(node, "module", None) or node.names[0].name for node in imports}
        assert not [module for module in modules if module.split(".")[0] in ("lpvhinf", "scipy", "cvxpy")]
    assert not {"eig", "eigvals", "eigh", "eigvalsh", "svd"} & set(
        ast.dump(ast.parse((ROOT / "checker.py").read_text("utf-8"))).split("'")
    )


def test_engine_and_checker_read_the_same_numbers() -> None:
    A = planar()
    assert np.array_equal(tensor(frozen(A, (-1,), box=[[-1, 1]] * 2), "A"), A)
    assert pack(np.array([[1.0, 2.0], [2.0, 3.0]])).tolist() == [1.0, 2.0, 3.0]
    S = lyapunov_factor(A[0, 0])
    assert np.allclose(A[0, 0].T @ S.T @ S + S.T @ S @ A[0, 0], -np.eye(3))
