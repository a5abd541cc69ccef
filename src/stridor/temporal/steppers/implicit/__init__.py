"""Steps of a part of a period of interest, whatever the mesh: the midpoint rule with set-valued contact."""

from .stepper import COARSEST, implicit_stepper, refuse, whole_steps, why_not_implicit

__all__ = ["COARSEST", "implicit_stepper", "refuse", "whole_steps", "why_not_implicit"]
