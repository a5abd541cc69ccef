"""Where the facets of curved meshes decide which nodes touch."""

from __future__ import annotations

from ..errors import AnalysisError
from ..sliding.pattern import BY_MESHES, facet_height
from ..sliding.solution import steady_nodes
from ..system import System


def decided_by_meshes(system: System, mu: float | None = None, solver: str | None = None) -> tuple[str, ...]:
    """What steady sliding warns of where the facets of curved surfaces decide what touches; nothing where all is flat,
    and where there is no equilibrium, which the analysis says."""
    if not any(surface.facets is not None and facet_height(surface) for surface in system.surfaces):
        return ()
    try:
        return tuple(said for said in steady_nodes(system, mu, solver).warnings if BY_MESHES in said)
    except AnalysisError:
        return ()

