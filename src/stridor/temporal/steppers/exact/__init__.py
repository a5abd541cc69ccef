"""From event to event: exact motion between changes of contact, for few contacts and friction that knows no speed."""

from .stepper import exact_not_begun, exact_stepper, refuse, why_not_exact

__all__ = ["exact_not_begun", "exact_stepper", "refuse", "why_not_exact"]
