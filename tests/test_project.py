"""The project's own rules: the lock, the reasons for dependencies, the floors of the house, the pages."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "lpvhinf"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
REQUIREMENTS = [Requirement(line) for line in [*PROJECT["dependencies"], *EXTRAS["dev"], *EXTRAS["docs"]]]
LOCK = (ROOT / "requirements.lock").read_text("utf-8")
PINS = dict(re.findall(r"^([\w.-]+)==(\S+)", LOCK, re.MULTILINE))

# A floor imports only from floors below it, and rooms of one floor never in a circle.
FLOORS = {
    "errors": 0,
    "checks": 0,
    "progress": 0,
    "storage": 0,
    "polynomial": 0,
    "fitting": 0,
    "jobs": 0,
    "notebook": 0,
    "statespace": 1,
    "plant": 2,
    "mmpa": 2,
    "hinfstruct": 2,
    "lpv": 2,
    "certify": 2,
    "decoupling": 3,
    "controllers": 3,
    "shaping": 3,
    "export": 3,
    "problems": 4,
    "codesign": 5,
    "robustness": 5,
    "simulation": 5,
    "stored_design": 2,
    "plotting": 6,
    "viewer": 6,
    "cli": 7,
}
ENGINES = ("hinfstruct", "lpv", "certify")  # serve any plant, so they know none
DRAWING = 6  # the lowest floor that may import matplotlib
HEAVY = ("matplotlib", "control", "cvxpy", "magpylib", "clarabel", "slycot", "skfem", "rich", "pytest")


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def room(module: Path) -> str:
    """The first name below the package: a file without its ending, or a folder."""
    return module.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(module: Path) -> Iterator[str]:
    """Full names of everything a file imports, inside functions and for type checking too."""
    for node in ast.walk(ast.parse(module.read_text("utf-8"), str(module))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import in line {node.lineno}"
            assert node.module is not None
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def rooms_used(module: Path) -> set[str]:
    parts = [name.split(".") for name in imported(module) if name.split(".")[0] == "lpvhinf"]
    return {name[1] for name in parts if len(name) > 1} - {room(module)}


def test_lock_holds_pins_and_hashes_only() -> None:
    # so it names no host, no index, no folder: lines are a pin, a hash, a comment or empty
    line = re.compile(r"[\w.-]+==[\w.+]+( ; [^\\]+)?( \\)?|    --hash=sha256:[0-9a-f]{64}( \\)?|\s*#.*|")
    assert not [text for text in LOCK.splitlines() if not line.fullmatch(text)]
    assert not re.search(r"://|--(index|extra-index|find-links|trusted)|/\w+/", LOCK)


def test_lock_pins_every_package_with_hashes() -> None:
    entries = re.split(r"^(?=[\w.-]+==)", LOCK, flags=re.MULTILINE)[1:]
    assert len(entries) == len(PINS) > len(REQUIREMENTS)
    assert not [entry.split()[0] for entry in entries if "--hash=sha256:" not in entry]


@pytest.mark.parametrize("requirement", REQUIREMENTS, ids=lambda requirement: requirement.name)
def test_lock_satisfies_pyproject(requirement: Requirement) -> None:
    pinned = {canonicalize_name(name): version for name, version in PINS.items()}
    assert requirement.specifier.contains(Version(pinned[canonicalize_name(requirement.name)]))


def test_every_dependency_has_its_reason_and_no_other() -> None:
    page = (ROOT / "docs/dependencies.md").read_text("utf-8")
    rows = re.findall(r"^\| ([a-z][\w-]*) \| \S.{20,}\|$", page, re.MULTILINE)
    assert sorted(rows) == sorted(requirement.name for requirement in REQUIREMENTS)


def test_version_is_the_same_everywhere() -> None:
    stated = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.MULTILINE)
    assert stated is not None
    assert stated[1] == PROJECT["version"]


def test_import_leaves_the_heavy_packages_alone() -> None:
    # Not timed: which packages are imported decides how long it takes.
    code = f"import sys, lpvhinf; print(*[name for name in {HEAVY!r} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout.split() == []


def test_import_prints_nothing_and_warns_of_nothing() -> None:
    command = [sys.executable, "-W", "error", "-c", "import lpvhinf"]
    run = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout + run.stderr == ""


@pytest.mark.parametrize("module", modules(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_floor_imports_only_from_below(module: Path) -> None:
    if module == PACKAGE / "__init__.py":
        pytest.skip("the package's own names come from all floors")
    if module == PACKAGE / "__main__.py":
        pytest.skip("the command line starts here")
    here = room(module)
    assert here in FLOORS, f"lpvhinf/{here} has no floor yet: give it one in FLOORS"
    higher = {name for name in rooms_used(module) if FLOORS.get(name, -1) > FLOORS[here]}
    assert not higher, f"{module.relative_to(ROOT)} imports {sorted(higher)} from above"


@pytest.mark.parametrize("module", modules(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_numerics_never_import_plotting(module: Path) -> None:
    if FLOORS.get(room(module), 0) < DRAWING:
        assert not [name for name in imported(module) if name.split(".")[0] == "matplotlib"]


def test_rooms_of_one_floor_do_not_import_in_a_circle() -> None:
    uses: dict[str, set[str]] = {}
    for module in modules():
        if module.parent != PACKAGE or room(module) not in {"__init__", "__main__"}:
            uses.setdefault(room(module), set()).update(rooms_used(module))
    while free := {name for name, used in uses.items() if not used & uses.keys()}:
        for name in free:
            del uses[name]
    assert not uses, f"a circle among {sorted(uses)}"


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_know_no_plant(engine: str) -> None:
    for module in (PACKAGE / engine).rglob("*.py"):
        assert not rooms_used(module) & {"plant", "mmpa"}, module


def test_the_checker_of_certificates_stands_alone() -> None:
    checker = PACKAGE / "certify" / "checker.py"
    if not checker.exists():
        pytest.skip("not built yet")
    assert not [name for name in imported(checker) if name.split(".")[0] == "lpvhinf"]


def test_nothing_beside_the_package_is_imported_by_it() -> None:
    beside = {"studies", "paper_figures", "benchmarks", "tests"}
    allowed = {"cli"}  # the command line hands over to the studies
    for module in modules():
        if room(module) not in allowed:
            assert not {name.split(".")[0] for name in imported(module)} & beside, module


def test_pages_name_no_machine_and_their_links_lead_somewhere() -> None:
    spec = importlib.util.spec_from_file_location("docs_build", ROOT / "docs/build.py")
    assert spec is not None
    assert spec.loader is not None
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    for page in build.pages():
        text = page.read_text("utf-8")
        assert not re.search(r"(?<![\w.])/(home|work|tmp|opt|root|usr|mnt)/", text), page
        assert not list(build.broken_links(page, text))
        assert text.count("<!-- begin: ") == text.count("<!-- end: ") == len(build.BLOCK.findall(text)), page


def test_make_lists_its_targets() -> None:
    run = subprocess.run(["make"], capture_output=True, text=True, check=True, cwd=ROOT)
    for target in ["reproduce", "reproduce-all", "test", "test-all", "lint", "bench", "docs", "lock", "clean"]:
        assert f"make {target} " in run.stdout
