"""What the user writes: case files, checked and frozen. Knows units and names, no matrices."""

from .load import load, loads, template_text, templates
from .model import Case
from .points import PointRef

__all__ = ["Case", "PointRef", "load", "loads", "template_text", "templates"]
