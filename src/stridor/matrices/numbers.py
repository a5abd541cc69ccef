"""Numbers as Fortran programs and punched cards write them."""

from __future__ import annotations

import math
import re

# 1.5, 1.5E+3, 1.5D+3, 1.5+3; some programs leave a blank before the letter, all drop the letter before three digits.
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?: *[EeDdQq]([+-]?\d+)|([+-]\d+))?", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d{1,18}", re.ASCII)


def fortran_number(text: str) -> float:
    """The number that a text is, NaN where it is none."""
    try:
        value = float(text)
    except ValueError:
        found = _REAL.fullmatch(text.strip())
        return float(f"{found[1]}E{found[2] or found[3] or 0}") if found else math.nan
    return math.nan if "_" in text else value


def whole_number(text: str | bytes, lowest: int = 0) -> int | None:
    """The whole number of at most 18 digits that a text is, None where it is none, or below the lowest."""
    shown = text.decode("latin-1") if isinstance(text, bytes) else text
    found = _WHOLE.fullmatch(shown.strip())
    return int(found[0]) if found and int(found[0]) >= lowest else None
