"""What callers ask for beside the case, refused where it is no number to compute with."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..errors import CaseError


def require_friction(mus: float | Iterable[float] | None, where: str = "mu") -> None:
    """Refuse friction coefficients that are negative or not finite. Raises CaseError."""
    values = [] if mus is None else [mus] if isinstance(mus, float | int) else list(mus)
    for value in values:
        if not 0.0 <= value < math.inf:
            raise CaseError(where, value, "a friction coefficient is a finite number ≥ 0")


def require_band(band_hz: tuple[float, float] | None, top: float, where: str = "band_hz") -> None:
    """Refuse a band of frequencies [Hz] that is none, or beyond the highest that is looked at. Raises CaseError."""
    if band_hz is not None and not 0.0 <= band_hz[0] < band_hz[1] <= top:
        raise CaseError(
            where, "{:g}:{:g}".format(*band_hz), f"low:high in Hz, 0 ≤ low < high ≤ {top:g}, the highest frequency "
            "looked at (--max-frequency, max_frequency_hz)",
        )  # fmt: skip


def require_frequency(value: float | None, where: str = "max_frequency_hz") -> None:
    """Refuse a highest frequency that is not positive and finite. Raises CaseError."""
    if value is not None and not 0.0 < value < math.inf:
        raise CaseError(where, value, "a highest frequency is a finite number > 0 [Hz]")
