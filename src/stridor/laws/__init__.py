"""Laws of materials and contacts: frozen numbers and pure functions of numbers; no mesh, no state."""

from stridor.laws.damping import Rayleigh
from stridor.laws.elasticity import Material, RectangularSection
from stridor.laws.friction import Coulomb, FrictionLaw, Hyperbolic, StaticKinetic, Tabulated, Weakening

__all__ = [
    "Coulomb",
    "FrictionLaw",
    "Hyperbolic",
    "Material",
    "Rayleigh",
    "RectangularSection",
    "StaticKinetic",
    "Tabulated",
    "Weakening",
]
