"""The documentation site: its own extensions, and what the built pages hold, link to and fetch."""

from __future__ import annotations

import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import lpvhinf

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"


@pytest.fixture(autouse=True)
def extensions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))


def public() -> Iterator[str]:
    """Names of the package that are no modules."""
    for name, value in vars(lpvhinf).items():
        if not name.startswith("_") and not inspect.ismodule(value) and name != "annotations":
            yield name


def test_every_public_name_has_one_place_in_the_reference() -> None:
    pages = importlib.import_module("site_tools.api_pages")
    rooms = pages.public_names(ROOT / "lpvhinf")
    listed = [name for names in rooms.values() for name in names["package"]]
    assert sorted(listed) == sorted(public())
    assert "Certificate" in rooms["certify"]["room"]
    assert "benchmark" in rooms["plant.mmpa"]["room"]
    assert "simulate" in rooms["simulation"]["room"]
    assert set(pages.TITLES) <= rooms.keys(), "a room that is titled has no names"


def test_pages_that_no_longer_belong_are_removed(tmp_path: Path) -> None:
    pages = importlib.import_module("site_tools.api_pages")
    (tmp_path / "old.rst").write_text("old", "utf-8")
    written = pages.write_pages(ROOT / "lpvhinf", tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in written)
    before = {path: path.stat().st_mtime_ns for path in written}
    pages.write_pages(ROOT / "lpvhinf", tmp_path)
    assert before == {path: path.stat().st_mtime_ns for path in written}


def test_a_page_that_the_index_lacks_is_listed() -> None:
    navigation = importlib.import_module("site_tools.navigation")
    index = (DOCS / "index.md").read_text("utf-8")
    names = sorted(path.stem for path in DOCS.glob("*.md"))
    assert navigation.with_further_pages(index, [*names, "new_page"]).count("\nnew_page\n") == 1
    assert navigation.with_further_pages(index, ["index", "plant"]) == index


class Page(HTMLParser):
    """What a built page fetches, links to, and offers as a target."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.targets: set[str] = set()
        self.images: list[dict[str, str | None]] = []
        self.tags: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.tags.add(tag)
        if values.get("id"):
            self.targets.add(str(values["id"]))
        if values.get("src"):
            self.fetched.append(str(values["src"]))
        if tag == "link" and values.get("rel") not in ("index", "search", "next", "prev", "canonical"):
            self.fetched.append(str(values["href"]))
        if tag == "a" and values.get("href"):
            self.links.append(str(values["href"]))
        if tag == "img":
            self.images.append(values)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site."""
    pytest.importorskip("sphinx", reason="the documentation tools are not installed (extra `docs`)")
    pytest.importorskip("myst_parser")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "--quiet", "--fail-on-warning", "--keep-going", "--fresh-env"]
    built = subprocess.run(
        [*command, "-d", str(out / "doctrees"), str(DOCS), str(out / "html")],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    return out / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path.read_text("utf-8")) for path in sorted(site.rglob("*.html"))}


@pytest.mark.slow
def test_every_page_is_built(pages: dict[Path, Page], site: Path) -> None:
    built = {path.relative_to(site).as_posix() for path in pages}
    assert {f"{path.stem}.html" for path in DOCS.glob("*.md")} <= built
    navigation = pages[site / "index.html"].links
    for path in DOCS.glob("*.md"):
        if path.stem != "index":
            assert f"{path.stem}.html" in navigation, f"{path.stem} is not in the navigation"


@pytest.mark.slow
def test_nothing_is_fetched_from_elsewhere(pages: dict[Path, Page], site: Path) -> None:
    for path, page in pages.items():
        assert page.fetched
        for target in page.fetched:
            parts = urlsplit(target)
            if parts.scheme == "data":
                continue
            assert not parts.scheme, (path, target)
            assert not parts.netloc, (path, target)
            assert (path.parent / unquote(parts.path)).is_file(), (path, target)
    for sheet in site.rglob("*.css"):
        text = sheet.read_text("utf-8")
        assert not re.search(r"""url\(\s*['"]?(https?:)?//|@import""", text), sheet
    for script in site.rglob("*.js"):
        assert not re.search(r"""(fetch|import|open)\(\s*['"`]https?:""", script.read_text("utf-8")), script


@pytest.mark.slow
def test_links_and_anchors_lead_somewhere(pages: dict[Path, Page]) -> None:
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                assert parts.scheme in ("http", "https", "mailto"), (path, link)
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.exists(), (path, link)
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].targets, (path, link)


@pytest.mark.slow
def test_every_public_name_can_be_linked_to(pages: dict[Path, Page]) -> None:
    targets = set().union(*(page.targets for page in pages.values()))
    assert not {f"lpvhinf.{name}" for name in public()} - targets


@pytest.mark.slow
def test_formulas_are_mathml_and_figures_are_described(pages: dict[Path, Page], site: Path) -> None:
    assert "math" in pages[site / "conventions.html"].tags
    assert "math" in pages[site / "api/hinfstruct.html"].tags
    assert not [name for page in pages.values() for name in page.fetched if "mathjax" in name.lower()]
    for path in pages:  # what no translator took stands as LaTeX
        assert not re.search(r"\\\(|\\\[ ?\\", path.read_text("utf-8")), path
    shown = [image for page in pages.values() for image in page.images]
    assert len(shown) > 15
    assert all(image.get("alt") for image in shown)
