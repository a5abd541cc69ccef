"""The boundary of a solid body as a master: facets with normals smoothed over the nodes.

Quadratic facets are walked over in parts between their own nodes: triangle6 as four triangles, quad9 as four
quadrilaterals, quad8 as a quadrilateral between its middle nodes and four triangles at its corners. A part is as curved
as its facet is: positions and normals are those of the facet's own shape functions, polynomials on the part.

A slave x belongs to the master point X(ξ) with x = X(ξ) + g n(ξ), n the smoothed normal, continuous over edges and
nodes unless they are sharp. The gap g is continuous; on a curved surface its derivative
    dg = n · (du_slave − Σ weights du_master) − n · X_ξ dξ − n · X_η dη
keeps the last two terms, which the normal row leaves out: of first order in the angle between n and the facet, zero
on flat surfaces. Linear facets lie below a curved surface by up to `chord_height`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy.sparse as sp
from scipy.optimize import nnls
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import CaseError
from ..mesh.facets import reference_nodes, shape_functions
from ..mesh.model import Blocks
from ..typing import Array, BoolArray, IntArray, Sparse
from .creases import creases
from .facet_edges import Edges, corners_of, edges_of
from .facet_search import EDGE_TOLERANCE, MONOMIALS, edge_coordinates, locate_all, nearest_edges, shape_of
from .master import CORNER_DEG, Location
from .rim_normals import rim_normals

CANDIDATES = 4
NODE = 1e-9  # weights below are none: a point within rounding of a node is that node, as in `facet_search`
STRAIGHT = 1e-12  # of an edge's length: what it may be bent by and be straight
SPLITS = {
    "triangle": [[0, 1, 2, -1]],
    "quad": [[0, 1, 2, 3]],
    "triangle6": [[0, 3, 5, -1], [3, 1, 4, -1], [5, 4, 2, -1], [3, 4, 5, -1]],
    "quad8": [[0, 4, 7, -1], [4, 1, 5, -1], [5, 2, 6, -1], [6, 3, 7, -1], [4, 5, 6, 7]],
    "quad9": [[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]],
}


@dataclass(frozen=True)
class FacetSurface:
    """k nodes and f linear facets, corners counter-clockwise seen from outside.

    nodes (k,): the mesh's own numbers of the surface's nodes, the order in which displacements and rows are expected.
    positions (k, 3) [m] undisplaced. facets (f, 4) of the surface's numbering, −1 in the last place of a triangle.
    neighbours (f, 4): the facet over the edge that begins at each corner, −1 at the surface's own edge. sharp (f, 4):
    edges of the body, over which normals are not averaged. groups (f, 4): the number of the smoothed normal
    that a corner takes part in. elements (f, 9): nodes of the mesh's own, maybe quadratic, facet that each was split
    from, 0 in unused places; tangents (patterns, 4, 2, 9): what their positions contribute to the two tangents at
    each corner, by the pattern (f,) of the split; kinds and splits: for each pattern the kind of that facet and which
    of its nodes are the corners. polynomials (patterns, 11, 9): what nodes of a quadratic facet contribute to the
    coefficients of its coordinates on a part, in `MONOMIALS` of those of the part; curved (patterns,): whether facets
    are quadratic; element_groups (f, 9): the smoothed normals at their nodes. blocks: the mesh's own facets by kind in
    the surface's numbering. doubtful (q, 4): middle [m] and angle [rad] of edges that may be as well what they are not
    taken as (`creases`). rim (groups, f): what normals of facets add to smoothed ones where the surface ends.
    """

    nodes: IntArray
    positions: Array
    facets: IntArray
    neighbours: IntArray
    sharp: BoolArray
    groups: IntArray
    elements: IntArray
    pattern: IntArray
    tangents: Array
    kinds: tuple[str, ...]
    splits: tuple[tuple[int, ...], ...]
    polynomials: Array
    curved: BoolArray
    element_groups: IntArray
    blocks: Blocks
    doubtful: Array
    rim: Sparse

    @classmethod
    def from_facets(cls, points: Array, facets: Blocks, *, where: str, corner_deg: float = CORNER_DEG) -> FacetSurface:
        """The surface that triangles and quadrilaterals of a mesh with points (·, 3) make up.

        corner_deg: over edges where neighbours turn by more, and over those that stand alone between flats (`creases`),
        normals are not averaged. Raises CaseError naming
        ``where`` for no facets, facets without area and edges that more than two facets share or that two facets
        pass in the same direction (they disagree about the outside).
        """
        blocks = [(kind, np.asarray(block)) for kind, block in facets.items() if len(block)]
        splits = [(kind, block, split) for kind, block in blocks for split in _splits(kind)]
        if not splits:
            raise CaseError(where, None, "has no facets; triangles or quadrilaterals are needed")
        raw = np.concatenate([_picked(block, split) for _, block, split in splits])
        nodes = np.unique(raw[raw >= 0])
        local = np.where(raw < 0, -1, np.searchsorted(nodes, raw)).astype(np.int64)
        whole = np.concatenate([_picked(block, [*range(block.shape[1])], width=9) for _, block, _ in splits])
        elements = np.where(whole < 0, 0, np.searchsorted(nodes, whole)).astype(np.int64)
        pattern = np.repeat(np.arange(len(splits)), [len(block) for _, block, _ in splits])
        tangents = np.stack([_corner_tangents(kind, split) for kind, _, split in splits])
        positions = np.ascontiguousarray(np.asarray(points, dtype=float)[nodes])
        normals = _facet_normals(positions, local)
        if not normals.any(axis=1).all():
            at = ", ".join(f"{x:.6g}" for x in positions[local[int(np.argmin(normals.any(axis=1))), :3]].mean(axis=0))
            raise CaseError(where, None, f"the facet at ({at}) m has no area; merge its nodes or leave it out")
        neighbours, over_edge = _neighbours(local, positions, where)
        kinds, parts = tuple(kind for kind, _, _ in splits), tuple(tuple(split) for _, _, split in splits)
        own = {kind: np.searchsorted(nodes, block).astype(np.int64) for kind, block in blocks}
        edges = edges_of(positions, own)
        found = creases(edges, corners_of(own), positions, np.radians(corner_deg))
        sharp = (neighbours >= 0) & _edges_of_parts(edges, found.edge, own, kinds, parts)
        groups = _groups(local, neighbours, over_edge, sharp)
        curved = np.array([len(_splits(kind)) > 1 for kind in kinds])
        polynomials = np.stack([_polynomial_of(kind, split) for kind, split in zip(kinds, parts, strict=True)])
        at_nodes = _element_groups(groups, kinds, parts, pattern)
        nothing = sp.csr_array((int(groups.max()) + 1, len(local)))
        averaged = cls(
            nodes, positions, local, neighbours, sharp, groups, elements, pattern, tangents, kinds, parts, polynomials,
            curved, at_nodes, own, np.column_stack([edges.middle, edges.turn])[found.doubtful], nothing,
        )  # fmt: skip
        flat, smoothed = ~curved[pattern], averaged._normals(positions)
        return replace(
            averaged, rim=rim_normals(positions, local, neighbours, sharp, groups, flat, normals, smoothed)
        )

    @property
    def node_count(self) -> int:
        """Number of nodes k."""
        return len(self.nodes)

    @property
    def dimension(self) -> int:
        """3."""
        return 3

    @property
    def chord_height(self) -> float:
        """Largest height [m] of the curved surface above chords between its nodes, about h²/8R, as the normals tell
        it."""
        normals = self.corner_normals(self.positions)

        def heights(begin: IntArray, end: IntArray) -> Array:
            """Of a cubic over its chord (f, e), from the slopes that the normals give its ends."""
            chord = np.take_along_axis(self.facets, end, axis=1), np.take_along_axis(self.facets, begin, axis=1)
            along = self.positions[chord[0]] - self.positions[chord[1]]
            change = np.take_along_axis(normals, end[..., None], 1) - np.take_along_axis(normals, begin[..., None], 1)
            return np.sum(change * along, axis=2) / 8.0

        following = _following(self.facets)
        own = np.broadcast_to(np.arange(4), following.shape)
        edges = np.abs(heights(own, following))[self.facets >= 0]
        # The middle of a quadrilateral lies half way between those of its diagonals.
        quads = self.facets[:, 3] >= 0
        middle = np.abs(heights(own[:, :2], own[:, 2:]).mean(axis=1))[quads]
        return float(max(edges.max(), middle.max(initial=0.0)))

    def corner_normals(self, current: Array) -> Array:
        """Smoothed unit normals (f, 4, 3) at the corners of the facets with nodes at ``current`` (k, 3).

        Those of the mesh's own facets, quadratic ones as curved as they are, are weighted as t1 × t2 / |t1|²|t2|² with
        their tangents along the edges (Max 1999), which makes the normals of a cylinder exact on uneven meshes too.
        """
        return np.ascontiguousarray(np.where((self.facets >= 0)[..., None], self._normals(current)[self.groups], 0.0))

    def _normals(self, current: Array) -> Array:
        """The smoothed unit normals (·, 3), as `groups` numbers them."""
        valid = self.facets >= 0
        both = np.empty((2, *self.facets.shape, 3))
        for number, table in enumerate(self.tangents):
            mine = self.pattern == number
            both[:, mine] = np.einsum("cjr,frd->jfcd", table, current[self.elements[mine]])
        weighted = np.cross(both[0], both[1])
        square = np.prod(np.sum(both * both, axis=3), axis=0)
        weighted /= np.where(valid & (square > 0), square, 1.0)[..., None]
        count = int(self.groups.max()) + 1
        total = [np.bincount(self.groups[valid], weights=weighted[..., i][valid], minlength=count) for i in range(3)]
        smoothed = _unit(np.asarray(total, dtype=float).T)
        if self.rim.nnz:
            further = self.rim @ _facet_normals(current, self.facets)
            smoothed = _unit(smoothed + further - np.sum(further * smoothed, axis=1, keepdims=True) * smoothed)
        return np.ascontiguousarray(smoothed)

    def locate(self, slaves: Array, displacement: Array | None = None, *, guess: IntArray | None = None) -> Location:
        """Points of the displaced surface under slave positions (m, 3) [m], along its smoothed normals.

        displacement (k, 3) [m] of the surface's nodes. With guess (m,) the search walks from those facets over their
        neighbours; only slaves that leave over an edge are searched for anew. Points up to 1e-6 of a facet beyond
        an edge of the surface are inside; from farther ones `point` is the nearest point of the edges. Off an outward
        sharp edge the gap is the distance from it.
        """
        current = self.positions if displacement is None else self.positions + displacement
        current, slaves = np.ascontiguousarray(current), np.ascontiguousarray(slaves, dtype=float)
        normals = self._normals(current)
        if guess is not None:
            facet, local, inside = self._search(slaves, current, normals, np.asarray(guess, dtype=np.int64)[:, None])
            again = np.flatnonzero(~inside)
        else:
            facet, local = np.zeros(len(slaves), dtype=np.int64), np.zeros((len(slaves), 2))
            inside, again = np.zeros(len(slaves), dtype=bool), np.arange(len(slaves))
        if len(again):
            starts = self.nearest_facets(slaves[again], current)
            facet[again], local[again], inside[again] = self._search(slaves[again], current, normals, starts)
        return self._location(slaves, current, normals, facet, local, inside)

    def _search(
        self, slaves: Array, current: Array, normals: Array, starts: IntArray
    ) -> tuple[IntArray, Array, BoolArray]:
        blocked = self.sharp | (self.neighbours < 0)
        sheet = (current, self.facets, normals, self.groups, self.neighbours, blocked)
        curved = (self.curved, self.pattern, self.polynomials, self.elements, self.element_groups)
        found = locate_all(slaves, sheet, curved, starts)
        return found[0], found[1], found[2]

    def nearest_facets(self, slaves: Array, current: Array | None = None) -> IntArray:
        """Facets (m, q) to begin a search at from positions (m, 3) [m], nodes at ``current`` (k, 3) [m] or undisplaced.

        Those whose centre, or points between centre and edges, are nearest, and both at the nearest sharp edge, over
        which no search goes: beside narrow ones a large one's centre is far.
        """
        current = self.positions if current is None else current
        valid = self.facets >= 0
        middles = 0.5 * (current[self.facets] + current[np.take_along_axis(self.facets, _following(self.facets), 1)])
        centres = np.sum(current[self.facets] * valid[..., None], axis=1) / valid.sum(axis=1, keepdims=True)
        each = np.arange(len(self.facets))
        beside = np.nonzero(valid)[0]
        samples = np.concatenate([centres, 0.75 * middles[valid] + 0.25 * centres[beside]])
        owner = np.concatenate([each, beside])
        count = min(CANDIDATES, len(owner))
        nearest = np.asarray(cKDTree(samples).query(slaves, k=count)[1], dtype=np.int64)
        starts = owner[nearest.reshape(len(slaves), count)]
        if not self.sharp.any():
            return starts
        facet, _, edge, _ = self._beside(slaves, current, [self.sharp])
        return np.column_stack([starts, facet, self.neighbours[facet, edge]])

    def _location(
        self, slaves: Array, current: Array, normals: Array, facet: IntArray, local: Array, inside: BoolArray
    ) -> Location:
        """Points and normals at local coordinates (m, 2) on facets (m,); slaves not inside go to the nearest edge."""
        point, normal, _, _ = self._at(current, normals, facet, local)
        edge = np.full(len(slaves), -1)  # of the slaves that are nearest to an edge
        borders = (self.neighbours < 0) & (self.facets >= 0)
        endless = not (borders.any() or self.sharp.any())
        lost = np.flatnonzero(~inside)
        if len(lost):
            chosen = [self.facets >= 0] if endless else [borders, self.sharp]
            facet[lost], local[lost], edge[lost], _ = self._beside(slaves[lost], current, chosen)
        if self.sharp.any():
            # A sharp edge may be much nearer than a facet behind it that happens to face the slave.
            distance = np.where(inside, np.abs(np.sum(normal * (slaves - point), axis=1)), 0.0)
            near = self._beside(slaves, current, [self.sharp])
            swap = np.flatnonzero(near[3] < 0.9 * distance)
            facet[swap], local[swap], edge[swap] = near[0][swap], near[1][swap], near[2][swap]
        inside = (edge < 0) | self.sharp[facet, edge] | endless
        point, normal, nodes, weights = self._at(current, normals, facet, local)
        rim = np.flatnonzero(~inside)
        inside[rim] = self._over_rim(facet[rim], slaves[rim] - point[rim], normal[rim], normals, current)
        corner = np.flatnonzero((edge >= 0) & self.sharp[facet, edge])
        if len(corner):
            across = self.neighbours[facet[corner], edge[corner]]
            normal[corner] = self._edge_normals(facet[corner], across, slaves[corner] - point[corner], current)
        gap = np.sum(normal * (slaves - point), axis=1)
        return Location(nodes, weights, point, normal, gap, facet, inside, local)

    def smooth_at(self, location: Location) -> tuple[Array, IntArray]:
        """The undisplaced surface's own normals (m, 3) at places on it, off edges those of one of the sides, and the
        number (m,) of the part between edges that each is on."""
        local = np.zeros((len(location.facet), 2)) if location.local is None else location.local
        normal = self._at(self.positions, self._normals(self.positions), location.facet, local)[1]
        facet, edge = np.nonzero((self.neighbours >= 0) & ~self.sharp)
        pairs, count = (facet, self.neighbours[facet, edge]), len(self.facets)
        parts = connected_components(sp.coo_array((np.ones(len(facet)), pairs), shape=(count, count)), directed=False)
        return normal, np.asarray(parts[1], dtype=np.int64)[location.facet]

    def _at(
        self, current: Array, normals: Array, facet: IntArray, local: Array
    ) -> tuple[Array, Array, IntArray, Array]:
        """Points (m, 3), unit normals (m, 3), nodes and weights (m, 4), with quadratic facets (m, 9), at local
        coordinates (m, 2) of facets (m,)."""
        weights = shape_of(self.facets[facet, 3] < 0, local)
        nodes = self.facets[facet]
        point = np.einsum("mr,mrd->md", weights, current[nodes])
        normal = np.einsum("mr,mrd->md", weights, normals[self.groups[facet]])
        if self.curved.any():
            nodes, weights = np.pad(nodes, ((0, 0), (0, 5))), np.pad(weights, ((0, 0), (0, 5)))
            mine = np.flatnonzero(self.curved[self.pattern[facet]])
            elements = self.elements[facet[mine]]
            own = self.element_weights(facet[mine], local[mine])
            point[mine] = np.einsum("mr,mrd->md", own, current[elements])
            normal[mine] = np.einsum("mr,mrd->md", own, normals[self.element_groups[facet[mine]]])
            nodes[mine], weights[mine] = elements, own
        nodes = np.where(weights == 0.0, 0, nodes)
        return point, normal / np.linalg.norm(normal, axis=1, keepdims=True), nodes, weights

    def element_weights(self, facet: IntArray, local: Array) -> Array:
        """Shape functions (m, 9) of the mesh's own facets at coordinates (m, 2) on their parts (m,), 0 in unused
        places."""
        corners = shape_of(self.facets[facet, 3] < 0, local)
        weights = np.zeros((len(facet), 9))
        for number, (kind, split) in enumerate(zip(self.kinds, self.splits, strict=True)):
            mine = np.flatnonzero(self.pattern[facet] == number)
            if len(mine):
                own = [c for c in split if c >= 0]
                at = reference_nodes(kind)
                weights[mine, : len(at)] = shape_functions(kind, corners[mine, : len(own)] @ at[own])[0]
        weights[np.abs(weights) < NODE] = 0.0
        return weights / weights.sum(axis=1, keepdims=True)

    def _beside(
        self, slaves: Array, current: Array, chosen: list[BoolArray]
    ) -> tuple[IntArray, Array, IntArray, Array]:
        """Facet, local coordinates (m, 2), edge and distance [m] of the nearest point on the chosen edges, the first
        lot first."""
        picked = [np.nonzero(edges) for edges in chosen]
        facet = np.concatenate([p[0] for p in picked])
        edge = np.concatenate([p[1] for p in picked])
        begin = current[self.facets[facet, edge]]
        end = current[self.facets[facet, _following(self.facets)[facet, edge]]]
        which, along, distance = nearest_edges(slaves, begin, end, self._edge_bends(current, facet, edge))
        facet, edge = facet[which], edge[which]
        return facet, edge_coordinates(self.facets[facet, 3] < 0, edge, along), edge, distance

    def _edge_bends(self, current: Array, facet: IntArray, edge: IntArray) -> Array:
        """What edges (b, 3) [m] of facets (b,) are bent by: begin + t (end − begin) + t (1 − t) bend."""
        begin, end = self.facets[facet, edge], self.facets[facet, _following(self.facets)[facet, edge]]
        chord = 0.5 * (current[begin] + current[end])
        bend = np.zeros((len(facet), 3))
        mine = np.flatnonzero(self.curved[self.pattern[facet]])
        if len(mine):
            half = edge_coordinates(self.facets[facet[mine], 3] < 0, edge[mine], np.full(len(mine), 0.5))
            weights = self.element_weights(facet[mine], half)
            bend[mine] = 4.0 * (np.einsum("mr,mrd->md", weights, current[self.elements[facet[mine]]]) - chord[mine])
            # What rounding leaves of a straight edge is none.
            size = np.linalg.norm(current[end[mine]] - current[begin[mine]], axis=1)
            bend[mine[np.linalg.norm(bend[mine], axis=1) < STRAIGHT * size]] = 0.0
        return bend

    def at_corners(self, location: Location, slaves: Array, slave_normals: Array) -> Location:
        """Places of undisplaced slaves (m, 3) [m] where those that lie on an edge look the way their own normals (m, 3)
        say, as far as the normals of both sides of the edge, or of all sides where edges meet, enclose that.

        Which of its sides is nearer there rounding decides, of an inward edge as of an outward one. Slaves without a
        normal keep that side's.
        """
        if not self.sharp.any():
            return location
        size = np.linalg.norm(np.ptp(self.positions[self.facets[:, :3]], axis=1), axis=1)
        facet, _, _, distance = self._beside(slaves, self.positions, [self.sharp])
        on = (distance <= EDGE_TOLERANCE * size[facet]) & np.any(slave_normals, axis=1)
        which = np.flatnonzero(on)
        if not len(which):
            return location
        facet, edge = np.nonzero(self.sharp & (np.arange(len(self.facets))[:, None] < self.neighbours))
        begin, end = self.facets[facet, edge], self.facets[facet, _following(self.facets)[facet, edge]]
        bends = self._edge_bends(self.positions, facet, edge)
        smoothed = self._normals(self.positions)
        normal = location.normal.copy()
        for slave in which.tolist():
            place = slaves[slave]
            sides: list[Array] = []
            close = np.linalg.norm(0.5 * (self.positions[begin] + self.positions[end]) - place, axis=1) <= size[facet]
            for k in np.flatnonzero(close).tolist():
                ends = self.positions[begin[k : k + 1]], self.positions[end[k : k + 1]]
                _, along, far = nearest_edges(place[None], *ends, bends[k : k + 1])
                if far[0] > EDGE_TOLERANCE * size[facet[k]]:
                    continue
                for side in (facet[k], self.neighbours[facet[k], edge[k]]):
                    looks = np.zeros(3)
                    for node, part in ((begin[k], 1.0 - along[0]), (end[k], along[0])):
                        looks += part * smoothed[self.groups[side, int(np.argmax(self.facets[side] == node))]]
                    sides.append(looks / np.linalg.norm(looks))
            normal[slave] = _enclosed(sides, -slave_normals[slave], location.normal[slave])
        return replace(location, normal=normal, gap=np.sum(normal * (slaves - location.point), axis=1))

    def _over_rim(self, facet: IntArray, offset: Array, normal: Array, normals: Array, current: Array) -> BoolArray:
        """Whether slaves at an offset (q, 3) from the surface's own edge stand over that edge as far as can be told.

        Facets know the normal of a curved surface as well as it turns from the facet to its corners, and at an edge
        they have neighbours on one side only. Nodes over the rim of a cylinder must not drop out for that: twice that
        angle is forgiven, once for the normal and once for the edge itself, which is as straight as the facet is flat.
        """
        corners = self.facets[facet] >= 0
        at_corners = normals[self.groups[facet]]
        deviation = np.linalg.norm(at_corners - _facet_normals(current, self.facets[facet])[:, None], axis=2)
        doubt = np.where(corners, deviation, 0.0).max(axis=1, initial=0.0)
        doubt[doubt < 1e-12] = 0.0
        height = np.sum(offset * normal, axis=1)
        beyond = np.linalg.norm(offset - height[:, None] * normal, axis=1)
        size = np.sqrt(np.sum(np.ptp(current[self.facets[facet, :3]], axis=1) ** 2, axis=1))
        return beyond <= EDGE_TOLERANCE * size + 2.0 * doubt * np.abs(height)

    def _edge_normals(self, facet: IntArray, across: IntArray, offset: Array, current: Array) -> Array:
        """Out of a sharp edge between two facets (q,) towards (from, inside the body) slaves at an offset (q, 3)."""
        around = np.stack([_facet_normals(current, self.facets[f]) for f in (facet, across)])
        mean = around.sum(axis=0)
        mean /= np.linalg.norm(mean, axis=1, keepdims=True)
        distance = np.linalg.norm(offset, axis=1)
        size = np.linalg.norm(np.ptp(current[self.facets[facet, :3]], axis=1), axis=1)
        apart = distance > 1e-9 * size
        side = np.where(np.sum(mean * offset, axis=1) < 0, -1.0, 1.0)
        scaled = side[:, None] * offset / np.where(apart, distance, 1.0)[:, None]
        return np.where(apart[:, None], scaled, mean)


def _enclosed(sides: list[Array], own: Array, otherwise: Array) -> Array:
    """The direction (3,) nearest to ``own`` among those that the normals of sides enclose, their sums with positive
    parts; another one where all of them look away from it."""
    if not sides:
        return otherwise
    enclosing = np.stack(sides, axis=1)
    nearest = enclosing @ nnls(enclosing, own)[0]
    length = float(np.linalg.norm(nearest))
    return nearest / length if length > 0.0 else otherwise


def _splits(kind: str) -> list[list[int]]:
    """Corners of the linear facets that a facet of a kind is split into. Raises ValueError for other kinds."""
    if kind not in SPLITS:
        raise ValueError(f"{kind!r} is no facet of a solid; there are: {', '.join(SPLITS)}")
    return SPLITS[kind]


def _picked(block: IntArray, columns: list[int], width: int = 4) -> IntArray:
    """Nodes (f, width) in the given columns of facets (f, r), −1 where there is none."""
    padded = [*columns, *[-1] * (width - len(columns))]
    return np.stack([block[:, c] if c >= 0 else np.full(len(block), -1) for c in padded], axis=1)


def _corner_tangents(kind: str, split: list[int]) -> Array:
    """Coefficients (4, 2, 9) of the nodes of a facet in its tangents at the corners of one part of its split.

    The first tangent leads towards the next corner of the part, the second towards the one before.
    """
    found = np.zeros((4, 2, 9))
    corners = reference_nodes(kind)[[c for c in split if c >= 0]]
    _, slopes = shape_functions(kind, corners)  # (2, q, r)
    for j, towards in enumerate((np.roll(corners, -1, axis=0), np.roll(corners, 1, axis=0))):
        found[: len(corners), j, : slopes.shape[2]] = np.einsum("eqr,qe->qr", slopes, towards - corners)
    return found


def _edges_of_parts(
    edges: Edges, chosen: BoolArray, blocks: Blocks, kinds: tuple[str, ...], splits: tuple[tuple[int, ...], ...]
) -> BoolArray:
    """Which edges (f, 4) of the parts of the mesh's own facets lie on chosen (e,) edges between these."""
    whole = np.zeros((sum(len(block) for block in blocks.values()), 4), dtype=bool)
    whole[edges.facets[chosen], edges.places[chosen]] = True
    starts = dict(zip(blocks, np.cumsum([0, *(len(block) for block in blocks.values())]), strict=False))
    found: list[BoolArray] = []
    for kind, split in zip(kinds, splits, strict=True):
        count = 3 if kind.startswith("triangle") else 4
        own = [c for c in split if c >= 0]
        mine = whole[starts[kind] : starts[kind] + len(blocks[kind])]
        of_part = np.zeros((len(mine), 4), dtype=bool)
        for place, pair in enumerate(zip(own, own[1:] + own[:1], strict=True)):
            for edge in range(count):
                if set(pair) <= {edge, (edge + 1) % count, count + edge}:
                    of_part[:, place] = mine[:, edge]
        found.append(of_part)
    return np.concatenate(found)


def _element_groups(
    groups: IntArray, kinds: tuple[str, ...], splits: tuple[tuple[int, ...], ...], pattern: IntArray
) -> IntArray:
    """Numbers (f, 9) of the smoothed normals at the nodes of the mesh's own facet of which each is a part, from those
    (f, 4) at the corners of all of its parts; 0 in unused places."""
    found = np.zeros((len(groups), 9), dtype=np.int64)
    for kind in set(kinds):
        parts = [number for number, other in enumerate(kinds) if other == kind]
        rows = [np.flatnonzero(pattern == number) for number in parts]
        for number, those in zip(parts, rows, strict=True):
            for corner, node in enumerate(c for c in splits[number] if c >= 0):
                for other in rows:
                    found[other, node] = groups[those, corner]
    return found


@cache
def _polynomial_of(kind: str, split: tuple[int, ...]) -> Array:
    """Coefficients (11, 9) in `MONOMIALS` of the coordinates on a part of a split of the nodes of a facet of a kind."""
    own = [c for c in split if c >= 0]
    at = reference_nodes(kind)
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij"), axis=-1).reshape(-1, 2)
    x, y = grid.T
    corners = np.stack([1 - x - y, x, y] if len(own) == 3 else [(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y])
    values = shape_functions(kind, corners.T @ at[own])[0]
    powers = x[:, None] ** MONOMIALS[:, 0] * y[:, None] ** MONOMIALS[:, 1]
    found = np.zeros((len(MONOMIALS), 9))
    found[:, : len(at)] = np.linalg.lstsq(powers, values, rcond=None)[0]
    # Those of shape functions on halves are multiples of 1/8, and rounding is none of them.
    return np.round(8.0 * found) / 8.0


def _unit(vectors: Array) -> Array:
    """Vectors (·, 3) of length one; those without length as they are."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def _following(facets: IntArray) -> IntArray:
    """Place (f, 4) of the next corner in its facet."""
    return np.where(facets[:, 3:] < 0, [[1, 2, 0, 0]], [[1, 2, 3, 0]])


def _facet_normals(positions: Array, facets: IntArray) -> Array:
    """Unit normals (f, 3) of facets, of a quadrilateral across its diagonals; zero where there is no area."""
    a, b, c = (positions[facets[:, i]] for i in range(3))
    last = positions[np.where(facets[:, 3] < 0, facets[:, 0], facets[:, 3])]
    normal = np.where(facets[:, 3:] < 0, np.cross(b - a, c - a), np.cross(c - a, last - b))
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    flat = length <= 1e-12 * np.sum((c - a) ** 2, axis=1, keepdims=True)
    return np.where(flat, 0.0, normal / np.where(flat, 1.0, length))


def _neighbours(facets: IntArray, positions: Array, where: str) -> tuple[IntArray, IntArray]:
    """The facet over each edge (f, 4) and which of its edges that is, −1 where there is none."""
    valid = facets >= 0
    ends = np.take_along_axis(facets, _following(facets), axis=1)
    begin, end = facets[valid], ends[valid]
    size = len(positions)
    key, opposite = begin * size + end, end * size + begin
    order = np.argsort(key)
    doubled = np.flatnonzero(np.diff(key[order]) == 0)
    if len(doubled):
        middle = 0.5 * (positions[begin[order[doubled[0]]]] + positions[end[order[doubled[0]]]])
        at = ", ".join(f"{x:.6g}" for x in middle)
        problem = f"two facets pass the edge at ({at}) m in the same direction: they overlap, branch or disagree"
        raise CaseError(where, None, f"{problem} about the outside; repair the mesh there")
    at = np.minimum(np.searchsorted(key[order], opposite), len(key) - 1)
    match = np.where(key[order][at] == opposite, order[at], -1)
    owner, corner = np.nonzero(valid)
    over, over_edge = np.full(facets.shape, -1), np.full(facets.shape, -1)
    over[valid] = np.where(match < 0, -1, owner[match])
    over_edge[valid] = np.where(match < 0, -1, corner[match])
    return over, over_edge


def _groups(facets: IntArray, neighbours: IntArray, over_edge: IntArray, sharp: BoolArray) -> IntArray:
    """Numbers (f, 4) of the smoothed normals: corners that share a node and are joined by edges not sharp."""
    facet, edge = np.nonzero((neighbours >= 0) & ~sharp)
    following = _following(facets)
    other, other_edge = neighbours[facet, edge], over_edge[facet, edge]
    begins = (facet * 4 + edge, other * 4 + following[other, other_edge])
    ends = (facet * 4 + following[facet, edge], other * 4 + other_edge)
    rows, columns = (np.concatenate(pair) for pair in zip(begins, ends, strict=True))
    size = facets.size
    joined = sp.csr_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
    return np.asarray(connected_components(joined, directed=False)[1], dtype=np.int64).reshape(facets.shape)
