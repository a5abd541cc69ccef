"""Facets of a boundary: areas, normals and the loads that pressure and traction bring to their nodes.

Facets by kind are those of `model`: line and line3 in the plane, with the body on their left, triangles and
quadrilaterals in space, their corners counter-clockwise seen from outside. In the plane an area is length times
thickness; in space thickness must be left at one. Arrays over all k points are returned, zero where no facet is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import CaseError
from ..typing import Array, IntArray
from .model import FACET_KINDS, Blocks
from .positive_basis import changed_basis

Order = list[tuple[int, int]]

# Highest total degree of the shape functions of a kind: x²y² of nine nodes, x²y of eight.
DEGREES = {"line": 1, "line3": 2, "triangle": 1, "triangle6": 2, "quad": 2, "quad8": 3, "quad9": 4}


@dataclass(frozen=True)
class FacetRule:
    """Shape functions of a kind at its q quadrature points.

    weights (q,) sum to the area of the reference facet; values (q, r); derivatives (e, q, r) along the e reference
    coordinates.
    """

    weights: Array
    values: Array
    derivatives: Array


def shape_functions(kind: str, local: Array) -> tuple[Array, Array]:
    """Values (q, r) and derivatives (e, q, r) of the shape functions of a kind at reference coordinates (q, e).

    The reference facet is [0, 1] for lines, the triangle (0, 0), (1, 0), (0, 1) and the square [0, 1]²; nodes in
    VTK's order: corners, then the middles of the edges in turn, then the centre. Raises KeyError for another kind.
    """
    return _SHAPES[kind](np.asarray(local, dtype=float))


def reference_nodes(kind: str) -> Array:
    """Reference coordinates (r, e) of the nodes of a kind. Raises KeyError for a kind that is no facet."""
    return _NODES[kind]


def quadrature(kind: str) -> tuple[Array, Array]:
    """Points (q, e) and weights (q,), exact for the pressure on a facet of that kind, curved or not."""
    if kind.startswith("line"):
        x, w = _gauss(2 if kind == "line" else 4)
        return x[:, None], w
    if kind == "triangle":
        return np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]]), np.full(3, 1 / 6)
    if kind == "triangle6":
        # Degree 4 with six points (Strang and Fix 1973; Cowper 1973).
        a, b = 0.445948490915965, 0.091576213509771
        wa, wb = 0.5 * 0.223381589678011, 0.5 * 0.109951743655322
        points = [[a, a], [1 - 2 * a, a], [a, 1 - 2 * a], [b, b], [1 - 2 * b, b], [b, 1 - 2 * b]]
        return np.array(points), np.array([wa, wa, wa, wb, wb, wb])
    x, w = _gauss(2 if kind == "quad" else 3)
    first, second = np.meshgrid(x, x, indexing="ij")
    return np.column_stack([first.ravel(), second.ravel()]), np.outer(w, w).ravel()


@cache
def triangle_rule(degree: int) -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,) on the reference triangle, all positive, exact for polynomials of a degree."""
    if degree <= 4:
        return quadrature("triangle6")
    from skfem.quadrature import get_quadrature  # slow to import, and linear facets do without it
    from skfem.refdom import RefTri

    points, weights = get_quadrature(RefTri, 8 if degree == 7 else degree)  # one weight of degree 7 is negative
    return np.asarray(points, dtype=float).T, np.asarray(weights, dtype=float)


def facet_rule(kind: str) -> FacetRule:
    """Shape functions of a kind at its quadrature points."""
    points, weights = quadrature(kind)
    values, derivatives = shape_functions(kind, points)
    return FacetRule(weights, values, derivatives)


def facet_areas(points: Array, facets: Blocks, *, thickness: float = 1.0) -> Mapping[str, Array]:
    """Areas (f,) [m²] of the facets of each kind."""
    return {
        kind: thickness * _size(_directed_areas(points, nodes, facet_rule(kind))).sum(axis=1)
        for kind, nodes in _known(facets).items()
    }


def nodal_areas(points: Array, facets: Blocks, *, thickness: float = 1.0) -> Array:
    """Area (k,) [m²] that each of the points (k, d) stands for; positive, and the sum is the area of the facets.

    ∫φ dA, which turns a uniform pressure into the exact nodal forces. On triangle6 and quad8 that would be zero or
    negative at the corners, where a contact force per area needs a positive area: there it is ∫φ̃ dA with the
    functions of `positive_basis`.
    """
    total = np.zeros(len(points))
    for kind, nodes in _known(facets).items():
        share = facet_integrals(points, nodes, kind)
        np.add.at(total, nodes, share @ changed_basis(kind, np.ones((1, nodes.shape[1]), dtype=bool))[0].T)
    return thickness * total


def facet_integrals(points: Array, nodes: IntArray, kind: str) -> Array:
    """∫φ dA (f, r) [m², in the plane m] over facets (f, r) of one kind, negative at the corners of quad8."""
    rule = facet_rule(kind)
    return _size(_directed_areas(points, nodes, rule)) @ rule.values


def nodal_normals(points: Array, facets: Blocks) -> Array:
    """Unit outward normals (k, d) at the points (k, d): those of the facets around, weighted by facet area.

    Each facet gives its normal at that very node, so that curved facets agree with their neighbours. Zero where no
    facet is, and where facets cancel (a sheet folded on itself).
    """
    total = np.zeros(points.shape)
    for kind, nodes in _known(facets).items():
        values, derivatives = shape_functions(kind, reference_nodes(kind))
        directed = _directed_areas(points, nodes, FacetRule(np.ones(len(values)), values, derivatives))
        size = _size(directed)
        unit = np.divide(directed, size[..., None], out=np.zeros_like(directed), where=size[..., None] > 0)
        areas = _size(_directed_areas(points, nodes, facet_rule(kind))).sum(axis=1)
        np.add.at(total, nodes, unit * areas[:, None, None])
    length = np.linalg.norm(total, axis=1)
    good = length > 1e-9 * length.max(initial=0.0)
    return np.divide(total, length[:, None], out=np.zeros_like(total), where=good[:, None])


def facet_normals(points: Array, nodes: IntArray, kind: str) -> Array:
    """Mean unit outward normals (f, d) of facets (f, r) of one kind, zero where there is no area."""
    total = _directed_areas(points, nodes, facet_rule(kind)).sum(axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0)


def pressure_load(points: Array, facets: Blocks, *, thickness: float = 1.0, pressure: float = 1.0) -> Array:
    """Nodal forces (k, d) [N] of a uniform pressure [Pa] that pushes into the body: −p ∫ φ n dA, consistent."""
    total = np.zeros(points.shape)
    for kind, nodes in _known(facets).items():
        rule = facet_rule(kind)
        directed = _directed_areas(points, nodes, rule)
        np.add.at(total, nodes, np.einsum("fqd,qr->frd", directed, rule.values))
    return -pressure * thickness * total


def traction_load(points: Array, facets: Blocks, vector: Array, *, thickness: float = 1.0) -> Array:
    """Nodal forces (k, d) [N] of a uniform traction ``vector`` (d,) [Pa] on the body: ∫ φ t dA, consistent."""
    total = np.zeros(len(points))
    for kind, nodes in _known(facets).items():
        rule = facet_rule(kind)
        np.add.at(total, nodes, _size(_directed_areas(points, nodes, rule)) @ rule.values)
    return thickness * total[:, None] * np.asarray(vector, dtype=float)


@dataclass(frozen=True)
class Chain:
    """Line facets in order: nodes (k,) of the points along the chain, the first not repeated where it is closed.

    facets (f, 3): first, last and middle node of each facet in the numbering of ``nodes``, −1 for no middle.
    """

    nodes: IntArray
    facets: IntArray
    closed: bool


def chain_of(points: Array, facets: Blocks, *, where: str) -> Chain:
    """One open or closed chain out of the facets "line" and "line3" between points (k, 2) [m].

    Raises CaseError naming ``where`` for no facets, facets that branch or disagree about the side of the body, lie in
    several pieces or have no length.
    """
    known = _known(facets)
    line, line3 = (known.get(kind, np.zeros((0, n), dtype=np.int64)) for kind, n in (("line", 2), ("line3", 3)))
    ends = np.concatenate([line, line3[:, :2]])
    middle = np.concatenate([np.full(len(line), -1), line3[:, 2]])
    if not len(ends):
        raise CaseError(where, None, "has no facets; a line of them is needed")
    for column in (0, 1):
        nodes, times = np.unique(ends[:, column], return_counts=True)
        if np.any(times > 1):
            at = _coordinates(points[nodes[np.argmax(times > 1)]])
            raise CaseError(where, None, f"branches or turns its side over at {at}; a single line is needed")
    starts_here = {int(node): facet for facet, node in enumerate(ends[:, 0])}
    heads = np.setdiff1d(ends[:, 0], ends[:, 1])
    order: list[int] = []
    first = int(heads[0]) if len(heads) else int(ends[0, 0])
    node, pieces, seen = first, 0, np.zeros(len(ends), dtype=bool)
    queue = [*(int(h) for h in heads[1:])]
    while True:  # walk each piece: the first gives the order, the others are only counted
        while (facet := starts_here.get(node, -1)) >= 0 and not seen[facet]:
            seen[facet] = True
            if not pieces:
                order.append(facet)
            node = int(ends[facet, 1])
        pieces += 1
        if queue:
            node = queue.pop()
        elif not seen.all():
            node = int(ends[np.argmin(seen), 0])
        else:
            break
    if pieces > 1:
        raise CaseError(
            where, None, f"lies in {pieces} pieces that do not join; give each a boundary and contact of its own"
        )
    return _numbered(points, ends[order], middle[order], closed=not len(heads), where=where)


def _numbered(points: Array, ends: IntArray, middle: IntArray, *, closed: bool, where: str) -> Chain:
    """The chain of facets already in order."""
    both = np.stack([ends[:, 0], middle], axis=1).ravel()
    nodes = both[both >= 0] if closed else np.append(both[both >= 0], ends[-1, 1])
    number = {int(node): k for k, node in enumerate(nodes)}
    following = points[np.roll(nodes, -1)] if closed else points[nodes[1:]]
    length = np.linalg.norm(following - points[nodes[: len(following)]], axis=1)
    if np.any(length <= 1e-12 * length.max()):
        at = _coordinates(points[nodes[int(np.argmin(length))]])
        raise CaseError(where, None, f"has two neighbouring nodes in the same place, at {at}; merge them")
    if closed and len(nodes) < 3:
        raise CaseError(where, None, "closes on itself over two nodes; at least three are needed")
    own = [[number[int(a)], number[int(b)], number.get(int(m), -1)] for (a, b), m in zip(ends, middle, strict=True)]
    return Chain(nodes, np.array(own, dtype=np.int64), closed)


def _coordinates(point: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in point) + ") m"


def _known(facets: Blocks) -> dict[str, IntArray]:
    """Blocks of facets that hold any. Raises ValueError for a kind that is no facet."""
    for kind in facets:
        if kind not in FACET_KINDS:
            raise ValueError(f"{kind!r} is no kind of facet; there are: {', '.join(FACET_KINDS)}")
    return {kind: np.asarray(nodes) for kind, nodes in facets.items() if len(nodes)}


def _directed_areas(points: Array, nodes: IntArray, rule: FacetRule) -> Array:
    """Outward n dA (f, q, d) at the quadrature points of facets (f, r), weights of the rule included."""
    corners = points[nodes]
    if points.shape[1] == 2:
        along = np.einsum("qr,frd->fqd", rule.derivatives[0], corners)
        directed = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    else:
        first, second = (np.einsum("qr,frd->fqd", d, corners) for d in rule.derivatives)
        directed = np.cross(first, second)
    return directed * rule.weights[:, None]


def _size(directed: Array) -> Array:
    return np.linalg.norm(directed, axis=-1)


def _gauss(count: int) -> tuple[Array, Array]:
    """Gauss–Legendre points and weights on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(count)
    return 0.5 * (x + 1.0), 0.5 * w


def _line(local: Array) -> tuple[Array, Array]:
    x = local[:, 0]
    one = np.ones_like(x)
    return np.stack([1 - x, x], axis=1), np.stack([-one, one], axis=1)[None]


def _line3(local: Array) -> tuple[Array, Array]:
    x = local[:, 0]
    values = np.stack([(1 - x) * (1 - 2 * x), x * (2 * x - 1), 4 * x * (1 - x)], axis=1)
    return values, np.stack([4 * x - 3, 4 * x - 1, 4 - 8 * x], axis=1)[None]


def _triangle(local: Array) -> tuple[Array, Array]:
    x, y = local.T
    one, zero = np.ones_like(x), np.zeros_like(x)
    slopes = [np.stack([-one, one, zero], axis=1), np.stack([-one, zero, one], axis=1)]
    return np.stack([1 - x - y, x, y], axis=1), np.stack(slopes)


def _triangle6(local: Array) -> tuple[Array, Array]:
    linear, slopes = _triangle(local)
    a, b = linear, linear[:, [1, 2, 0]]
    values = np.hstack([a * (2 * a - 1), 4 * a * b])
    derivatives: list[Array] = []
    for da in slopes:
        db = da[:, [1, 2, 0]]
        derivatives.append(np.hstack([da * (4 * a - 1), 4 * (da * b + a * db)]))
    return values, np.stack(derivatives)


def _tensor(local: Array, line: Callable[[Array], tuple[Array, Array]], order: Order) -> tuple[Array, Array]:
    """Products of the functions of a line along both coordinates, in the given order."""
    (a, (da,)), (b, (db,)) = line(local[:, :1]), line(local[:, 1:])
    values = np.stack([a[:, i] * b[:, j] for i, j in order], axis=1)
    along_first = np.stack([da[:, i] * b[:, j] for i, j in order], axis=1)
    along_second = np.stack([a[:, i] * db[:, j] for i, j in order], axis=1)
    return values, np.stack([along_first, along_second])


def _quad(local: Array) -> tuple[Array, Array]:
    return _tensor(local, _line, [(0, 0), (1, 0), (1, 1), (0, 1)])


def _quad9(local: Array) -> tuple[Array, Array]:
    order = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (1, 2), (2, 1), (0, 2), (2, 2)]
    return _tensor(local, _line3, order)


def _quad8(local: Array) -> tuple[Array, Array]:
    # Serendipity: the centre of quad9 shared out, −1/4 to each corner and +1/2 to each middle.
    share = np.array([-0.25] * 4 + [0.5] * 4)
    values, derivatives = _quad9(local)
    return values[:, :8] + values[:, 8:] * share, derivatives[..., :8] + derivatives[..., 8:] * share


_SHAPES = {
    "line": _line,
    "line3": _line3,
    "triangle": _triangle,
    "triangle6": _triangle6,
    "quad": _quad,
    "quad8": _quad8,
    "quad9": _quad9,
}
_TRIANGLE = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
_SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0.5]])
_NODES: dict[str, Array] = {
    "line": np.array([[0.0], [1.0]]),
    "line3": np.array([[0.0], [1.0], [0.5]]),
    "triangle": _TRIANGLE[:3],
    "triangle6": _TRIANGLE,
    "quad": _SQUARE[:4],
    "quad8": _SQUARE[:8],
    "quad9": _SQUARE,
}
