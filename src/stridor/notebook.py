"""What Python and notebooks show of cases and results: a line, a small table; what is there already, and short."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

MOST_ROWS = 12
MOST_LETTERS = 200  # of a cell or a line


class Shown:
    """What is shown in one line, `<Kind: in a few words>`, and in notebooks as that or a table of its own.

    A dataclass among them is made with ``repr=False``, or it would print every number that it holds.
    """

    @property
    def _line(self) -> str:
        """What it is, in a few words."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return shortened(f"<{type(self).__name__}: {' '.join(self._line.split())}", ">")

    def _repr_html_(self) -> str:
        return html_table(f"{type(self).__name__}: {self._line}", (), ())


def html_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[object]], lines: Iterable[str] = ()) -> str:
    """A title, a table of the first rows, and lines below it; "" is left out."""
    all_rows = list(rows)
    body = "".join(f"<tr>{''.join(f'<td>{_short(cell)}</td>' for cell in row)}</tr>" for row in all_rows[:MOST_ROWS])
    head = "".join(f"<th>{_short(cell)}</th>" for cell in heads)
    more = [f"and {len(all_rows) - MOST_ROWS} more"] if len(all_rows) > MOST_ROWS else []
    below = "".join(f"<div>{_short(line)}</div>" for line in [*more, *lines] if line)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>" if all_rows else ""
    return f"<div><strong>{_short(title)}</strong>{table}{below}</div>"


def counted(count: int, what: str) -> str:
    """A number of things: "1 mode", "2 modes", "no modes"."""
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


def shortened(text: str, end: str = "") -> str:
    """A text with an end, of no more than some letters."""
    most = MOST_LETTERS - len(end)
    return (text if len(text) <= most else text[: most - 1] + "…") + end


def _short(value: object) -> str:
    return escape(shortened(str(value)))
