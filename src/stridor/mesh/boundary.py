"""Facets of the surface of a body: which there are, which way is out, and how files name them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..errors import CaseError
from ..typing import Array, BoolArray, IntArray
from .kinds import FACET_CORNERS, FACET_REVERSED, KINDS, corner_jacobians
from .model import Blocks, Mesh

_MOST_NAMES_SHOWN = 12
_HOW_TO_NAME = (
    "in Gmsh name them with Physical Curve (plane) or Physical Surface (solid), in Abaqus with *SURFACE or *NSET"
)


@dataclass(frozen=True)
class CellFacets:
    """Every facet (f,) of every cell, outward from it: those between two cells occur twice.

    nodes: (f, n) by facet kind. corners: (f, 4) sorted corner nodes, −1 where a facet has fewer, of all kinds in the
    order of `nodes`.
    """

    nodes: Blocks
    corners: IntArray


def cell_facets(cells: Blocks, points: Array) -> CellFacets:
    """All facets of cells by kind in points (k, d); those of cells that are inverted are turned to point out."""
    nodes: dict[str, list[IntArray]] = {}
    for kind, block in cells.items():
        if not len(block):
            continue
        table = KINDS[kind]
        inverted = _inverted(kind, block, points)
        faces = block[:, np.array(table.facets)]  # (c, faces, n)
        faces[inverted] = faces[inverted][:, :, FACET_REVERSED[table.facet_kind]]
        nodes.setdefault(table.facet_kind, []).append(faces.reshape(len(block) * len(table.facets), -1))
    joined = {kind: np.concatenate(parts) for kind, parts in nodes.items()}
    corners = [_corner_key(kind, facets) for kind, facets in joined.items()]
    return CellFacets(
        nodes=joined,
        corners=np.concatenate(corners) if corners else np.zeros((0, 4), dtype=np.int64),
    )


def outer_facets(cells: Blocks, points: Array) -> dict[str, IntArray]:
    """Facets by kind (f, n) that belong to one cell only, oriented outward; none between a hexahedron and two
    tetrahedra, which are inside the body though no cell shares them (`quadrilaterals_on_triangles`)."""
    every = cell_facets(cells, points)
    outer = _outer(every)
    return _split(every, outer & ~_diagonal(every, outer))


def facets_of_one_cell(every: CellFacets) -> dict[str, IntArray]:
    """Facets by kind (f, n) whose corners are those of no other cell's."""
    return _split(every, _outer(every))


def quadrilaterals_on_triangles(every: CellFacets) -> dict[str, IntArray]:
    """Quadrilaterals by kind (f, n) whose corners are those of two triangles on their other side."""
    found = _split(every, _diagonal(every, _outer(every)))
    return {kind: facets for kind, facets in found.items() if FACET_CORNERS[kind] == 4}


def _diagonal(every: CellFacets, outer: BoolArray) -> BoolArray:
    """Which of all facets (f,), of those of one cell only, are quadrilaterals whose corners are those of two triangles,
    and which those triangles."""
    found = np.zeros(len(every.corners), dtype=bool)
    four = np.flatnonzero(outer & (every.corners[:, 3] >= 0))
    three = np.flatnonzero(outer & (every.corners[:, 3] < 0) & (every.corners[:, 2] >= 0))
    if not (len(four) and len(three)):
        return found
    # Only where corners are those of the other kind can there be any: few facets of many.
    both = np.zeros((2, int(every.corners.max()) + 1), dtype=bool)
    both[0, every.corners[four]] = both[1, every.corners[three, :3]] = True
    four = four[both[1, every.corners[four]].all(axis=1)]
    three = three[both[0, every.corners[three, :3]].all(axis=1)]
    if not (len(four) and len(three)):
        return found
    # Corners are sorted, so that each diagonal cuts off two of the four triples.
    triples = [every.corners[four][:, [i for i in range(4) if i != left]] for left in range(4)]
    identity = _identities(np.concatenate([every.corners[three, :3], *triples]))
    known = identity[: len(three)]
    there = identity[len(three) :].reshape(4, len(four))
    across = np.isin(there, known)
    cut = across.sum(axis=0) == 2
    found[four[cut]] = True
    found[three[np.isin(known, there[:, cut][across[:, cut]])]] = True
    return found


def facets_within(cells: Blocks, points: Array, nodes: IntArray) -> dict[str, IntArray]:
    """Outer facets by kind (f, n), oriented outward, all of whose nodes are among ``nodes`` (s,)."""
    within = np.zeros(len(points), dtype=bool)
    within[nodes] = True
    chosen = {kind: f[within[f].all(axis=1)] for kind, f in outer_facets(cells, points).items()}
    return {kind: f for kind, f in chosen.items() if len(f)}


def facets_of_faces(cells: Blocks, faces: Iterable[tuple[str, IntArray, int]]) -> dict[str, IntArray]:
    """Facets by kind from (cell kind, cells (c,) of it, face), faces counted from 0 as Abaqus's S1, oriented outward
    from cells that are not inverted. Raises IndexError for a face that the kind does not have."""
    found: dict[str, list[IntArray]] = {}
    for kind, chosen, face in faces:
        table = KINDS[kind]
        found.setdefault(table.facet_kind, []).append(cells[kind][chosen][:, table.facets[face]])
    return {kind: np.concatenate(parts) for kind, parts in found.items()}


@dataclass(frozen=True)
class Matched:
    """Facets given by a file as sides of cells: outer ones by kind, oriented outward; how many lie between two cells,
    and how many are a side of no cell."""

    outer: dict[str, IntArray]
    inner_count: int
    stray_count: int


def match_facets(every: CellFacets, given: Blocks) -> Matched:
    """The sides of cells that facets in any orientation are, told by their corners: a straight facet given on a
    quadratic cell becomes that cell's own."""
    keys = [_corner_key(kind, facets) for kind, facets in given.items() if len(facets)]
    if not keys:
        return Matched({}, 0, 0)
    wanted = np.unique(np.concatenate(keys), axis=0)
    # Only facets whose corners are all among the wanted ones' can be wanted: few, where groups are many.
    known = np.zeros(max(int(wanted.max()), int(every.corners.max(initial=-1))) + 2, dtype=bool)
    known[wanted.ravel()] = True
    known[-1] = True  # what stands for no fourth corner
    near = np.flatnonzero(known[every.corners].all(axis=1))
    identity = _identities(np.concatenate([every.corners[near], wanted]))
    mine, asked = identity[: len(near)], identity[len(near) :]
    times = np.bincount(mine, minlength=int(identity.max()) + 1)
    is_asked = np.zeros(len(times), dtype=bool)
    is_asked[asked] = True
    outer = np.zeros(len(every.corners), dtype=bool)
    outer[near] = is_asked[mine] & (times[mine] == 1)
    return Matched(
        outer=_split(every, outer),
        inner_count=int(np.sum(times[asked] > 1)),
        stray_count=int(np.sum(times[asked] == 0)),
    )


def require_boundary(mesh: Mesh, name: str, where: str) -> Blocks:
    """Facets of the boundary of that name or, where it names a node set, the outer facets all of whose nodes it holds.

    Raises CaseError, with the names there are, for an unknown name and for a node set without one whole facet.
    """
    if name in mesh.boundaries:
        return mesh.boundaries[name]
    if name not in mesh.node_sets:
        raise CaseError(where, name, f"no such boundary; {_names(mesh, name)}")
    facets = facets_within(mesh.cells, mesh.points, mesh.node_sets[name])
    if not facets:
        raise CaseError(
            where,
            name,
            f"a set of {len(mesh.node_sets[name])} nodes that holds no whole side of a cell on the surface; a contact "
            f"or a pressure needs a boundary; {_names(mesh, name)}",
        )
    return facets


def listed(names: Iterable[str]) -> str:
    """Names as a list in a message, the first dozen of them."""
    held = list(names)
    rest = len(held) - _MOST_NAMES_SHOWN
    return ", ".join(held[:_MOST_NAMES_SHOWN]) + (f" and {rest} more" if rest > 0 else "")


def closest(name: str, names: Iterable[str]) -> str:
    """What asks whether another name was meant, where one is like the given one, else nothing."""
    lowered = {n.lower(): n for n in names}
    near = difflib.get_close_matches(name.lower(), lowered, n=1)
    return f"did you mean {lowered[near[0]]}? " if near else ""


def _names(mesh: Mesh, name: str) -> str:
    """What names the mesh has, for a message."""
    which = mesh.source or "the mesh"
    names = [*mesh.boundaries, *(n for n in mesh.node_sets if n not in mesh.boundaries)]
    if not names:
        return f"{which} has no named groups; {_HOW_TO_NAME}"
    hint = "" if name in names else closest(name, names)
    return f"{hint}{which} has: {listed(names)}"


def _inverted(kind: str, block: IntArray, points: Array) -> BoolArray:
    """Which cells (c,) are inside out, by the sum of their Jacobians at the corners."""
    with np.errstate(all="ignore"):  # points that are not finite are told of elsewhere
        return corner_jacobians(kind, block, points)[0].sum(axis=1) < 0


def _corner_key(kind: str, facets: IntArray) -> IntArray:
    """Sorted corner nodes (f, 4), filled with −1."""
    corners = FACET_CORNERS[kind]
    key = np.full((len(facets), 4), -1, dtype=np.int64)
    key[:, :corners] = np.sort(facets[:, :corners], axis=1)
    return key


def _identities(keys: IntArray) -> IntArray:
    """A number (f,) for each row that is the same for the same rows."""
    if not len(keys):
        return np.zeros(0, dtype=np.int64)
    order = np.lexsort(keys.T)
    ordered = keys[order]
    new = np.concatenate([[0], np.any(ordered[1:] != ordered[:-1], axis=1).astype(np.int64)])
    identity = np.empty(len(keys), dtype=np.int64)
    identity[order] = np.cumsum(new)
    return identity


def _outer(every: CellFacets) -> BoolArray:
    """Which of all facets (f,) belong to one cell only."""
    identity = _identities(every.corners)
    return np.bincount(identity)[identity] == 1 if len(identity) else np.zeros(0, dtype=bool)


def _split(every: CellFacets, chosen: BoolArray) -> dict[str, IntArray]:
    """Chosen (f,) of all facets by kind."""
    found: dict[str, IntArray] = {}
    start = 0
    for kind, facets in every.nodes.items():
        mine = facets[chosen[start : start + len(facets)]]
        start += len(facets)
        if len(mine):
            found[kind] = mine
    return found
