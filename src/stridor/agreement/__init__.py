"""Modal against temporal: do both approaches tell the same story?"""

from .comparison import (
    GOOD_CRITICAL,
    GOOD_FREQUENCY,
    GOOD_GROWTH,
    GOOD_MAC,
    Agreement,
    Comparison,
    compare,
    critical_friction,
    dominant_response,
    modal_assurance,
    mode_shape,
)
from .perturbation import LINEAR, PERTURBATION, PERTURBATION_DURATION, Perturbation, linear_part, perturb

__all__ = [
    "GOOD_CRITICAL",
    "GOOD_FREQUENCY",
    "GOOD_GROWTH",
    "GOOD_MAC",
    "LINEAR",
    "PERTURBATION",
    "PERTURBATION_DURATION",
    "Agreement",
    "Comparison",
    "Perturbation",
    "compare",
    "critical_friction",
    "dominant_response",
    "linear_part",
    "modal_assurance",
    "mode_shape",
    "perturb",
]
