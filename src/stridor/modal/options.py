"""What may be asked of the modal approach beside the range of μ and the band."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """Which effects of the steady state count beside the friction law's slope, which always does, and who computes.

    friction_damping: vibration across the slip turns the friction force by δẇ/|v|, which damps (space only).
    prestress: the geometric stiffness that the steady stresses make. solver: that of `direct.factorise`.
    source: where eigenpairs come from, one of `source.SOURCES`; None: what suits the system (`source.sources_for`).
    """

    friction_damping: bool = False
    prestress: bool = False
    solver: str | None = None
    source: str | None = None
