"""Sphinx: Markdown pages, docstrings as plain text. Building fetches nothing; MathJax draws the formulas."""

from __future__ import annotations

import re
import textwrap
from importlib.metadata import version as installed_version

project = "stridor"
author = "the stridor authors"
project_copyright = "2026, the stridor authors"
release = version = installed_version("stridor")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
smartquotes = False

myst_enable_extensions = ["amsmath", "attrs_block", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True

html_theme = "alabaster"
html_theme_options = {
    "description": "friction-induced instabilities, in frequency and in time",
    "fixed_sidebar": True,
    "page_width": "1080px",
    "sidebar_width": "240px",
}
html_copy_source = False


def plain_text(app, what, name, obj, options, lines):
    """Docstrings are prose with symbols, |λ| and μ*, not reStructuredText: keep `code`, escape the rest."""
    paragraphs = re.split(r"\n\s*\n", textwrap.dedent("\n".join(lines)).strip("\n"))
    lines[:] = []
    for paragraph in paragraphs:
        rows = paragraph.splitlines()
        # Lists, tables and indented sections keep their rows; everything else flows.
        laid_out = any(re.match(r"\s|[-•*] |\d+[.)] |>>> ", row) for row in rows)
        for row in rows:
            indent = " " * (len(row) - len(row.lstrip()))
            lines.append(("| " + indent if laid_out else "") + escaped(row.strip()))
        lines.append("")


def escaped(text: str) -> str:
    """One row of plain text as reStructuredText."""
    parts = re.split(r"``?([^`]+)``?", text)
    parts[0::2] = [re.sub(r"([\\*|_`:<>-])", r"\\\1", part) for part in parts[0::2]]
    parts[1::2] = [f"\\ ``{part.strip()}``\\ " for part in parts[1::2]]
    return "".join(parts)


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", plain_text)
