"""Quadrature of slave facets in pieces that each lie over one facet of the master.

What is integrated over a slave facet, the product of its functions and the master's, has kinks where the master goes
from facet to facet. In the plane the slave is cut at the master's nodes, in space by the outlines of its facets,
projected along the normal of the slave facet; within a piece everything is smooth.

Where facets are affine it is a polynomial. Functions of a slave of degree s, dual ones among them, times those of a
master of degree m, and the products of the slave's own that make them dual, are of degree s + max(s, m) at most, 2 to 4
of linear facets, 8 of nine-node quadrilaterals, and the points on a piece are exact for it. In the plane they are of
degree 4 at most, for which four Gauss points (degree 7) do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..mesh.facets import DEGREES, quadrature, reference_nodes, shape_functions, triangle_rule
from ..typing import Array, BoolArray, IntArray
from .clipping import common_triangles
from .curve import Curve
from .facets import FacetSurface
from .master import Location

# A facet of which less than this is found over the master, or more than all, is integrated without pieces.
LEAST_COVER = 0.9
MOST_COVER = 1.0 + 1e-6
OPPOSED = -0.1  # cosine between normals that face each other
STEPS = 12
CONVERGED = 1e-14  # step of a reference coordinate, of the size of facets: rounding
LEAST_DEGREE = 4  # the six points of lower degrees are these


@dataclass(frozen=True)
class Points:
    """Quadrature points: the facet (q,) each belongs to, its reference coordinates (q, e) and weight (q,) there."""

    owner: IntArray
    local: Array
    weight: Array


@dataclass(frozen=True)
class NodeLine:
    """Nodes (k, 2) [m] of a master in the plane, and the tree of them."""

    nodes: Array
    tree: Any


@dataclass(frozen=True)
class Outlines:
    """The mesh's own facets of a master in space: corners (o, 4, 3) [m], how many (o,) each has, whether (o,) it is
    affine, the degree (o,) of its functions, outward unit normals (o, 3), centres (o, 3) and radii (o,) [m].

    lots: which (q,) are within a factor of two of one size, the tree of their centres, the largest radius. One large
    facet amid small ones must not make neighbours of them all.
    """

    corners: Array
    sides: IntArray
    even: BoolArray
    degree: IntArray
    normal: Array
    centre: Array
    radius: Array
    lots: tuple[tuple[IntArray, Any, float], ...]


def outlines(master: Curve | FacetSurface, current: Array) -> NodeLine | Outlines:
    """What slave facets are cut by on a master whose nodes are at current (k, d) [m]."""
    if isinstance(master, Curve):
        return NodeLine(current, cKDTree(current))
    corners, sides, even, degree = _corners(master, current)
    a, b, c, d = (corners[:, i] for i in range(4))
    normal = np.where((sides == 4)[:, None], np.cross(c - a, d - b), np.cross(b - a, c - a))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    centre = corners[:, :3].mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    level = np.floor(np.log2(np.maximum(radius / radius.max(), 1e-12)))
    lots = [np.flatnonzero(level == number) for number in np.unique(level)]
    by_size = tuple((lot, cKDTree(centre[lot]), float(radius[lot].max())) for lot in lots)
    return Outlines(corners, sides, even, degree, normal, centre, radius, by_size)


def pieces(kind: str, facets: Array, under: Array, below: NodeLine | Outlines) -> Points:
    """Points on slave facets (f, r, d) [m] of a kind over a master of these outlines.

    under (f, d) [m]: the point of the master below the middle of each facet. Facets that the master does not cover
    get points that know nothing of it.
    """
    cut = _on_line(kind, facets, under, below) if isinstance(below, NodeLine) else _in_space(kind, facets, under, below)
    owner, local, weight, good = cut
    keep = good[owner]
    rest = np.flatnonzero(~good)
    plain_local, plain_weight = _composite(kind)
    return Points(
        np.concatenate([owner[keep], np.repeat(rest, len(plain_weight))]),
        np.concatenate([local[keep], np.tile(plain_local, (len(rest), 1))]),
        np.concatenate([weight[keep], np.tile(plain_weight, len(rest))]),
    )


def places_below(
    master: Curve | FacetSurface, at: Array, outward: Array, displacement: Array | None, guess: IntArray
) -> Location:
    """Places of points (q, d) [m] on slave facets with unit normals outward (q, d), searched from facets (q,) of the
    master.

    A node in a notch is on either flank. Where these turn by more than a right angle, a search from the wrong one ends
    on it, as its feet lie within; what does not face the slave's facet there is searched anew.
    """
    found = master.locate(at, displacement, guess=guess)
    astray = np.flatnonzero(np.sum(outward * found.normal, axis=1) > OPPOSED)
    if not len(astray):
        return found
    anew = master.locate(at[astray], displacement)
    better = np.flatnonzero(np.sum(outward[astray] * anew.normal, axis=1) < OPPOSED)
    return found.with_places(astray[better], anew.only(better))


def covered(kind: str, facets: Array, under: Array, below: NodeLine | Outlines) -> Points:
    """Points on the parts of linear slave facets (f, r, d) [m] that lie over outlines in space; in the plane points on
    whole facets, none of whose pieces crosses an end of the master."""
    if isinstance(below, NodeLine):
        owner, local, weight, _ = _on_line(kind, facets, under, below)
        return Points(owner, local, weight)
    # The nearest points of an edge lie to one side of a facet that hangs over it: look right below the facet.
    middle = facets.mean(axis=1)
    normal = _frames(facets)[:, 2]
    level = np.sum((under - middle) * normal, axis=1, keepdims=True)
    owner, local, weight, good = _in_space(kind, facets, middle + level * normal, below, least=0.0)
    keep = good[owner]
    return Points(owner[keep], local[keep], weight[keep])


def _on_line(
    kind: str, facets: Array, under: Array, line: NodeLine
) -> tuple[IntArray, Array, Array, BoolArray]:
    """Between the feet of the master's nodes on the chord of each facet, four Gauss points each."""
    begin, chord = facets[:, 0], facets[:, 1] - facets[:, 0]
    length = np.linalg.norm(chord, axis=1)
    along = chord / length[:, None]
    distance = np.linalg.norm(under - facets[:, :2].mean(axis=1), axis=1)
    # Only nodes around the point below: the far side of a ring has feet on the chord as well.
    near = line.tree.query_ball_point(under, length + 1e-9 * distance)
    counts = np.array([len(n) for n in near], dtype=np.int64)
    facet = np.repeat(np.arange(len(facets)), counts)
    node = np.concatenate([np.asarray(n, dtype=np.int64) for n in near]) if len(near) else np.zeros(0, dtype=np.int64)
    foot = np.sum((line.nodes[node] - begin[facet]) * along[facet], axis=1) / length[facet]
    within = (foot > 1e-9) & (foot < 1.0 - 1e-9)
    each = np.arange(len(facets))
    facet = np.concatenate([each, facet[within], each])
    foot = np.concatenate([np.zeros(len(each)), foot[within], np.ones(len(each))])
    order = np.lexsort((foot, facet))
    facet, foot = facet[order], foot[order]
    piece = np.flatnonzero((facet[1:] == facet[:-1]) & (np.diff(foot) > 1e-9))
    x, w = quadrature("line3")
    owner = np.repeat(facet[piece], len(w))
    size = foot[piece + 1] - foot[piece]
    part = (foot[piece][:, None] + size[:, None] * x[:, 0]).ravel()
    weight = (size[:, None] * w).ravel()
    flat = np.einsum("frd,fd->fr", facets - begin[:, None], along)[:, :, None]
    local, slope, good = _inverted(kind, flat, owner, (part * length[owner])[:, None])
    return owner, local, weight * length[owner] / slope, good


def _in_space(
    kind: str, facets: Array, under: Array, below: Outlines, *, least: float = LEAST_COVER
) -> tuple[IntArray, Array, Array, BoolArray]:
    corner_count = 3 if kind.startswith("triangle") else 4
    corners = facets[:, :corner_count]
    origin = corners.mean(axis=1)
    frame = _frames(corners)  # (f, 3, 3): two tangents and the normal
    flat = np.einsum("fij,frj->fri", frame[:, :2], facets - origin[:, None])
    pair_facet, pair_other = _neighbours(corners, under, frame[:, 2], below)
    relative = below.corners[pair_other] - origin[pair_facet][:, None]
    others = np.einsum("pij,prj->pri", frame[pair_facet][:, :2], relative)
    polygons = np.zeros((len(facets), 4, 2))
    polygons[:, :corner_count] = flat[:, :corner_count]
    counts = np.full(len(facets), corner_count, dtype=np.int64)
    sides = below.sides[pair_other]
    which, triangles = common_triangles(polygons, counts, pair_facet, np.ascontiguousarray(others), sides)
    owner = pair_facet[which]
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    twice = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    following = np.roll(flat[:, :corner_count], -1, axis=1)
    cross = flat[:, :corner_count, 0] * following[:, :, 1] - flat[:, :corner_count, 1] * following[:, :, 0]
    part = np.bincount(owner, twice, len(facets)) / np.abs(cross.sum(axis=1))
    even = _affine(kind, facets)[owner] & below.even[pair_other[which]]
    owners: list[IntArray] = []
    coordinates: list[Array] = []
    weights: list[Array] = []
    good = (part >= least) & (part <= MOST_COVER)
    own = DEGREES[kind]
    degree = np.maximum(own + np.maximum(own, below.degree[pair_other[which]]), LEAST_DEGREE)
    degrees = np.union1d(degree, [LEAST_DEGREE]).tolist()
    lots = [(even & (degree == d), triangle_rule(d)) for d in degrees]
    lots += [(~even & (degree == d), _fine_triangle(d)) for d in degrees]
    for lot, (at, w) in lots:
        points = triangles[lot, None, 0] + at[:, :1] * first[lot, None] + at[:, 1:] * second[lot, None]
        facet = np.repeat(owner[lot], len(w))
        local, slope, found = _inverted(kind, flat, facet, points.reshape(-1, 2))
        owners.append(facet)
        coordinates.append(local)
        weights.append((twice[lot, None] * w).ravel() / slope)
        good = good & found
    return np.concatenate(owners), np.concatenate(coordinates), np.concatenate(weights), good


def _affine(kind: str, facets: Array) -> BoolArray:
    """Which facets (f, r, d) are images of the reference facet without distortion: polynomials stay polynomials."""
    nodes = reference_nodes(kind)
    last = 2 if kind.startswith("triangle") else 3
    first, second = facets[:, 1] - facets[:, 0], facets[:, last] - facets[:, 0]
    straight = facets[:, :1] + nodes[:, :1] * first[:, None] + nodes[:, 1:] * second[:, None]
    size = np.abs(first).max(axis=1) + np.abs(second).max(axis=1)
    return np.abs(facets - straight).max(axis=(1, 2)) <= 1e-9 * size


def _fine_triangle(degree: int) -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,) on the reference triangle: Gauss points of a square, one side drawn together.

    For facets that are distorted, where nothing is a polynomial: n along a side are exact of degree 2n − 2, and there
    is one more than the degree on affine facets of these kinds takes.
    """
    x, w = np.polynomial.legendre.leggauss(-(-degree // 2) + 2)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    first, second = np.meshgrid(x, x, indexing="ij")
    return np.column_stack([first.ravel(), ((1.0 - first) * second).ravel()]), (np.outer((1.0 - x) * w, w)).ravel()


def _frames(corners: Array) -> Array:
    """Tangents and outward normals (f, 3, 3), row by row, of facets by their corners (f, 3 or 4, 3)."""
    across = corners[:, 2] - corners[:, 0]
    other = corners[:, -1] - corners[:, 1] if corners.shape[1] == 4 else corners[:, 2] - corners[:, 1]
    normal = np.cross(across, other) if corners.shape[1] == 4 else np.cross(corners[:, 1] - corners[:, 0], across)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = across - np.sum(across * normal, axis=1, keepdims=True) * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first), normal], axis=1)


def _corners(master: FacetSurface, current: Array) -> tuple[Array, IntArray, BoolArray, IntArray]:
    """Corners (o, 4, 3) of the mesh's own facets of a master, how many (o,) each has, whether (o,) it is affine and the
    degree (o,) of its functions."""
    found: list[Array] = []
    sides: list[IntArray] = []
    even: list[BoolArray] = []
    degree: list[IntArray] = []
    for kind, block in master.blocks.items():
        count = 3 if kind.startswith("triangle") else 4
        corners = current[block[:, :count]]
        found.append(corners if count == 4 else np.concatenate([corners, corners[:, :1]], axis=1))
        sides.append(np.full(len(block), count, dtype=np.int64))
        even.append(_affine(kind, current[block]))
        degree.append(np.full(len(block), DEGREES[kind], dtype=np.int64))
    return np.concatenate(found), np.concatenate(sides), np.concatenate(even), np.concatenate(degree)


def _neighbours(corners: Array, under: Array, normal: Array, below: Outlines) -> tuple[IntArray, IntArray]:
    """Pairs (p,) of slave facets and outlines that may lie over each other and face each other."""
    own = np.linalg.norm(corners - corners.mean(axis=1)[:, None], axis=2).max(axis=1)
    facets: list[IntArray] = []
    others: list[IntArray] = []
    for lot, tree, largest in below.lots:
        near = tree.query_ball_point(under, 1.01 * (own + largest))
        counts = np.array([len(n) for n in near], dtype=np.int64)
        facets.append(np.repeat(np.arange(len(corners)), counts))
        others.append(lot[np.concatenate([np.asarray(n, dtype=np.int64) for n in near])])
    facet, other = np.concatenate(facets), np.concatenate(others)
    height = np.abs(np.sum((below.centre[other] - under[facet]) * normal[facet], axis=1))
    facing = np.sum(below.normal[other] * normal[facet], axis=1) < OPPOSED
    facing &= height <= own[facet] + below.radius[other]
    return facet[facing], other[facing]


def _inverted(kind: str, flat: Array, owner: IntArray, target: Array) -> tuple[Array, Array, BoolArray]:
    """Reference coordinates (q, e) of targets (q, e) in the plane of facets (f, r, e), the determinants (q,) of the map
    there, and for which facets (f,) all were found."""
    e = flat.shape[2]
    centre = reference_nodes(kind).mean(axis=0)
    local = np.broadcast_to(centre, (len(target), e)).copy()
    tangents = np.zeros((len(target), e, e))
    offset = np.zeros(target.shape)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            values, slopes = shape_functions(kind, local)
            offset = np.einsum("qr,qre->qe", values, flat[owner]) - target
            tangents = np.einsum("aqr,qre->qea", slopes, flat[owner])
            step = np.clip(_solve(tangents, offset), -0.5, 0.5)
            local = local - step
            if float(np.abs(step).max(initial=0.0)) <= CONVERGED:
                break
        values, slopes = shape_functions(kind, local)
        offset = np.einsum("qr,qre->qe", values, flat[owner]) - target
        tangents = np.einsum("aqr,qre->qea", slopes, flat[owner])
        slope = np.abs(np.linalg.det(tangents))
    size = np.abs(flat).max(axis=(1, 2))
    found = np.all(np.abs(offset) <= 1e-9 * size[owner][:, None], axis=1) & (slope > 0)
    found &= np.all((local > -1e-6) & (local < 1 + 1e-6), axis=1)
    good = np.ones(len(flat), dtype=bool)
    good[owner[~found]] = False
    return local, np.where(found, slope, 1.0), good


def _solve(matrices: Array, right: Array) -> Array:
    """Solutions (q, e) of 1 × 1 or 2 × 2 systems (q, e, e)."""
    if matrices.shape[1] == 1:
        return right / matrices[:, 0]
    (a, b), (c, d) = matrices[:, 0].T, matrices[:, 1].T
    det = a * d - b * c
    return np.stack([d * right[:, 0] - b * right[:, 1], a * right[:, 1] - c * right[:, 0]], axis=1) / det[:, None]


def _composite(kind: str) -> tuple[Array, Array]:
    """Points (q, e) and weights (q,) of a fine rule for what has kinks anywhere."""
    parts = 4
    x, w = quadrature(kind)
    cells = np.arange(parts) / parts
    if x.shape[1] == 1:
        return (cells[:, None] + x[:, 0] / parts).reshape(-1, 1), np.tile(w / parts, parts)
    corner = np.stack(np.meshgrid(cells, cells, indexing="ij"), axis=-1).reshape(-1, 2)
    if not kind.startswith("triangle"):
        return (corner[:, None] + x / parts).reshape(-1, 2), np.tile(w / parts**2, parts**2)
    upright = corner[corner.sum(axis=1) < 1.0 - 0.5 / parts]
    inverted = corner[corner.sum(axis=1) < 1.0 - 1.5 / parts] + 1.0 / parts
    local = np.concatenate([(upright[:, None] + x / parts), (inverted[:, None] - x / parts)])
    return local.reshape(-1, 2), np.tile(w / parts**2, parts**2)
