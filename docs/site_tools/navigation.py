"""Navigation: a page that index.md does not name yet is listed at the end of the guides, so that none is lost."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

LAST_GUIDE = "claims\n"


def with_further_pages(index: str, pages: list[str]) -> str:
    r"""The text of index.md with the pages (names without ending) that it lacks.

    Examples
    --------
    >>> with_further_pages("plant\nclaims\n```\n", ["claims", "index", "plant", "viewer"])
    'plant\nclaims\nviewer\n```\n'
    """
    named = set(re.findall(r"^[\w/]+$", index, re.MULTILINE))
    further = [page for page in pages if page not in named and page != "index"]
    return index.replace(LAST_GUIDE, LAST_GUIDE + "".join(f"{page}\n" for page in further), 1)


def on_source_read(app: Any, name: str, source: list[str]) -> None:
    """Complete index.md as it is read."""
    if name == "index":
        source[0] = with_further_pages(source[0], sorted(path.stem for path in Path(app.srcdir).glob("*.md")))


def setup(app: Any) -> dict[str, bool]:
    """Connect."""
    app.connect("source-read", on_source_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
