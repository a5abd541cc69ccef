"""A source of eigenpairs that cannot serve a system."""

from __future__ import annotations

from ..errors import AnalysisError


class Unfit(AnalysisError):
    """A source of eigenpairs does not take this system, which another may.

    band_hz: up to which frequency it was asked, where it knows; None where modes were counted.
    """

    def __init__(self, message: str, band_hz: float | None = None) -> None:
        super().__init__(message)
        self.band_hz = band_hz
