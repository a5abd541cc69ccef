"""Tables on stdout that fit the page: heads in several lines first, then columns left out, which a line below names."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from rich.align import Align
from rich.style import Style
from rich.table import Table
from rich.text import Text

from .output import stdout

UNSTABLE = Style(color="red")
INDENT, GAP = 2, 2
HEADS = (None, 12, 1)  # what heads are broken to, one after another, where their cells are no wider
WORDS = 24  # columns that a text has at least before others are left out


@dataclass
class _Column:
    """A column: its head, its cells, whether they are text; the least it takes up and the most it has use for."""

    head: str
    cells: list[str]
    text: bool
    least: int = 0
    most: int = 0


def table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    drop: Sequence[str | Collection[str]] = (),
    words: Collection[str] = (),
    marked: Collection[int] = (),
    kept_in: str,
) -> list[str]:
    """Print a table no wider than the page, numbers to the right. Returns the columns that were left out.

    drop: columns, or groups of them, in the order in which they are left out where the page is too narrow; kept_in:
    the file where they are all the same. words: columns of text, which may take several lines. marked: rows in red.
    """
    made, gone = _fitting(columns, rows, drop, words)
    stdout.print(title)
    body = Table(box=None, pad_edge=False, padding=(0, GAP, 0, 0), header_style="")
    for column in made:
        side = "left" if column.text else "right"
        head = Align(Text(column.head), side, vertical="bottom")
        body.add_column(head, justify=side, width=column.least, no_wrap=not column.text)
    for number in range(len(rows)):
        cells = (Text(column.cells[number]) for column in made)
        body.add_row(*cells, style=UNSTABLE if number in marked else None)
    for line in stdout.render_lines(body, stdout.options.update(width=_width(made) + GAP), pad=False):
        text = Text.assemble(" " * INDENT, *((segment.text, segment.style or "") for segment in line))
        text.rstrip()
        stdout.print(text)
    missing = [name for name in columns if name in gone]
    if missing:
        stdout.print(f"  not shown, for want of room: {', '.join(name.strip() for name in missing)}; in {kept_in}")
    return missing


def _fitting(
    columns: Sequence[str], rows: Sequence[Sequence[str]], drop: Sequence[str | Collection[str]], words: Collection[str]
) -> tuple[list[_Column], set[str]]:
    """The columns that fit on the page, each as wide as it is to be, and the names of those left out; where nothing
    fits, what is left when all that may go has gone."""
    page = stdout.page - INDENT
    found: tuple[list[_Column], set[str]] = ([], set())
    for gone in _ways(drop):
        for heads in HEADS:
            made = [
                _column(name, [row[k] for row in rows], heads, text=name in words)
                for k, name in enumerate(columns)
                if name not in gone
            ]
            found = made, gone
            if _width(made) <= page:
                _widen(made, page)
                return found
    return found


def _ways(drop: Sequence[str | Collection[str]]) -> Iterator[set[str]]:
    """Which columns to leave out, none first."""
    gone: set[str] = set()
    yield set(gone)
    for names in drop:
        gone |= {names} if isinstance(names, str) else set(names)
        yield set(gone)


def _column(name: str, cells: list[str], heads: int | None, *, text: bool) -> _Column:
    widest = max((len(cell) for cell in cells), default=0)
    least = max((len(word) for cell in cells for word in cell.split()), default=0) if text else widest
    least = max(least, min(widest, WORDS)) if text else least
    head = name if heads is None else "\n".join(textwrap.wrap(name, max(least, heads), break_long_words=False))
    wide = max((len(line) for line in head.splitlines()), default=0)
    return _Column(head, cells, text, max(least, wide), max(widest, wide))


def _width(made: Sequence[_Column]) -> int:
    return sum(column.least for column in made) + GAP * (len(made) - 1)


def _widen(made: Sequence[_Column], page: int) -> None:
    """Let columns of text have what room there is left, those first that need least of it."""
    needy = sorted((c for c in made if c.most > c.least), key=lambda c: c.most - c.least)
    for k, column in enumerate(needy):
        column.least += min(column.most - column.least, (page - _width(made)) // (len(needy) - k))
