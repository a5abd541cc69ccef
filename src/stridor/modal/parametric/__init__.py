"""Problems with parameters, reduced once and solved in milliseconds everywhere in their box."""

from .all_freedoms import all_freedoms
from .component import craig_bampton
from .contacts import contact_parameters
from .correct import CorrectedModes, Corrector
from .full import FullModes, verified
from .model import ReducedModel, ReducedModes
from .offline import reduce
from .points import ModesAtPoints
from .problem import Parameter, ParametricProblem, Term

__all__ = [
    "CorrectedModes",
    "Corrector",
    "FullModes",
    "ModesAtPoints",
    "Parameter",
    "ParametricProblem",
    "ReducedModel",
    "ReducedModes",
    "Term",
    "all_freedoms",
    "contact_parameters",
    "craig_bampton",
    "reduce",
    "verified",
]
