"""Contacts of a case: points on lines, surfaces on surfaces, anything on a rigid obstacle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..case import Case
from ..case.bodies import ObstacleBody, SlidingTable
from ..case.points import PointRef
from ..case.schema import Contact as ContactCase
from ..contact.curve import Curve
from ..contact.interface import Contact, Rows, pair
from ..contact.master import MasterSurface
from ..contact.obstacles import Cylinder, Flat
from ..contact.pairing import pair_surface
from ..contact.surfaces import SurfaceContact
from ..errors import CaseError
from ..mesh.boundary import require_boundary
from ..mesh.facets import nodal_areas, nodal_normals
from ..mesh.model import Blocks
from ..typing import Array, IntArray
from .motion import columns, distance_name
from .repeats import ALIKE, Repeat, master_nodes, master_rows
from .sameness import Itself, SameNumbers
from .sectors import lent_repeats, require_apart_from_images, require_same_sectors
from .seen_alike import Seen, require_seen_alike
from .view import View, point_position

OF_TABLES = ("sliding", "thickness")  # what of a body's table matters to its contacts beside the mesh


def is_point_on_line(case: Case, contact: ContactCase) -> bool:
    """Whether a contact is that of one point on a beam's line."""
    return contact.master in case.beams and isinstance(case.location(contact.slave), PointRef)


def point_contact(case: Case, view: View, name: str, contact: ContactCase) -> Contact:
    """A point on the C1 line of a beam. Raises CaseError where the point faces no part of it."""
    master = view.bodies[contact.master]
    at = case.point(contact.slave)
    position = point_position(case, view.bodies, at)
    slave, line = view.point_rows(case, contact.slave), view.node_rows(master)
    _require_same_part(case, view, name, contact, line)
    built = pair(
        name,
        slave=Rows(slave.free[:2], slave.lift[:2]),
        slave_position=position,
        master=line,
        master_positions=master.points,
        side=case.side(name),
        stiffness=np.inf if contact.stiffness == "rigid" else float(contact.stiffness),
        law=contact.friction.law_object(),
        sliding=contact.sliding,
        closed=contact.closed,
    )
    if built is None:
        raise CaseError(
            f"contacts.{name}.slave",
            contact.slave,
            f"the point ({position[0]:g}, {position[1]:g}) m lies beyond the ends of {contact.master}; "
            "move a body so that the slave faces the master line",
        )
    return replace(built, normal_lift=_overlapping(view, name, contact, built.normal_lift))


def paired_by(case: Case, view: View, name: str, contact: ContactCase) -> tuple[object, ...]:
    """All that `surface_contact` follows from, to compare with that of a like case."""
    sides = [reference.partition(".")[0] for reference in (contact.slave, contact.master)]
    tables = [case.bodies[side] for side in sides]
    own = [t if isinstance(t, ObstacleBody) else [getattr(t, key, None) for key in OF_TABLES] for t in tables]
    slave = case.location(contact.slave, where=f"contacts.{name}.slave")
    side = case.side(name) if contact.master in case.beams else 0
    # A body that is tied to others repeats as these do.
    bodies = [body for at, body in view.bodies.items() if at in sides or case.ties]
    meshes = [(body.name, body.offset, body.size, Itself(body.mesh), SameNumbers(body.points)) for body in bodies]
    rows = SameNumbers(view.free), SameNumbers(view.motion.lift), view.motion.names, columns(view.constraints)
    return contact, slave, side, own, meshes, rows, view.total, dict(case.ties), Itself(view.tie)


def surface_contact(case: Case, view: View, name: str, contact: ContactCase) -> SurfaceContact:
    """Slave nodes of a boundary, or one point, on a boundary or an obstacle."""
    where = f"contacts.{name}"
    require_apart_from_images(case, view.bodies, name, contact)
    slave_rows, position, area, normals, facets, freedoms = _slave(case, view, where, contact)
    master, master_rows = _master(case, view, where, contact, position)
    _require_same_part(case, view, name, contact, master_rows)
    slave_body = case.location(contact.slave).body
    drift = _drift(case, view, slave_body, contact.master.partition(".")[0], position)
    built = pair_surface(
        name,
        where=where,
        slave=slave_rows,
        slave_position=position,
        area=area,
        slave_normals=normals,
        master=master,
        master_rows=master_rows,
        drift=drift,
        stiffness_per_area=np.inf if contact.stiffness == "rigid" else float(contact.stiffness),
        law=contact.friction.law_object(),
        sliding=contact.sliding,
        allowed_overlap=contact.adjust or None,
        adjust=contact.adjust > 0,
        facets=facets,
        thickness=_thickness(case, slave_body, position.shape[1]),
        freedoms=freedoms,
        repeats=view.repeats,
        turn=_turn(case, view, contact) if contact.sliding == "finite" else None,
    )
    if facets is None:
        # A point stands for no area: its stiffness is in N/m, and it has no pressure.
        built = replace(built, nodes=replace(built.nodes, area=np.full(len(built.area), np.nan)))
    lift = _overlapping(view, name, contact, built.nodes.normal_lift)
    return replace(built, nodes=replace(built.nodes, normal_lift=lift, closed=(contact.closed,)))


def _overlapping(view: View, name: str, contact: ContactCase, lift: Array) -> Array:
    """The lift (…, p) of gaps with the column of the contact's interference, which closes them."""
    if contact.interference:
        lift = lift.copy()
        lift[..., view.motion.names.index(distance_name("contacts", name))] = -contact.interference
    return lift


def _slave(
    case: Case, view: View, where: str, contact: ContactCase
) -> tuple[Rows, Array, Array, Array, Blocks | None, IntArray | None]:
    """Rows (m d, n), positions (m, d), areas (m,) and outward normals (m, d) of the slave, and the facets between
    its nodes and freedoms (m, d) of their displacements, None for a point."""
    at = case.location(contact.slave, where=f"{where}.slave")
    body = view.bodies[at.body]
    d = body.dimension
    if isinstance(at, PointRef):
        rows = view.point_rows(case, contact.slave)
        position = point_position(case, view.bodies, at)[None, :]
        return Rows(rows.free[:d], rows.lift[:d]), position, np.ones(1), np.zeros((1, d)), None, None
    assert body.mesh is not None, "checked: boundaries belong to meshes"
    facets = require_boundary(body.mesh, at.boundary, f"{where}.slave")
    nodes = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    area = nodal_areas(body.points, facets, thickness=_thickness(case, at.body, d))[nodes]
    normals = nodal_normals(body.points, facets)[nodes]
    own = {kind: np.searchsorted(nodes, block) for kind, block in facets.items() if len(block)}
    return view.node_rows(body, nodes), body.points[nodes], area, normals, own, body.displacements(nodes)


def _thickness(case: Case, body: str, dimension: int) -> float:
    return float(getattr(case.bodies[body], "thickness", 1.0)) if dimension == 2 else 1.0


def _master(
    case: Case, view: View, where: str, contact: ContactCase, slave: Array
) -> tuple[MasterSurface, Rows]:
    """The surface that slave positions (m, d) [m] are to lie on, and the rows of its nodes' displacements."""
    owner = contact.master.partition(".")[0]
    table = case.bodies[owner]
    if isinstance(table, ObstacleBody):
        empty = Rows(view.pick(np.zeros(0, dtype=np.int64)).free, np.zeros((0, len(view.motion.names))))
        return _obstacle(table), empty
    body = view.bodies[owner]
    if body.beam is not None:
        # The line of a beam: outward is the side on which the slave lies, the right of the order of the nodes.
        order = np.arange(len(body.points))
        if case.side(where.partition(".")[2]) > 0:
            order = order[::-1]
        lines = np.stack([np.arange(len(order) - 1), np.arange(1, len(order))], axis=1)
        line = Curve.from_facets(body.points[order], {"line": lines}, where=f"{where}.master", follows_spline=True)
        return line, view.node_rows(body, order)
    lent = lent_repeats(case, view.bodies, contact)
    surface, nodes, turns = master_nodes(case, view.bodies, contact.master, f"{where}.master", slave, lent)
    sliding: SlidingTable | None = getattr(table, "sliding", None)
    if turns is not None and sliding is not None:
        _require_images_that_slide(where, contact, sliding, lent, body.points[nodes])
    return surface, master_rows(view, body, nodes, turns)


def is_held(case: Case, view: View, reference: str) -> bool:
    """Whether no node of a contact's boundary, point or line can move by itself."""
    body = view.bodies[reference.partition(".")[0]]
    nodes = None
    if "." in reference:
        at = case.location(reference)
        if isinstance(at, PointRef):
            return not view.point_rows(case, reference).free.nnz
        assert body.mesh is not None, "checked: boundaries belong to meshes"
        nodes = body.mesh.boundary_nodes(at.boundary)
    return not view.node_rows(body, nodes).free.nnz


def _require_same_part(case: Case, view: View, name: str, contact: ContactCase, master: Rows) -> None:
    """Raises CaseError where sides of a contact are not the same part of a whole. master: rows of all of its nodes."""
    if master.free.nnz:  # one that is held all over does not feel how many press on it
        require_same_sectors(case, view.bodies, name, contact)
    if not master.free.nnz or contact.master in case.beams:
        require_seen_alike(case, view.bodies, name, contact, partial(_seen, case, view, f"contacts.{name}", contact))


def _seen(case: Case, view: View, where: str, contact: ContactCase, places: Array) -> Seen:
    """The master below places (q, d) [m]."""
    surface, rows = _master(case, view, where, contact, places)
    sliding: SlidingTable | None = getattr(case.bodies[contact.master.partition(".")[0]], "sliding", None)
    lift = rows.lift.reshape(surface.node_count, surface.dimension, rows.lift.shape[1])
    return Seen(surface, lift, np.zeros_like if sliding is None else partial(material_velocity, sliding))


def _require_images_that_slide(
    where: str, contact: ContactCase, sliding: SlidingTable, lent: Sequence[Repeat], points: Array
) -> None:
    """Raises CaseError for a master whose images slide otherwise than its velocity says of their places. points (k, d)
    [m]: of the master."""
    own = material_velocity(sliding, points)
    for repeat in lent:
        moved, turn = repeat.moved(points, 1)
        if float(np.abs(material_velocity(sliding, moved) - own @ turn.T).max()) > ALIKE * float(np.abs(own).max()):
            accepted = (
                f"reaches over the cut of the slave {contact.slave}, which repeats (ties.{repeat.name}), and slides "
                f"otherwise than its images there. Take {contact.master} as the slave and {contact.slave} as the master"
            )
            raise CaseError(f"{where}.master", contact.master, accepted)


def _obstacle(table: ObstacleBody) -> MasterSurface:
    if table.shape == "flat":
        assert table.normal is not None, "checked: a flat has a normal"
        return Flat(np.array(table.point), np.array(table.normal))
    assert table.radius is not None, "checked: a cylinder has a radius"
    axis = None if table.axis is None else np.array(table.axis)
    return Cylinder(np.array(table.point), table.radius, axis, inside=table.inside)


def _drift(case: Case, view: View, slave: str, master: str, position: Array) -> Array:
    """Velocity (m, d, p) [m/s] of the slave's material against the master's, for each prescribed motion."""
    drift = np.zeros((*position.shape, len(view.motion.names)))
    for name, sign in ((slave, 1.0), (master, -1.0)):
        sliding = getattr(case.bodies[name], "sliding", None)
        if sliding is not None:
            drift[:, :, view.motion.names.index(name)] += sign * material_velocity(sliding, position)
    return drift


def _turn(case: Case, view: View, contact: ContactCase) -> Array | None:
    """How the master's material velocity changes from place to place (d, d, p) [1/s], for each prescribed motion; None
    where it does not."""
    name = contact.master.partition(".")[0]
    sliding: SlidingTable | None = getattr(case.bodies[name], "sliding", None)
    if sliding is None or not sliding.spin:
        return None
    d = case.dimension
    turn = np.zeros((d, d, len(view.motion.names)))
    turn[:, :, view.motion.names.index(name)] = (
        material_velocity(sliding, np.eye(d)) - material_velocity(sliding, np.zeros((1, d)))
    ).T
    return turn


def material_velocity(sliding: SlidingTable, position: Array) -> Array:
    """Velocity (m, d) [m/s] of material that slides through its mesh at positions (m, d) [m]."""
    d = position.shape[1]
    velocity = np.zeros_like(position)
    if sliding.velocity is not None:
        velocity += np.array(sliding.velocity)
    if sliding.spin:
        centre = np.zeros(d) if sliding.centre is None else np.array(sliding.centre)
        arm = position - centre
        if d == 2:
            velocity += sliding.spin * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        else:
            axis = np.array(sliding.axis) / np.linalg.norm(sliding.axis)
            velocity += sliding.spin * np.cross(axis, arm)
    return velocity
