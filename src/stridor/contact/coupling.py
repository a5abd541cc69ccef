"""How slave nodes are coupled to their master: weighted over the facets around them, or each by itself.

A node against the point of the master below it gives neither a slave with quadratic facets nor a master whose mesh does
not match the nodal forces of a uniform pressure. Between meshed surfaces the rows are those of a dual mortar method:
with functions φ̃ of positive integrals (`mesh.positive_basis`), u = Σ φ̃_i ũ_i on the
slave, and multipliers ψ_i with ∫ ψ_i φ̃_k = δ_ik ∫ φ̃_i (Wohlmuth 2000), node i stands for

    g̃_i = ũ_i − Σ_l (∫ ψ_i φ_l dA / A_i) u_l,   A_i = ∫ φ̃_i dA.

As Σ ψ_i = 1, a uniform pressure p_i = p A_i gives both bodies their consistent nodal forces, whatever their meshes.
Gaps between linear facets are those of the nodes, which lie on the true surface where facets are its chords; between
quadratic ones they are weighted as displacements are. On obstacles and on the spline of a beam each node of the changed
basis stands by itself. Facets that hang over an edge of the master are integrated over what lies above it (`rim`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from ..mesh.facets import facet_integrals, facet_normals, shape_functions
from ..mesh.model import Blocks
from ..mesh.positive_basis import MIDDLES, changed_basis
from ..typing import Array, BoolArray, IntArray, Sparse
from .curve import Curve
from .facets import FacetSurface
from .interpolation import LINEAR, element_weights
from .master import Location, MasterSurface
from .pieces import outlines, pieces, places_below
from .rim import Hanging, Rim

# Facets integrated together: their arrays fit comfortably into memory.
TOGETHER = 400
NOTHING = 1e-11


@dataclass(frozen=True)
class Coupling:
    """m rows of relative displacement: slave (m, m) csr on the slave nodes minus master (m, k) csr on the master's.

    Each row of either sums to one. area (m,) [m²] that a node stands for, gap (m,) [m] of the row. hanging (m,): nodes
    of facets over an edge of the master that it still covers in part; None where there are none.
    """

    slave: Sparse
    master: Sparse
    area: Array
    gap: Array
    hanging: BoolArray | None = None


@dataclass(frozen=True)
class SlaveFacets:
    """The facets whose nodes are b slave nodes at positions (b, d) [m], of which m take part in the contact.

    blocks: facets by kind in the numbering of the b nodes. own (b,): number among those that take part, −1 for none.
    integrals: ∫φ dA (f, r) [m²] of the undeformed facets, thickness included, zero for those that hang over an edge of
    the master: ``rim`` stands for them. nodal_gaps: whether gaps are those of the nodes though facets are quadratic,
    because nodes were moved onto the master.
    """

    blocks: Blocks
    own: IntArray
    integrals: Mapping[str, Array] = field(repr=False)
    nodal_gaps: bool = False
    rim: Rim | None = None

    @classmethod
    def of(
        cls,
        positions: Array,
        blocks: Blocks,
        taking: IntArray,
        *,
        thickness: float = 1.0,
        nodal_gaps: bool = False,
        hanging: Hanging | None = None,
    ) -> SlaveFacets:
        """Facets between b positions of which ``taking`` (m,) take part; ``hanging`` tells those over an edge."""
        own = np.full(len(positions), -1)
        own[taking] = np.arange(len(taking))
        integrals = {k: thickness * facet_integrals(positions, block, k) for k, block in blocks.items()}
        rim = None
        if hanging is not None:
            for kind, over in hanging.over.items():
                integrals[kind][over] = 0.0
            rim = hanging.rim(own, positions, thickness)
        return cls(blocks, own, integrals, nodal_gaps or all(kind in LINEAR for kind in blocks), rim)


def collocated(location: Location, area: Array, master_nodes: int) -> Coupling:
    """Each node by itself against the point of the master below it."""
    m = len(location.gap)
    return Coupling(sp.csr_array(sp.eye_array(m)), point_weights(location, master_nodes), area, location.gap)


def coupled(
    facets: SlaveFacets | None,
    positions: Array,
    area: Array,
    location: Location,
    master: MasterSurface,
    displacement: Array | None = None,
) -> Coupling:
    """Coupling of m slave nodes at positions (m, d) [m], found at a location, to a master displaced by (k, d) [m].

    area (m,) is taken where facets are not known.
    """
    single = collocated(location, area, master.node_count)
    if facets is None:
        return single
    mixture, area = _values_of_basis(facets, len(positions)), _areas(facets, len(positions))
    below, gap = sp.csr_array(mixture @ single.master), mixture @ location.gap
    if not isinstance(master, Curve | FacetSurface):
        return Coupling(mixture, below, area, gap)
    spline = isinstance(master, Curve) and master.follows_spline
    hanging = None
    # Facets that are not whole in contact have no integral over the master: their nodes stand by themselves.
    alone = area if spline else _areas(facets, len(positions), whole=False)
    if facets.rim is not None:
        shared, nodal, weighted = facets.rim.integrated(positions, location, master, displacement)
        hanging = nodal > 0.0
        added = _of_basis(mixture, shared)
        # A node that has slid off altogether stands for nothing any more, and by itself.
        gone = np.where(area + added > 0.0, 0.0, 1.0)
        area, alone, added = area + added + gone, alone + gone, np.maximum(added, 0.0)
        share = np.maximum(alone + added, 1e-300)
        covered = sp.diags_array(np.where(hanging, 1.0 / np.where(hanging, nodal, 1.0), 0.0)) @ weighted
        covered = covered + sp.diags_array(np.where(hanging, 0.0, 1.0)) @ single.master
        below = sp.diags_array(alone / share) @ below + sp.diags_array(added / share) @ (mixture @ covered)
        alone = alone + added
    if spline:
        return Coupling(mixture, sp.csr_array(below), area, gap, hanging)
    alone = alone / area
    weighted, gaps = _integrated(facets, positions, location, master, displacement)
    below = sp.csr_array(sp.diags_array(alone) @ below + sp.diags_array(1.0 / area) @ weighted)
    below.data[np.abs(below.data) < NOTHING] = 0.0
    below.eliminate_zeros()
    return Coupling(mixture, below, area, gap if facets.nodal_gaps else alone * gap + gaps / area, hanging)


def _of_basis(mixture: Sparse, nodal: Array) -> Array:
    """∫φ̃ (m,) from ∫φ (m,): the other way than values, a middle node gives its corners their shares."""
    own = mixture.diagonal()
    return nodal / own - (mixture - sp.diags_array(own)).T @ (nodal / own)


def point_weights(location: Location, nodes: int) -> Sparse:
    """Weights (m, k) csr of the k nodes of a master in the points of a location on it."""
    m, r = location.weights.shape
    entries = (location.weights.ravel(), (np.repeat(np.arange(m), r), location.nodes.ravel()))
    found = sp.csr_array(entries, shape=(m, nodes))
    found.eliminate_zeros()
    return found


def _values_of_basis(facets: SlaveFacets, count: int) -> Sparse:
    """ũ = T u: T (m, m) csr, the identity but at the middles of facets whose basis was changed."""
    rows, columns, values = [np.arange(count)], [np.arange(count)], [np.ones(count)]
    for kind, block in facets.blocks.items():
        own = facets.own[block]
        change = changed_basis(kind, own >= 0)
        for middle, corners in MIDDLES.get(kind, {}).items():
            taking = own[:, middle] >= 0
            left = change[:, middle, middle]
            values[0][own[taking, middle]] = 1.0 / left[taking]
            for corner in corners:
                both = np.flatnonzero(taking & (own[:, corner] >= 0))
                rows.append(own[both, middle])
                columns.append(own[both, corner])
                values.append(-change[both, corner, middle] / left[both])
    row, column, value = (np.concatenate(part) for part in (rows, columns, values))
    # An edge is met in both its facets.
    _, once = np.unique(row * count + column, return_index=True)
    return sp.csr_array((value[once], (row[once], column[once])), shape=(count, count))


def _shares(facets: SlaveFacets, kind: str) -> tuple[IntArray, Array, Array]:
    """Numbers (f, r) of the nodes that take part, S (f, r, r) and ∫φ̃ dA (f, r) of facets of a kind."""
    own = facets.own[facets.blocks[kind]]
    change = changed_basis(kind, own >= 0)
    return own, change, np.einsum("fij,fj->fi", change, facets.integrals[kind])


def _areas(facets: SlaveFacets, count: int, *, whole: bool = True) -> Array:
    """A_i (m,) [m²]; without ``whole`` only what belongs to facets some of whose nodes do not take part."""
    total = np.zeros(count)
    for kind in facets.blocks:
        own, _, share = _shares(facets, kind)
        taking: BoolArray = own >= 0
        if not whole:
            taking = taking & ~taking.all(axis=1, keepdims=True)
        np.add.at(total, own[taking], share[taking])
    return total


def _integrated(
    facets: SlaveFacets,
    positions: Array,
    location: Location,
    master: Curve | FacetSurface,
    displacement: Array | None,
) -> tuple[Sparse, Array]:
    """∫ ψ_i φ_l dA (m, k) csr [m²] and ∫ ψ_i g dA (m,) [m³] over the facets all of whose nodes take part."""
    shape = (len(positions), master.node_count)
    gaps = np.zeros(len(positions))
    found_so_far: list[Sparse] = []
    current = master.positions if displacement is None else master.positions + displacement
    cut_by = outlines(master, current)
    for kind in facets.blocks:
        own, change, share = _shares(facets, kind)
        whole = np.flatnonzero(np.all(own >= 0, axis=1) & facets.integrals[kind].any(axis=1))
        for part in np.array_split(whole, max(1, -(-len(whole) // TOGETHER))):
            if not len(part):
                continue
            nodes = own[part]
            corners = positions[nodes]
            points = pieces(kind, corners, location.point[nodes].mean(axis=1), cut_by)
            values, slopes = shape_functions(kind, points.local)
            at = np.einsum("qr,qrd->qd", values, corners[points.owner])
            weight = points.weight * stretch(slopes, corners[points.owner])
            outward = facet_normals(positions, nodes, kind)[points.owner]
            found = places_below(master, at, outward, displacement, location.facet[nodes[points.owner, 0]])
            element, weights = element_weights(master, found, at, current)
            below = np.einsum("qr,qrd->qd", weights, current[element])
            gap = np.sum(found.normal * (at - below), axis=1)
            dual = _dual(change[part], share[part], values, weight, points.owner)
            row = nodes[points.owner]
            entries = (dual[:, :, None] * weights[:, None, :]).ravel()
            rows = np.repeat(row, weights.shape[1], axis=1).ravel()
            columns = np.repeat(element[:, None, :], row.shape[1], axis=1).ravel()
            found_so_far.append(sp.csr_array((entries, (rows, columns)), shape=shape).tocoo())
            np.add.at(gaps, row, dual * gap[:, None])
    return total_of(found_so_far, shape), gaps


def total_of(parts: list[Sparse], shape: tuple[int, int]) -> Sparse:
    """The sum csr of coo matrices, taken once: one after the other would take the time of their number squared."""
    none = np.zeros(0, dtype=np.int64)
    rows = np.concatenate([none, *(part.row for part in parts)])
    columns = np.concatenate([none, *(part.col for part in parts)])
    values = np.concatenate([np.zeros(0), *(part.data for part in parts)])
    return sp.csr_array((values, (rows, columns)), shape=shape)


def _dual(change: Array, share: Array, values: Array, weight: Array, owner: IntArray) -> Array:
    """ψ_i dA (q, r) at the points of facets (f,), from S (f, r, r), ∫φ̃ (f, r), φ (q, r) and dA (q,).

    Biorthogonal in this very quadrature, so that matching meshes are coupled node to node, and scaled to the integrals
    over the whole facet where a rim of it was not covered.
    """
    changed = np.einsum("qij,qj->qi", change[owner], values)
    gram = np.zeros(change.shape)
    np.add.at(gram, owner, weight[:, None, None] * changed[:, :, None] * changed[:, None, :])
    coefficients = share[:, :, None] * np.linalg.inv(gram)
    return weight[:, None] * np.einsum("qij,qj->qi", coefficients[owner], changed)


def stretch(slopes: Array, corners: Array) -> Array:
    """dA/dξ (q,) of elements with corners (q, r, d), slopes (e, q, r)."""
    tangents = np.einsum("eqr,qrd->eqd", slopes, corners)
    if len(tangents) == 1:
        return np.linalg.norm(tangents[0], axis=1)
    return np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=1)
