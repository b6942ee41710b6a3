"""Every Python block of README.md and docs/ runs as printed, and what the pages quote of its output is what it prints.

A block that speaks of things that the reader has (`design`, `loop`) is run after a setup that makes small real ones.
Numbers are compared with a tolerance: the last digits, and where an optimiser ends, depend on the processor.
"""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent

# One rigid axis, one flexible mode with gains that depend on p, and a co-design that takes a second.
DESIGN = """
import numpy as np
import lpvhinf as lh

def gains_in(p):
    return np.stack([np.array([[1.0, 1.0], [1.0 + 3.0 * q[0], 3.0 * q[0] - 1.0]]) for q in p])

def gains_out(p):
    return np.stack([np.array([[1.0, 1.0], [1.0, 2.0 * q[0] - 1.0]]) for q in p])

decoupled = lh.decouple(
    lh.ModalModel.from_modal_data(
        omega=[0.0, 800.0], zeta=0.01, box=[[-0.05, 0.05]], input_gains=gains_in, output_gains=gains_out
    ),
    degree=3,
)
design = lh.codesign(
    decoupled, "output-observer", lh.Specification(f_bw=[20.0]),
    n_positions=3, starts=1, exchange_rounds=0, n_search=4, max_iterations=15,
)
gamma = 1.05 * design.gamma_worst
"""
# A loop whose gain lies in the interval that the page searches.
LOOP = """
M = design.performance_loop
scale = 2.6 / design.gamma_worst
loop = lh.LPVStateSpace(M.A, M.B, np.array([[scale]]) * np.eye(M.n_y) @ M.C, scale * np.eye(M.n_y) @ M.D)
design.closed_loop.save("closed_loop.npz")
"""
AFFINE = """
import numpy as np
import lpvhinf as lh

A = np.array([[[-1.0, 1.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, -5.0]], np.diag([0.2, 0.1, 0.0])])
B = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]]
C = [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
D = [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]
lpv_plant = lh.LPVGeneralizedPlant(lh.LPVStateSpace.from_coefficients(A, B, C, D, box=[[-1.0, 1.0]]), n_u=1, n_y=1)
"""


@dataclass(frozen=True, kw_only=True)
class Page:
    """How the blocks of a page are run."""

    setup: str = ""  # in front of the blocks of a page that needs it; they share one session then
    session: bool = False
    smaller: tuple[tuple[str, str], ...] = ()  # sizes that are made smaller, as they stand on the page
    slow: bool = False
    tolerance: float = 0.02  # relative, of the numbers that are quoted


PAGES = {
    "README.md": Page(slow=True, tolerance=0.3),  # a rough design: where it ends depends on the last digits
    "docs/certificates.md": Page(setup=DESIGN + LOOP, session=True, slow=True),
    "docs/lpv_synthesis.md": Page(setup=AFFINE, session=True, smaller=(("lpv_plant, 2", "lpv_plant, 1"),)),
    "docs/own_plant.md": Page(slow=True, tolerance=0.1),
    "docs/plant.md": Page(slow=True),  # makes the tables of the exact field where they are not on disk
    "docs/robustness.md": Page(setup=DESIGN, session=True, smaller=(("10_000", "6"), ("jobs=2", "jobs=1"))),
    "docs/tutorial.md": Page(session=True, slow=True, tolerance=0.1),
}


def load_build() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_build", ROOT / "docs/build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


BUILD = load_build()
NAMES = [
    path.relative_to(ROOT).as_posix()
    for path in BUILD.pages()
    if BUILD.python_blocks(path.relative_to(ROOT).as_posix())
]


def marked(name: str) -> object:
    return pytest.param(name, marks=pytest.mark.slow) if PAGES.get(name, Page()).slow else name


def printed(name: str, folder: Path) -> list[str]:
    """What each Python block of a page prints."""
    how, blocks = PAGES.get(name, Page()), BUILD.python_blocks(name)
    for old, new in how.smaller:
        assert any(old in block for block in blocks), f"{name} no longer holds {old!r}"
        blocks = [block.replace(old, new) for block in blocks]
    if not how.session:
        return [run([block], ROOT)[0] for block in blocks]
    if not how.setup:
        return run(blocks, ROOT)
    return run([how.setup, *blocks], folder)[1:]


def run(blocks: list[str], folder: Path) -> list[str]:
    command = [sys.executable, "-W", "error", "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{BUILD.SESSION}"]
    done = subprocess.run(
        command, input=json.dumps(blocks), cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, done.stderr
    return [str(text) for text in json.loads(done.stdout)]


NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")


def assert_alike(found: str, quoted: str, tolerance: float) -> None:
    """The same words, and numbers within the tolerance or one unit of their last digit."""
    assert re.sub(r"\s+", " ", NUMBER.sub("#", found)).strip() == re.sub(r"\s+", " ", NUMBER.sub("#", quoted)).strip()
    for one, other in zip(NUMBER.findall(found), NUMBER.findall(quoted), strict=True):
        mantissa, _, exponent = other.partition("e")
        unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
        assert float(one) == pytest.approx(float(other), rel=tolerance, abs=1.01 * unit), (one, other)


@pytest.mark.parametrize("name", [marked(name) for name in NAMES])
def test_the_blocks_run_and_print_what_the_page_quotes(name: str, tmp_path: Path) -> None:
    texts = printed(name, tmp_path)
    for match in BUILD.BLOCK.finditer((ROOT / name).read_text("utf-8")):
        kind, _, rest = match["name"].partition(" ")
        if kind in BUILD.RUN:
            page, number = rest.rsplit(" ", 1)
            assert page == name
            quoted = re.sub(r"^```.*$", "", match["body"], flags=re.MULTILINE)
            assert_alike(texts[int(number) - 1], quoted, PAGES.get(name, Page()).tolerance)
    if name == "docs/certificates.md":
        check_commands(tmp_path)


def check_commands(folder: Path) -> None:
    """The commands of the page on certificates, on the files that its blocks wrote."""
    from lpvhinf.certify import Certificate, stability
    from lpvhinf.statespace import LPVStateSpace

    assert (folder / "stable.npz").is_file()
    proof = stability(LPVStateSpace.load(folder / "closed_loop.npz"))
    assert isinstance(proof, Certificate)
    proof.save(folder / "stable.npz")  # the page's last claim is about another loop
    lines = re.findall(
        r"^(python -m lpvhinf\.certify check .*?)(?:\s+#.*)?$", page_text("docs/certificates.md"), re.MULTILINE
    )
    assert len(lines) >= 3
    for line in lines:
        command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r}); import runpy; "
                   "sys.argv[0] = 'check'; runpy.run_module('lpvhinf.certify', run_name='__main__')"]  # fmt: skip
        done = subprocess.run(
            [*command, *shlex.split(line)[3:]], cwd=folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, (line, done.stdout, done.stderr)
        assert done.stdout.startswith("proved")


def page_text(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


def test_outputs_that_differ_are_noticed() -> None:
    assert_alike("gamma 2.00 at [-1.0, 3] mm\n", "gamma 2.01 at [-1.0,  3] mm", 0.001)
    for found in ("gamma 2.20 at [-1.0, 3] mm", "gamma 2.00 at [1.0, 3] mm", "norm 2.00 at [-1.0, 3] mm", "gamma 2.00"):
        with pytest.raises(AssertionError):
            assert_alike(found, "gamma 2.00 at [-1.0, 3] mm", 0.02)


def shell_lines() -> list[tuple[str, str]]:
    """Commands of Python modules in the shell blocks of all pages, but for those of the generated gallery."""
    found = []
    for path in BUILD.pages():
        text = BUILD.BLOCK.sub("", path.read_text("utf-8"))
        for language, code in BUILD.FENCE.findall(text):
            if language == "sh":
                found += [(path.name, line.split("#")[0].strip()) for line in code.splitlines() if line.strip()]
    return found


@pytest.mark.parametrize(("page", "line"), shell_lines())
def test_commands_exist(page: str, line: str) -> None:
    words = shlex.split(line)
    if words[0] == "make":
        assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE), line
    elif words[:2] == ["python", "-m"]:
        help_of = [word for word in words[3:4] if re.fullmatch(r"[a-z]+", word)]
        done = subprocess.run(
            [sys.executable, "-m", words[2], *help_of, "--help"], cwd=ROOT, capture_output=True, text=True, check=True
        )
        assert all(word in done.stdout for word in words if word.startswith("--")), line
    else:
        assert words[0] in ("pip", "lpvhinf", "python", "cc"), line
