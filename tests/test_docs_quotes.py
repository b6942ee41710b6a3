"""The pages quote the code rightly: limits, names, equations, navigation."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Literal

import numpy as np
import pytest

import lpvhinf as lh
from lpvhinf.certify import Certificate, reader, stability
from lpvhinf.certify.verdict import recheck
from lpvhinf.statespace import LPVStateSpace

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"


def text_of(page: str) -> str:
    return (DOCS / page).read_text("utf-8")


def load_build() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_build", DOCS / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# The certificate's format


def test_the_limits_of_the_reader_are_those_of_the_page() -> None:
    rows = re.findall(
        r"^\| .+? \| `(MAX_\w+)(?:\[\"(\w+)\"\])?` \| ([\d ]+) \|$", text_of("certificate_format.md"), re.MULTILINE
    )
    quoted = {(name, key): int(number.replace(" ", "")) for name, key, number in rows}
    known: dict[tuple[str, str], int] = {}
    for name, value in vars(reader).items():
        if name.startswith("MAX_"):
            known |= {(name, key): v for key, v in value.items()} if isinstance(value, dict) else {(name, ""): value}
    assert quoted == known


def test_the_limits_on_the_page_about_certificates_agree() -> None:
    text = " ".join(text_of("certificates.md").split())
    section = text[text.index("## Limits of the checker") :]
    for part in (
        f"{reader.MAX_SIZE} states",
        f"{reader.MAX_SIZE} inputs and outputs",
        f"{reader.MAX_AXES} coordinates",
        f"{reader.MAX_LEAVES // 1000} 000 cells",
        f"degree {reader.MAX_LENGTH['system'] - 1}",
        f"({reader.MAX_LENGTH['X'] - 1} of a Lyapunov",
        f"{reader.MAX_BYTES // 10**9} GB",
    ):
        assert part in section, part


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_in_either_order_are_the_same_file(tmp_path: Path, order: Literal["C", "F"]) -> None:
    A = [[[-2.0, 1.0], [0.0, -3.0]], [[0.5, 0.0], [0.2, 0.1]]]
    system = LPVStateSpace.from_coefficients(A, np.eye(2), np.eye(2), np.zeros((2, 2)), box=[[-1.0, 1.0]])
    proof = stability(system)
    assert isinstance(proof, Certificate)
    proof.save(tmp_path / "written.npz")
    with np.load(tmp_path / "written.npz") as archive:
        turned = {name: np.asarray(archive[name], order=order) for name in archive.files}
    assert np.isfortran(turned["A_coefficients"]) == (order == "F")
    np.savez(tmp_path / "turned.npz", **turned)  # type: ignore[arg-type]
    assert recheck(tmp_path / "turned.npz").proved


# Names


def resolved(name: str) -> object:
    """What a dotted name on a page stands for; `lh.` is the package, a bare class one of its public names."""
    first, *rest = name.split(".")
    if first in ("lpvhinf", "control"):
        for cut in range(len(rest), -1, -1):  # the longest module
            try:
                value: object = importlib.import_module(".".join([first, *rest[:cut]]))
            except ModuleNotFoundError:
                continue
            rest = rest[cut:]
            break
    elif first == "lh":
        value = lh
    else:
        value = getattr(lh, first)
    for part in rest:
        # attributes of a dataclass without a default are in its annotations alone
        if not hasattr(value, part) and part in getattr(value, "__annotations__", {}):
            return value
        value = getattr(value, part)
    return value


def spans(page: str) -> list[str]:
    """Code in the running text and in tables."""
    text = re.sub(r"^```.*?^```", "", text_of(page), flags=re.DOTALL | re.MULTILINE)
    return re.findall(r"`([^`\n]+)`", text)


NAMED = r"(?:lh|lpvhinf|control)(?:\.\w+)+|(?:[A-Z]\w+)(?:\.[a-z]\w*)+"


@pytest.mark.parametrize("page", ["coming_from_matlab.md", "conventions.md", "numerical_accuracy.md"])
def test_every_name_on_a_page_exists_with_the_arguments_shown(page: str) -> None:
    found = 0
    for span in spans(page):
        match = re.fullmatch(rf"({NAMED})(\((.*)\))?", span)
        if match is None or span.startswith("TuningGoal"):
            continue
        value = resolved(match[1])
        found += 1
        if match[2]:
            assert callable(value), span
            known = set(inspect.signature(value).parameters)
            assert set(re.findall(r"(\w+)=", match[3])) <= known, span
    assert found > 8


def test_coming_from_matlab_names_the_functions_asked_for() -> None:
    text = text_of("coming_from_matlab.md")
    for name in (
        "hinfstruct",
        "systune",
        "looptune",
        "hinfsyn",
        "lpvsyn",
        "lpvsynsf",
        "lpvnorm",
        "hinfgs",
        "LPVTools",
        "LPVcore",
        "c2d",
        "HIFOO",
    ):
        assert name in text


def test_tolerances_quoted_are_those_of_the_code() -> None:
    text = text_of("numerical_accuracy.md")
    rows = re.findall(r"^\| [^|]+ \| ([\d.e-]+) \(`(lpvhinf\.[\w.]+)`\) \|$", text, re.MULTILINE)
    assert len(rows) >= 3
    for number, name in rows:
        assert float(number) == resolved(name), name
    defaults = re.findall(r"`(\w+)` of `(lh\.\w+)` \| ([\d.e-]+) \|", text)
    assert len(defaults) >= 4
    for argument, name, number in defaults:
        function = resolved(name)
        assert callable(function)
        assert inspect.signature(function).parameters[argument].default == float(number), name


# The equations of the paper


def test_the_table_of_equations_is_complete_and_in_order() -> None:
    rows = re.findall(r"^\| \((\d+)\) \| (.+?) \| ", text_of("conventions.md"), re.MULTILINE)
    assert [int(number) for number, _ in rows] == list(range(1, 24))


@pytest.mark.parametrize("page", sorted(path.name for path in DOCS.glob("*.md")))
def test_equation_numbers_on_the_pages_fit_what_they_speak_of(page: str) -> None:
    """Words that belong to one equation of the paper, wherever a page (not a quoted report) names its number."""
    build = load_build()
    text = build.BLOCK.sub("", text_of(page))
    meaning = {
        r"extended[^.|]{0,60}\(?eq\. (\d+)": 6,
        r"rigid-body decoupling \(eq\. (\d+)\)": 5,
        r"roll-off of eq\. (\d+)": 17,
        r"notch-shaped filter of eq\. (\d+)": 18,
        r"with M of eq\. (\d+)": 14,
        r"observer's model is eq\. (\d+)": 8,
    }
    for pattern, number in meaning.items():
        for found in re.findall(pattern, text):
            assert int(found) == number, pattern


# Citing, navigation


def test_the_citation_is_that_of_the_file() -> None:
    page, stated = text_of("how_to_cite.md"), (ROOT / "CITATION.cff").read_text("utf-8")
    fields = dict(re.findall(r'^(title|version|license): "?(.+?)"?$', stated, re.MULTILINE))
    plain = re.sub(r"[{}]", "", page)
    assert fields["title"] in plain
    assert f"version = {fields['version']}," in re.sub(r" +", " ", plain)
    assert f"license = {fields['license']}," in re.sub(r" +", " ", plain)
    entry = re.search(r"^@misc\{broens2022modal.*?^\}", text_of("bibliography.bib"), re.DOTALL | re.MULTILINE)
    assert entry is not None
    assert entry[0] in page


def test_the_index_names_pages_that_exist_once() -> None:
    named = re.findall(r"^([a-z_0-9/]+)$", text_of("index.md"), re.MULTILINE)
    assert len(named) == len(set(named)) > 15
    assert all((DOCS / f"{name}.md").is_file() for name in named if name != "api/index")
