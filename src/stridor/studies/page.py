"""A study as a page: what was asked, what came out, what of it was confirmed, and its figures."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from ..io.atomic import write_text
from .result import StudyResult
from .summary import Line, answer, failures, tables

_TITLES = {
    "stability-map": "Where it squeals",
    "root-locus": "Modes of all samples",
    "bands": "How likely a mode grows, by frequency",
    "sobol-indices": "What decides it",
}


def write_page(result: StudyResult, figures: Mapping[str, Figure], path: Path) -> Path:
    """Write the page with its figures in it. Raises AnalysisError where it cannot be written."""
    title = result.study.title or f"Study of {result.compute}"
    parts = [f"<h1>{html.escape(title)}</h1>", f"<p><strong>{html.escape(answer(result))}</strong></p>"]
    parts += [f"<p>{html.escape(note)}</p>" for note in result.notes]
    for heading, heads, rows in tables(result):
        parts += [f"<h2>{html.escape(heading)}</h2>", _table(heads, rows)]
    for name, figure in figures.items():
        words = _TITLES.get(name, "")
        parts.append(f"<h2>{html.escape(words)}</h2>" if words else "")
        parts.append(f'<figure><img alt="{html.escape(words or name)}" src="{_inline(figure)}"></figure>')
    if bad := failures(result):
        parts += ["<h2>Rows that failed</h2>", _table(("error", "rows"), bad)]
    style = (resources.files("stridor.view") / "templates" / "report.css").read_text(encoding="utf-8")
    own = "figure img { max-width: 100%; height: auto; } body { max-width: 60rem; margin: 0 auto; padding: 1rem; }"
    body = "\n".join(part for part in parts if part)
    text = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{style}\n{own}</style></head>\n<body>\n{body}\n</body></html>\n"
    )
    write_text(path, text)
    return path


def _inline(figure: Figure) -> str:
    held = BytesIO()
    figure.savefig(held, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(held.getvalue()).decode()


def _table(heads: Sequence[str], rows: Iterable[Line]) -> str:
    head = "".join(f"<th>{html.escape(h)}</th>" for h in heads)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
