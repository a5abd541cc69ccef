"""Linear elastic materials and the cross-sections of beams."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """Isotropic linear elasticity: Young's modulus [Pa], density [kg/m³], Poisson's ratio [-]."""

    young_modulus: float
    density: float
    poisson_ratio: float = 0.3


@dataclass(frozen=True)
class RectangularSection:
    """Rectangle: width out of the plane of bending [m], thickness in that plane [m]."""

    width: float
    thickness: float

    @property
    def area(self) -> float:
        """Area [m²]."""
        return self.width * self.thickness

    @property
    def second_moment(self) -> float:
        """Second moment of area about the axis of bending [m⁴], width · thickness³ / 12."""
        return self.width * self.thickness**3 / 12.0
