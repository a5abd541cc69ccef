"""What callers ask for beside the case, refused where it is no number to compute with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

from ..asking import is_number
from ..case.usual import MOST_FRICTION, TOO_MUCH
from ..errors import CaseError


def require_friction(mus: float | Iterable[float] | None, where: str = "mu", *, several: bool = True) -> Any:
    """Refuse friction coefficients that are none: negative, not finite, too large, text, an empty list, a list where
    ``several`` is false. Gives them back, as a list what can be gone through once only. Raises CaseError."""
    given: Any = mus
    if several and isinstance(given, Iterable) and not isinstance(given, str | Mapping | Sequence):
        given = given if hasattr(given, "ndim") else list(cast("Iterable[Any]", given))
    values: list[Any] = [] if given is None else [given]
    if isinstance(given, Iterable) and not isinstance(given, str | Mapping) and getattr(given, "ndim", 1):
        values = list(cast("Iterable[Any]", given)) if several else [given]
        if not values:
            raise CaseError(where, given, "at least one friction coefficient, or None")
    for value in values:
        value = value.item() if getattr(value, "ndim", None) == 0 else value  # an array of one number is one
        if not is_number(value) or not 0.0 <= value < math.inf:
            raise CaseError(where, value, "a friction coefficient is a finite number ≥ 0")
        if value > MOST_FRICTION:
            raise CaseError(where, value, TOO_MUCH)
    return given


def require_band(band_hz: tuple[float, float] | None, top: float, where: str = "band_hz") -> None:
    """Refuse a band of frequencies [Hz] that is none, or beyond the highest that is looked at. Raises CaseError."""
    if band_hz is None:
        return
    given: Any = band_hz
    given = tuple(given) if isinstance(given, Iterable) else given
    pair = isinstance(given, tuple) and len(given) == 2 and all(map(is_number, given))
    if not pair or not 0.0 <= given[0] < given[1] <= top:
        raise CaseError(
            where, "{:g}:{:g}".format(*given) if pair else given,
            f"low:high in Hz, 0 ≤ low < high ≤ {top:g}, the highest frequency looked at (--max-frequency, "
            "max_frequency_hz)",
        )  # fmt: skip


def require_frequency(value: float | None, where: str = "max_frequency_hz") -> None:
    """Refuse a highest frequency that is not positive and finite. Raises CaseError."""
    if value is not None and (not is_number(value) or not 0.0 < value < math.inf):
        raise CaseError(where, value, "a highest frequency is a finite number > 0 [Hz]")


def require_range(given: Any, where: str, least: float = -math.inf) -> tuple[float, float]:
    """Two finite numbers low < high, the first not below ``least``. Raises CaseError for anything else."""
    try:
        low, high = (float(v) for v in given)
    except (TypeError, ValueError):
        low = high = math.nan
    if not (least <= low < high < math.inf and low > -math.inf):
        accepted = "low < high" if least == -math.inf else f"{least:g} ≤ low < high"
        raise CaseError(where, given, f"two finite numbers {accepted}")
    return low, high


def require_count(value: Any, where: str, least: int = 1, more: str = "") -> None:
    """Refuse what is no whole number or below ``least``; more: what else is accepted, in words. Raises CaseError."""
    if isinstance(value, bool) or not hasattr(value, "__index__") or value < least:
        raise CaseError(where, value, f"a whole number ≥ {least}{more}")


def require_choice(given: Any, where: str, accepted: Iterable[str | bool | None]) -> None:
    """Refuse what is none of a few words, or of True, False and None among them. Raises CaseError."""
    words = tuple(accepted)
    if not any(given is word or (isinstance(given, str) and given == word) for word in words):
        raise CaseError(where, given, f"one of {', '.join(str(word) for word in words)}")


def names_of(given: str | Iterable[str], where: str, *, none: bool = False) -> tuple[str, ...]:
    """Names as a list of them; one may stand by itself, and there may be ``none``. Raises CaseError for anything
    else."""
    if isinstance(given, str):
        return (given,)
    listed: Any = given
    names: tuple[Any, ...] = tuple(listed) if isinstance(listed, Iterable) else (None,)
    if not (names or none) or not all(isinstance(name, str) for name in names):
        raise CaseError(where, given, "a name, or a list of names")
    return names
