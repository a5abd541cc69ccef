"""Tables of a report as plain text cells, and how printed values find their computed partners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from ..digits import measured
from ..typing import Array

FAR = 0.005  # a difference beyond this fraction is marked
UNPAIRED = 0.2  # relative difference from which two frequencies are not the same mode
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class TableRow:
    """Cells of a line, and its kind: "" plain, "far" a marked difference, "new" without printed partner,
    "unstable", "good", "bad"."""

    cells: tuple[str, ...]
    kind: str = ""


@dataclass(frozen=True)
class Table:
    """A table: name (its anchor), title, heads, rows, the columns that hold words, and what to know."""

    name: str
    title: str
    heads: tuple[str, ...]
    rows: tuple[TableRow, ...]
    words: frozenset[int] = field(default_factory=frozenset[int])
    caption: str = ""


def drop_empty(table: Table) -> Table:
    """The table without the columns that say nothing in any row."""
    keep = [k for k in range(len(table.heads)) if any(row.cells[k] for row in table.rows)]
    return Table(
        table.name,
        table.title,
        tuple(table.heads[k] for k in keep),
        tuple(TableRow(tuple(row.cells[k] for k in keep), row.kind) for row in table.rows),
        frozenset(index for index, k in enumerate(keep) if k in table.words),
        table.caption,
    )


def number(value: float | None, digits: int = 1) -> str:
    """A number with so many decimals and a true minus sign; empty for None."""
    if value is None or not np.isfinite(value):
        return ""
    text = f"{value:.{digits}f}"
    return (text if float(text) != 0 else f"{0.0:.{digits}f}").replace("-", "−")


def quantity(value: float | None, decimals: int = 1, digits: int = 3) -> str:
    """A number with a unit: so many decimals, more where a small one would keep fewer digits; empty for None."""
    return "" if value is None or not np.isfinite(value) else powers(measured(value, decimals, digits))


def significant(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits, powers of ten written out; empty for None."""
    return "" if value is None or not np.isfinite(value) else powers(f"{value:.{digits}g}")


def powers(text: str) -> str:
    """A number of Python with powers of ten written out and a true minus sign: "-2.50e-07" is "−2.50 · 10⁻⁷"."""
    if "e" in text:
        mantissa, exponent = text.split("e")
        power = f"10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
        text = {"1": power, "-1": f"-{power}"}.get(mantissa, f"{mantissa} · {power}")
    return text.replace("-", "−")


def percent(fraction: float | None, digits: int = 2) -> str:
    """A signed percentage; empty for None."""
    if fraction is None or not np.isfinite(fraction):
        return ""
    text = f"{100 * fraction:+.{digits}f}"
    return f"{0.0:.{digits}f} %" if float(text) == 0 else f"{text} %".replace("-", "−")


def difference(computed: float, printed: float) -> float | None:
    """(computed − printed)/printed, None where nothing is printed to divide by."""
    return (computed - printed) / printed if printed else None


def same_as_printed(computed: float, printed: float) -> bool:
    """Whether the computed value, rounded to the decimals of the printed one, is the printed one."""
    text = f"{printed:.12g}"
    decimals = len(text.split(".")[1]) if "." in text and "e" not in text else 0
    return bool(printed) and decimals > 0 and round(computed, decimals) == printed


def is_far(fraction: float | None) -> bool:
    """Whether a difference is large enough to be marked."""
    return fraction is not None and abs(fraction) > FAR


def paired(computed: Sequence[float] | Array, printed: Sequence[float] | Array) -> list[tuple[int | None, int | None]]:
    """Partners (computed, printed) of two lists of frequencies [Hz], each used once, by computed frequency.

    The sum of relative differences is the least possible; what differs by more than 20 % has no partner.
    """
    a, b = np.asarray(computed, dtype=float), np.asarray(printed, dtype=float)
    if not len(a) or not len(b):
        return [*((i, None) for i in range(len(a))), *((None, j) for j in range(len(b)))]
    partner = assigned(np.abs(np.log((a[:, None] + 1.0) / (b + 1.0))), UNPAIRED)
    pairs: list[tuple[int | None, int | None]] = [(i, partner.get(i)) for i in range(len(a))]
    alone = sorted(set(range(len(b))) - set(partner.values()))
    pairs += [(None, j) for j in alone]
    return sorted(pairs, key=lambda pair: _height(pair, a, b))


def _height(pair: tuple[int | None, int | None], a: Array, b: Array) -> float:
    i, j = pair
    if i is not None:
        return float(a[i])
    return float(b[j]) if j is not None else 0.0


def assigned(cost: Array, limit: float) -> dict[int, int]:
    """Row → column with the least sum of costs, where having no partner costs ``limit``."""
    rows, columns = cost.shape
    padded = np.hstack([cost, np.full((rows, rows), limit)])
    chosen, partners = scipy.optimize.linear_sum_assignment(padded)
    return {int(i): int(j) for i, j in zip(chosen, partners, strict=True) if j < columns and cost[i, j] <= limit}
