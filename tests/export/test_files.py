"""Guards exported files: what is read back is what was written, and other files are refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from numpy.polynomial import chebyshev

from lpvhinf.errors import StorageError
from lpvhinf.export import SampledController, load, sampled, save
from tests.export.systems import KINDS

Make = Callable[[str], SampledController]


@pytest.mark.parametrize("suffix", [".json", ".mat"])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_read_back_is_what_was_written(kind: str, suffix: str, make: Make, tmp_path: Path) -> None:
    K = make(kind)
    path = save(K, tmp_path / f"K{suffix}")[0]
    back = load(path)
    assert repr(back) == repr(K)
    assert (back.inputs, back.outputs, back.fit_error) == (K.inputs, K.outputs, K.fit_error)
    for found, wanted in zip(back.matrices, K.matrices, strict=True):
        assert np.array_equal(found.coefficients, wanted.coefficients)
        assert np.array_equal(found.box, wanted.box)


def test_the_mat_file_is_as_its_loader_reads_it(make: Make, tmp_path: Path) -> None:
    K = make("scheduled")
    path, script = save(K, tmp_path / "K.mat")
    text = script.read_text()
    data = scipy.io.loadmat(path)
    assert script.name == "load_scheduled.m"
    assert text.startswith("function K = load_scheduled(file)")
    assert "'K.mat'" in text
    assert set(re.findall(r"K\.([a-zA-Z]\w*)", text)) - {"step", "mat"} <= data.keys()
    assert str(data["form"][0]) in text
    # the loader's sum: Chebyshev polynomials of the first axis change fastest
    p = np.array([0.01, -0.02])
    x = (2 * p - data["box"].sum(axis=1)) / (data["box"][:, 1] - data["box"][:, 0])
    basis = [chebyshev.chebvander(x[i], data["A"].shape[2 + i] - 1) for i in range(2)]
    weights = np.kron(basis[1].ravel(), basis[0].ravel())
    A = np.reshape(data["A"], (64, -1), order="F") @ weights
    assert np.allclose(np.reshape(A, (8, 8), order="F"), K.A.at(p), rtol=0, atol=1e-9)


@pytest.mark.parametrize("suffix", [".json", ".mat"])
def test_other_files_are_refused(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"K{suffix}"
    with pytest.raises(StorageError, match="cannot be read"):
        load(path)
    path.write_text("{half a fi")
    with pytest.raises(StorageError, match="cannot be read"):
        load(path)
    if suffix == ".json":
        path.write_text('{"kind": "another"}')
    else:
        scipy.io.savemat(path, {"A": np.eye(2)})
    with pytest.raises(StorageError, match="not a file of kind"):
        load(path)


def test_damaged_and_later_files_are_refused(tmp_path: Path) -> None:
    path = save(sampled(2.0), tmp_path / "K.json")[0]
    good = json.loads(path.read_text())
    for change, message in (
        ({"format": 2}, "has the format 2"),
        ({"A_shape": [1, 2]}, "is damaged"),
        ({"period": -1.0}, "is damaged"),
        ({"D": [["x"]]}, "is damaged"),
        ({"form": "euler"}, "is damaged"),
        ({"name": None}, "is damaged"),
        ({"box": None}, "is damaged"),
    ):
        path.write_text(json.dumps(good | change))
        with pytest.raises(StorageError, match=message):
            load(path)
    path.write_text(json.dumps({key: value for key, value in good.items() if key != "C"}))
    with pytest.raises(StorageError, match="is damaged"):
        load(path)


def test_unknown_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"has the suffix '\.xml', wanted one of \.json, \.mat, \.c"):
        save(sampled(2.0), tmp_path / "K.xml")
    with pytest.raises(StorageError, match="suffix ''"):
        load(tmp_path / "K")
    with pytest.raises(StorageError, match="C code"):
        load(tmp_path / "K.c")
    with pytest.raises(StorageError, match=r"Use controller\.c"):
        save(sampled(2.0), tmp_path / "K.c")
    assert not list(tmp_path.iterdir())
