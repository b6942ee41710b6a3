"""Read certificate files that nobody has to trust: docs/certificate_format.md, sections 1 to 3, 5 and 10.

Sizes are known before anything is read, nothing is unpickled, what is wrong ends as `NotACertificate`. No engine here.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import struct
import warnings
import zipfile
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

MAX_BYTES, MAX_DIRECTORY, MAX_MEMBERS, MAX_HEADER = 2 * 10**9, 2**16, 40, 10**6
MAX_SIZE, MAX_AXES, MAX_LENGTH, MAX_LEAVES, MAX_DEPTH = 400, 4, {"system": 129, "X": 65}, 200_000, 60
MAX_COEFFICIENTS, MAX_NUMBERS = 2 * 10**7, 5 * 10**7  # of a polynomial matrix; of the largest array of a cell
MAX_PRODUCTS, MAX_WORK = 10**11, 2 * 10**13  # multiplications of a cell, and of all cells
Path = str | os.PathLike[str]


class NotACertificate(Exception):
    """The file is damaged, of another format or beyond the limits; the message says which."""


def demand(condition: object, message: str) -> None:
    """Raise `NotACertificate` unless the condition holds."""
    if not condition:
        raise NotACertificate(message)


def read_members(path: Path) -> dict[str, Any]:
    """The arrays of an archive, after a look at its directory; only plain numbers and text."""
    try:
        with open(path, "rb") as stream, warnings.catch_warnings():
            warnings.simplefilter("error")
            end = stream.seek(0, os.SEEK_END)
            demand(42 <= end <= MAX_BYTES, f"{end} bytes are not an archive, or more than {MAX_BYTES}")
            stream.seek(end - 42)
            locator, record = stream.read(20), stream.read(22)
            demand(record[:4] == b"PK\5\6" and record[20:] == b"\0\0", "the file is no archive, or truncated")
            count, size = struct.unpack("<HI", record[10:16])
            demand(locator[:4] != b"PK\6\7" and count <= MAX_MEMBERS and size <= MAX_DIRECTORY, "too many members")
            with zipfile.ZipFile(stream) as archive:
                infos = archive.infolist()
                names = [info.filename for info in infos]
                demand(len(set(names)) == len(names) and all(n.endswith(".npy") for n in names), "wrong member names")
                demand(sum(info.file_size for info in infos) <= MAX_BYTES, f"more than {MAX_BYTES} bytes when unpacked")
                plain = all(info.compress_type in (0, 8) and not info.flag_bits & 1 for info in infos)
                demand(plain, "a member is encrypted or packed in an unknown way")
                return {info.filename[:-4]: _array(_bytes(archive, info), info.filename) for info in infos}
    except NotACertificate:
        raise
    except Exception as error:  # whatever a hostile file makes the libraries raise
        raise NotACertificate(f"it cannot be read: {' '.join(str(error).split())[:200]}") from error


def _bytes(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    with archive.open(info) as stream:
        data = stream.read(info.file_size + 1)
    demand(len(data) == info.file_size, f"{info.filename} has another length than stated")
    return data


def _array(data: bytes, name: str) -> Any:
    stream = io.BytesIO(data)
    demand(np.lib.format.read_magic(stream) == (1, 0), f"{name} is of another .npy version")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    known = dtype.str in {"<f2", "<f4", "<f8", "<i8", "|i1", "|u1"} or (dtype.kind == "U" and dtype.itemsize <= 400)
    demand(known and dtype.str[0] != ">", f"{name} holds {dtype.str}")
    size = math.prod(shape) * dtype.itemsize
    demand(all(k >= 0 for k in shape) and size == len(data) - stream.tell(), f"{name} has another length than stated")
    if size == 0:
        return np.zeros(shape, dtype=dtype)
    array = np.frombuffer(data, dtype=dtype, offset=stream.tell()).reshape(shape, order="F" if fortran else "C")
    demand(dtype.kind != "f" or np.all(np.isfinite(array)), f"{name} holds NaN or infinity")
    return array


def seal(members: Mapping[str, Any]) -> bytes:
    """SHA-256 of all members but the seal."""
    digest = hashlib.sha256()
    for name in sorted(set(members) - {"seal"}):
        array = members[name]
        digest.update(f"{name}\0{array.dtype.str}\0{','.join(map(str, array.shape))}\0".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()


def polynomial(members: Mapping[str, Any], name: str, n_p: int) -> tuple[tuple[int, ...], Any, Any]:
    """(shape, entries, coefficients) of a matrix of the system."""
    shape, entries, c = (members[f"{name}_{part}"] for part in ("shape", "entries", "coefficients"))
    types = shape.dtype.str == entries.dtype.str == "<i8" and c.dtype.str == "<f8"
    demand(types and shape.shape == (n_p + 2,) and entries.ndim == 1, f"the members of {name} have wrong types")
    lengths = shape.tolist()
    sizes = all(1 <= k <= MAX_LENGTH["system"] for k in lengths[:-2]) and all(0 <= k <= MAX_SIZE for k in lengths[-2:])
    demand(sizes and c.size <= MAX_COEFFICIENTS, f"{name} of shape {lengths} is beyond the limits")
    demand(c.shape == (math.prod(lengths[:-2]), len(entries)), f"{name}_coefficients has shape {c.shape}")
    inside = np.all(np.diff(entries) > 0) and np.all((entries >= 0) & (entries < lengths[-2] * lengths[-1]))
    demand(inside, f"{name}_entries do not increase within the matrix")
    return tuple(lengths), entries, c


def canonical(shape: tuple[int, ...], entries: Any, c: Any) -> tuple[tuple[int, ...], Any, Any]:
    """The canonical form (section 2) of the same polynomial matrix."""
    used = np.any(c != 0.0, axis=0)
    tensor = (c[:, used] + 0.0).reshape(*shape[:-2], -1)  # adding zero turns a negative zero into zero
    for axis in range(len(shape) - 2):
        others = tuple(i for i in range(tensor.ndim) if i != axis)
        last = max(np.flatnonzero(np.any(tensor != 0.0, axis=others)), default=0)
        tensor = np.take(tensor, range(int(last) + 1), axis=axis)
    lengths = tuple(int(k) for k in tensor.shape[:-1])
    return (*lengths, *shape[-2:]), entries[used], np.ascontiguousarray(tensor.reshape(math.prod(lengths), -1))


def system_hash(box: Any, matrices: Mapping[str, tuple[tuple[int, ...], Any, Any]]) -> str:
    """The hash of section 2."""
    digest = hashlib.sha256(b"lpvhinf.system 1\n" + np.array(len(box), dtype="<i8").tobytes() + box.tobytes())
    for name in sorted(matrices):
        shape, entries, c = matrices[name]
        digest.update(name.encode() + np.array([*shape, len(entries)], dtype="<i8").tobytes())
        digest.update(entries.tobytes() + c.tobytes())
    return digest.hexdigest()


def hash_of_system_file(path: Path, names: Sequence[str]) -> str:
    """The hash of those matrices of an `LPVStateSpace` file."""
    members = read_members(path)
    try:
        demand(str(members["__kind__"]) == "lpvhinf.LPVStateSpace", "the system's file is of another kind")
        box = _box(members["box"], "box")
        return system_hash(box, {name: canonical(*polynomial(members, name, len(box))) for name in names})
    except NotACertificate:
        raise
    except Exception as error:  # whatever a hostile file makes the libraries raise
        raise NotACertificate(f"the system's file lacks something: {error}") from error


def _box(box: Any, name: str) -> Any:
    rows = box.dtype.str == "<f8" and box.ndim == 2 and box.shape[1] == 2 and 1 <= len(box) <= MAX_AXES
    demand(rows, f"{name} is no box of 1 to {MAX_AXES} coordinates")
    demand(np.all(box[:, 0] < box[:, 1]), f"{name} is empty or inverted")
    return box


def leaves(tree: Any, n_p: int) -> list[list[tuple[Fraction, Fraction]]]:
    """The leaves of a bisection tree of [-1, 1]^n_p in preorder, which cover it: (centre, half width) on every axis."""
    demand(tree.dtype.str == "|i1" and tree.ndim == 1 and len(tree) < 2 * MAX_LEAVES, "the tree is too large, or none")
    found, waiting = [], [[(Fraction(0), Fraction(1))] * n_p]
    for axis in tree.tolist():
        demand(waiting and -1 <= axis < n_p, "the tree goes on after its end, or cuts an unknown axis")
        cell = waiting.pop()
        if axis < 0:
            found.append(cell)
            continue
        centre, half = cell[axis][0], cell[axis][1] / 2
        demand(half >= Fraction(1, 2**MAX_DEPTH), f"the tree is deeper than {MAX_DEPTH}")
        # the lower half is put on top, so that it comes next
        waiting += [[*cell[:axis], (centre + shift, half), *cell[axis + 1 :]] for shift in (half, -half)]
    demand(not waiting, "the tree ends before its cells cover the box")
    return found


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    demand(len(dict(pairs)) == len(pairs), "the header repeats a key")
    return dict(pairs)


def _fields(mapping: Any, names: str) -> list[Any]:
    wanted = names.split()
    demand(isinstance(mapping, dict) and sorted(mapping) == sorted(wanted), f"the header has not exactly: {names}")
    return [mapping[name] for name in wanted]


def _number(value: Any, what: str, least: float = -math.inf, most: float = math.inf) -> float:
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    demand(good and least <= value <= most, f"{what} is {value!r}")
    return float(value)


def _whole(value: Any, what: str, least: int, most: int) -> int:
    demand(isinstance(value, int), f"{what} is {value!r}")
    return int(_number(value, what, least, most))


def _choice(value: Any, what: str, *known: str) -> str:
    demand(isinstance(value, str) and value in known, f"{what} is {value!r}, wanted one of {', '.join(known)}")
    return str(value)


def read_certificate(path: Path) -> dict[str, Any]:
    """What `lpvhinf.certify.checker.check` needs, and what the verdict says, from a certificate whose seal is whole.

    Raises
    ------
    NotACertificate
        For everything that docs/certificate_format.md rules out before the mathematics.
    """
    members = read_members(path)
    try:
        demand("seal" in members and members["seal"].tobytes() == seal(members), "the seal does not fit: damaged")
        return _certificate(members)
    except NotACertificate:
        raise
    except Exception as error:  # whatever a hostile file makes the libraries raise
        raise NotACertificate(f"a member is missing or malformed: {' '.join(str(error).split())[:200]}") from error


def _certificate(members: Mapping[str, Any]) -> dict[str, Any]:
    demand(str(members["__kind__"]) == "lpvhinf.Certificate", "the file is of another kind")
    version = members["__format__"]
    demand(version.dtype.str == "<i8" and version.shape == () and int(version) == 1, "the format is not 1")
    header = members["header"]
    demand(header.dtype.str == "|u1" and header.ndim == 1 and len(header) <= MAX_HEADER, "the header is no text")
    top = json.loads(header.tobytes().decode("utf-8"), object_pairs_hook=_unique)
    format_, claim, stated, proof, producer = _fields(top, "format claim system proof producer")
    _whole(format_, "format", 1, 1)
    demand(isinstance(producer, dict), "the producer is no object")
    property_, kind, decay, gamma, rate, remainder = _fields(claim, "property kind decay gamma rate remainder")
    layout, degree, lyapunov_degree = _fields(proof, "layout degree lyapunov_degree")
    gain = _choice(property_, "property", "stability", "l2-gain") == "l2-gain"
    _choice(kind, "kind", "frozen", "quadratic", "rate")
    _choice(layout, "layout", "cells", "global")
    _choice(remainder, "remainder", "none", "bounded", "sampled")
    demand(layout == "global" or kind == "frozen", f"layout cells proves nothing {kind}")
    d, e = _whole(degree, "degree", 1, 8), _whole(lyapunov_degree, "lyapunov_degree", 0, 8)
    _number(decay, "decay", 0.0, 0.0 if gain else math.inf)
    demand(gain or gamma is None, "stability has no gamma")
    demand(not gain or _number(gamma, "gamma", 0.0) > 0.0, "gamma is not above 0")

    box, system_box = _box(members["box"], "box"), _box(members["system_box"], "system_box")
    n_p = len(box)
    inside = box.shape == system_box.shape and np.all((box[:, 0] >= system_box[:, 0]) & (box[:, 1] <= system_box[:, 1]))
    demand(inside, "the box is not inside the system's box")
    names = "ABCD" if gain else "A"
    matrices = {name: polynomial(members, name, n_p) for name in names}
    for name, parts in matrices.items():
        shape, _, c = canonical(*parts)
        demand(shape == parts[0] and c.tobytes() == parts[2].tobytes(), f"{name} is not in canonical form")
    demand(isinstance(stated, str) and stated == system_hash(system_box, matrices), "the system's hash does not fit")
    n = matrices["A"][0][-1]
    n_u, n_y = (matrices["B"][0][-1], matrices["C"][0][-2]) if gain else (0, 0)
    sizes = {"A": (n, n), "B": (n, n_u), "C": (n_y, n), "D": (n_y, n_u)}
    demand(all(matrices[name][0][-2:] == sizes[name] for name in names), "the sizes of the matrices disagree")
    m = n + n_u + n_y
    demand(n >= 1 and n_u + n_y <= MAX_SIZE, "there is no state, or more inputs and outputs than allowed")

    expected = {"__kind__", "__format__", "header", "system_box", "box", "tree", "S", "X", "seal"}
    expected |= {f"{name}_{part}" for name in names for part in ("shape", "entries", "coefficients")}
    for name in names if remainder != "none" else "":
        expected.add(f"remainder_{name}")
        bound = members[f"remainder_{name}"]
        fits = bound.dtype.str == "<f8" and bound.shape == sizes[name] and np.all(bound >= 0.0)
        demand(fits, f"remainder_{name} has another shape than {name}, or is negative")
    demand(set(members) == expected, f"members too many: {sorted(set(members) - expected)}")

    rates = [[Fraction(0)]] * n_p
    if kind == "rate":
        demand(isinstance(rate, list) and len(rate) == n_p, "rate has not one row for every coordinate")
        demand(all(isinstance(row, list) and len(row) == 2 for row in rate), "a row of rate is no pair")
        pairs = [(_number(low, "rate", most=0.0), _number(high, "rate", least=0.0)) for low, high in rate]
        rates = [sorted({Fraction(low), Fraction(high)}) for low, high in pairs]
    demand(kind == "rate" or rate is None, f"a {kind} claim has no rate")

    cells = leaves(members["tree"], n_p)
    S, X, packed = members["S"], members["X"], n * (n + 1) // 2
    demand(S.dtype.kind == "f" and X.dtype.kind == "f", "S or X are no floats")
    if layout == "cells":
        wanted = (len(cells), math.comb(n_p + e, e) - 1, packed)
        demand(S.shape == (len(cells), n, n) and X.shape == wanted, f"S or X have not the shape of {len(cells)} cells")
    else:
        lengths = X.shape[:-1]
        fits = len(lengths) == n_p and X.shape[-1] == packed and all(1 <= k <= MAX_LENGTH["X"] for k in lengths)
        demand(S.shape == (n, n) and fits and X.size <= MAX_COEFFICIENTS, "S or X have a wrong shape")
        demand(kind != "quadratic" or math.prod(lengths) == 1, "a quadratic claim needs one constant X")
    products = (math.comb(n_p + d, d) * math.comb(n_p + e, e) * 2 ** (n_p * (kind == "rate")) + (d + 1) ** n_p) * m**3
    products += sum(c.size * sum(shape[:-2]) for shape, _, c in matrices.values())
    products += X.size * sum(X.shape[:-1]) if layout == "global" else 0
    numbers = max(math.comb(n_p + d + e, n_p), (d + 1) ** n_p) * m**2
    bounded = products <= MAX_PRODUCTS and numbers <= MAX_NUMBERS and products * len(cells) <= MAX_WORK
    demand(bounded, "checking would take more memory or time than the limits allow")

    out: dict[str, Any] = dict(members)
    out |= {"n": n, "m": m, "cells": cells, "rate": rates, "layout": layout, "degree": d, "lyapunov_degree": e}
    out |= {"decay": float(decay), "gamma": float(gamma) if gain else 0.0, "kind": kind, "remainder": remainder}
    out |= {"box": _exact(box), "system_box": _exact(system_box), "system": stated, "speeds": rate}
    out["matrices"], out["blocks"] = names, [(name, (n + n_u) * (name in "CD"), n * (name in "BD")) for name in names]
    return out | {f"{name}_shape": shape for name, (shape, _, _) in matrices.items()}


def _exact(box: Any) -> list[list[Fraction]]:
    return [[Fraction(v) for v in row] for row in box.tolist()]
