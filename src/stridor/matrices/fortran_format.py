"""Numbers in lines that a Fortran format lays out: cut out by columns, since they may touch each other."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np

from ..errors import CaseError
from ..typing import Array
from .numbers import fortran_number
from .source import MatrixFile, quoted

_MOST_COLUMNS = 4096
_SPARE_COLUMNS = 256
_ITEM = re.compile(
    r"""(?P<scale>[+-]?\d+)P | (?P<skip>\d*)X
      | (?P<repeat>\d*)(?P<kind>E[SN]?|[IDFG])(?P<width>\d+)(?:\.(?P<digits>\d+))?(?:E\d+)?""",
    re.VERBOSE,
)
_IN_CHARACTERS = np.zeros(256, dtype=bool)
_IN_CHARACTERS[list(b" 0123456789+-.E")] = True


@dataclass(frozen=True)
class Format:
    """A Fortran format of equal fields: its text, where in a line fields begin, their width, digits after the point
    that are assumed where none is written (0: whole numbers), and the power of ten that a P asks for."""

    text: str
    starts: tuple[int, ...]
    width: int
    digits: int
    scale: int

    @property
    def end(self) -> int:
        return self.starts[-1] + self.width

    def lines(self, count: int) -> int:
        """How many lines that many numbers take."""
        return -(-count // len(self.starts))


def formats_in(source: MatrixFile, text: str) -> list[str]:
    """The first three groups in brackets of the fourth line."""
    found: list[str] = []
    depth, begin = 0, 0
    for at, letter in enumerate(text):
        if letter == "(":
            begin = at if depth == 0 else begin
            depth += 1
        elif letter == ")" and depth:
            depth -= 1
            if depth == 0:
                found.append(text[begin : at + 1])
    if len(found) < 3:
        source.refuse(f"line 4: {quoted(text.encode())} must hold the Fortran formats of pointers, indices and values")
    return found[:3]


def format_of(source: MatrixFile, text: str) -> Format:
    """What a format such as (1P,5D16.8) means. Raises CaseError for one that is not of equal fields."""
    bad = f"line 4: the format {text[:40]} is not understood; accepted are such as (8I10), (1P,5D16.8), (4(1X,E20.12))"
    inner = "".join(text.upper().split())[1:-1]
    times = 1
    group = re.fullmatch(r"(?:([+-]?\d+)P,?)?(\d*)\(([^()]*)\)", inner)
    scale = 0
    if group:
        scale, times, inner = int(group[1] or 0), int(group[2] or 1), group[3]
    starts: list[int] = []
    widths: set[tuple[int, int]] = set()
    at, column = 0, 0
    while at < len(inner):
        item = _ITEM.match(inner, at)
        if item is None or len(item[0]) > 12:
            source.refuse(bad)
        at = item.end() + (inner[item.end() : item.end() + 1] == ",")
        if item["scale"]:
            scale = int(item["scale"])
        elif item["kind"]:
            width, repeat = int(item["width"]), int(item["repeat"] or 1)
            widths.add((width, 0 if item["kind"] == "I" else int(item["digits"] or 0)))
            if not 0 < width * repeat <= _MOST_COLUMNS:
                source.refuse(bad)
            starts += range(column, column + width * repeat, width)
            column += width * repeat
        else:
            column += int(item["skip"] or 1)
        if column > _MOST_COLUMNS:
            source.refuse(bad)
    if len(widths) != 1 or not 0 < times * column <= _MOST_COLUMNS:
        source.refuse(bad)
    width, digits = widths.pop()
    return Format(text, tuple(t * column + s for t in range(times) for s in starts), width, digits, scale)


def cut(
    source: MatrixFile, lines: list[bytes], layout: Format, count: int, before: int, what: str
) -> tuple[Array, tuple[str, ...]]:
    """Numbers (count,) of a format from lines, and what is to be noted about them.

    before: lines of the file that precede these; what: the numbers are. Raises CaseError.
    """
    if not lines:
        return np.zeros(0), ()
    try:
        return _cut(source, lines, layout, count, before, what), ()
    except CaseError:
        other = _one_less(lines, layout, count)
        if other is None:
            raise
        numbers = _cut(source, lines, other, count, before, what)
        return numbers, (f"Its {what} take {other.width} columns each, not those of the format {layout.text}.",)


def _one_less(lines: list[bytes], layout: Format, count: int) -> Format | None:
    """The same format of fields a column less wide, as SciPy writes them, if these fill every line; else None."""
    many, width = len(layout.starts), layout.width - 1
    filled = np.full(len(lines), many)
    filled[-1] = count - many * (len(lines) - 1)
    lengths = np.array([len(line.rstrip()) for line in lines])
    if not layout.digits or layout.end != many * layout.width or not np.array_equal(lengths, width * filled):
        return None
    return replace(layout, starts=tuple(range(0, many * width, width)), width=width)


def _cut(source: MatrixFile, lines: list[bytes], layout: Format, count: int, before: int, what: str) -> Array:
    """Numbers (count,) by the columns of a format. Raises CaseError."""
    longest = max(map(len, lines))
    if longest > layout.end + _SPARE_COLUMNS:
        at = next(k for k, line in enumerate(lines) if len(line) == longest)
        source.refuse(f"line {before + at + 1} has {longest} columns; the format {layout.text} has {layout.end}")
    wide = max(longest, layout.end)
    if wide * len(lines) > 10_000_000 + 20 * sum(map(len, lines)):  # a broken format must not take all memory
        source.refuse(f"lines {before + 1} to {before + len(lines)} are much shorter than the format {layout.text}")
    text = np.array(lines, dtype=f"S{wide}").view(np.uint8).reshape(len(lines), wide).copy()
    text[(text == 0) | (text == 13)] = 32  # short lines are filled with NUL
    if np.any(tabbed := np.any(text == 9, axis=1)):
        at = int(np.flatnonzero(tabbed)[0])
        source.refuse(f"line {before + at + 1} has a tab, but {layout.text} goes by columns; write blanks instead")
    columns = np.add.outer(np.array(layout.starts), np.arange(layout.width))
    # Fortran would pass over these, be it a sign.
    outside = np.delete(np.arange(wide), columns.ravel())
    if np.any(beyond := np.any(text[:, outside] != 32, axis=1)):
        at = int(np.flatnonzero(beyond)[0])
        source.refuse(f"line {before + at + 1}: {quoted(lines[at])} has more in it than {layout.text} takes")
    cells = text[:, columns].reshape(-1, layout.width)

    def refuse(at: int, reason: str) -> NoReturn:
        line = before + at // len(layout.starts) + 1
        source.refuse(f"line {line}: {quoted(cells[at].tobytes())} {reason}")

    blank = np.all(cells == 32, axis=1)
    if np.any(wrong := blank[:count]):
        at = int(np.flatnonzero(wrong)[0])
        refuse(at, f"stands where number {at + 1} of its {what} should be, by the format {layout.text}")
    if not np.all(blank[count:]):
        refuse(count + int(np.flatnonzero(~blank[count:])[0]), f"is one more than the {count} {what} promised")
    return _values(cells[:count], layout, refuse)


def _values(given: Any, layout: Format, refuse: Callable[[int, str], NoReturn]) -> Array:
    """Numbers (k,) from characters (k, width); refuse(k, reason) is told the first that is none."""
    cells = np.ascontiguousarray(given).copy()
    cells[np.isin(cells, list(b"DdeQq"))] = ord("E")
    sign = (cells == ord("+")) | (cells == ord("-"))
    mantissa = ((cells >= ord("0")) & (cells <= ord("9"))) | (cells == ord("."))
    touching = np.any(sign[:, 1:] & mantissa[:, :-1], axis=1)  # 1.0-101: three digits leave no room for the letter
    words = cells.view(f"S{layout.width}").ravel()
    filled = cells != 32
    ends = filled.shape[1] - np.argmax(filled[:, ::-1], axis=1)
    split = np.sum(filled, axis=1) != ends - np.argmax(filled, axis=1)  # by a blank
    values = np.full(len(words), np.nan)
    known = np.all(_IN_CHARACTERS[cells], axis=1)
    slow = known & (touching | split)
    try:
        values[known & ~slow] = words[known & ~slow].astype(np.float64)
    except ValueError:
        slow = known
    for at in np.flatnonzero(slow):
        values[at] = fortran_number(words[at].decode("ascii"))
        if not np.isfinite(values[at]):
            break  # and be refused
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        refuse(int(wrong[0]), f"is not a finite number, by the format {layout.text}")
    # Fortran shifts numbers without a point, and under P those without an exponent; other programs do not.
    nonzero = values != 0
    if layout.digits and np.any(unclear := nonzero & ~np.any(cells == ord("."), axis=1)):
        refuse(int(np.flatnonzero(unclear)[0]), f"has no decimal point, which {layout.text} lets be read two ways")
    plain = ~np.any(cells == ord("E"), axis=1) & ~touching
    if layout.scale and np.any(unclear := nonzero & plain):
        refuse(int(np.flatnonzero(unclear)[0]), f"has no exponent, which {layout.text} lets be read two ways")
    return values
