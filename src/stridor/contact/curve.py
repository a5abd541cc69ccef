"""The boundary of a plane body as a master: a C1 cubic spline through its nodes, split at corners.

Images of a boundary of a body that repeats may lie apart: then it is several such splines side by side.

The spline is that of `surface`: cubic Hermite, slopes from the neighbours, linear in the node positions. At its ends
it begins as the parabola through the three nodes there, so that normals are of second order up to the edge of a curved
master; the line of a beam begins along its chord, as `surface` has it. Since the
normal is perpendicular to it and the master point the nearest one, the normal row of a contact is the exact
derivative of the gap: dg = n · (du_slave − Σ weights du_master), at any gap and any curvature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..kernels import njit
from ..mesh.facets import Chain, chain_of
from ..mesh.model import Blocks
from ..typing import Array, IntArray
from . import surface
from .kinks import lone_kinks
from .master import CORNER_DEG, Location

# Beyond an end by less than this part of a segment is still on the line.
END_TOLERANCE = 1e-6
# Nearer to a node than this part of a segment is that node: four weights there would only blur the rows.
NODE_TOLERANCE = 1e-9
# A node is seen from both its segments; beyond it by rounding is no reason to walk to and fro.
ROUNDING = 1e-10
CANDIDATES = 4
INSIDE, BEFORE, AFTER = 0, 1, 2
# No node of a stencil: the spline begins as a parabola, or along its chord.
PARABOLA, CHORD = -1, -2
# An end segment this many times as long as its neighbour is still bent by it in full: a long straight side beside the
# short ones of a fillet is not.
LONG = 2.0

_spline_weights = njit(cache=True)(surface.spline_weights)


@dataclass(frozen=True)
class Curve:
    """k nodes in order, the body on the left of their direction, so that the outward normal is on the right.

    nodes (k,) are the mesh's own numbers of the curve's nodes, the order in which displacements and rows are
    expected. positions (k, 2) [m] undisplaced. A closed curve has no ends; several side by side have many.
    Between segments that turn by more than the corner angle, or by far more than at the nodes around (`kinks`), the
    spline is broken, so that the side of a rectangle and the flat beside a chamfer stay straight; off an outward corner
    the gap is the distance from it. facets (f, 3): first, last and middle node (−1 for linear facets) of the curve's
    numbering, as the finite elements interpolate.
    stencils (c, 4): nodes that shape each of the c segments, negative where the spline begins or ends; chords (c, 3):
    undisplaced lengths [m] of the segments before, of and after it. before, after (c,): segments that continue it
    smoothly, −1 at ends and corners. follows_spline: whether displacements are interpolated as positions are, by the
    spline (the line of a beam), or by the facets.
    """

    nodes: IntArray
    positions: Array
    closed: bool
    facets: IntArray
    stencils: IntArray
    chords: Array
    before: IntArray
    after: IntArray
    follows_spline: bool = False

    @classmethod
    def from_facets(
        cls, points: Array, facets: Blocks, *, where: str, corner_deg: float = CORNER_DEG, follows_spline: bool = False
    ) -> Curve:
        """The curve that facets "line" and "line3" of a mesh with points (·, 2) make up.

        Middle nodes of line3 become nodes of the spline. corner_deg: consecutive segments that turn by more make a
        corner. Raises CaseError naming ``where`` for facets that branch, that lie in several pieces or have no length.
        """
        chain = chain_of(points, facets, where=where)
        return cls._of_chain(points, chain, corner_deg, follows_spline)

    @classmethod
    def _of_chain(cls, points: Array, chain: Chain, corner_deg: float, follows_spline: bool) -> Curve:
        positions = np.asarray(points, dtype=float)[chain.nodes]
        count = len(positions) if chain.closed else len(positions) - 1
        start = np.arange(count)
        end = (start + 1) % len(positions)
        chord = positions[end] - positions[start]
        length = np.linalg.norm(chord, axis=1)
        direction = chord / length[:, None]
        previous, following = (start - 1) % count, (start + 1) % count
        cosine = np.sum(direction * direction[previous], axis=1)  # at the start of each segment
        smooth = cosine >= np.cos(np.radians(corner_deg))
        turn = np.arctan2(direction[previous, 0] * direction[:, 1] - direction[previous, 1] * direction[:, 0], cosine)
        middle = np.zeros(len(positions), dtype=bool)
        middle[chain.facets[:, 2][chain.facets[:, 2] >= 0]] = True
        smooth &= ~lone_kinks(turn, length, middle[:count], ~smooth, closed=chain.closed)
        if not chain.closed:
            smooth[0] = False
        before = np.where(smooth, previous, -1)
        after = np.where(smooth[following], following, -1)
        none = CHORD if follows_spline else PARABOLA
        stencils = np.stack(
            [np.where(before < 0, none, start[before]), start, end, np.where(after < 0, none, end[after])], axis=1
        )
        chords = np.stack(
            [np.where(before < 0, 0.0, length[before]), length, np.where(after < 0, 0.0, length[after])], axis=1
        )
        return cls(
            chain.nodes, positions, chain.closed, chain.facets, stencils, chords, before, after, follows_spline
        )  # fmt: skip

    @classmethod
    def side_by_side(cls, parts: Sequence[Curve]) -> Curve:
        """Curves, one by one as they are, as one of all their nodes; it is closed where a single one is."""
        if len(parts) == 1:
            return parts[0]
        nodes = np.cumsum([0, *(len(part.positions) for part in parts)])
        segments = np.cumsum([0, *(len(part.chords) for part in parts)])

        def put(name: str, offsets: IntArray) -> IntArray:
            """The numbers of all parts, negative ones as they are."""
            given = [getattr(part, name) for part in parts]
            return np.concatenate([np.where(of < 0, of, of + o) for of, o in zip(given, offsets[:-1], strict=True)])

        return cls(
            np.concatenate([part.nodes for part in parts]),
            np.concatenate([part.positions for part in parts]),
            False,
            put("facets", nodes),
            put("stencils", nodes),
            np.concatenate([part.chords for part in parts]),
            put("before", segments),
            put("after", segments),
            parts[0].follows_spline,
        )

    @property
    def node_count(self) -> int:
        """Number of nodes k."""
        return len(self.nodes)

    @property
    def dimension(self) -> int:
        """2."""
        return 2

    @property
    def corners(self) -> IntArray:
        """Nodes of the curve's own numbering where it turns sharply."""
        broken = self.stencils[self.before < 0, 1]
        return broken[np.isin(broken, self.stencils[:, 2])]  # others begin a line

    @property
    def chord_height(self) -> float:
        """Largest height [m] of the spline above its chords, about h²/8R: what a polygon would be wrong by."""
        xi = np.full(len(self.chords), 0.5)
        weights, _ = weights_at(np.arange(len(self.chords)), xi, self.stencils, self.chords)
        middle = np.einsum("cr,crd->cd", weights, self.positions[self.stencils])
        chord_middle = self.positions[self.stencils[:, 1:3]].mean(axis=1)
        return float(np.linalg.norm(middle - chord_middle, axis=1).max())

    def locate(self, slaves: Array, displacement: Array | None = None, *, guess: IntArray | None = None) -> Location:
        """Nearest points of the displaced curve to slave positions (m, 2) [m].

        displacement (k, 2) [m] of the curve's nodes. With guess (m,) the search walks from those segments and stays
        on their side of a body; only slaves that leave over an end or corner are searched for anew. Without, it
        begins at the nearest segments.
        """
        current = self.positions if displacement is None else self.positions + displacement
        slaves = np.ascontiguousarray(slaves, dtype=float)
        if guess is not None:
            found = self._walk(slaves, current, np.asarray(guess, dtype=np.int64)[:, None])
            again = np.flatnonzero(found[2] != INSIDE)
            if len(again):
                anew = self._walk(slaves[again], current, self._nearest_segments(slaves[again], current))
                for whole, part in zip(found, anew, strict=True):
                    whole[again] = part
        else:
            found = self._walk(slaves, current, self._nearest_segments(slaves, current))
        return self._location(slaves, current, *found)

    def _walk(self, slaves: Array, current: Array, starts: IntArray) -> tuple[IntArray, Array, IntArray]:
        """Segment (m,), xi (m,) and state (m,) of the nearest points found from starts (m, q)."""
        found = _walk_all(
            slaves, np.ascontiguousarray(current), self.stencils, self.chords, self.before, self.after, starts
        )
        return found[0], found[1], found[2]

    def _nearest_segments(self, slaves: Array, current: Array) -> IntArray:
        """Segments (m, q) to begin with: long ones are sampled more often, lest short ones seem nearer."""
        length = self.chords[:, 1]
        parts = np.clip(np.ceil(length / np.median(length)), 1, 16).astype(np.int64)
        owner = np.repeat(np.arange(len(parts)), parts)
        xi = (np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts) + 0.5) / parts[owner]
        ends = current[self.stencils[:, 1:3]][owner]
        samples = ends[:, 0] + xi[:, None] * (ends[:, 1] - ends[:, 0])
        count = min(CANDIDATES, len(owner))
        nearest = np.asarray(cKDTree(samples).query(slaves, k=count)[1], dtype=np.int64)
        return owner[nearest.reshape(len(slaves), count)]

    def _location(self, slaves: Array, current: Array, segment: IntArray, xi: Array, state: IntArray) -> Location:
        xi = np.where(xi < NODE_TOLERANCE, 0.0, np.where(xi > 1.0 - NODE_TOLERANCE, 1.0, xi))
        weights, slopes = weights_at(segment, xi, self.stencils, self.chords)
        nodes = np.where(weights == 0.0, 0, self.stencils[segment])
        around = current[np.maximum(self.stencils[segment], 0)]
        point = np.einsum("mr,mrd->md", weights, around)
        along = np.einsum("mr,mrd->md", slopes, around)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
        inside = state == INSIDE
        at = np.where(state == BEFORE, self.stencils[segment, 1], self.stencils[segment, 2])
        cornered = np.flatnonzero(~inside & np.isin(at, self.corners))
        if len(cornered):
            normal[cornered] = self._corner_normals(at[cornered], slaves[cornered] - point[cornered], current)
            inside[cornered] = True
        gap = np.sum(normal * (slaves - point), axis=1)
        return Location(nodes, weights, point, normal, gap, segment, inside, xi[:, None])

    def smooth_at(self, location: Location) -> tuple[Array, IntArray]:
        """The undisplaced curve's own normals (m, 2) at places on it, off corners those of one of the sides, and the
        number (m,) of the part between corners that each is on."""
        xi = np.zeros(len(location.facet)) if location.local is None else location.local[:, 0]
        segment = location.facet
        slopes = weights_at(segment, xi, self.stencils, self.chords)[1]
        along = np.einsum("mr,mrd->md", slopes, self.positions[np.maximum(self.stencils[segment], 0)])
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        count, before = len(self.chords), np.flatnonzero(self.after >= 0)
        graph = sp.coo_array((np.ones(len(before)), (before, self.after[before])), shape=(count, count))
        parts = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
        return np.stack([along[:, 1], -along[:, 0]], axis=1), parts[segment]

    def _corner_normals(self, corner: IntArray, offset: Array, current: Array) -> Array:
        """Out of a corner towards (from, inside the body) slaves at an offset (q, 2) from it."""
        chord = current[self.stencils[:, 2]] - current[self.stencils[:, 1]]
        chord /= np.linalg.norm(chord, axis=1, keepdims=True)
        towards, away = self._segments_at(corner)
        along = chord[away] + chord[towards]
        mean = np.stack([along[:, 1], -along[:, 0]], axis=1)
        mean /= np.linalg.norm(mean, axis=1, keepdims=True)
        distance = np.linalg.norm(offset, axis=1)
        apart = distance > NODE_TOLERANCE * self.chords[:, 1].min()
        side = np.where(np.sum(mean * offset, axis=1) < 0, -1.0, 1.0)
        scaled = side[:, None] * offset / np.where(apart, distance, 1.0)[:, None]
        return np.where(apart[:, None], scaled, mean)

    def _segments_at(self, node: IntArray) -> tuple[IntArray, IntArray]:
        """The segments (q,) that end and that begin at nodes (q,) with both."""
        towards, away = np.zeros((2, len(self.positions)), dtype=np.int64)
        towards[self.stencils[:, 2]] = away[self.stencils[:, 1]] = np.arange(len(self.chords))
        return towards[node], away[node]

    def at_corners(self, location: Location, slaves: Array, slave_normals: Array) -> Location:
        """Places of undisplaced slaves (m, 2) [m] where those that lie at a corner look the way their own normals
        (m, 2) say, as far as the normals of both sides of the corner enclose that.

        Which of its sides is nearer there rounding decides, of an inward corner as of an outward one. Slaves without a
        normal keep that side's.
        """
        xi = np.zeros(len(slaves)) if location.local is None else location.local[:, 0]
        at = self.stencils[location.facet, np.where(xi < 0.5, 1, 2)]
        length = self.chords[np.stack(self._segments_at(at)), 1].min(axis=0)
        near = np.linalg.norm(slaves - self.positions[at], axis=1) <= END_TOLERANCE * length
        which = np.flatnonzero(near & np.isin(at, self.corners) & np.any(slave_normals, axis=1))
        if not len(which):
            return location
        chord = self.positions[self.stencils[:, 2]] - self.positions[self.stencils[:, 1]]
        out = np.stack([chord[:, 1], -chord[:, 0]], axis=1) / np.linalg.norm(chord, axis=1, keepdims=True)
        one, two = (out[segment] for segment in self._segments_at(at[which]))
        turn, own = _angle(one, two), _angle(one, -slave_normals[which])
        angle = np.clip(own, np.minimum(turn, 0.0), np.maximum(turn, 0.0))[:, None]
        across = np.stack([-one[:, 1], one[:, 0]], axis=1)
        normal = location.normal.copy()
        normal[which] = np.cos(angle) * one + np.sin(angle) * across
        return replace(location, normal=normal, gap=np.sum(normal * (slaves - location.point), axis=1))


def _angle(one: Array, other: Array) -> Array:
    """Signed angles (q,) [rad] from vectors (q, 2) to others."""
    return np.arctan2(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0], np.sum(one * other, axis=1))


def weights_at(segment: IntArray, xi: Array, stencils: IntArray, chords: Array) -> tuple[Array, Array]:
    """Weights (m, 4) of the nodes of the stencil in the spline points, and in their derivatives along xi."""
    weights, slopes = np.zeros((len(segment), 4)), np.zeros((len(segment), 4))
    _fill_weights(np.asarray(segment, dtype=np.int64), xi, stencils, chords, weights, slopes)
    return weights, slopes


@njit(cache=True)
def _segment_weights(
    segment: int, xi: float, stencils: IntArray, chords: Array, weights: Array, slopes: Array
) -> None:  # pragma: no cover - compiled
    first = 1 if stencils[segment, 0] < 0 else 0
    last = 2 if stencils[segment, 3] < 0 else 3
    _spline_weights(1 - first, xi, chords[segment, first:last], weights, slopes)
    if first == 1 and last == 3 and stencils[segment, 0] == PARABOLA:
        own, other = chords[segment, 1], chords[segment, 2]
        value = xi * (1.0 - xi) * (1.0 - xi)
        _bend(value, (1.0 - xi) * (1.0 - 3.0 * xi), own, other, weights, slopes, 1, 2, 3)
    elif first == 0 and last == 2 and stencils[segment, 3] == PARABOLA:
        own, other = chords[segment, 1], chords[segment, 0]
        value = xi * xi * (1.0 - xi)
        _bend(value, xi * (2.0 - 3.0 * xi), own, other, weights, slopes, 2, 1, 0)


@njit(cache=True)
def _bend(
    value: float,
    slope: float,
    own: float,
    other: float,
    weights: Array,
    slopes: Array,
    end: int,
    middle: int,
    beyond: int,
) -> None:  # pragma: no cover - compiled
    """Add to the chord's slope at an end of a segment what that of the parabola through three nodes has more.

    Away from the end the parabola's slope is the chord's by −own² times the second divided difference. value and slope:
    of the Hermite function that has slope one there, directed from the end.
    """
    ratio = min(1.0, (LONG * other / own) ** 2)
    whole = own + other
    to_end, to_beyond = ratio * own / whole, ratio * own * own / (other * whole)
    weights[end] -= to_end * value
    weights[middle] += (to_end + to_beyond) * value
    weights[beyond] -= to_beyond * value
    slopes[end] -= to_end * slope
    slopes[middle] += (to_end + to_beyond) * slope
    slopes[beyond] -= to_beyond * slope


@njit(cache=True)
def _fill_weights(
    segment: IntArray, xi: Array, stencils: IntArray, chords: Array, weights: Array, slopes: Array
) -> None:  # pragma: no cover - compiled
    for i in range(segment.shape[0]):
        _segment_weights(segment[i], xi[i], stencils, chords, weights[i], slopes[i])


@njit(cache=True)
def _sum(stencil: IntArray, current: Array, weights: Array) -> tuple[float, float]:  # pragma: no cover - compiled
    x = 0.0
    y = 0.0
    for k in range(4):
        if weights[k] != 0.0:
            x += weights[k] * current[stencil[k], 0]
            y += weights[k] * current[stencil[k], 1]
    return x, y


@njit(cache=True)
def _project(
    x: float,
    y: float,
    current: Array,
    stencils: IntArray,
    chords: Array,
    before: IntArray,
    after: IntArray,
    segment: int,
    weights: Array,
    slopes: Array,
) -> tuple[int, float, int, float]:  # pragma: no cover - compiled
    """Segment, xi, state and squared distance of the nearest point, walking from the middle of ``segment``."""
    xi = 0.5
    state = INSIDE
    for _ in range(surface.MAX_PROJECTION_STEPS):
        stencil = stencils[segment]
        # The slope is quadratic in xi, so that its central difference over one is exactly its derivative.
        _segment_weights(segment, xi + 0.5, stencils, chords, weights, slopes)
        ax, ay = _sum(stencil, current, slopes)
        _segment_weights(segment, xi - 0.5, stencils, chords, weights, slopes)
        bx, by = _sum(stencil, current, slopes)
        _segment_weights(segment, xi, stencils, chords, weights, slopes)
        px, py = _sum(stencil, current, weights)
        sx, sy = _sum(stencil, current, slopes)
        square = sx * sx + sy * sy
        # Newton's method; past the centre of curvature the full curvature would lead away from the nearest point.
        bent = square - (x - px) * (ax - bx) - (y - py) * (ay - by)
        new = xi + ((x - px) * sx + (y - py) * sy) / max(bent, 0.1 * square)
        state = INSIDE
        if new < 0.0:
            if before[segment] >= 0:
                if new < -ROUNDING:
                    ratio = chords[segment, 1] / chords[segment, 0]
                    segment = before[segment]
                    xi = max(1.0 + new * ratio, 0.0)
                    continue
            elif new < -END_TOLERANCE:
                state = BEFORE
            new = 0.0
        elif new > 1.0:
            if after[segment] >= 0:
                if new > 1.0 + ROUNDING:
                    ratio = chords[segment, 1] / chords[segment, 2]
                    segment = after[segment]
                    xi = min((new - 1.0) * ratio, 1.0)
                    continue
            elif new > 1.0 + END_TOLERANCE:
                state = AFTER
            new = 1.0
        moved = abs(new - xi)
        xi = new
        if moved < 1e-13:
            break
    _segment_weights(segment, xi, stencils, chords, weights, slopes)
    px, py = _sum(stencils[segment], current, weights)
    return segment, xi, state, (x - px) * (x - px) + (y - py) * (y - py)


@njit(cache=True)
def _walk_all(
    slaves: Array,
    current: Array,
    stencils: IntArray,
    chords: Array,
    before: IntArray,
    after: IntArray,
    starts: IntArray,
) -> tuple[IntArray, Array, IntArray]:  # pragma: no cover - compiled
    """The nearest of the points found from each start; one on the line rather than an end equally near."""
    count = slaves.shape[0]
    segments = np.empty(count, dtype=np.int64)
    parameters = np.empty(count)
    states = np.empty(count, dtype=np.int64)
    weights = np.zeros(4)
    slopes = np.zeros(4)
    for i in range(count):
        best = np.inf
        for j in range(starts.shape[1]):
            repeated = False
            for earlier in range(j):
                repeated = repeated or starts[i, earlier] == starts[i, j]
            if repeated:
                continue
            segment, xi, state, square = _project(
                slaves[i, 0],
                slaves[i, 1],
                current,
                stencils,
                chords,
                before,
                after,
                starts[i, j],
                weights,
                slopes,
            )
            if state != INSIDE:
                square += 1e-9 * (square + chords[segment, 1] * chords[segment, 1] * 1e-9)
            if square < best:
                best = square
                segments[i], parameters[i], states[i] = segment, xi, state
    return segments, parameters, states
