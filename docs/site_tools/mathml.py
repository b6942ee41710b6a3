"""Formulas as MathML, which browsers draw by themselves: no script, no font, nothing from another site.

The translation from LaTeX is that of docutils, which Sphinx brings with it.
"""

from __future__ import annotations

import html
import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError, unichar2tex
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

logger = logging.getLogger(__name__)

# Commands of LaTeX that docutils knows by another name.
SYNONYMS = (
    (re.compile(r"\\dots(?![a-zA-Z])"), r"\\ldots"),
    (re.compile(r"\\(big|Big|bigg|Bigg)(?![a-zA-Z])"), r"\\\1l"),
)


def mathml(source: str, *, block: bool, location: Any = None) -> str:
    r"""MathML of a LaTeX formula; one that docutils cannot read is a warning, and stays as it is.

    Examples
    --------
    >>> mathml(r"\gamma^2", block=False).startswith("<math")
    True
    """
    formula = source.strip()
    for command, name in SYNONYMS:
        formula = command.sub(name, formula)
    try:
        return str(tex2mathml(formula.translate(unichar2tex.uni2tex_table), as_block=block))
    except (MathError, SyntaxError, KeyError, IndexError) as error:
        logger.warning("formula %r cannot be written as MathML: %s", formula, error, location=location)
        return f"<code>{html.escape(formula)}</code>"


def visit_inline(writer: Any, node: nodes.math) -> None:
    """A formula within a line."""
    writer.body.append(mathml(node.astext(), block=False, location=node))
    raise nodes.SkipNode


def visit_block(writer: Any, node: nodes.math_block) -> None:
    """A formula on lines of its own."""
    writer.body.append(writer.starttag(node, "div", CLASS="math"))
    writer.body.append(mathml(node.astext(), block=True, location=node))
    writer.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Register the renderer under the name `mathml`."""
    app.add_html_math_renderer("mathml", inline_renderers=(visit_inline, None), block_renderers=(visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
