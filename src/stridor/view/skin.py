"""What of a System can be seen: the outer facets of its solids, its lines and point masses, and how they move with a
vector."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import CaseError
from ..system import System
from ..typing import Array, ComplexArray, IntArray
from .colours import COLOURS
from .units import frequency_unit

AMPLITUDE = 0.08  # of the model's extent: how far the largest motion is drawn
VIEW = (28.0, -58.0)  # elevation and azimuth [degrees]
EDGES_UP_TO = 6000  # facets; with more of them their edges would cover the colours
CONCENTRATED = 0.15  # of the largest amplitude: three quarters of the nodes move less where one corner moves

# Corner nodes only: middle nodes bend an edge by less than a drawing shows. Corners turn counter-clockwise seen from
# outside, triangles repeat their last corner.
_TRIANGLE, _QUAD = ((0, 1, 2, 2),), ((0, 1, 2, 3),)
_TETRA = ((0, 2, 1, 1), (0, 1, 3, 3), (1, 2, 3, 3), (0, 3, 2, 2))
_HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
FLAT: dict[str, tuple[tuple[int, ...], ...]] = {
    **dict.fromkeys(("triangle", "triangle6"), _TRIANGLE),
    **dict.fromkeys(("quad", "quad8", "quad9"), _QUAD),
}
SOLID: dict[str, tuple[tuple[int, ...], ...]] = {
    **dict.fromkeys(("tetra", "tetra10"), _TETRA),
    **dict.fromkeys(("hexahedron", "hexahedron20", "hexahedron27"), _HEXAHEDRON),
}


@dataclass(frozen=True)
class Skin:
    """The visible surface of a system of dimension d = 2 or 3, all bodies in one list.

    names: bodies, the meshed ones first, then point masses, then the lines. points (k, d) [m]: only those that are
    drawn. facets (f, 4) index them, triangles repeat their last corner; in the plane they are the cells, in space the
    outer facets, corners counter-clockwise seen from outside; closed: whether they all bound volumes, so that those
    facing away are hidden. body (f,) and point_body (k,) index names. edges (e, 2): the outline in the plane, none in
    space; segments (s, 2) with segment_body (s,): the pieces of the lines, and for each point mass one that begins and
    ends at its point. motion (k, d) is the complex displacement [m] of a vector, zero without one.
    """

    names: tuple[str, ...]
    points: Array
    point_body: IntArray
    facets: IntArray
    body: IntArray
    edges: IntArray
    segments: IntArray
    segment_body: IntArray
    motion: ComplexArray
    closed: bool

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.points.shape[1])

    @property
    def lone(self) -> IntArray:
        """Segments (m,) that are point masses."""
        return np.flatnonzero(self.segments[:, 0] == self.segments[:, 1])

    @property
    def triangles(self) -> int:
        """How many the facets are drawn as."""
        return len(self.facets) + int(np.count_nonzero(self.facets[:, 3] != self.facets[:, 2]))

    @property
    def extent(self) -> float:
        """Largest side of the box around everything [m], 1 where there is none."""
        return float(np.ptp(self.points, axis=0).max(initial=0.0)) or 1.0 if len(self.points) else 1.0


def skin_of(system: System, vector: Array | ComplexArray | None = None) -> Skin:
    """The visible surface of a system moving with ``vector`` (n,).

    Raises CaseError for a vector of another length or with values that are not finite, for a system that has neither
    solids nor lines (point masses alone are no shape), and for cells of a kind that is not known.
    """
    moving = checked_vector(system, vector)
    points: list[Array] = []
    motion: list[ComplexArray] = []
    facets: list[IntArray] = []
    edges: list[IntArray] = []
    owner: list[IntArray] = []
    start = 0
    masses = [solid for solid in system.solids if not solid.cells.keys() - {"vertex"}]
    solids = [solid for solid in system.solids if solid.cells.keys() - {"vertex"}]
    if not solids and not system.lines:
        raise CaseError("system", None, "has neither solids nor lines, so there is nothing to draw")
    for index, solid in enumerate(solids):
        found = surface_facets(solid.cells, int(solid.points.shape[1]))
        used, inverse = np.unique(found, return_inverse=True)
        local = inverse.reshape(found.shape) + start
        facets.append(local)
        owner.append(np.full(len(local), index))
        edges.append(_outline(local) if solid.points.shape[1] == 2 else np.zeros((0, 2), dtype=np.int64))
        points.append(solid.points[used])
        motion.append((solid.rows.free @ moving).reshape(solid.points.shape)[used])
        start += len(used)
    pieces: list[IntArray] = []
    piece_owner: list[IntArray] = []
    for index, mass in enumerate(masses, start=len(solids)):
        points.append(mass.points)
        motion.append((mass.rows.free @ moving).reshape(mass.points.shape))
        pieces.append(np.repeat(start + np.arange(len(mass.points)), 2).reshape(-1, 2))
        piece_owner.append(np.full(len(mass.points), index))
        start += len(mass.points)
    for index, line in enumerate(system.lines, start=len(system.solids)):
        count, width = line.coordinates.shape
        pad = ((0, 0), (0, system.dimension - width))
        points.append(np.pad(line.coordinates, pad))
        motion.append(np.pad((line.rows.free @ moving).reshape(count, width), pad))
        pieces.append(start + np.column_stack([np.arange(count - 1), np.arange(1, count)]))
        piece_owner.append(np.full(count - 1, index))
        start += count
    none = np.zeros((0, 2), dtype=np.int64)
    return Skin(
        names=tuple(body.name for body in (*solids, *masses, *system.lines)),
        points=np.concatenate(points),
        point_body=np.repeat(np.arange(len(points)), [len(p) for p in points]),
        facets=np.concatenate([np.zeros((0, 4), dtype=np.int64), *facets]),
        body=np.concatenate([none[:, 0], *owner]),
        edges=np.concatenate([none, *edges]),
        segments=np.concatenate([none, *pieces]),
        segment_body=np.concatenate([none[:, 0], *piece_owner]),
        motion=np.concatenate(motion),
        closed=all(kind in SOLID for s in solids for kind in s.cells),
    )


def checked_vector(system: System, vector: Array | ComplexArray | None) -> ComplexArray:
    """The vector as complex numbers (n,), zeros for None. Raises CaseError where it does not fit the system."""
    if vector is None:
        return np.zeros(system.size, dtype=complex)
    given = np.asarray(vector)
    if given.shape != (system.size,):
        raise CaseError("vector", f"an array of shape {given.shape}", f"one value for each of {system.size} freedoms")
    if not np.all(np.isfinite(given)):
        raise CaseError("vector", "values that are not finite", "real or complex numbers")
    return given.astype(complex)


def surface_facets(cells: Mapping[str, IntArray], dimension: int) -> IntArray:
    """Facets (f, 4) of cells by kind: those that belong to one solid cell only; flat cells as they are.

    Indices are those of the cells. Raises CaseError for kinds that are not of the given dimension.
    """
    flat: list[IntArray] = []
    solid: list[IntArray] = []
    for kind, nodes in cells.items():
        if kind in FLAT:
            flat.append(np.asarray(nodes)[:, FLAT[kind]].reshape(-1, 4))
        elif kind in SOLID and dimension == 3:
            solid.append(np.asarray(nodes)[:, SOLID[kind]].reshape(-1, 4))
        else:
            known = (*FLAT, *SOLID) if dimension == 3 else tuple(FLAT)
            raise CaseError("cells", kind, f"not a kind that can be drawn in {dimension}D; known: {', '.join(known)}")
    kept = flat
    if solid:
        every = np.concatenate(solid)
        # A triangle repeats a corner; as −1 it sorts first, and no quadrilateral looks the same.
        key = np.where((every[:, 3] == every[:, 2])[:, None] & (np.arange(4) == 3), -1, every)
        kept = [*flat, every[_alone(np.sort(key, axis=1))]]
    return np.concatenate([np.zeros((0, 4), dtype=np.int64), *kept])


def _alone(rows: IntArray) -> IntArray:
    """Places of rows (r, 4) that occur once. Two whole numbers for a row sort far quicker than four."""
    size = int(rows.max(initial=0)) + 2
    first, second = rows[:, 0] * size + rows[:, 1], rows[:, 2] * size + rows[:, 3]
    order = np.lexsort((second, first))
    same = (np.diff(first[order]) == 0) & (np.diff(second[order]) == 0)
    twin = np.concatenate([[False], same]) | np.concatenate([same, [False]])
    return np.sort(order[~twin])


def _outline(facets: IntArray) -> IntArray:
    """Edges (e, 2) that belong to one facet only."""
    pairs, _, count = distinct(facet_edges(facets))
    return pairs[count == 1]


def distinct(pairs: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Pairs (e, 2) of indices each once, which of them each given one is, and how often they occur."""
    size = int(pairs.max(initial=0)) + 1
    key, inverse, count = np.unique(pairs[:, 0] * size + pairs[:, 1], return_inverse=True, return_counts=True)
    return np.column_stack([key // size, key % size]), inverse.ravel(), count


def facet_edges(facets: IntArray) -> IntArray:
    """Edges (e, 2) of all facets, smaller node first, shared ones once for each facet."""
    every = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.sort(every[every[:, 0] != every[:, 1]], axis=1)


def at_largest(motion: ComplexArray) -> tuple[ComplexArray, float]:
    """Motion (k, d) turned so that its real part is as large as can be, and its largest amplitude [m].

    The amplitude of a point is √Σ|û|² over its components. A motion of nothing stays as it is, with amplitude 0.
    """
    turn = np.exp(-0.5j * np.angle(np.sum(motion**2)))
    return motion * turn, float(np.sqrt(np.sum(np.abs(motion) ** 2, axis=1)).max(initial=0.0))


def drawn_scale(skin: Skin, largest: float, scale: float | None) -> float:
    """Factor on displacements in a drawing: the given one, else the largest motion as AMPLITUDE of the extent."""
    if scale is not None:
        if not np.isfinite(scale):
            raise CaseError("scale", scale, "a finite number, or nothing for one that suits the drawing")
        return float(scale)
    return AMPLITUDE * skin.extent / largest if largest > 0 else 0.0


def concentrated(skin: Skin) -> bool:
    """Whether the amplitudes of a cycle are small nearly everywhere."""
    amplitude = np.linalg.norm(np.abs(skin.motion), axis=1)
    return bool(len(amplitude)) and float(np.quantile(amplitude, 0.75)) < CONCENTRATED * float(amplitude.max())


def body_colour(index: int) -> str:
    """The colour of body number ``index``; after the last one they begin again."""
    return COLOURS[index % len(COLOURS)]


def normals(points: Array, facets: IntArray) -> Array:
    """Unit normals (f, 3) of facets in space from their diagonals; zero for degenerate ones."""
    corner = points[facets]
    # A triangle repeats its last corner; its "diagonals" are two of its sides, in the same sense.
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    size = np.linalg.norm(across, axis=1, keepdims=True)
    return across / np.where(size > 0, size, 1.0)


def mode_title(frequency_hz: float | None, growth_rate: float | None) -> str:
    """A mode in words: its frequency and whether it grows."""
    words: list[str] = []
    if frequency_hz is not None:
        unit, its_name = frequency_unit(abs(frequency_hz) or 1.0)
        words.append(f"{frequency_hz / unit:.4g} {its_name}")
    if growth_rate is not None:
        kind = "unstable: grows" if growth_rate > 0 else "stable: decays" if growth_rate < 0 else "neutral"
        rate = f"{growth_rate:+.4g}" if growth_rate else "0"
        words.append(f"growth rate {rate} 1/s ({kind})")
    return ", ".join(words)
