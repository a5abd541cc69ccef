"""Whether contact forces look like a pressure: nodes that stand open amid others, forces that alternate.

A pressure that meshes resolve varies little from a node to its neighbours, and opens where it has fallen to nothing.
What does neither comes from the discretisation (meshes of very different size, faces that are badly distorted, rigid
contact where a body has too few freedoms), and modes and time inherit it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

from ..contact.coupling import SlaveFacets
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..contact.pairing import overlap_tolerance
from ..contact.surfaces import SurfaceContact
from ..system import System
from ..typing import Array, BoolArray, IntArray, Sparse

# A node is surrounded by pressure where its neighbours have this part of the mean.
PRESSED = 0.2
# Half the nodes amid others differ from their neighbours by more than this part of the mean pressure: no picture of it.
UNEVEN = 0.4
LEAST_NODES = 8
BY_MESHES = "so that the meshes decide what touches"
# Of what facets leave of curved surfaces: smaller differences of gaps are rounding.
FACETED = 1e-3
# Nodes of a facet in the order of its outline; a centre is next to the middles.
OUTLINES = {
    "line": [(0, 1)],
    "line3": [(0, 2), (2, 1)],
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "triangle6": [(0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0)],
    "quad8": [(0, 4), (4, 1), (1, 5), (5, 2), (2, 6), (6, 3), (3, 7), (7, 0)],
}
OUTLINES["quad9"] = [*OUTLINES["quad8"], (8, 4), (8, 5), (8, 6), (8, 7)]


def unexplained_patterns(system: System, normal_force: Array, gap: Array, active: BoolArray) -> Iterator[str]:
    """A sentence for each surface contact whose nodes open or press in a pattern that no pressure explains.

    normal_force (m,) [N], gap (m,) [m] and active (m,) of all contact nodes in equilibrium.
    """
    nodes = system.contact_nodes()
    for surface, mine in system.nodes_of_surfaces():
        loaded = active[mine] & (normal_force[mine] > 0.0)
        # A contact may touch without any force; one kept closed is open nowhere, and its pressure may change sign.
        if surface.facets is None or any(surface.nodes.closed) or not loaded.any():
            continue
        around = _neighbours(surface.facets, surface.nodes.count, surface.own)
        by_mesh = _open_by_mesh(surface, loaded, nodes.gap[mine], gap[mine])
        if by_mesh:
            yield by_mesh
            continue
        pressure = normal_force[mine] / nodes.area[mine]
        open_amid = _open_amid(around, loaded, pressure, nodes.gap[mine], gap[mine])
        if open_amid:
            yield (
                f"contact {surface.name}: {open_amid} of {surface.nodes.count} slave nodes stand open amid touching "
                "ones, which neither gap nor pressure explains; refine the coarser mesh, mend distorted faces, or give "
                "the contact a stiffness"
            )
        elif _alternates(around, loaded, pressure):
            yield (
                f"contact {surface.name}: the pressure jumps from node to node by more than {UNEVEN:.0%} of its mean; "
                "refine the coarser mesh, mend distorted faces, or give the contact a stiffness"
            )


def left_by_facets(system: System) -> Iterator[str]:
    """A sentence for each surface contact that is open all over by what facets leave of curved surfaces."""
    nodes = system.contact_nodes()
    for surface, mine in system.nodes_of_surfaces():
        gap, height = nodes.gap[mine], facet_height(surface)
        if height and np.all((gap > 0.0) & (gap <= 2 * height)):
            yield (
                f"the facets of the curved surfaces of contact {surface.name} leave gaps up to {gap.max():.2g} m, so "
                f"that nothing touches; {_remedy(surface, height)}"
            )


def facet_height(surface: SurfaceContact) -> float:
    """How far [m] facets may be off the curved surfaces of a contact, 0 for flat ones."""
    normal, parts, master = surface.location.normal, None, surface.master
    if isinstance(master, Curve | FacetSurface):
        # Off an edge of the body nodes look away from it, which is no curve.
        normal, parts = master.smooth_at(surface.location)
    height = overlap_tolerance(surface.slave_position, -normal, master, parts)
    return height if height > 1e-8 * float(np.linalg.norm(np.ptp(surface.slave_position, axis=0))) else 0.0


def _remedy(surface: SurfaceContact, height: float) -> str:
    apart = np.abs(surface.location.gap)
    # Also where every node lies on the master already: with adjust gaps count at nodes, not between them.
    widest = max(1.1 * float(apart[apart <= height].max(initial=0.0)), 1e-3 * height)
    return (
        "let the nodes of both sides match, refine, or close such gaps and overlaps with "
        f"contacts.{surface.name}.adjust = {widest:.2g}"
    )


def _open_by_mesh(surface: SurfaceContact, loaded: BoolArray, gap_before: Array, gap: Array) -> str:
    """A sentence where nodes stand open whose gaps are no larger than those that facets make of curved surfaces which
    fit: whether they touch is then decided by how the meshes lie to each other, not by the shapes."""
    height = facet_height(surface)
    if not height:
        return ""  # flat
    beyond = gap_before - gap_before.min()
    count = int(np.sum(~loaded & (beyond > FACETED * height) & (beyond <= 2 * height) & (gap <= 2 * height)))
    if not count:
        return ""
    return (
        f"contact {surface.name}: {count} of {surface.nodes.count} slave nodes stand open by no more than facets leave "
        f"of curved surfaces ({height:.2g} m), {BY_MESHES}; {_remedy(surface, height)}"
    )


def _neighbours(facets: SlaveFacets, count: int, own: IntArray | None = None) -> Sparse:
    """Which nodes (m, m) of a contact follow each other on the outline of a facet, ones without the diagonal.

    own: which of these each slave node is, where some are one."""
    ends = [facets.own[block[:, list(pair)]] for kind, block in facets.blocks.items() for pair in OUTLINES[kind]]
    both = np.concatenate(ends)
    both = both[np.all(both >= 0, axis=1)]
    if own is not None:
        both = own[both]
        both = both[both[:, 0] != both[:, 1]]
    row, column = np.concatenate([both, both[:, ::-1]]).T
    found = sp.csr_array((np.ones(len(row)), (row, column)), shape=(count, count))
    found.data[:] = 1.0
    return found


def _open_amid(around: Sparse, loaded: BoolArray, pressure: Array, gap_before: Array, gap: Array) -> int:
    """How many open nodes have touching neighbours only, under pressure, and no more gap to begin with than those."""
    number = np.maximum(np.diff(around.indptr), 1)
    amid = ~loaded & (around @ loaded >= number) & (np.diff(around.indptr) > 1)
    amid &= around @ pressure / number >= PRESSED * pressure[loaded].mean()
    opening = gap - around @ gap / number
    given = gap_before - around @ gap_before / number
    return int(np.sum(amid & (given < 0.5 * opening)))


def _alternates(around: Sparse, loaded: BoolArray, pressure: Array) -> bool:
    number = np.maximum(np.diff(around.indptr), 1)
    inner = loaded & (around @ loaded >= number)
    if inner.sum() < LEAST_NODES:
        return False
    apart = np.abs(pressure - around @ pressure / number)[inner]
    return bool(np.median(apart) > UNEVEN * pressure[loaded].mean())
