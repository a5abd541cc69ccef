"""Small tables of HTML, as notebooks show results: what is already there, escaped, and short."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

MOST_ROWS = 12
MOST_LETTERS = 200  # of a cell or a line


def html_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[object]], lines: Iterable[str] = ()) -> str:
    """A title, a table of the first rows, and lines below it; "" is left out."""
    all_rows = list(rows)
    body = "".join(f"<tr>{''.join(f'<td>{_short(cell)}</td>' for cell in row)}</tr>" for row in all_rows[:MOST_ROWS])
    head = "".join(f"<th>{_short(cell)}</th>" for cell in heads)
    more = [f"and {len(all_rows) - MOST_ROWS} more"] if len(all_rows) > MOST_ROWS else []
    below = "".join(f"<div>{_short(line)}</div>" for line in [*more, *lines] if line)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>" if all_rows else ""
    return f"<div><strong>{_short(title)}</strong>{table}{below}</div>"


def _short(value: object) -> str:
    text = str(value)
    return escape(text if len(text) <= MOST_LETTERS else text[: MOST_LETTERS - 1] + "…")
