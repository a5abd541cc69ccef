"""Bonded surfaces whose meshes do not match: slave nodes follow the master by its own interpolation.

A slave node on a facet moves as the facet does at that place. Since the weights interpolate positions as well, any
motion linear in the coordinates, a rotation or a constant strain, is carried over exactly. A node beside the master by
a distance δ is an exception: a rotation θ then strains the slave by θ δ at that node. `NodeTies.point` says where to
move such nodes before the matrices are made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..errors import CaseError
from ..typing import Array, BoolArray, IntArray, Sparse
from .curve import Curve
from .facets import FacetSurface
from .interpolation import LINEAR
from .master import MasterSurface
from .projection import line3, nearest_on_faces, project_on_lines

CANDIDATES = 3
CHAIN_DOUBLINGS = 12
SAME = 1e-6  # difference of weights that two bonds of one node may have: rounding of mesh files
_SAME_DIRECTION = 0.5  # cosine between outward normals above which surfaces do not face each other


@dataclass(frozen=True)
class NodeTies:
    """s slave nodes on a master: displacement of the slave = Σ weights · displacement of nodes.

    nodes (s, r) in the master's numbering and weights (s, r), unused places holding node 0 with weight 0; point (s, d)
    [m] the places on the master, distance (s,) [m] of the slave nodes from them.
    """

    nodes: IntArray
    weights: Array
    point: Array
    distance: Array


@dataclass(frozen=True)
class Bond:
    """A tie between freedoms of a structure: slave (s, d) and master (k, d) indices of the displacements of the nodes.

    where names it in messages. rotation R (d, d) turns what the master does into what the slave does, u_s = R Σ w u_m:
    that which turns the master's face onto the slave's in a structure that repeats round an axis; None where both move
    alike.
    """

    where: str
    tie: NodeTies
    slave: IntArray
    master: IntArray
    rotation: Array | None = None

    def only(self, keep: BoolArray) -> Bond:
        """The bond of some of its slave nodes (s,)."""
        tie = self.tie
        kept = NodeTies(tie.nodes[keep], tie.weights[keep], tie.point[keep], tie.distance[keep])
        return replace(self, tie=kept, slave=self.slave[keep])

    @property
    def shares(self) -> Bond:
        """The bond by which masses of the slave's nodes go to their leaders: weights without sign that add up to one,
        and squares of the rotation's components, whose rows and columns both do, so that a mass stays the same in all
        directions."""
        weights = np.abs(self.tie.weights)
        weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
        rotation = None if self.rotation is None else self.rotation**2
        return replace(self, tie=replace(self.tie, weights=weights), rotation=rotation)


def tie(slave_points: Array, master: MasterSurface, *, where: str, tolerance: float) -> NodeTies:
    """Places of slave points (s, d) [m] on the undisplaced master, as its facets interpolate.

    The facets themselves count, straight or quadratic, not the spline through their nodes. Raises CaseError naming
    ``where`` for a slave point farther than ``tolerance`` [m] from the master, over its edges included, and for a
    master without nodes.
    """
    if master.node_count == 0:
        raise CaseError(where, None, "nothing can be tied to an obstacle; fix those nodes by a support instead")
    if isinstance(master, Curve):
        nodes, weights = _on_lines(slave_points, master)
    else:
        location = master.locate(slave_points)
        nodes, weights = location.nodes, location.weights
        if isinstance(master, FacetSurface) and not set(master.kinds) <= set(LINEAR):
            nodes, weights = nearest_on_faces(slave_points, master, location.facet)
        # Not the location's point: of sharp edges and corners that one belongs to the gap, this one to the weights.
    positions = _positions(master)
    point = np.einsum("sr,srd->sd", weights, positions[nodes])
    distance = np.linalg.norm(slave_points - point, axis=1)
    far = np.flatnonzero(distance > tolerance)
    if len(far):
        worst = int(np.argmax(distance))
        at = ", ".join(f"{x:.6g}" for x in slave_points[worst])
        count = f"{len(far)} of {len(distance)} slave nodes are"
        accepted = (
            f"{count} farther than {tolerance:.3g} m from the master, the farthest by {distance[worst]:.3g} m at "
            f"({at}) m; tie only nodes that lie on it, or set a larger tolerance"
        )
        raise CaseError(where, None, accepted)
    return NodeTies(nodes, weights, point, distance)


def check_facing(
    slave_points: Array, slave_normals: Array, master: MasterSurface, found: NodeTies, *, where: str, limit: float
) -> None:
    """Raise CaseError naming ``where`` unless the slave nodes (s, d) [m] with outward unit normals (s, d), NaN where a
    node has none, face the master, and lie within ``limit`` [m] of their places on it: an element, whatever tolerance
    is given.

    A bond over more than an element is none: rotations would strain it by the distance times their angle. Bodies are
    bonded where their outward normals oppose; within 60° of the same direction they turn their backs on each other.
    """
    distance = found.distance
    if np.any(distance > limit):
        worst = int(np.argmax(distance))
        at = ", ".join(f"{x:.6g}" for x in slave_points[worst])
        accepted = (
            f"the slave node at ({at}) m is {distance[worst]:.3g} m from the master, more than an element "
            f"({limit:.3g} m); a tie bonds surfaces that touch: bring them together, or set a smaller tolerance"
        )
        raise CaseError(where, None, accepted)
    along = np.sum(slave_normals * master.locate(slave_points).normal, axis=1)
    wrong = np.flatnonzero(along > _SAME_DIRECTION)
    if len(wrong):
        at = ", ".join(f"{x:.6g}" for x in slave_points[wrong[0]])
        accepted = (
            f"at {len(wrong)} of {len(along)} slave nodes both surfaces face the same way, first at ({at}) m; a tie "
            "bonds surfaces that face each other: is it the boundary on the other side of a body?"
        )
        raise CaseError(where, None, accepted)


def tie_transformation(total: int, bonds: Sequence[Bond], *, checked: bool = True) -> Sparse:
    """T (N, N) csr of u = T u_independent on N = ``total`` freedoms: identity but for the rows of tied ones.

    The columns of tied freedoms are empty. Matrices become Tᵀ M T, forces Tᵀ f; rows and columns of tied freedoms are
    then empty and to be dropped. A master node that is itself tied elsewhere is followed on to what it hangs on, and a
    node that is slave in two bonds follows the first, if the second then says the same. Raises CaseError where it does
    not, with ``checked``, and for nodes that hang on nothing but each other.
    """
    owner = np.full(total, -1)
    rows: list[IntArray] = []
    columns: list[IntArray] = []
    values: list[Array] = []
    again: list[tuple[int, IntArray]] = []  # bond, nodes that are tied already
    for number, bond in enumerate(bonds):
        first = _claim(bond, number, owner)
        if not first.all():
            again.append((number, np.flatnonzero(~first)))
        row, column, value = _entries(bond.only(first))
        rows.append(row)
        columns.append(column)
        values.append(value)
    tied = owner >= 0
    free = np.flatnonzero(~tied)
    # Long integers would pass on to every matrix of the system, which is a third larger and slower with them.
    short = np.int32 if total <= np.iinfo(np.int32).max else np.int64
    transformation = sp.csr_array(
        (
            np.concatenate([np.ones(len(free)), *values]),
            (np.concatenate([free, *rows]).astype(short), np.concatenate([free, *columns]).astype(short)),
        ),
        shape=(total, total),
    )
    transformation.eliminate_zeros()
    for _ in range(CHAIN_DOUBLINGS):
        if not np.any(tied[transformation.indices]):
            for number, nodes in again if checked else ():
                _check_again(bonds, number, nodes, transformation, owner)
            return transformation
        transformation = sp.csr_array(transformation @ transformation)
        transformation.eliminate_zeros()
    hanging = owner[np.unique(transformation.indices[tied[transformation.indices]])]
    names = [bonds[k].where for k in np.unique(hanging)]
    raise CaseError(
        names[0],
        None,
        f"nodes hang on nothing but each other in a circle of ties: {', '.join(names)}; exchange slave and master",
    )


def _entries(bond: Bond) -> tuple[IntArray, IntArray, Array]:
    """Rows, columns and values of what slaves do by what their leaders do."""
    r, d = bond.tie.weights.shape[1], bond.slave.shape[1]
    if bond.rotation is None:
        row = np.repeat(bond.slave[:, None, :], r, axis=1).ravel()
        return row, bond.master[bond.tie.nodes].ravel(), np.repeat(bond.tie.weights[:, :, None], d, axis=2).ravel()
    shape = (len(bond.slave), r, d, d)  # slave node, leader, component of the slave, of the leader
    row = np.broadcast_to(bond.slave[:, None, :, None], shape).ravel()
    column = np.broadcast_to(bond.master[bond.tie.nodes][:, :, None, :], shape).ravel()
    return row, column, (bond.tie.weights[:, :, None, None] * bond.rotation).ravel()


def _claim(bond: Bond, number: int, owner: IntArray) -> BoolArray:
    """Enter the slaves of a bond as tied; which (s,) were not yet."""
    _, once = np.unique(bond.slave[:, :1], return_index=True)
    first = np.zeros(len(bond.slave), dtype=bool)
    first[once] = True
    first &= ~(owner[bond.slave] >= 0).any(axis=1)
    owner[bond.slave[first]] = number
    return first


def _check_again(
    bonds: Sequence[Bond], number: int, nodes: IntArray, transformation: Sparse, owner: IntArray
) -> None:
    """Raise CaseError unless nodes of a bond that are tied already do by that what this bond says, and where that is so
    of all of them: the bond is there twice."""
    bond = bonds[number]
    keep = np.zeros(len(bond.slave), dtype=bool)
    keep[nodes] = True
    bond = bond.only(keep)
    row, column, value = _entries(bond)
    said = sp.csr_array((value, (row, column)), shape=transformation.shape) @ transformation
    freedoms = np.unique(bond.slave)
    off = abs(sp.csr_array(said[freedoms] - transformation[freedoms])).max(axis=1).toarray().ravel() > SAME
    wrong = np.isin(bond.slave, freedoms[off]).any(axis=1)
    if wrong.any():
        node = int(np.argmax(wrong))
        at = ", ".join(f"{x:.6g}" for x in bond.tie.point[node])
        other = int(owner[bond.slave[node]].max())
        by = f"also by {bonds[other].where}, to something else" if other != number else "twice, to different places"
        accepted = "a node may be slave of two ties only if both say the same of it, leave it out of one of them"
        raise CaseError(bond.where, None, f"the node at ({at}) m is tied {by}; {accepted}")
    if keep.all():  # a slip: copied, and not changed
        others = ", ".join(bonds[k].where for k in np.unique(owner[bond.slave]))
        raise CaseError(bond.where, None, f"says nothing that {others} does not say already; leave it out")


def _positions(master: MasterSurface) -> Array:
    positions: Array = np.asarray(getattr(master, "positions"))  # noqa: B009 - not part of the protocol
    return positions


def _on_lines(points: Array, curve: Curve) -> tuple[IntArray, Array]:
    """Nodes (s, 3) and weights (s, 3) of the nearest points on the line facets of a curve."""
    corners = curve.positions[curve.facets]
    quadratic = curve.facets[:, 2] >= 0
    # A straight facet is a quadratic one with its middle half way.
    corners[~quadratic, 2] = 0.5 * (corners[~quadratic, 0] + corners[~quadratic, 1])
    count = min(CANDIDATES, len(corners))
    nearest = np.concatenate([_nearest_chords(part, corners, count) for part in _portions(points, len(corners))])
    facets = corners[nearest]  # (s, q, 3, d)
    xi = project_on_lines(points[:, None, :], facets)
    distance = np.linalg.norm(np.einsum("sqr,sqrd->sqd", line3(xi), facets) - points[:, None, :], axis=2)
    best = np.argmin(distance, axis=1)
    each = np.arange(len(points))
    facet, local = nearest[each, best], xi[each, best]
    linear = np.stack([1.0 - local, local, np.zeros_like(local)], axis=1)
    weights = np.where(quadratic[facet][:, None], line3(local), linear)
    weights[np.abs(weights) < 1e-12] = 0.0
    return np.where(weights == 0.0, 0, curve.facets[facet]), weights


def _portions(points: Array, facets: int) -> list[Array]:
    """The points in portions whose distances from all facets fit comfortably into memory."""
    return np.array_split(points, max(1, len(points) * facets // 1_000_000))


def _nearest_chords(points: Array, corners: Array, count: int) -> IntArray:
    """The ``count`` facets (s, q) whose two half chords are nearest to each point."""
    squared = np.full((len(points), len(corners)), np.inf)
    for first, second in ((0, 2), (2, 1)):
        begin, along = corners[:, first], corners[:, second] - corners[:, first]
        offset = points[:, None, :] - begin
        part = np.clip(np.sum(offset * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
        squared = np.minimum(squared, np.sum((offset - part[..., None] * along) ** 2, axis=2))
    return np.argsort(squared, axis=1)[:, :count]
