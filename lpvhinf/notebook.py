"""Tables that a notebook shows in place of the text of an object."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def table(title: str, rows: Sequence[Sequence[str]]) -> str:
    """HTML of a bold title over a table whose first row and first column are headings.

    Examples
    --------
    >>> table("K", [["", "size"], ["A", "2 x 2"]])
    '<b>K</b><table><tr><th></th><th>size</th></tr><tr><th>A</th><td>2 x 2</td></tr></table>'
    """
    lines = []
    for i, row in enumerate(rows):
        cells = [
            f"<th>{escape(text)}</th>" if i == 0 or j == 0 else f"<td>{escape(text)}</td>" for j, text in enumerate(row)
        ]
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return f"<b>{escape(title)}</b><table>{''.join(lines)}</table>"


def properties(title: str, values: Sequence[tuple[str, str]]) -> str:
    """HTML of a bold title over a table of names and values.

    Examples
    --------
    >>> properties("K", [("states", "2")])
    '<b>K</b><table><tr><th>states</th><td>2</td></tr></table>'
    """
    lines = [f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in values]
    return f"<b>{escape(title)}</b><table>{''.join(lines)}</table>"
