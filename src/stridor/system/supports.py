"""Supports of a case as constraints on freedoms, and ties between bodies as a transformation."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.points import BoundaryRef, PointRef
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..contact.ties import Bond, Tie, tie_transformation
from ..contact.ties import tie as tie_weights
from ..errors import CaseError
from ..mesh.boundary import require_boundary
from ..mesh.model import Mesh
from ..typing import Array, IntArray, Sparse
from .bodies import BuiltBody
from .model import Constraint
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
        at = case.place(support.at, where=f"{where}.at")
        body = bodies[at.body]
        nodes = _held_nodes(body, at, f"{where}.at")
        freedoms: list[int] = []
        velocity: list[float] = []
        displacement: list[float] = []
        lacking = set() if body.lacking is None else set((body.offset + body.lacking).tolist())
        moved = 0
        for direction in support.fixed:
            place = body.stride - 1 if direction == "rotation" else _DIRECTIONS[direction]
            speed = float(support.velocity.get(direction, 0.0))
            distance = float(support.displacement.get(direction, 0.0))
            for freedom in (body.offset + body.stride * nodes + place).tolist():
                if freedom in lacking:
                    moved += bool(speed or distance)
                    continue
                other, held, away = taken.setdefault(freedom, (name, speed, distance))
                if other == name:
                    freedoms.append(freedom)
                    velocity.append(speed)
                    displacement.append(distance)
                elif held != speed or away != distance:
                    two = f"displacements, {away:g} and {distance:g} m"
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


def tie_matrix(case: Case, bodies: dict[str, BuiltBody], total: int, held: set[int]) -> tuple[Sparse, IntArray] | None:
    """T (N, N) with u = T u_independent, and the freedoms that follow; None without ties.

    Freedoms that a support holds stay with their support.
    """
    if not case.ties:
        return None
    bonds: list[Bond] = []
    for name, tie in case.ties.items():
        where = f"ties.{name}"
        slave_at, master_at = case.place(tie.slave), case.place(tie.master)
        assert isinstance(slave_at, BoundaryRef), "checked"
        assert isinstance(master_at, BoundaryRef), "checked"
        slave, master = bodies[slave_at.body], bodies[master_at.body]
        nodes = boundary_nodes(slave, slave_at, f"{where}.slave")
        assert master.mesh is not None, "checked: boundaries belong to meshes"
        surface, master_nodes = master_surface(master.mesh, master_at.boundary, f"{where}.master")
        tolerance = tie.tolerance if tie.tolerance is not None else 0.05 * _edge(master.points[master_nodes])
        bond = Bond(
            where,
            tie_weights(slave.points[nodes], surface, where=where, tolerance=tolerance),
            slave.displacements(nodes),
            master.displacements(master_nodes),
        )
        bonds.append(_free_of_supports(bond, held))
    return tie_transformation(total, bonds), np.unique(np.concatenate([b.slave.ravel() for b in bonds]))


def _free_of_supports(bond: Bond, held: set[int]) -> Bond:
    """The bond without nodes that a support holds in a direction in which their leaders are free.

    Where the leaders are held as well, as on a plane of symmetry, the node follows them and is held so.
    """
    is_held = np.vectorize(held.__contains__, otypes=[bool])
    if not held:
        return bond
    leaders = bond.master[bond.tie.nodes]  # (s, r, d)
    leading = is_held(leaders) | (bond.tie.weights == 0.0)[:, :, None]
    conflict = np.any(is_held(bond.slave) & ~leading.all(axis=1), axis=1)
    keep = ~conflict
    if len(keep) and not keep.any():
        accepted = (
            f"bonds nothing: supports hold all of its {len(keep)} slave nodes, and a held node cannot follow as well; "
            "exchange slave and master, or support the master's body instead"
        )
        raise CaseError(bond.where, None, accepted)
    tie = Tie(bond.tie.nodes[keep], bond.tie.weights[keep], bond.tie.point[keep], bond.tie.distance[keep])
    return Bond(bond.where, tie, bond.slave[keep], bond.master)


def _edge(points: Array) -> float:
    """A typical distance between neighbouring nodes [m]."""
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(points).query(points, k=2)
    return float(np.median(distances[:, 1]))


def tied_mass(mass: Sparse, tie: Sparse) -> Sparse:
    """TᵀMT, for a diagonal mass diagonal again: each node's mass goes to its leaders in their shares."""
    if np.all(mass.tocoo().row == mass.tocoo().col):
        share = abs(tie)
        total = np.asarray(share.sum(axis=1)).ravel()
        share = sp.diags_array(1.0 / np.where(total > 0, total, 1.0)) @ share
        return sp.csr_array(sp.diags_array(share.T @ mass.diagonal()))
    return sp.csr_array(tie.T @ mass @ tie)
