"""Settings of the documentation site: `make docs` builds it into build/site.

Everything that a page needs lies beside it: fonts of the reader's system, formulas as MathML, a search that runs in the
page.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE)]

from site_tools.api_pages import write_pages  # noqa: E402

import lpvhinf  # noqa: E402

project = "lpvhinf"
author = "The lpvhinf authors"
copyright = author
release = version = lpvhinf.__version__
html_title = f"lpvhinf {release}"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "site_tools.mathml",
    "site_tools.docstrings",
    "site_tools.navigation",
]
exclude_patterns = ["examples", "site_tools", "_*"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # links to headings as on GitHub

default_role = "code"  # `name` in docstrings
autodoc_typehints = "none"  # docstrings say shapes and units, which tell more
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
autodoc_preserve_defaults = True  # `SILENT`, not where it lies in memory
napoleon_google_docstring = False
napoleon_use_ivar = True  # attributes of a dataclass once, not as members again
napoleon_use_rtype = False
html_math_renderer = "mathml"

html_theme = "furo"
html_copy_source = False
html_show_sphinx = False
html_static_path = ["site_tools/static"]
html_css_files = ["site.css"]


def setup(app: Any) -> None:
    """Write the pages of the API reference before the others are read."""
    app.connect("builder-inited", lambda _: write_pages(HERE.parent / "lpvhinf", HERE / "api"), priority=1)
