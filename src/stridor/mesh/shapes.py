"""Built-in meshes of simple bodies: rectangles, quadrilaterals, annuli, discs, blocks, pads.

Every shape is a grid of cells, or two of them joined, whose nodes are placed by a function: of straight edges or of
circles. Midside nodes of quadratic cells are placed by the same function, so they lie on the circle exactly.

Common to all: divisions are numbers of cells along each direction; element_size [m], given in their place, is the
length that no edge along these directions exceeds (around a circle: at its largest radius). grading, beside divisions,
has an entry for each direction: the size of the last cell over that of the first, those between in a geometric series,
or a list of the places of the cells' ends from 0 to 1. kind is "quad" or "triangle" in the plane, "hexahedron" or
"tetra" in space; order 2 makes them quadratic with midside nodes ("quad8", "triangle6", "hexahedron20", "tetra10"); the
kind may also be written out, for the complete "quad9" and "hexahedron27" as well. where is what errors begin with. All
raise CaseError for sizes, angles, divisions and gradings that make no body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..errors import CaseError
from ..typing import Array
from .grid import Grid, Side, cell_kind, mesh_of_grids
from .kinds import KINDS
from .model import Mesh
from .shape_inputs import (
    Grading,
    counts_along,
    enough_around,
    finite,
    numbers,
    radii,
    sector,
    shares_along,
    sizes,
    span,
)
from .shape_inputs import divisions_for as divisions_for

# Half the side of the square in the middle of a solid disc, over its radius: it keeps the cells around it near square.
_CORE = 0.4


def rectangle(
    corner: Sequence[float],
    size: Sequence[float],
    divisions: Sequence[int] | None = None,
    *,
    element_size: float | None = None,
    grading: Grading | None = None,
    kind: str = "quad",
    order: int = 1,
    angle_deg: float = 0.0,
    where: str = "rectangle",
) -> Mesh:
    """Rectangle from its corner (2,) [m], of a size (2,) [m], turned about the corner by angle_deg.

    Boundaries left, right, bottom, top, named before turning.
    """
    at, (width, height) = numbers(corner, 2, f"{where}.corner"), sizes(size, 2, f"{where}.size")
    angle = math.radians(finite(angle_deg, f"{where}.angle_deg"))
    along = width * np.array([math.cos(angle), math.sin(angle)])
    up = height * np.array([-math.sin(angle), math.cos(angle)])
    # A quarter turn is meant exactly: 6e-17 in its place would move points off the axes.
    along, up = (np.where(np.abs(v) < 1e-15 * np.abs(v).max(), 0.0, v) for v in (along, up))
    corners = np.array([at, at + along, at + along + up, at + up])
    return _four_sided(corners, divisions, element_size, grading, kind, order, where, "rectangle")


def quadrilateral(
    corners: Sequence[Sequence[float]] | Array,
    divisions: Sequence[int] | None = None,
    *,
    element_size: float | None = None,
    grading: Grading | None = None,
    kind: str = "quad",
    order: int = 1,
    where: str = "quadrilateral",
) -> Mesh:
    """Quadrilateral with straight sides between corners (4, 2) [m], convex and counter-clockwise.

    Boundaries: bottom from corner 0 to 1, right from 1 to 2, top from 2 to 3, left from 3 to 0.
    """
    rows = [numbers(c, 2, f"{where}.corners") for c in corners]
    if len(rows) != 4:
        raise CaseError(f"{where}.corners", len(rows), "four corners make a quadrilateral")
    table = np.array(rows)
    ahead, behind = np.roll(table, -1, axis=0) - table, np.roll(table, 1, axis=0) - table
    turn = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    if np.any(turn <= 1e-12 * np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1)):
        raise CaseError(
            f"{where}.corners",
            table.tolist(),
            "the corners must be convex and go round counter-clockwise: bottom left, bottom right, top right, top left",
        )
    return _four_sided(table, divisions, element_size, grading, kind, order, where, "quadrilateral")


def annulus(
    centre: Sequence[float],
    inner_radius: float,
    outer_radius: float,
    divisions: Sequence[int] | None = None,
    *,
    element_size: float | None = None,
    grading: Grading | None = None,
    start_deg: float = 0.0,
    sweep_deg: float = 360.0,
    kind: str = "quad",
    order: int = 1,
    where: str = "annulus",
) -> Mesh:
    """Annulus about its centre (2,) [m] between radii [m], or a sector of it, counter-clockwise from start_deg.

    divisions: radial, circumferential. Boundaries inner and outer; a sector has start and end too. An inner radius of
    0 makes a solid disc with a square of cells in its middle: its boundary is outer, its circumferential divisions a
    multiple of 4, its radial divisions count the rings around the square.
    """
    at = numbers(centre, 2, f"{where}.centre")
    inner, outer = radii(inner_radius, outer_radius, where, solid=True)
    name = cell_kind(kind, order, 2, where)
    step = 1 if KINDS[name].nodes == KINDS[name].corners else 2
    if inner == 0.0:
        return _solid_disc(at, outer, divisions, element_size, grading, start_deg, sweep_deg, name, step, where)
    start, sweep = sector(start_deg, sweep_deg, where)
    lengths = (outer - inner, outer * math.radians(sweep))
    names = ("radial", "circumferential")
    counts = counts_along(divisions, element_size, lengths, names, where)
    shares = shares_along(_with_divisions(grading, divisions, where), counts, step, names, where)
    closed = sweep == 360.0
    enough_around(counts[1], sweep, where)
    grid, points = _ring(inner, outer, start, sweep, counts, step, shares)
    sides = {"inner": Side(0, 0, False), "outer": Side(0, 0, True)}
    if not closed:
        sides |= {"start": Side(0, 1, False), "end": Side(0, 1, True)}
    return mesh_of_grids([grid], points + at, name, sides, "annulus")


def block(
    corner: Sequence[float],
    size: Sequence[float],
    divisions: Sequence[int] | None = None,
    *,
    element_size: float | None = None,
    grading: Grading | None = None,
    kind: str = "hexahedron",
    order: int = 1,
    where: str = "block",
) -> Mesh:
    """Cuboid from its corner (3,) of least coordinates [m], of a size (3,) [m], along the axes.

    Boundaries left and right (x−, x+), front and back (y−, y+), bottom and top (z−, z+).
    """
    at, lengths = numbers(corner, 3, f"{where}.corner"), sizes(size, 3, f"{where}.size")
    name = cell_kind(kind, order, 3, where)
    directions = ("along x", "along y", "along z")
    counts = counts_along(divisions, element_size, lengths, directions, where)
    step = 1 if KINDS[name].nodes == KINDS[name].corners else 2
    shares = shares_along(_with_divisions(grading, divisions, where), counts, step, directions, where)
    axes = [span(0.0, length, step * n, part) for length, n, part in zip(lengths, counts, shares, strict=True)]
    grid, order_of = Grid.of_counts(counts, step)
    points = np.stack([a.ravel()[order_of] for a in np.meshgrid(*axes, indexing="ij")], axis=1)
    names = {"left": 0, "right": 0, "front": 1, "back": 1, "bottom": 2, "top": 2}
    sides = {n: Side(0, axis, n in ("right", "back", "top")) for n, axis in names.items()}
    return mesh_of_grids([grid], points + at, name, sides, "block")


def disc(
    centre: Sequence[float],
    inner_radius: float,
    outer_radius: float,
    thickness: float,
    divisions: Sequence[int] | None = None,
    *,
    element_size: float | None = None,
    grading: Grading | None = None,
    kind: str = "hexahedron",
    order: int = 1,
    where: str = "disc",
) -> Mesh:
    """Annular disc about an axis along z; centre (3,) [m] is the centre of its bottom, thickness [m] goes up from it.

    divisions: radial, circumferential, axial. Boundaries inner, outer, bottom (z−), top (z+).
    """
    return _annular_block(
        *(centre, inner_radius, outer_radius, 0.0, 360.0, thickness),
        *(divisions, element_size, grading, kind, order, where, "disc"),
    )


def pad(
    centre: Sequence[float],
    inner_radius: float,
    outer_radius: float,
    start_deg: float,
    sweep_deg: float,
    thickness: float,
    divisions: Sequence[int] | None = None,
    *,
    element_size: float | None = None,
    grading: Grading | None = None,
    kind: str = "hexahedron",
    order: int = 1,
    where: str = "pad",
) -> Mesh:
    """Sector of an annular disc about an axis along z, counter-clockwise from start_deg; centre (3,) [m] is the
    centre of the disc's bottom, thickness [m] goes up from it.

    divisions: radial, circumferential, axial. Boundaries inner, outer, start, end, bottom (z−), top (z+).
    """
    if sweep_deg >= 360:
        raise CaseError(f"{where}.sweep_deg", sweep_deg, "must be less than 360; a whole disc is of shape disc")
    return _annular_block(
        *(centre, inner_radius, outer_radius, start_deg, sweep_deg, thickness),
        *(divisions, element_size, grading, kind, order, where, "pad"),
    )


# ---------------------------------------------------------------------------------------------------------------------


def _with_divisions(grading: Grading | None, divisions: Sequence[int] | None, where: str) -> Grading | None:
    """The grading, refused where an element size says how long cells are."""
    if grading is not None and divisions is None:
        raise CaseError(f"{where}.grading", list(grading), "goes with divisions, not with element_size")
    return grading


def _four_sided(
    corners: Array,
    divisions: Sequence[int] | None,
    element_size: float | None,
    grading: Grading | None,
    kind: str,
    order: int,
    where: str,
    source: str,
) -> Mesh:
    """A quadrilateral of corners (4, 2) [m], counter-clockwise, filled bilinearly."""
    name = cell_kind(kind, order, 2, where)
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    lengths = (float(max(sides[0], sides[2])), float(max(sides[1], sides[3])))
    directions = ("along the bottom", "along the sides")
    counts = counts_along(divisions, element_size, lengths, directions, where)
    step = 1 if KINDS[name].nodes == KINDS[name].corners else 2
    shares = shares_along(_with_divisions(grading, divisions, where), counts, step, directions, where)
    grid, order_of = Grid.of_counts(counts, step)
    even = [np.arange(step * n + 1) / (step * n) for n in counts]
    axes = [e if part is None else part for e, part in zip(even, shares, strict=True)]
    s, t = (a.ravel()[order_of][:, None] for a in np.meshgrid(*axes, indexing="ij"))
    p0, p1, p2, p3 = corners
    # Written so that points on a side lie on it exactly: at s, t = 0 and 1 the other terms vanish.
    points = (1 - t) * ((1 - s) * p0 + s * p1) + t * ((1 - s) * p3 + s * p2)
    names = {"left": Side(0, 0, False), "right": Side(0, 0, True), "bottom": Side(0, 1, False), "top": Side(0, 1, True)}
    return mesh_of_grids([grid], points, name, names, source)


def _annular_block(
    centre: Sequence[float],
    inner_radius: float,
    outer_radius: float,
    start_deg: float,
    sweep_deg: float,
    thickness: float,
    divisions: Sequence[int] | None,
    element_size: float | None,
    grading: Grading | None,
    kind: str,
    order: int,
    where: str,
    source: str,
) -> Mesh:
    """A disc or a sector of one."""
    at = numbers(centre, 3, f"{where}.centre")
    inner, outer = radii(inner_radius, outer_radius, where, solid=False)
    (height,) = sizes([thickness], 1, f"{where}.thickness")
    start, sweep = sector(start_deg, sweep_deg, where)
    name = cell_kind(kind, order, 3, where)
    lengths = (outer - inner, outer * math.radians(sweep), height)
    names = ("radial", "circumferential", "axial")
    counts = counts_along(divisions, element_size, lengths, names, where)
    enough_around(counts[1], sweep, where)
    step = 1 if KINDS[name].nodes == KINDS[name].corners else 2
    shares = shares_along(_with_divisions(grading, divisions, where), counts, step, names, where)
    grid, points = _ring(inner, outer, start, sweep, counts, step, shares, height)
    sides = {
        "inner": Side(0, 0, False),
        "outer": Side(0, 0, True),
        "start": Side(0, 1, False),
        "end": Side(0, 1, True),
        "bottom": Side(0, 2, False),
        "top": Side(0, 2, True),
    }
    if sweep == 360.0:
        del sides["start"], sides["end"]
    return mesh_of_grids([grid], points + at, name, sides, source)


def _ring(
    inner: float,
    outer: float,
    start_deg: float,
    sweep_deg: float,
    counts: tuple[int, ...],
    step: int,
    shares: Sequence[Array | None],
    height: float | None = None,
) -> tuple[Grid, Array]:
    """Grid and points (k, d) [m] of an annulus about the origin, in space upwards from it."""
    closed = sweep_deg == 360.0
    grid, order_of = Grid.of_counts(counts, step, closed=1 if closed else None)
    radii = span(inner, outer, step * counts[0], shares[0])
    around = np.arange(step * counts[1] + 1) / (step * counts[1]) if shares[1] is None else shares[1]
    around = around[:-1] if closed else around
    angles = np.radians(start_deg + sweep_deg * around)
    axes = [radii, angles]
    if height is not None:
        axes.append(span(0.0, height, step * counts[2], shares[2]))
    radius, angle, *rest = (a.ravel()[order_of] for a in np.meshgrid(*axes, indexing="ij"))
    return grid, np.stack([radius * np.cos(angle), radius * np.sin(angle), *rest], axis=1)


def _solid_disc(
    centre: Array,
    radius: float,
    divisions: Sequence[int] | None,
    element_size: float | None,
    grading: Grading | None,
    start_deg: float,
    sweep_deg: float,
    name: str,
    step: int,
    where: str,
) -> Mesh:
    """A square of cells with rings about it; the rings turn from the square into the circle."""
    start, sweep = sector(start_deg, sweep_deg, where)
    if sweep != 360.0:
        raise CaseError(f"{where}.inner_radius", 0, "a sector needs an inner radius above 0; a solid disc goes round")
    lengths = ((1 - _CORE) * radius, 2 * math.pi * radius)
    names = ("rings", "circumferential")
    rings, around = counts_along(divisions, element_size, lengths, names, where)
    shares = shares_along(_with_divisions(grading, divisions, where), (rings, around), step, names, where)
    if shares[1] is not None:
        raise CaseError(f"{where}.grading.1", 1.0, "a solid disc is even round its circumference: leave it at 1")
    if element_size is not None:
        around = 4 * math.ceil(around / 4)
    if around % 4:
        raise CaseError(f"{where}.divisions", list(divisions or ()), "a solid disc needs a multiple of 4 around")
    side = step * around // 4  # intervals of nodes along a side of the square
    # The square, from −1 to 1; its first side, the bottom, faces start_deg − 135° … − 45°.
    line = np.linspace(-1.0, 1.0, side + 1)
    s, t = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    core_ids = np.arange(len(s)).reshape(side + 1, side + 1)
    rim = np.concatenate([core_ids[:-1, 0], core_ids[-1, :-1], core_ids[:0:-1, -1], core_ids[0, :0:-1]])
    core = _CORE * radius * np.stack([s, t], axis=1)
    # Straight lines from the rim of the square to points at equal angles on the circle.
    angles = np.radians(-135.0 + 360.0 * np.arange(4 * side) / (4 * side))
    circle = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    even = np.arange(step * rings + 1) / (step * rings)
    share = (even if shares[0] is None else shares[0])[1:, None, None]
    layers = (1 - share) * core[rim] + share * circle
    layers[-1] = circle
    ring_ids = np.concatenate([rim[None], len(core) + np.arange(layers[..., 0].size).reshape(layers.shape[:2])])
    ring_ids = np.concatenate([ring_ids, ring_ids[:, :1]], axis=1)  # closed
    points = np.concatenate([core, layers.reshape(-1, 2)])
    # Numbered across the disc line by line: the bandwidth is a diameter's nodes.
    new = np.empty(len(points), dtype=np.int64)
    new[np.lexsort((points[:, 1], np.round(points[:, 0] / radius * side)))] = np.arange(len(points))
    ordered = np.empty_like(points)
    turn = math.radians(start)
    rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    ordered[new] = points @ rotation if turn else points
    grids = [Grid(new[core_ids], step), Grid(new[ring_ids], step)]
    return mesh_of_grids(grids, ordered + centre, name, {"outer": Side(1, 0, True)}, "annulus")
