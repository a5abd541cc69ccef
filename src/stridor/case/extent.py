"""How large the built-in shapes are, without meshing them."""

from __future__ import annotations

import math

from .bodies import AnnulusMesh, BuiltInMesh, DiscMesh, PadMesh, QuadrilateralMesh


def extent_of(mesh: BuiltInMesh) -> float:
    """A length [m] that no side of a shape exceeds, around a circle along its rim."""
    if isinstance(mesh, QuadrilateralMesh):
        return max(math.dist(a, b) for a in mesh.corners for b in mesh.corners)
    if isinstance(mesh, AnnulusMesh):
        return 2.0 * math.pi * mesh.outer_radius
    if isinstance(mesh, DiscMesh | PadMesh):
        return max(2.0 * math.pi * mesh.outer_radius, mesh.thickness)
    return max(mesh.size)
