"""Supports of a case as constraints on freedoms, and ties between bodies as a transformation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.points import BoundaryRef, PointRef
from ..case.schema import Rotation
from ..case.schema import Tie as TieCase
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..contact.held_ties import led_by_supports
from ..contact.tie_mortar import weighted
from ..contact.ties import Bond, check_facing, tie_transformation
from ..contact.ties import tie as tie_weights
from ..errors import CaseError
from ..mesh.boundary import facets_within, require_boundary
from ..mesh.facets import nodal_normals
from ..mesh.model import Blocks, Mesh
from ..typing import Array, BoolArray, IntArray, Sparse
from .bodies import BuiltBody
from .motion import Constraint, columns
from .sameness import Itself
from .view import nearest_node

_DIRECTIONS = {"x": 0, "y": 1, "z": 2}


def boundary_nodes(body: BuiltBody, at: BoundaryRef, where: str) -> IntArray:
    """Nodes of a boundary or a node set of a meshed body. Raises CaseError listing those that exist."""
    assert body.mesh is not None, "checked: only meshed bodies have boundaries"
    if at.boundary in body.mesh.node_sets and at.boundary not in body.mesh.boundaries:
        return body.mesh.node_sets[at.boundary]
    require_boundary(body.mesh, at.boundary, where)
    return body.mesh.boundary_nodes(at.boundary)


def constraints_of(case: Case, bodies: dict[str, BuiltBody]) -> list[Constraint]:
    """Every support as freedoms held. Raises CaseError where two supports prescribe different velocities."""
    found: list[Constraint] = []
    taken: dict[int, tuple[str, float, float]] = {}
    for name, support in case.supports.items():
        where = f"supports.{name}"
        at = case.location(support.at, where=f"{where}.at")
        body = bodies[at.body]
        nodes = _held_nodes(body, at, f"{where}.at")
        freedoms: list[int] = []
        velocity: list[float] = []
        displacement: list[float] = []
        lacking = set() if body.lacking is None else set((body.offset + body.lacking).tolist())
        moved = 0
        for direction in support.fixed:
            if direction == "rotation":
                along = body.rotations_of(nodes)
                if not len(along):
                    accepted = f"the matrices of {at.body} name no rotation there (freedoms 4 to 6 of a node)"
                    raise CaseError(f"{where}.fixed", direction, accepted)
            else:
                along = body.offset + body.stride * nodes + _DIRECTIONS[direction]
            speed = float(support.velocity.get(direction, 0.0))
            distance = float(support.displacement.get(direction, 0.0))
            for freedom in along.tolist():
                if freedom in lacking:
                    moved += bool(speed or distance)
                    continue
                other, held, held_distance = taken.setdefault(freedom, (name, speed, distance))
                if other == name:
                    freedoms.append(freedom)
                    velocity.append(speed)
                    displacement.append(distance)
                elif held != speed or held_distance != distance:
                    two = f"displacements, {held_distance:g} and {distance:g} m"
                    if held != speed:
                        two = f"velocities, {held:g} and {speed:g} m/s"
                    node = body.points[(freedom - body.offset) // body.stride]
                    accepted = (
                        f"{direction} of the node at ({', '.join(f'{x:.6g}' for x in node)}) m, shared with "
                        f"supports.{other}, gets two {two}; let one of them hold it"
                    )
                    raise CaseError(f"{where}.fixed", support.fixed, accepted)
        if moved:
            accepted = (
                f"cannot be moved: the matrices of {at.body} lack {moved} of its freedoms, held by the program that "
                "wrote them; write them without that support, or let the material slide (sliding)"
            )
            key = "velocity" if support.velocity else "displacement"
            raise CaseError(f"{where}.{key}", dict(getattr(support, key)), accepted)
        found.append(Constraint(name, tuple(freedoms), tuple(velocity), tuple(displacement)))
    for name, body in bodies.items():
        if body.lacking is not None and len(body.lacking):
            freedoms = (body.offset + body.lacking).tolist()
            found.append(Constraint(f"bodies.{name}", tuple(freedoms), (0.0,) * len(freedoms)))
    return found


def _held_nodes(body: BuiltBody, at: PointRef | BoundaryRef, where: str) -> IntArray:
    if isinstance(at, BoundaryRef):
        return boundary_nodes(body, at, where)
    if body.beam is None:
        return np.array([nearest_node(body, at)])
    node = body.beam.node_at(at.distance)
    if node is None:
        raise CaseError(where, at.distance, "no mesh node there")
    return np.array([node])


def master_surface(mesh: Mesh, boundary: str, where: str) -> tuple[Curve | FacetSurface, IntArray]:
    """A boundary as a surface to slide or be bonded on, and the mesh nodes (k,) in the order of its own numbering."""
    facets = require_boundary(mesh, boundary, where)
    if mesh.dimension == 2:
        curve = Curve.from_facets(mesh.points, facets, where=where)
        return curve, curve.nodes
    surface = FacetSurface.from_facets(mesh.points, facets, where=where)
    return surface, surface.nodes


@dataclass(frozen=True)
class Tied:
    """T (N, N) with u = T u_independent; freedoms that follow (f,); by which shares (N, N) masses follow, None where
    those of T do. words: warnings. repeats: the bonds of bodies that repeat."""

    matrix: Sparse
    followers: IntArray
    shares: Sparse | None = None
    words: tuple[str, ...] = ()
    repeats: tuple[Bond, ...] = ()

    def within(self, matrix: Sparse) -> Sparse:
        """TᵀAT (N, N) csr. Few rows of a large A know of a tie: the others stay as they are."""
        follows = np.zeros(matrix.shape[0], dtype=bool)
        follows[self.followers] = True
        met = np.searchsorted(matrix.indptr, np.flatnonzero(follows[matrix.indices]), side="right") - 1
        changed = np.unique(np.concatenate([self.followers, self.matrix[self.followers].indices, met]))
        order = np.arange(matrix.shape[0])
        order[changed] = matrix.shape[0] + np.arange(len(changed))
        new = sp.csr_array(self.matrix.T)[changed] @ matrix @ self.matrix
        found = sp.csr_array(sp.vstack([matrix, new], format="csr")[order])
        found.eliminate_zeros()
        found.sort_indices()
        return found

    def mass(self, mass: Sparse) -> Sparse:
        """TᵀMT, for a diagonal mass diagonal again: each node's mass goes to its leaders in their shares."""
        if np.any(mass.tocoo().row != mass.tocoo().col):
            return sp.csr_array(self.matrix.T @ mass @ self.matrix)
        share = abs(self.matrix) if self.shares is None else self.shares
        total = np.asarray(share.sum(axis=1)).ravel()
        share = sp.diags_array(1.0 / np.where(total > 0, total, 1.0)) @ share
        return sp.csr_array(sp.diags_array(share.T @ mass.diagonal()))


def tie_matrix(
    case: Case, bodies: dict[str, BuiltBody], total: int, constraints: Sequence[Constraint]
) -> Tied | None:
    """Ties between bodies, and of bodies that repeat with themselves; None without ties.

    Slave freedoms that a support holds stay with their support, and hold their leaders.
    """
    if not case.ties:
        return None
    names = {f: _path(c) for c in constraints for f in c.freedoms}
    held = np.zeros(total, dtype=bool)
    held[list(names)] = True
    alone = held | _slaves_twice(case, bodies, total)
    bonds: list[Bond] = []
    repeats: list[Bond] = []
    words: list[str] = []
    repeated: set[int] = set()
    for name, tie in case.ties.items():
        bond, said = _bond(case, bodies, f"ties.{name}", tie, alone)
        words += said
        if bond.rotation is not None:
            _refuse_rotated_motion(bond, constraints)
        if tie.translation is not None:
            # A corner of a body that repeats in two directions follows by one of them; the other is implied.
            again = np.array([bool(repeated.intersection(row)) for row in bond.slave.tolist()], dtype=bool)
            bond = bond.only(~again)
            repeated.update(bond.slave.ravel().tolist())
        bonds.append(bond)
        if tie.translation is not None or tie.rotation is not None:
            repeats.append(bond)
    moving = columns(list(constraints))
    prescribed = np.zeros((total, len(moving)))
    for number, column in enumerate(moving):
        prescribed[list(column.freedoms), number] = column.values
    tied = np.unique(np.concatenate([b.slave.ravel() for b in bonds]))
    matrix, followers = led_by_supports(tie_transformation(total, bonds), tied, held, prescribed, names)
    if all(bond.rotation is None for bond in bonds):
        return Tied(matrix, followers, words=tuple(words), repeats=tuple(repeats))
    shares = tie_transformation(total, [bond.shares for bond in bonds], checked=False)
    changed = np.setxor1d(followers, tied)
    if len(changed):
        # What supports hold, and the leaders that are held by it, share as they move.
        keep = np.ones(total)
        keep[changed] = 0.0
        led = np.zeros(total)
        led[changed] = 1.0
        shares = sp.csr_array((sp.diags_array(keep) @ shares + sp.diags_array(led)) @ _shared(matrix, changed))
    return Tied(matrix, followers, shares, tuple(words), tuple(repeats))


def tied_by(case: Case, bodies: Mapping[str, BuiltBody], constraints: Sequence[Constraint]) -> tuple[object, ...]:
    """All that `tie_matrix` follows from, to compare with that of a like case: of bodies their places among the
    freedoms, and the meshes themselves, which are the same where nothing of them differs."""
    if not case.ties:
        return ()
    meshes = tuple((name, body.offset, body.size, Itself(body.mesh)) for name, body in bodies.items())
    boundaries = tuple(case.location(at) for tie in case.ties.values() for at in (tie.slave, tie.master))
    return dict(case.ties), boundaries, meshes, tuple(constraints)


def _shared(matrix: Sparse, changed: IntArray) -> Sparse:
    """Identity but for the rows of the changed freedoms: sizes of theirs in T, of sum one."""
    total = matrix.shape[0]
    keep = np.ones(total)
    keep[changed] = 0.0
    size = abs(matrix)
    along = np.asarray(size.sum(axis=1)).ravel()
    part = np.where(keep == 0.0, 1.0 / np.where(along > 0.0, along, 1.0), 0.0)
    return sp.csr_array(sp.diags_array(keep) + sp.diags_array(part) @ size)


def _path(constraint: Constraint) -> str:
    return constraint.name if constraint.name.startswith("bodies.") else f"supports.{constraint.name}"


def _slaves_twice(case: Case, bodies: dict[str, BuiltBody], total: int) -> BoolArray:
    """Which freedoms (N,) are slaves of more than one tie, or of one and on the side that another repeats."""
    times = np.zeros(total, dtype=np.int64)
    for name, tie in case.ties.items():
        # What repeats at the slave's corner must begin alike at the master's.
        repeats = tie.translation is not None or tie.rotation is not None
        for side in ("slave", "master") if repeats else ("slave",):
            at = case.location(getattr(tie, side))
            assert isinstance(at, BoundaryRef), "checked"
            body = bodies[at.body]
            times[np.unique(body.displacements(boundary_nodes(body, at, f"ties.{name}.{side}")))] += 1
    return times > 1


def _bond(
    case: Case, bodies: dict[str, BuiltBody], where: str, tie: TieCase, alone: BoolArray
) -> tuple[Bond, list[str]]:
    """Slave nodes with their leaders, sought where the slave would be on the master's side, and warnings.

    alone (N,): freedoms whose nodes follow the point below them and are not weighted with their neighbours.
    """
    slave_at, master_at = case.location(tie.slave), case.location(tie.master)
    assert isinstance(slave_at, BoundaryRef), "checked"
    assert isinstance(master_at, BoundaryRef), "checked"
    slave, master = bodies[slave_at.body], bodies[master_at.body]
    nodes = boundary_nodes(slave, slave_at, f"{where}.slave")
    assert master.mesh is not None, "checked: boundaries belong to meshes"
    surface, master_nodes = master_surface(master.mesh, master_at.boundary, f"{where}.master")
    edge = _edge(master.points[master_nodes])
    tolerance = tie.tolerance if tie.tolerance is not None else 0.05 * edge
    points, rotation = slave.points[nodes], None
    assert slave.mesh is not None, "checked: boundaries belong to meshes"
    normals = _outward(slave.mesh, slave_at.boundary, nodes)
    if tie.translation is not None:
        points = points - np.array(tie.translation)
    elif tie.rotation is not None:
        rotation, centre = turn_of(tie.rotation, slave.dimension)
        points = (points - centre) @ rotation + centre  # Rᵀ(x − c) + c, row by row
        normals = normals @ rotation
    weights = tie_weights(points, surface, where=where, tolerance=tolerance)
    check_facing(points, normals, surface, weights, where=where, limit=max(edge, _edge(slave.points[nodes])))
    facets = _facets_between(slave.mesh, slave_at.boundary, nodes)
    single: BoolArray = np.any(alone[slave.displacements(nodes)], axis=1)
    bonded = weighted(weights, points, facets, surface, single, tolerance)
    words: list[str] = []
    if bonded.uncovered:
        words.append(
            f"{where}: {bonded.uncovered} of {len(nodes)} slave nodes belong to facets that the master does not cover; "
            "each follows the point below it, which passes no even stress where meshes differ"
        )
    weights = bonded.tie
    bond = Bond(where, weights, slave.displacements(nodes), master.displacements(master_nodes), rotation)
    own = (bond.master[weights.nodes] == bond.slave[:, None, :]).any(axis=2) & (weights.weights != 0.0)
    if own.any():
        at = ", ".join(f"{x:.6g}" for x in slave.points[nodes[int(np.argmax(own.any(axis=1)))]])
        accepted = f"the node at ({at}) m would follow itself: it lies on the axis; tie boundaries without it"
        raise CaseError(where, None, accepted)
    return bond, words


def turn_of(rotation: Rotation, dimension: int) -> tuple[Array, Array]:
    """R (d, d) and a point (d,) [m] of the axis of a turn (Rodrigues' formula)."""
    angle, axis = math.radians(rotation.angle_deg), np.array(rotation.axis)
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    cosine, sine = (0.0 if abs(v) < 1e-15 else v for v in (math.cos(angle), math.sin(angle)))
    full = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    full[np.abs(full) < 1e-15] = 0.0
    centre = np.zeros(dimension) if rotation.centre is None else np.array(rotation.centre)
    return full[:dimension, :dimension], centre


def _refuse_rotated_motion(bond: Bond, constraints: Sequence[Constraint]) -> None:
    moving = [c for c in constraints if c.moves or any(c.displacement)]
    moved = {c.name for c in moving if np.isin(c.freedoms, bond.slave).any()}
    if moved:
        accepted = (
            f"supports.{min(moved)} moves nodes of the slave in a direction of its own, which does not turn with the "
            "rotation; let the material slide (sliding) instead"
        )
        raise CaseError(f"{bond.where}.slave", None, accepted)


def _facets_between(mesh: Mesh, boundary: str, nodes: IntArray) -> Blocks:
    """Facets of a boundary, or whole sides within a node set, in the order of its nodes (s,)."""
    facets = mesh.boundaries.get(boundary)
    if facets is None:
        facets = facets_within(mesh.cells, mesh.points, mesh.node_sets[boundary])
    number = np.full(len(mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    return {kind: number[np.asarray(block)] for kind, block in facets.items() if len(block)}


def _outward(mesh: Mesh, boundary: str, nodes: IntArray) -> Array:
    """Outward unit normals (s, d) at nodes of a boundary, or of the whole sides within a node set; NaN elsewhere."""
    facets = mesh.boundaries.get(boundary)
    if facets is None:
        facets = facets_within(mesh.cells, mesh.points, mesh.node_sets[boundary])
    if not facets:
        return np.full((len(nodes), mesh.dimension), np.nan)
    normals = np.full(mesh.points.shape, np.nan)
    found = np.unique(np.concatenate([f.ravel() for f in facets.values()]))
    normals[found] = nodal_normals(mesh.points, facets)[found]
    return normals[nodes]


def _edge(points: Array) -> float:
    """A typical distance between neighbouring nodes [m]."""
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(points).query(points, k=2)
    return float(np.median(distances[:, 1]))
