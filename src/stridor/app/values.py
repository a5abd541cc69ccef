"""Values of options as text, read: numbers, words, pairs, bands."""

from __future__ import annotations

from ..errors import CaseError

INFINITY = float("inf")


MOST = 1_000_000  # values of one option


def number(text: str, name: str, *, least: float) -> float:
    """One finite number, not below ``least``. Raises CaseError."""
    try:
        value = float(text)
    except ValueError:
        value = INFINITY
    if not least <= value < INFINITY:
        raise CaseError(name, text, f"a number ≥ {least:g}")
    return value


def numbers(text: str, name: str, *, least: float = 0.0) -> list[float]:
    """Numbers from "0.1", "0.1,0.2" or "start:stop:count", none below ``least``. Raises CaseError."""
    accepted = "a number, numbers with commas, or start:stop:count"
    if least > -INFINITY:
        accepted += f", each number ≥ {least:g}"
    try:
        if ":" in text:
            start, stop, count = text.split(":")
            amount = int(count) if count.strip().isdecimal() else 0
            if not 1 <= amount <= MOST:
                raise CaseError(name, text, f"start:stop:count, where count is a whole number from 1 to {MOST}")
            low, high = float(start), float(stop)
            step = (high - low) / max(amount - 1, 1)
            values = [low + k * step for k in range(amount)]
        else:
            values = [float(part) for part in text.split(",")]
    except ValueError:
        raise CaseError(name, text, accepted) from None
    if not all(least <= v < INFINITY and v > -INFINITY for v in values):
        raise CaseError(name, text, accepted)
    return values


def one_of(text: str, name: str, accepted: tuple[str, ...]) -> str:
    """The text, one of some words. Raises CaseError."""
    if text not in accepted:
        raise CaseError(name, text, " or ".join(accepted))
    return text


def pair(text: str, name: str) -> tuple[float, float]:
    """Two numbers from "low:high". Raises CaseError."""
    parts = text.split(":")
    try:
        low, high = (float(p) for p in parts)
    except ValueError:
        raise CaseError(name, text, "two numbers, low:high") from None
    return low, high


def range_of(text: str, name: str) -> tuple[float, float]:
    """Two finite numbers from "low:high", low < high. Raises CaseError."""
    low, high = pair(text, name)
    if not -INFINITY < low < high < INFINITY:
        raise CaseError(name, text, "low:high, two finite numbers low < high")
    return low, high


def band_of(text: str | None, top: float, branches: list[int] | None = None) -> tuple[float, float] | None:
    """A band of frequencies [Hz] from "low:high" that ends at ``top`` [Hz] or below; None of None. Raises CaseError for
    another, and beside modes named by --branch."""
    if text is None:
        return None
    if branches:
        raise CaseError("--band", text, "goes without --branch, which says already which modes")

    from ..study.asked import require_band

    band = pair(text, "--band")
    require_band(band, top, "--band")
    return band
