"""A compiler that takes less time over asking itself with which options it works.

numba compares the options of what it compiles at every call that it looks up, each time by two tables of all forty of
them: a tenth of the time to compile a time loop. What these say of each other is told without making them, most times.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba.core import targetconfig

_Options: Any = targetconfig.TargetConfig


@cache
def _of_class(kind: Any) -> int:
    """Options of one kind have the same hash, that of their names, as ``TargetConfig.__hash__`` has it."""
    return hash(tuple(sorted(kind.options)))


def _hash(self: Any) -> int:
    return _of_class(type(self))


def _equal(self: Any, other: Any) -> Any:
    if not isinstance(other, _Options):
        return NotImplemented
    # One may say what is the default of the other: then the tables decide.
    alike: bool = self is other or (type(self) is type(other) and self._values == other._values)
    return alike or self.values() == other.values()


def compare_quickly() -> None:
    """Make it so, for every function of this process: the answers stay as they are."""
    if hasattr(_Options, "values") and hasattr(_Options, "options"):
        _Options.__hash__, _Options.__eq__ = _hash, _equal
