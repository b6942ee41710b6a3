"""Docstrings as they stand, on the site: magnitudes stay magnitudes, and sizes are no links."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx import addnodes

LITERAL = re.compile(r"(`+[^`]+`+)")
DOCTEST = re.compile(r"^\s*(>>>|\.\.\.) ")


def escape_magnitudes(lines: list[str]) -> list[str]:
    r"""Escape the bars of |K G|, which reStructuredText takes for a name to be replaced, outside of literals.

    Examples
    --------
    >>> escape_magnitudes([r"|K G| is `a|b` at |x|"])
    ['\\|K G\\| is `a|b` at \\|x\\|']
    """
    parts = LITERAL.split("\n".join(lines))
    for i in range(0, len(parts), 2):
        prose = parts[i].split("\n")
        parts[i] = "\n".join(
            line if DOCTEST.match(line) else re.sub(r"\|(?=\S)([^|\n]*\S)\|", r"\\|\1\\|", line) for line in prose
        )
    return "".join(parts).split("\n")


def on_docstring(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Before napoleon reads the docstring."""
    lines[:] = escape_magnitudes(lines)


def unlink_sizes(_app: Any, doctree: nodes.document) -> None:
    """Types such as ``(N, n_p)`` are shapes: of their words only class names are links."""
    for reference in list(doctree.findall(addnodes.pending_xref)):
        target = str(reference.get("reftarget", "")).rpartition(".")[2]
        if reference.get("refdomain") == "py" and not target[:1].isupper():
            reference.replace_self(reference.children)


def setup(app: Any) -> dict[str, bool]:
    """Connect both."""
    app.connect("autodoc-process-docstring", on_docstring, priority=400)
    app.connect("doctree-read", unlink_sizes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
