"""Slave nodes paired with a master surface, at the start and again as they slide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from ..errors import CaseError
from ..laws.friction import FrictionLaw
from ..mesh.facets import facet_normals
from ..mesh.model import Blocks
from ..typing import Array, BoolArray, IntArray
from .coupling import SlaveFacets, coupled, point_weights
from .curve import Curve
from .facets import FacetSurface
from .interface import Rows, rounding_of, without_rounding
from .joined import joined
from .master import Location, MasterSurface
from .pieces import OPPOSED
from .rim import Hanging, hanging, over_gaps
from .surfaces import SurfaceContact, operators
from .ties import Bond


def pair_surface(
    name: str,
    *,
    where: str,
    slave: Rows,
    slave_position: Array,
    slave_normals: Array,
    area: Array,
    master: MasterSurface,
    master_rows: Rows,
    drift: Array,
    stiffness_per_area: float,
    law: FrictionLaw,
    sliding: Literal["small", "finite"] = "small",
    reach: float | None = None,
    allowed_overlap: float | None = None,
    adjust: bool = False,
    facets: Blocks | None = None,
    thickness: float = 1.0,
    freedoms: IntArray | None = None,
    repeats: Sequence[Bond] = (),
    turn: Array | None = None,
) -> SurfaceContact:
    """A surface contact of those slave nodes that the undisplaced master faces.

    slave: rows (m d, n) of m slave nodes at slave_position (m, d) [m] with outward unit normals slave_normals (m, d)
    (zero where unknown) and area (m,) [m²]; the others are those of `SurfaceContact`. A node takes part where it lies
    over the master rather than beyond its edges, where both outward normals oppose each other, and where its gap is
    at most ``reach`` [m] (None: however far, as for a cylinder on a plane).

    Overlaps up to ``allowed_overlap`` [m] count as touching and stay as negative gaps. None stands for what facets
    make of curved surfaces, 1.5 times the height h²/8R of their chords on both sides. ``adjust`` moves the contact's
    own positions of slave nodes with |gap| up to that tolerance onto the master, without strain; the bodies' meshes
    are not touched.

    facets: those between the slave nodes, by kind; in the plane of a ``thickness`` [m]. With them contacts of
    quadratic facets are weighted over facets (`coupling`), which also says what area a node stands for; without, each
    node stands by itself. freedoms (m, d) of the slave nodes' displacements, and the bonds by which bodies repeat:
    slave nodes that these make one are one node of the contact (`joined`). turn: that of `SurfaceContact`.

    Raises CaseError naming ``where`` when no node faces the master, or when nodes overlap it by more than that.
    """
    facing, location = _facing(where, slave_position, slave_normals, master, reach)
    around = None
    if facets is not None:
        over = _over_edges(facets, slave_position, slave_normals, facing, location, master, reach)
        if over is None:
            facets, facing, location = _opposed(facets, slave_position, facing, location)
        else:
            edge = facing[0]
            facets, (facing, location) = over.blocks, over.places(facing)
            if not len(facing):
                raise CaseError(where, None, _only_at_an_edge(slave_position[edge]))
        around = SlaveFacets.of(
            slave_position, facets, facing, thickness=thickness, nodal_gaps=adjust, hanging=over
        )  # fmt: skip
    d = slave_position.shape[1]
    own = (facing[:, None] * d + np.arange(d)).ravel()
    slave, area, drift = Rows(slave.free[own], slave.lift[own]), area[facing], drift[facing]
    position = slave_position[facing]
    if isinstance(master, Curve | FacetSurface):
        location = master.at_corners(location, position, slave_normals[facing])
    tolerance = allowed_overlap
    if tolerance is None:
        tolerance = overlap_tolerance(position, slave_normals[facing], master)
    # Beyond an edge the slave may well reach below the master.
    deepest = int(np.argmin(np.where(location.inside, location.gap, np.inf)))
    if location.gap[deepest] < -tolerance:
        raise CaseError(where, None, _overlapping(position, location, deepest, tolerance))
    if adjust:
        moved = np.where(np.abs(location.gap) <= tolerance, location.gap, 0.0)
        position = position - moved[:, None] * location.normal
        location = replace(location, gap=location.gap - moved)
    coupling = coupled(around, position, area, location, master)
    coupling = replace(coupling, gap=without_rounding(coupling.gap, position, *_placing(master)))
    one = joined(freedoms[facing], location.normal, repeats) if freedoms is not None and len(repeats) else None
    if one is not None:
        location = one.even(location, coupling.area)
    nodes = operators(
        name,
        slave=slave,
        slave_position=position,
        area=area,
        master_rows=master_rows,
        drift=drift,
        stiffness_per_area=stiffness_per_area,
        law=law,
        location=location,
        coupling=coupling,
        joined=one,
    )
    return SurfaceContact(
        name=name,
        slave=slave,
        slave_position=position,
        area=coupling.area,
        master=master,
        master_rows=master_rows,
        drift=drift,
        stiffness_per_area=stiffness_per_area,
        law=law,
        sliding=sliding,
        location=location,
        nodes=nodes,
        facets=around,
        joined=one,
        turn=turn,
    )


def _facing(
    where: str, position: Array, normals: Array, master: MasterSurface, reach: float | None
) -> tuple[IntArray, Location]:
    """Indices (q,) of the slave nodes that take part and their places. CaseError where there are none."""
    location = master.locate(position)
    if isinstance(master, Curve | FacetSurface):
        # In a corner which of its sides is nearer must not decide either.
        location = master.at_corners(location, position, normals)
    # A node that looks along the master is beside it: rounding must not decide.
    opposed = np.sum(normals * location.normal, axis=1) < -1e-9
    opposed |= ~np.any(normals, axis=1)
    near = location.gap <= (np.inf if reach is None else reach)
    facing = np.flatnonzero(location.inside & opposed & near)
    if not len(facing):
        raise CaseError(where, None, _never_touching(position, location, opposed, reach))
    return facing, location.only(facing)


def _opposed(
    facets: Blocks, position: Array, facing: IntArray, location: Location
) -> tuple[Blocks, IntArray, Location]:
    """Facets that face the master, and the nodes (q,) that take part and belong to one, with their places.

    A boundary may go round an edge: its nodes there take part, the facets on the other side stand for no contact.
    """
    masks = _which_oppose(facets, position, facing, location)
    if not any(keep.any() for keep in masks.values()):
        return facets, facing, location
    kept = {kind: np.asarray(facets[kind])[keep] for kind, keep in masks.items() if keep.any()}
    held = np.flatnonzero(np.isin(facing, np.concatenate([block.ravel() for block in kept.values()])))
    return kept, facing[held], location.only(held)


def _which_oppose(
    facets: Blocks, position: Array, facing: IntArray, location: Location
) -> dict[str, BoolArray]:
    """Which facets (f,) of each kind face the master with a node that takes part."""
    out = np.zeros(position.shape)
    out[facing] = location.normal
    masks: dict[str, BoolArray] = {}
    for kind, block in facets.items():
        below = out[block].sum(axis=1)
        normal = facet_normals(position, block, kind)
        masks[kind] = (np.sum(normal * below, axis=1) < OPPOSED * np.linalg.norm(below, axis=1)) & below.any(axis=1)
    return masks


def _over_edges(
    facets: Blocks,
    position: Array,
    normals: Array,
    facing: IntArray,
    location: Location,
    master: MasterSurface,
    reach: float | None,
) -> Hanging | None:
    """Facets that hang over an edge of the master, of which nodes facing (q,) lie at a location above it."""
    if not isinstance(master, Curve | FacetSurface):
        return None
    everywhere = location if len(facing) == len(position) else master.locate(position)
    between = over_gaps(facets, position, facing, master, everywhere)
    if len(facing) == len(position) and not any(each.any() for each in between.values()):
        return None
    masks = _which_oppose(facets, position, facing, location)
    if not any(keep.any() for keep in masks.values()):
        return None
    return hanging(facets, masks, position, normals, facing, master, everywhere, reach, between)


def repair(
    contact: SurfaceContact, slave_displacement: Array, master_displacement: Array
) -> tuple[SurfaceContact, IntArray]:
    """The contact paired anew where its slave nodes are now, and which of them have left the master.

    slave_displacement (m, d) and master_displacement (k, d) [m] are whole displacements from the positions the contact
    was made with, prescribed motions included. The search begins where the nodes were found last. The new operators
    are linear about the present configuration: with normal row N and reference gap g0 the gap is g0 + N u, and g0 is
    chosen so that this is exactly the present gap at the present displacement.

    Nodes (q,) that have left over an edge stay in the list, on the nearest point of that edge, so that m does not
    change; the caller has to hold them open. Nodes of facets that hung over an edge at the start have left when nothing
    of those is above the master any more. Areas are kept node by node; the drift is that of the place on the master
    where each node is now.
    """
    location = contact.master.locate(
        contact.slave_position + slave_displacement, master_displacement, guess=contact.location.facet
    )
    rim = None if contact.facets is None else contact.facets.rim
    if rim is not None:
        location = replace(location, gap=location.gap - rim.bend)
    now = coupled(
        contact.facets,
        contact.slave_position + slave_displacement,
        contact.area,
        location,
        contact.master,
        master_displacement,
    )
    if contact.turn is not None:
        carried = point_weights(location, contact.master.node_count) @ master_displacement
        contact = replace(contact, shift=slave_displacement - carried)
    if contact.joined is not None:
        location = contact.joined.even(location, contact.area)
    relative = now.slave @ slave_displacement - now.master @ master_displacement
    reference = replace(now, area=contact.area, gap=now.gap - np.sum(location.normal * relative, axis=1))
    nodes = operators(
        contact.name,
        slave=contact.slave,
        slave_position=contact.slave_position,
        area=contact.area,
        master_rows=contact.master_rows,
        drift=contact.present_drift,
        stiffness_per_area=contact.stiffness_per_area,
        law=contact.law,
        location=location,
        coupling=reference,
        joined=contact.joined,
    )
    left = ~location.inside
    if now.hanging is not None:
        left &= ~now.hanging
    if contact.joined is not None:  # of one node all parts
        left = np.bincount(contact.own, weights=~left) == 0.0
    return replace(contact, location=location, nodes=nodes), np.flatnonzero(left)


def overlap_tolerance(
    position: Array, normals: Array, master: MasterSurface, parts: IntArray | None = None
) -> float:
    """How far [m] curved surfaces that fit may seem to overlap: 1.5 times the chord heights h²/8R of both.

    position (m, d), normals (m, d): the slave nodes, whose chords are taken between nearest neighbours; of the same of
    parts (m,) only, where these are known.
    """
    rounding = 1e-9 * float(np.linalg.norm(np.ptp(position, axis=0)))
    rounding = max(rounding + rounding_of(position), rounding_of(*_placing(master)))
    height = float(getattr(master, "chord_height", 0.0))
    count = min(len(position), 2 * position.shape[1] - 1)
    if count > 1:
        near = np.asarray(cKDTree(position).query(position, k=count)[1], dtype=np.int64)[:, 1:]
        change = normals[near] - normals[:, None]
        # Across a corner of the slave there is no chord of a curve.
        smooth = np.sum(normals[near] * normals[:, None], axis=2) > np.cos(np.radians(40.0))
        if parts is not None:
            smooth &= parts[near] == parts[:, None]
        heights = np.abs(np.sum(change * (position[near] - position[:, None]), axis=2)) / 8.0
        height += float(np.where(smooth, heights, 0.0).max())
    return 1.5 * height + rounding


def _placing(master: MasterSurface) -> list[Array]:
    """Numbers [m] that say where a surface is, by whose rounding gaps are wrong: a point on a circle need not have any
    itself."""
    return [np.asarray(getattr(master, name, 0.0)) for name in ("positions", "point", "centre", "radius")]


def _never_touching(position: Array, location: Location, opposed: BoolArray, reach: float | None) -> str:
    if not len(position):
        return "the slave has no nodes"
    distance = np.linalg.norm(position - location.point, axis=1)
    over = location.inside & opposed
    among = np.flatnonzero(over) if over.any() else np.arange(len(position))
    nearest = int(among[np.argmin(distance[among])])
    lead = (
        f"the bodies do not face each other: the nearest node of the slave is {distance[nearest]:.3g} m from the "
        f"master, at {_coordinates(position[nearest])}"
    )
    if over.any():
        return f"{lead}, beyond the reach of {reach:.3g} m; move a body or set a longer reach"
    if location.inside.any():
        return f"{lead}, and their outward normals do not oppose each other; check which boundaries are meant"
    return f"{lead}, and none lies over the master; all are beyond its edges. Move a body or take a longer boundary"


def _only_at_an_edge(position: Array) -> str:
    return (
        f"the bodies do not face each other: they only meet at an edge of the master, at {_coordinates(position)}, and "
        "no facet of the slave lies over the master. Move a body or take a longer boundary"
    )


def _overlapping(position: Array, location: Location, deepest: int, tolerance: float) -> str:
    overlap = -float(location.gap[deepest])
    count = int(np.sum(location.gap < -tolerance))
    nodes = "1 node of the slave lies" if count == 1 else f"{count} nodes of the slave lie"
    direction = ", ".join(f"{x + 0.0:.3g}" for x in np.round(location.normal[deepest], 3))
    return (
        f"the bodies overlap: {nodes} inside the master, the deepest by {overlap:.3g} m at "
        f"{_coordinates(position[deepest])}; up to {tolerance:.3g} m is allowed. Move the slave's body by "
        f"{overlap:.6g} m along ({direction}), or the master's the opposite way"
    )


def _coordinates(point: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in point) + ") m"
