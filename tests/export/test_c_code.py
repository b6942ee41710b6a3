"""Guards the C code: compiled with the system's compiler, it does what the Python controller does."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.export import SampledController, c_code, sampled, save
from lpvhinf.statespace import LPVStateSpace
from tests.export.systems import BOX, KINDS

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
STRICT = ["-std=c89", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O1"]
SAMPLES = 10_000

pytestmark = pytest.mark.skipif(COMPILER is None, reason="the C code is not compiled: no C compiler (cc, gcc, clang)")


@dataclass
class Compiled:
    """The functions of a compiled controller."""

    library: ctypes.CDLL
    controller: SampledController
    dtype: Any

    def __post_init__(self) -> None:
        # generous: the state is x and room for every matrix and the basis
        n = self.controller.n_x + self.controller.n_u + self.controller.n_y
        self.state = np.full(8 * n * n + 1000, np.nan, self.dtype)
        self.reset()

    def reset(self) -> None:
        self.call("reset")

    def call(self, function: str, *arrays: Array) -> int:
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (self.state, *arrays)]
        return int(getattr(self.library, f"{self.controller.name}_{function}")(*pointers))

    def step(self, u: Array, p: Array | None = None) -> tuple[int, Array]:
        y = np.full(self.controller.n_y, np.nan, self.dtype)
        signals = [np.ascontiguousarray(value, dtype=self.dtype) for value in ([u] if p is None else [p, u])]
        return self.call("step", *signals, y), y

    def run(self, u: Array, p: Array | None) -> Array:
        out = np.zeros((len(u), self.controller.n_y), self.dtype)
        for k in range(len(u)):
            status, out[k] = self.step(u[k], None if p is None else p[k])
            assert status == 0
        return out


def compiled(controller: SampledController, folder: Path, precision: str = "double") -> Compiled:
    assert COMPILER is not None
    _, source = save(controller, folder / f"{controller.name}.c", precision=precision)
    library = folder / f"{controller.name}_{precision}.so"
    run = subprocess.run(
        [COMPILER, *STRICT, "-fPIC", "-shared", str(source), "-o", str(library)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    return Compiled(ctypes.CDLL(str(library)), controller, np.float64 if precision == "double" else np.float32)


@pytest.mark.parametrize("kind", KINDS)
def test_double_precision_equals_python_to_round_off(
    kind: str,
    make: Callable[[str], SampledController],
    signals: Callable[[SampledController, int], tuple[Array, Array | None]],
    tmp_path: Path,
) -> None:
    K = make(kind)
    u, p = signals(K, SAMPLES)
    wanted, found = K.simulate(u, p), compiled(K, tmp_path).run(u, p)
    assert np.max(np.abs(wanted)) > 0.0
    assert np.max(np.abs(found - wanted)) <= 1e-13 * np.max(np.abs(wanted))


@pytest.mark.parametrize("kind", ["six axes", "scheduled"])
def test_single_precision_equals_python_in_single_precision(
    kind: str,
    make: Callable[[str], SampledController],
    signals: Callable[[SampledController, int], tuple[Array, Array | None]],
    tmp_path: Path,
) -> None:
    K = make(kind)
    u, p = signals(K, SAMPLES)
    wanted, found = K.simulate(u, p, dtype=np.float32), compiled(K, tmp_path, "single").run(u, p)
    assert found.dtype == np.float32
    assert np.max(np.abs(found - wanted)) <= 1e-5 * np.max(np.abs(wanted))
    # and it is not the double code
    assert np.max(np.abs(found - K.simulate(u, p))) > 1e-9 * np.max(np.abs(wanted))


def test_a_position_outside_is_moved_to_the_border_and_reported(
    make: Callable[[str], SampledController], tmp_path: Path
) -> None:
    code = compiled(make("scheduled"), tmp_path)
    u = np.array([1.0, -1.0])
    for outside, border in (
        ([0.1, 0.0], [0.06, 0.0]),
        ([0.0, -9.0], [0.0, -0.05]),
        ([np.nan, 0.0], [-0.06, 0.0]),
        ([np.inf, -np.inf], [0.06, -0.05]),
    ):
        code.reset()
        status, found = code.step(u, np.array(outside))
        assert status == 1
        code.reset()
        status, wanted = code.step(u, np.array(border))
        assert status == 0
        assert np.array_equal(found, wanted)


def test_a_reset_begins_anew(make: Callable[[str], SampledController], tmp_path: Path) -> None:
    code = compiled(make("scheduled"), tmp_path)
    p, u = BOX.mean(axis=1), np.ones(2)
    first = [code.step(u, p)[1] for _ in range(5)]
    assert not np.allclose(first[0], first[4])
    code.reset()
    assert np.array_equal([code.step(u, p)[1] for _ in range(5)], first)


def test_a_singular_step_changes_nothing(tmp_path: Path) -> None:
    # A touches 2/T = 2^14 at p = 0.5 alone, without round-off
    A = np.array([2.0**14 - 2.0**8, 2.0**10, -(2.0**10)]).reshape(3, 1, 1)
    G = LPVStateSpace.from_coefficients(A, [[1.0]], [[1.0]], [[1.0]], box=[[-1.0, 1.0]], basis="power")
    K = sampled(G, period=2.0**-13, name="touching")
    code, u = compiled(K, tmp_path), np.ones(1)
    assert code.step(u, np.array([0.25]))[0] == 0
    before = code.state[0]
    status, y = code.step(u, np.array([0.5]))
    assert status == 2
    assert np.all(np.isnan(y))
    assert code.state[0] == before
    with pytest.raises(AssumptionError, match="singular in sample 1"):
        K.simulate(np.ones((2, 1)), [[0.25], [0.5]])


def test_the_code_is_cplusplus_too(make: Callable[[str], SampledController], tmp_path: Path) -> None:
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    _, source = save(make("scheduled"), tmp_path / "scheduled.c")
    run = subprocess.run(
        [compiler, "-x", "c++", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", str(source)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr


def test_the_header_tells_sizes_period_and_channels(make: Callable[[str], SampledController]) -> None:
    header, source = c_code(make("six axes"))
    assert "#define six_axes_N_X 12" in header
    assert "#define six_axes_PERIOD 0.0001" in header
    assert "u[2]: e_z [m or rad]" in header
    assert source.count("#include") == 1


def test_bad_input_is_named() -> None:
    with pytest.raises(DomainError, match="precision is 'half'"):
        c_code(sampled(2.0), precision="half")
    with pytest.raises(DomainError, match="too large for single precision"):
        c_code(sampled(1e39), precision="single")
    header, _ = c_code(sampled(2.0, inputs=["an end */ of a comment"]))
    assert "end * / of" in header
