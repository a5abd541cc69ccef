"""What was changed in the middle of a run that was gone on from with another model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import shown

if TYPE_CHECKING:
    from .trajectory import Trajectory


@dataclass(frozen=True)
class Difference:
    """One number, text or file that another run had: its path in the case, as it was and as it is; None: not given."""

    path: str
    before: Any
    after: Any

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"path": self.path, "before": self.before, "after": self.after}

    def __str__(self) -> str:
        return f"{self.path}: {as_given(self.before)} → {as_given(self.after)}"


def changes_of(run: Trajectory) -> list[str]:
    """In words, what was changed in the middle of a run, restart by restart; none for a run of one model."""
    lines: list[str] = []
    for restart in run.provenance.get("restarts", []):
        at = f"at t = {restart['time']:.6g} s"
        lines += [f"{at} {Difference(d['path'], d['before'], d['after'])}" for d in restart["changed"]]
        if not restart["known"]:
            lines.append(f"{at} gone on from a file that does not tell its model")
    return lines


def as_given(value: Any) -> str:
    """A value of a case as it reads in messages."""
    return "not given" if value is None else shown(value)
