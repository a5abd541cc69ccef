"""Numbers for people: significant digits whatever the units, and no negative zero."""

from __future__ import annotations

import math

WRITTEN_OUT = (1e-4, 1e12)  # sizes between which no power of ten is written


def readable(value: float, digits: int = 6, *, decimals: int = 2, zero: float = 0.0) -> str:
    """A number with at least so many significant digits and, from one on, so many decimals.

    What is no larger than ``zero`` is "0". 8765.2279 is 8765.23, 0.1591549 is 0.159155, 1e-9 is 1.00000e-09.
    """
    if math.isnan(value) or math.isinf(value):
        return str(value)
    size = abs(value)
    if size <= zero or size == 0.0:
        return "0"
    if not WRITTEN_OUT[0] <= size < WRITTEN_OUT[1]:
        return f"{value:.{digits - 1}e}"
    places = digits - 1 - math.floor(math.log10(size))
    return f"{value:.{max(places, decimals if size >= 1 else 0)}f}"


def hertz(value: float, digits: int = 6) -> str:
    """A frequency [Hz] with its unit, for sentences."""
    return f"{value:.{digits}g} Hz"


def measured(value: float, decimals: int, digits: int = 3) -> str:
    """A number with so many decimals, and with more where a small one would keep fewer than so many digits.

    For quantities whose units may be any: 3199.75 is 3199.8 with one decimal, 0.1591549 is 0.159, 0.0 is 0.0.
    """
    size = abs(value)
    if size == 0.0 or not math.isfinite(value):
        return fixed(value, decimals)
    places = max(digits - 1 - math.floor(math.log10(size)), decimals)
    if size < min(WRITTEN_OUT[0], 10.0**-decimals) or size >= WRITTEN_OUT[1]:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{places}f}"


def fixed(value: float, decimals: int) -> str:
    """A number with so many decimals; never a negative zero."""
    text = f"{value:.{decimals}f}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text
