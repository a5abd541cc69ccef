"""Slave facets that hang over an edge of the master: only what lies above the master is in contact.

A node of such a facet stands for A_i = ∫ φ_i dA over the covered part, also a node beyond the edge, and its dual
function ψ_i is biorthogonal there (Cichosz and Bischoff, Comput. Methods Appl. Mech. Eng. 200, 2011, 1317; Popp, Seitz,
Gee and Wall, ibid. 264, 2013, 67). So areas sum to the intersection of both surfaces, an even pressure gives both
bodies their consistent forces, and the master's weights, ∫ ψ_i φ_l dA / A_i, continue its surface to nodes beyond the
edge: forces and moments balance. Quadratic facets are taken as linear ones between their own nodes, whose functions are
positive on every part. So are facets with all nodes above the master that reach over a gap between its pieces. A node
beyond the edge that stands for less than a twentieth of what it would if all of its facets were covered takes no part,
and its share goes to the others of each facet: a rigid contact would press there with a force that does not go to zero
with the area. The gap of a node beyond the edge is that to the tangent plane of the edge, less what the slave bends
away from there on, as if the master bent with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..mesh.facets import facet_integrals, facet_normals, shape_functions
from ..mesh.model import Blocks
from ..typing import Array, BoolArray, IntArray, Sparse
from .curve import Curve
from .facets import SPLITS, FacetSurface
from .interpolation import element_weights
from .master import Location
from .pieces import MOST_COVER, OPPOSED, Points, covered, outlines, places_below

# A part of a facet of which less lies over the master is rounding.
LEAST = 1e-12
# A node beyond the edge stands for this part at least of what it stands for where all of its facets are covered.
THIN = 0.05
# A facet whose middle is farther from the master, in radii of its own, is not looked at.
FAR = 4.0
LINES = {"line": [[0, 1]], "line3": [[0, 2], [2, 1]]}
LINEAR_OF = {2: "line", 3: "triangle", 4: "quad"}


@dataclass(frozen=True)
class Rim:
    """Linear parts of facets over an edge, by kind, between the m nodes that take part, numbered first, and g nodes
    that do not. leaders (g,): which of the former these follow, at an offset (g, d) [m]. In the plane of a thickness
    [m]. bend (m,) [m]: what is to be taken off the gap of nodes beyond the edge."""

    blocks: Blocks
    leaders: IntArray
    offset: Array
    thickness: float
    bend: Array

    def integrated(
        self, positions: Array, location: Location, master: Curve | FacetSurface, displacement: Array | None
    ) -> tuple[Array, Array, Sparse]:
        """Areas (m,) [m²] with the shares of nodes that take no part, ∫ φ_i dA (m,) [m²] and ∫ ψ_i φ_l dA (m, k) csr
        [m²] over what the master covers."""
        m, every = len(positions), np.concatenate([np.arange(len(positions)), self.leaders])
        positions = np.concatenate([positions, positions[self.leaders] + self.offset])
        location = location.only(every)
        shape = (len(every), master.node_count)
        area, shared, weighted = np.zeros(len(every)), np.zeros(len(every)), sp.csr_array(shape)
        current = master.positions if displacement is None else master.positions + displacement
        for kind, block in self.blocks.items():
            points, at, found = _above(kind, block, positions, location, master, displacement)
            values, weight = _measured(kind, positions[block], points)
            weight = weight * self.thickness
            share = np.zeros(block.shape)
            np.add.at(share, points.owner, weight[:, None] * values)
            np.add.at(area, block, share)
            taking = np.where(block < m, share, 0.0)
            left = taking.sum(axis=1, keepdims=True)
            scaled = taking * share.sum(axis=1, keepdims=True) / np.where(left > 0.0, left, 1.0)
            # Where no node of a facet takes part, those that they follow do.
            np.add.at(shared, every[block], np.where(left > 0.0, scaled, share))
            if isinstance(master, Curve) and master.follows_spline:
                element, weights = found.nodes, found.weights
            else:
                element, weights = element_weights(master, found, at, current)
            entries = (_dual(share, values, weight, points.owner)[:, :, None] * weights[:, None, :]).ravel()
            rows = np.repeat(block[points.owner], weights.shape[1], axis=1).ravel()
            columns = np.repeat(element[:, None, :], block.shape[1], axis=1).ravel()
            weighted = weighted + sp.csr_array((entries, (rows, columns)), shape=shape)
        # Thin parts make the dual functions large: what rounding leaves of their sum must not push anybody.
        total = np.asarray(weighted.sum(axis=1))
        exact = np.divide(area, total, out=np.zeros_like(area), where=total > 0.0)
        return shared[:m], area[:m], sp.csr_array(sp.diags_array(exact) @ weighted)[:m]


@dataclass(frozen=True)
class Hanging:
    """Of b slave nodes: which facets (f,) of each kind hang over an edge and are covered in part, the linear parts of
    them that are, which nodes (b,) of these are too thinly covered to take part, and bend (b,) [m] of `Rim`. blocks:
    facets but for those of which nothing is covered. location (b,): gaps without the bend."""

    blocks: Blocks
    over: Mapping[str, BoolArray]
    parts: Blocks
    thin: BoolArray
    bend: Array
    location: Location

    def rim(self, own: IntArray, positions: Array, thickness: float) -> Rim:
        """The rim in the numbers own (b,) of nodes at positions (b, d) [m] that take part."""
        taking, ghosts = np.flatnonzero(own >= 0), np.flatnonzero(self.thin)
        nearest = np.zeros(0, dtype=np.int64)
        if len(ghosts):
            nearest = taking[np.asarray(cKDTree(positions[taking]).query(positions[ghosts])[1], dtype=np.int64)]
        number = own.copy()
        number[ghosts] = len(taking) + np.arange(len(ghosts))
        blocks = {kind: number[block] for kind, block in self.parts.items()}
        return Rim(blocks, own[nearest], positions[ghosts] - positions[nearest], thickness, self.bend[taking])

    def places(self, facing: IntArray) -> tuple[IntArray, Location]:
        """Nodes (m,) that take part, in order, and their places: those of the parts, and on other facets those facing
        (q,) the master."""
        others = [block[~self.over[kind]].ravel() for kind, block in self.blocks.items()]
        own = np.intersect1d(facing, np.concatenate([facing[:0], *others]))
        taking = np.unique(np.concatenate([own, *(block.ravel() for block in self.parts.values())]))
        taking = taking[~self.thin[taking]]
        return taking, self.location.only(taking)


def hanging(
    facets: Blocks,
    kept: Mapping[str, BoolArray],
    position: Array,
    normals: Array,
    facing: IntArray,
    master: Curve | FacetSurface,
    location: Location,
    reach: float | None,
    between: Mapping[str, BoolArray],
) -> Hanging | None:
    """What hangs over an edge of facets between b nodes at position (b, d) [m] with outward unit normals (b, d), found
    at a location (b,); None for nothing.

    facing (q,): the nodes right above the master; kept: which facets (f,) of each kind are in contact as far as these
    tell; between: which reach over what is between its pieces (`over_gaps`).
    """
    over = np.zeros(len(position), dtype=bool)
    over[facing] = True
    opposed = (np.sum(normals * location.normal, axis=1) < -1e-9) | ~np.any(normals, axis=1)
    beyond = ~location.inside & opposed & (location.gap <= (np.inf if reach is None else reach))
    blocks: dict[str, IntArray] = {}
    masks: dict[str, BoolArray] = {}
    parts: dict[str, list[IntArray]] = {}
    held, whole = np.zeros(len(position)), np.zeros(len(position))
    changes = False
    for kind, given in facets.items():
        block = np.asarray(given)
        crossing = beyond[block].any(axis=1) & (over | beyond)[block].all(axis=1)
        crossing |= between[kind]
        chosen = np.flatnonzero(crossing)
        chosen = chosen[_near(position, location, block[chosen])]
        found = np.zeros(len(block), dtype=bool)
        for columns in _split(kind):
            linear = LINEAR_OF[len(columns)]
            part = block[chosen][:, columns]
            share = _covered_shares(linear, position, part, master, location)
            integral = facet_integrals(position, part, linear)
            np.add.at(held, part, share)
            np.add.at(whole, part, integral)
            some = share.sum(axis=1) > LEAST * integral.sum(axis=1)
            found[chosen[some]] = True
            parts.setdefault(linear, []).append(part[some])
        # All nodes of a facet may be beyond the edge, and a corner of the master below it all the same.
        changes = changes or bool(found.any() or (kept[kind] & crossing).any())
        stay = (kept[kind] & ~crossing) | found
        if stay.any():
            blocks[kind], masks[kind] = block[stay], found[stay]
    if not changes:
        return None
    together = {kind: np.concatenate(some) for kind, some in parts.items() if sum(map(len, some))}
    bend = _bends(together, position, normals, over, location)
    thin = np.zeros(len(position), dtype=bool)
    thin[np.concatenate([facing[:0], *(block.ravel() for block in together.values())])] = True
    thin &= ~over & (held < THIN * whole)
    return Hanging(blocks, masks, together, thin, bend, replace(location, gap=location.gap - bend))


def over_gaps(
    facets: Blocks, position: Array, facing: IntArray, master: Curve | FacetSurface, location: Location
) -> dict[str, BoolArray]:
    """Which facets (f,) of each kind lie over what is between pieces of the master, with all of their nodes, those
    facing (q,) of b at position (b, d) [m] and a location (b,), above some of these."""
    over = np.zeros(len(position), dtype=bool)
    over[facing] = True
    piece = piece_below(master, location)
    found: dict[str, BoolArray] = {}
    for kind, given in facets.items():
        block = np.asarray(given)
        gap = np.zeros(len(block), dtype=bool)
        below = piece[block]
        chosen = np.flatnonzero(over[block].all(axis=1) & (below.max(axis=1) > below.min(axis=1)))
        share, whole = np.zeros(len(chosen)), np.zeros(len(chosen))
        for columns in _split(kind):
            linear, part = LINEAR_OF[len(columns)], block[chosen][:, columns]
            share += _covered_shares(linear, position, part, master, location).sum(axis=1)
            whole += facet_integrals(position, part, linear).sum(axis=1)
        gap[chosen] = share < (2.0 - MOST_COVER) * whole
        found[kind] = gap
    return found


def steps_between_pieces(
    facets: Blocks, own: IntArray, master: Curve | FacetSurface, location: Location
) -> tuple[IntArray, Array]:
    """Slave nodes (q,), numbered at a location (m,), on facets over more than one piece of the master, and by how much
    (q,) [m] another piece lies higher or lower there: no node has a place on more than one.

    facets between b nodes, own (b,) their numbers, −1 for none. Between normals on both sides a curve has no steps.
    """
    piece = piece_below(master, location)
    nodes: list[IntArray] = [np.zeros(0, dtype=np.int64)]
    steps: list[Array] = [np.zeros(0)]
    for block in facets.values():
        taking = own[block]
        for i in range(block.shape[1]):
            for j in range(block.shape[1]):
                a, b = taking[:, i], taking[:, j]
                both = (a >= 0) & (b >= 0)
                a, b = a[both], b[both]
                a, b = a[piece[a] != piece[b]], b[piece[a] != piece[b]]
                mean = 0.5 * (location.normal[a] + location.normal[b])
                nodes.append(a)
                steps.append(np.abs(np.sum(mean * (location.point[b] - location.point[a]), axis=1)))
    which, number = np.unique(np.concatenate(nodes), return_inverse=True)
    largest = np.zeros(len(which))
    np.maximum.at(largest, number, np.concatenate(steps))
    return which, largest


def piece_below(master: Curve | FacetSurface, location: Location) -> IntArray:
    """Numbers (b,) of the connected pieces of a master that places (b,) are on."""
    first = np.repeat(master.facets[:, :1], master.facets.shape[1] - 1, axis=1).ravel()
    other = master.facets[:, 1:].ravel()
    first, other = first[other >= 0], other[other >= 0]
    graph = sp.coo_array((np.ones(len(first)), (first, other)), shape=(master.node_count, master.node_count))
    label = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
    nearest = np.argmax(np.abs(location.weights), axis=1)
    return label[location.nodes[np.arange(len(nearest)), nearest]]


def _split(kind: str) -> list[list[int]]:
    """Nodes of the linear parts of a facet."""
    return LINES[kind] if kind in LINES else [[c for c in columns if c >= 0] for columns in SPLITS[kind]]


def _near(position: Array, location: Location, block: IntArray) -> BoolArray:
    """Which facets (f, r) may be over the master: not the many of a large slave that lie far beside it."""
    corners = position[block]
    radius = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1, initial=0.0)
    return _beside(position, location)[block].min(axis=1, initial=np.inf) <= FAR * radius


def _beside(position: Array, location: Location) -> Array:
    """Distance (b,) [m] of nodes from their places, along the master."""
    return np.linalg.norm(_along(position - location.point, location.normal), axis=1)


def _along(vectors: Array, normal: Array) -> Array:
    return vectors - np.sum(vectors * normal, axis=-1, keepdims=True) * normal


def _covered_shares(
    kind: str, position: Array, part: IntArray, master: Curve | FacetSurface, location: Location
) -> Array:
    """∫φ dA (f, r) [m², in the plane m] over what lies above the master of linear facets (f, r)."""
    share = np.zeros(part.shape)
    if len(part):
        points, _, _ = _above(kind, part, position, location, master, None)
        values, weight = _measured(kind, position[part], points)
        np.add.at(share, points.owner, weight[:, None] * values)
    return share


def _above(
    kind: str,
    block: IntArray,
    position: Array,
    location: Location,
    master: Curve | FacetSurface,
    displacement: Array | None,
) -> tuple[Points, Array, Location]:
    """Points on linear facets (f, r) that lie above the master, where (q, d) [m] they are, and their places on it."""
    current = master.positions if displacement is None else master.positions + displacement
    points = covered(kind, position[block], location.point[block].mean(axis=1), outlines(master, current))
    values = shape_functions(kind, points.local)[0]
    at = np.einsum("qr,qrd->qd", values, position[block[points.owner]])
    normal = facet_normals(position, block, kind)[points.owner]
    found = places_below(master, at, normal, displacement, location.facet[block[points.owner, 0]])
    if isinstance(master, FacetSurface):
        return points, at, found
    # In the plane pieces end where the master does, so that all points of one are above it or none.
    above = np.flatnonzero(found.inside & (np.sum(normal * found.normal, axis=1) < OPPOSED))
    return Points(points.owner[above], points.local[above], points.weight[above]), at[above], found.only(above)


def _measured(kind: str, corners: Array, points: Points) -> tuple[Array, Array]:
    """φ (q, r) and dA (q,) at points of linear facets with corners (f, r, d)."""
    values, slopes = shape_functions(kind, points.local)
    tangents = np.einsum("eqr,qrd->eqd", slopes, corners[points.owner])
    stretch = np.cross(tangents[0], tangents[1]) if len(tangents) == 2 else tangents[0]
    return values, points.weight * np.linalg.norm(stretch, axis=1)


def _dual(share: Array, values: Array, weight: Array, owner: IntArray) -> Array:
    """ψ_i dA (q, r), biorthogonal to φ (q, r) on the covered part, from its ∫φ (f, r) and dA (q,).

    On a thin part functions differ in size or hardly differ at all: they are scaled, and what rounding cannot tell
    apart is left alone.
    """
    gram = np.zeros((*share.shape, share.shape[1]))
    np.add.at(gram, owner, weight[:, None, None] * values[:, :, None] * values[:, None, :])
    size = np.sqrt(np.einsum("fii->fi", gram))
    size = np.where(size > 0.0, size, 1.0)
    inverse = np.linalg.pinv(gram / (size[:, :, None] * size[:, None, :]), rcond=1e-12, hermitian=True)
    coefficients = share[:, :, None] * inverse / (size[:, :, None] * size[:, None, :])
    return weight[:, None] * np.einsum("qij,qj->qi", coefficients[owner], values)


def _bends(parts: Blocks, position: Array, normals: Array, over: BoolArray, location: Location) -> Array:
    """How far (b,) [m] slave nodes beyond the edge are off its tangent plane because the slave is curved.

    From the edge at a share t of the way to a neighbour right above the master the slope against the master changes by
    t times what it differs by between both, and the gap by half of that times the distance.
    """
    facing = np.sum(normals * location.normal, axis=1)
    slope = -_along(normals, location.normal) / np.where(facing < -1e-3, facing, -np.inf)[:, None]
    off = _along(position - location.point, location.normal)
    total, count = np.zeros(len(position)), np.zeros(len(position))
    for block in parts.values():
        for i in range(block.shape[1]):
            for j in range(block.shape[1]):
                a, b = block[:, i], block[:, j]
                # Across a corner of the slave there is no curve to follow.
                both = ~over[a] & over[b] & (np.sum(normals[a] * normals[b], axis=1) > np.cos(np.radians(40.0)))
                a, b = a[both], b[both]
                apart = np.linalg.norm(_along(position[a] - position[b], location.normal[a]), axis=1)
                t = np.minimum(np.linalg.norm(off[a], axis=1) / apart, 1.0)
                np.add.at(total, a, 0.5 * t * np.sum((slope[a] - slope[b]) * off[a], axis=1))
                np.add.at(count, a, 1.0)
    bend = total / np.maximum(count, 1.0)
    # A bend may close a gap, never turn it into an overlap: the edge of a bevel is no curve.
    gap = location.gap
    return np.clip(bend, np.minimum(gap, 0.0), np.maximum(gap, 0.0))
