"""The one object between modelling and analysis, and how a case becomes one."""

from .build import build_system
from .model import Line, System
from .motion import PrescribedMotion

__all__ = ["Line", "PrescribedMotion", "System", "build_system"]
