"""What the user writes: case files, checked and frozen. Knows units and names, no matrices.

Names of the checked case are imported when first used: a file that is missing or no TOML is told without them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .source import load, loads, template_text, templates

if TYPE_CHECKING:
    from .model import Case
    from .points import PointRef

_HOMES = {"Case": ".model", "PointRef": ".points"}

__all__ = ["Case", "PointRef", "load", "loads", "template_text", "templates"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'stridor.case' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)
