"""Modal against temporal: do both approaches tell the same story?"""

from .comparison import PARTS, compare, dominant_response, stronger_below
from .critical import critical_friction
from .four_answers import GOOD_AMPLITUDE, CycleSeen, FourAnswers
from .kept import PartStore
from .perturbation import perturb
from .result import GOOD_CRITICAL, GOOD_FREQUENCY, GOOD_GROWTH, GOOD_MAC, SAME_DECAY, Agreement, Comparison
from .settled import SettledVelocity, last_rate, settled_velocity
from .shapes import modal_assurance, mode_shape
from .small_motion import LINEAR, PERTURBATION, Perturbation, linear_part

__all__ = [
    "GOOD_AMPLITUDE",
    "GOOD_CRITICAL",
    "GOOD_FREQUENCY",
    "GOOD_GROWTH",
    "GOOD_MAC",
    "LINEAR",
    "PARTS",
    "PERTURBATION",
    "SAME_DECAY",
    "Agreement",
    "Comparison",
    "CycleSeen",
    "FourAnswers",
    "PartStore",
    "Perturbation",
    "SettledVelocity",
    "compare",
    "critical_friction",
    "dominant_response",
    "last_rate",
    "linear_part",
    "modal_assurance",
    "mode_shape",
    "perturb",
    "settled_velocity",
    "stronger_below",
]
