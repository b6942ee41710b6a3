"""Refresh what README.md and the pages in docs/ quote from results, and check their links.

Between ``<!-- begin: NAME -->`` and ``<!-- end: NAME -->`` stands what NAME says:

* ``results/.../report.md``: the file; ``results/.../report.md#Title``: one section of it, without its title;
* ``figure results/.../name.png: text``: the figure, copied to docs/images, with `text` for those who cannot see it
  (the text is left out of the end marker);
* ``gallery``: every figure in docs/images, with what it shows and the commands that draw it;
* ``output PAGE.md 1``: what the page's first Python block prints;
* ``session PAGE.md 2``: what the page's second Python block prints after those before it, in one session.

Where a file is missing (results are not part of a checkout), the quoted text stays and a line says so.

Usage: ``python docs/build.py [--check] [--no-run]``. With ``--check`` nothing is written, and the exit status is 1 if a
page differs or a link is broken. With ``--no-run`` no Python block is run.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # for the table of figures in paper_figures
IMAGES = Path("docs/images")
BLOCK = re.compile(r"<!-- begin: (?P<name>[^\n]+?) -->\n(?P<body>.*?)<!-- end: (?P<end>[^\n]+?) -->", re.DOTALL)
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```[^\n]*$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[[^\]\n]*\]\((?P<target>[^)\s]+)\)")
RUN = ("output", "session")  # what is quoted from a run of Python blocks
# Runs blocks of a page (a JSON list on the standard input) in one name space and returns what each printed.
SESSION = """
import contextlib, io, json, sys
blocks, scope, printed = json.load(sys.stdin), {"__name__": "__main__"}, []
for number, code in enumerate(blocks, 1):
    heard = io.StringIO()
    with contextlib.redirect_stdout(heard):
        exec(compile(code, f"<block {number}>", "exec"), scope)
    printed.append(heard.getvalue())
json.dump(printed, sys.stdout)
"""


class Missing(Exception):
    """A quoted file is not there; the message names it."""


def pages() -> list[Path]:
    """README.md and the pages in docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def section(text: str, title: str) -> str:
    """The text below the heading `title`, up to the next heading of its level or a higher one."""
    heading = re.search(rf"^(#+) {re.escape(title)}[ \t]*$", text, re.MULTILINE)
    if heading is None:
        raise Missing(f"no heading {title!r}")
    rest = text[heading.end() :]
    following = re.search(rf"^#{{1,{len(heading[1])}}} ", rest, re.MULTILINE)
    return rest[: following.start() if following else None].strip() + "\n"


def source(name: str) -> Path:
    """A file below the root."""
    path = ROOT / name
    if not path.is_file():
        raise Missing(f"{name} is not there: run `make reproduce`")
    return path


def figure(name: str, text: str, page: Path, *, write: bool) -> str:
    """The Markdown of a figure, after its copy to docs/images."""
    original = source(name).read_bytes()
    copy = ROOT / IMAGES / Path(name).name
    if write:
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(original)
    elif not copy.is_file() or copy.read_bytes() != original:
        return "(another figure)\n"
    return f"![{text}]({Path(os.path.relpath(copy, page.parent)).as_posix()})\n"


def gallery() -> str:
    """Every figure in docs/images, with the first line of its script and the commands that draw it."""
    from paper_figures.__main__ import FIGURES
    from studies.__main__ import STUDIES

    studies = {name: study for study, figures in FIGURES.items() for name in figures}
    shown = {Path(m["name"].split(": ")[0]).stem: m["name"].partition(": ")[2] for m in figure_markers()}
    parts = []
    for image in sorted((ROOT / IMAGES).glob("*.png")):
        name = image.stem
        summary = (ast.get_docstring(ast.parse(source(f"paper_figures/{name}.py").read_text("utf-8"))) or "").split(
            "\n\n"
        )[0]
        summary = " ".join(summary.split())
        commands = [f"python -m paper_figures.{name} --out figures"]
        if name in studies:
            study = studies[name]
            run = f"python -m studies run {study} --preset paper --out results/{study}"
            commands = [
                run if study in STUDIES else "make reproduce",
                f"python -m paper_figures {name} --from results/{study} --out figures",
            ]
        title = name.replace("_", " ").capitalize()
        parts.append(
            f"## {title}\n\n{summary}\n\n![{shown.get(name) or title}](images/{image.name})\n\n```sh\n"
            + "\n".join(commands)
            + "\n```\n"
        )
    return "\n".join(parts)


def figure_markers() -> Iterator[re.Match[str]]:
    """The markers of figures on all pages."""
    for page in pages():
        yield from (m for m in BLOCK.finditer(page.read_text("utf-8")) if m["name"].startswith("figure "))


def python_blocks(page_name: str) -> list[str]:
    """The Python blocks of a page, in their order."""
    return [code for language, code in FENCE.findall(source(page_name).read_text("utf-8")) if language == "python"]


@lru_cache
def printed(page_name: str, blocks: tuple[str, ...]) -> list[str]:
    """What each of some blocks prints, one after another in one session of its own."""
    command = [sys.executable, "-W", "error", "-c", SESSION]
    run = subprocess.run(
        command, input=json.dumps(blocks), cwd=ROOT, capture_output=True, text=True, encoding="utf-8", check=False
    )
    if run.returncode != 0:
        raise SystemExit(f"docs/build.py: a Python block of {page_name} fails:\n{run.stderr}")
    return [str(text) for text in json.loads(run.stdout)]


def output(page_name: str, number: int, *, session: bool = False) -> str:
    """What a Python block of a page prints, alone or after the blocks before it, as a text block."""
    blocks = python_blocks(page_name)
    if not 1 <= number <= len(blocks):
        raise SystemExit(f"docs/build.py: {page_name} has {len(blocks)} Python blocks, block {number} is quoted")
    text = printed(page_name, tuple(blocks))[number - 1] if session else printed(page_name, (blocks[number - 1],))[0]
    return f"```text\n{text.rstrip()}\n```\n"


def content(name: str, page: Path, *, write: bool) -> str:
    """What stands between the markers of `name`."""
    kind, _, rest = name.partition(" ")
    if kind == "figure":
        path, _, text = rest.partition(": ")
        return figure(path, text, page, write=write)
    if kind == "gallery":
        return gallery()
    if kind in RUN:
        page_name, number = rest.rsplit(" ", 1)
        return output(page_name, int(number), session=kind == "session")
    path, _, title = name.partition("#")
    text = source(path).read_text("utf-8")
    return section(text, title) if title else text.strip() + "\n"


def refreshed(page: Path, *, write: bool, run: bool, notes: list[str]) -> str:
    """The text of `page` with its quoted blocks as they should be."""

    def replace(match: re.Match[str]) -> str:
        name, end = match["name"], match["end"]
        if name.split(": ")[0] != end:
            raise SystemExit(f"docs/build.py: {page.name}: 'begin: {name}' is closed by 'end: {end}'")
        if name.partition(" ")[0] in RUN and not run:
            return match[0]
        try:
            body = content(name, page, write=write)
        except Missing as missing:
            notes.append(f"{page.name}: left as it is, {missing}")
            return match[0]
        return f"<!-- begin: {name} -->\n{body}<!-- end: {end} -->"

    return BLOCK.sub(replace, page.read_text("utf-8"))


def anchors(text: str) -> set[str]:
    """The anchors that a page's headings get."""
    titles = re.findall(r"^#+ (.+)$", FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-") for title in titles}


def broken_links(page: Path, text: str) -> Iterator[str]:
    """Links of a page to files or headings that do not exist; other sites are not visited."""
    for match in LINK.finditer(FENCE.sub("", text)):
        target = match["target"]
        if re.match(r"https?://|mailto:", target):
            continue
        path, _, anchor = target.partition("#")
        file = page.parent / path if path else page
        if not file.exists():
            yield f"{page.name}: no file {target}"
        elif anchor and anchor not in anchors(text if file == page else file.read_text("utf-8")):
            yield f"{page.name}: no heading for {target}"


def main(argv: Sequence[str] | None = None) -> int:
    """Refresh or check all pages."""
    parser = argparse.ArgumentParser(prog="python docs/build.py", description="Refresh quoted results, check links.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit status 1 if something differs")
    parser.add_argument("--no-run", action="store_true", help="run no Python block")
    arguments = parser.parse_args(argv)
    if not arguments.check:
        subprocess.run(
            [sys.executable, "-m", "paper_figures.block_diagram", "--out", str(IMAGES)], cwd=ROOT, check=True
        )
    notes: list[str] = []
    faults: list[str] = []
    for page in pages():
        text = refreshed(page, write=not arguments.check, run=not arguments.no_run, notes=notes)
        if text != page.read_text("utf-8"):
            if arguments.check:
                faults.append(f"{page.name}: quotes other results than those in results/: run `make docs`")
            else:
                page.write_text(text, "utf-8")
                print(f"{page.name}: refreshed")
        faults += broken_links(page, text)
    for line in notes + faults:
        print(line)
    print(f"{len(pages())} pages, {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
