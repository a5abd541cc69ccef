"""Which edges between the facets of a surface in space are edges of the body though they turn by little.

As `kinks` has it for lines: facets of a curve turn by a like amount over edges that follow each other, a chamfer turns
once, between flats. So of an edge the edges around the far corners of the facets on both sides are asked, as far as
they turn about the same axis and the same way. Quadratic facets turn themselves: their edges count by the angle between
the true normals on both sides, and one that turns by no more than the facets beside it do is part of a curve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ..typing import Array, BoolArray, IntArray
from .facet_edges import Edges
from .kinks import EVEN, LIKE, RATIO, SLIGHT

# cos of the angle between edges that continue each other, or lie side by side.
ALONG = np.cos(np.radians(30.0))
# cos of the angle between what is across an edge and where one is that follows it.
ACROSS = 0.5
# Where an arc begins beside a flat, its first edge turns by half of what the next do.
BEGINS = 2.0 / 3.0
# Edges sharper than the corner angle and no sharper than this that follow each other alike may be a coarse curve.
COARSE = np.radians(60.0)


@dataclass(frozen=True)
class Creases:
    """Of e edges: which are edges of the body, by angle or alone between flats (e,); of which that cannot be told
    (e,): they are taken as what ``edge`` says."""

    edge: BoolArray
    doubtful: BoolArray


def creases(edges: Edges, corners: IntArray, positions: Array, corner_angle: float) -> Creases:
    """Which edges between facets with corners (f, 4), −1 in the last place of a triangle, are edges of the body.

    positions (k, 3) [m] are those of the nodes.

    corner_angle [rad]: beyond it all are. Others are where they stand alone: on both sides facets are flat, or turn by
    a tenth. A side that ends with the facet at an edge of the surface, or at a sharp one, says nothing: then the other
    side has to be flat. Three and more at even distances, that turn alike, are a curve whose facets were divided.
    Of few flats, of which no three edges follow each other, those round one that is far wider than the others are
    edges, as an arc has no such facet; of others it cannot be told.
    """
    size = np.abs(edges.turn)
    sharp = size > corner_angle
    if not (size > SLIGHT).any():
        return Creases(sharp, sharp)
    around = _Around(edges, corners, sharp)
    alike, opposite, told = around.evidence(~sharp)
    limit = SLIGHT + np.maximum(RATIO * alike, edges.own)
    straight = told & (size[:, None] > limit)
    flat = told & (np.maximum(alike, opposite) <= SLIGHT) & (size[:, None] > limit)
    ends = ~told & (size[:, None] > SLIGHT + edges.own)
    one = (flat[:, 0] & ends[:, 1]) | (flat[:, 1] & ends[:, 0])
    for e in np.flatnonzero(one & ~sharp):
        # Where the surface turns back a little farther in, the flat is an inflection.
        one[e] = not around.turns_back(int(e), int(flat[e, 1]))
    lone = ~sharp & (straight.all(axis=1) | one)
    _continue(edges, lone, ~sharp & flat.any(axis=1), ~sharp & ends.all(axis=1), size)
    curve = _even(edges, lone, sharp, len(corners))
    lone &= ~curve
    whole, part = _reaching(edges, lone, corners, sharp)
    lone = whole | part
    wide, few = _of_few_flats(edges, around, positions, sharp | lone)
    held = _reaching(edges, (wide | few) & ~curve, corners, sharp | lone)[0]
    wide, few = wide & held, few & held
    lone |= wide
    doubtful = _doubtful(edges, around, size, sharp, lone | curve, alike, told)
    doubtful &= sharp | _reaching(edges, doubtful, corners, sharp | lone)[0]
    return Creases(sharp | lone, few | (doubtful & (sharp | _straight_on(edges, doubtful))))


def _doubtful(
    edges: Edges, around: _Around, size: Array, sharp: BoolArray, settled: BoolArray, alike: Array, told: BoolArray
) -> BoolArray:
    """Edges that a curve may have as well as a body with flats."""
    open_ = ~sharp & ~settled & (size > SLIGHT)
    level = told & (alike <= SLIGHT)
    # Beside a flat an arc begins by half. Two edges of the whole angle at once may be those of a chamfer as well.
    begins = (level[:, 0] | level[:, 1]) & (size >= BEGINS * alike.max(axis=1)) & (edges.own.max(axis=1) <= SLIGHT)
    begins &= around.only_such(np.minimum(alike[:, 0], alike[:, 1]) > SLIGHT)
    # Two facets, or three, between ends are as much a bent plate as a piece of a curve.
    some = told[:, 0] | told[:, 1]
    few = some & ~(told[:, 0] & told[:, 1]) & around.only_such(told[:, 0] & told[:, 1])
    # A face as curved as the edge beside it is sharp.
    beside = (size > SLIGHT + 0.5 * edges.own.max(axis=1)) & (edges.own.max(axis=1) > SLIGHT)
    beside &= size > SLIGHT + RATIO * alike.max(axis=1)
    likely = open_ & (begins | ~some | few | beside)
    # Sharp ones that follow each other alike may be a curve of few facets.
    both, _, _ = around.evidence(sharp & (size <= COARSE))
    return likely | (sharp & (size <= COARSE) & (both.min(axis=1) * LIKE >= size))


class _Around:
    """Edges at the nodes of a surface."""

    def __init__(self, edges: Edges, corners: IntArray, sharp: BoolArray) -> None:
        self.edges, self.corners, self.sharp = edges, corners, sharp
        count = int(corners.max()) + 1
        node, edge = edges.nodes.ravel(), np.repeat(np.arange(len(edges.turn)), 2)
        order = np.argsort(node, kind="stable")
        self.start = np.searchsorted(node[order], np.arange(count + 1))
        self.at = edge[order]
        self.most = int(np.diff(self.start).max(initial=0))
        everyone = corners[edges.facets]  # (e, 2, 4)
        beside = (everyone < 0) | (everyone == edges.nodes[:, :1, None]) | (everyone == edges.nodes[:, 1:, None])
        # Edges that do not turn ask for nothing.
        self.far = np.where(beside | (np.abs(edges.turn) <= SLIGHT)[:, None, None], -1, everyone)

    def each(self, which: IntArray) -> list[tuple[IntArray, IntArray]]:
        """For nodes (q,), −1 for none: pairs of places in that list and edges there, by number."""
        found: list[tuple[IntArray, IntArray]] = []
        for k in range(self.most):
            there = np.flatnonzero((which >= 0) & (self.start[which] + k < self.start[which + 1]))
            found.append((there, self.at[self.start[which[there]] + k]))
        return found

    def evidence(self, telling: BoolArray) -> tuple[Array, Array, BoolArray]:
        """By what edges at the far corners of both facets turn (e, 2) [rad] about each edge, the same way and the
        other way, and whether there are (e, 2) any, of those that tell."""
        count = len(self.edges.turn)
        same, other, told = np.zeros((2 * count, 1)), np.zeros((2 * count, 1)), np.zeros(2 * count, dtype=bool)
        ends, along, turn = self.edges.nodes, self.edges.along, self.edges.turn
        flat = self.far.reshape(2 * count, 4)
        for corner in range(4):
            for there, found in self.each(flat[:, corner]):
                mine = there // 2
                apart = (ends[found][:, :, None] != ends[mine][:, None, :]).all(axis=(1, 2)) & telling[found]
                there, found, mine = there[apart], found[apart], mine[apart]
                part = turn[found] * np.abs(np.sum(along[found] * along[mine], axis=1)) * np.sign(turn[mine])
                same[there, 0] = np.maximum(same[there, 0], part)
                other[there, 0] = np.maximum(other[there, 0], -part)
                told[there] = True
        return same.reshape(count, 2), other.reshape(count, 2), told.reshape(count, 2)

    def followed_by(self, bent: BoolArray, sides: IntArray) -> IntArray:
        """Of bent edges (e,) between flats (e, 2): one at the far corners of both facets (e, 2) that follows over the
        same flat, along them and turning alike, −1 where none is."""
        edges, count = self.edges, len(self.edges.turn)
        partner = np.full(2 * count, -1, dtype=np.int64)
        flat, patch, inward = self.far.reshape(2 * count, 4), sides.ravel(), edges.inward.reshape(2 * count, 3)
        for corner in range(4):
            for there, found in self.each(flat[:, corner]):
                mine = there // 2
                near = bent[mine] & bent[found] & (mine != found) & (sides[found] == patch[there, None]).any(axis=1)
                there, found, mine = there[near], found[near], mine[near]
                away = edges.middle[found] - edges.middle[mine]
                ratio = edges.turn[found] / edges.turn[mine]
                like = (ratio <= LIKE) & (ratio >= 1.0 / LIKE)
                like &= np.abs(np.sum(edges.along[found] * edges.along[mine], axis=1)) >= ALONG
                like &= np.sum(away * inward[there], axis=1) > ACROSS * np.linalg.norm(away, axis=1)
                partner[there[like]] = found[like]
        return partner.reshape(count, 2)

    def turns_back(self, edge: int, side: int) -> bool:
        """Whether two facets away on a side edges turn the other way."""
        ends = self.edges.nodes[edge]
        near = self.far[edge, side]
        first = np.unique(np.concatenate([self.at[self.start[n] : self.start[n + 1]] for n in near[near >= 0]]))
        facets = np.unique(self.edges.facets[first])
        nodes = np.unique(self.corners[facets])
        found = np.unique(np.concatenate([self.at[self.start[n] : self.start[n + 1]] for n in nodes[nodes >= 0]]))
        found = found[~self.sharp[found] & ~np.isin(self.edges.nodes[found], ends).any(axis=1)]
        ahead = np.sum((self.edges.middle[found] - self.edges.middle[edge]) * self.edges.inward[edge, side], axis=1) > 0
        part = self.edges.turn[found] * np.abs(self.edges.along[found] @ self.edges.along[edge])
        return bool(np.any((-np.sign(self.edges.turn[edge]) * part > SLIGHT) & ahead))

    def only_such(self, amid: BoolArray) -> BoolArray:
        """Edges (e,) around which others turn the same way, none of them amid (e,) a curve."""
        count = len(self.edges.turn)
        inner, like = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        ends, along, turn = self.edges.nodes, self.edges.along, self.edges.turn
        flat = self.far.reshape(2 * count, 4)
        for corner in range(4):
            for there, found in self.each(flat[:, corner]):
                mine = there // 2
                part = turn[found] * np.abs(np.sum(along[found] * along[mine], axis=1)) * np.sign(turn[mine])
                near = (ends[found][:, :, None] != ends[mine][:, None, :]).all(axis=(1, 2)) & (part > SLIGHT)
                like[mine[near]] = True
                inner[mine[near & amid[found]]] = True
        return like & ~inner


def _continue(edges: Edges, lone: BoolArray, beside: BoolArray, unknown: BoolArray, size: Array) -> None:
    """Edges beside (e,) a flat that go straight on where one that stands alone ends, and turn alike, are of the same
    crease; those of which nothing around says anything (e,) are of the body that others are of, as in a mitre."""
    count = int(edges.nodes.max(initial=-1)) + 1
    front = np.flatnonzero(lone)
    waiting = np.flatnonzero((beside | unknown) & ~lone)
    while len(front) and len(waiting):
        by_node: dict[int, list[int]] = {}
        for e in front.tolist():
            for n in edges.nodes[e].tolist():
                by_node.setdefault(n, []).append(e)
        known = np.zeros(count, dtype=bool)
        known[list(by_node)] = True
        new: list[int] = []
        for e in waiting[known[edges.nodes[waiting]].any(axis=1)].tolist():
            for other in {o for n in edges.nodes[e].tolist() for o in by_node.get(n, [])}:
                like = edges.turn[e] * edges.turn[other] > 0 and size[e] <= LIKE * size[other] <= LIKE**2 * size[e]
                if unknown[e] or (like and abs(float(edges.along[e] @ edges.along[other])) >= ALONG):
                    new.append(e)
                    break
        front = np.array(new, dtype=np.int64)
        lone[front] = True
        waiting = waiting[~lone[waiting]]


def _reaching(edges: Edges, chosen: BoolArray, corners: IntArray, others: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Which chosen edges (e,) belong to lines that close or reach ends of the surface or other edges at all of their
    ends, and which to lines of more than one edge that do at some: no body has an edge that begins and ends amid a
    smooth face, but facets of bad shape do."""
    count = int(corners.max()) + 1
    if not chosen.any():
        return chosen, chosen
    following = np.where(corners[:, 3:] < 0, [[1, 2, 0, 0]], [[1, 2, 3, 0]])
    valid = corners >= 0
    begin, end = corners[valid], np.take_along_axis(corners, following, axis=1)[valid]
    once, times = np.unique(np.minimum(begin, end) * count + np.maximum(begin, end), return_counts=True)
    held = np.zeros(count, dtype=bool)
    held[np.stack(np.divmod(once[times == 1], count))] = True
    held[edges.nodes[others & ~chosen]] = True
    a, b = edges.nodes[chosen].T
    line = np.asarray(
        connected_components(sp.coo_array((np.ones(len(a)), (a, b)), shape=(count, count)), directed=False)[1]
    )
    degree = np.bincount(np.concatenate([a, b]), minlength=count)
    closed, reaches = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    closed[line[(degree == 1) & ~held]] = False
    nodes = np.bincount(line[degree > 0], minlength=count)
    closed |= np.bincount(line[a], minlength=count) >= np.maximum(nodes, 1)  # round a face, and maybe on from there
    reaches[line[held & (degree > 0)]] = True
    reaches &= np.bincount(line[a], minlength=count) > 1
    whole, part = chosen.copy(), chosen.copy()
    whole[chosen], part[chosen] = closed[line[a]], reaches[line[a]]
    return whole, part


def _straight_on(edges: Edges, chosen: BoolArray) -> BoolArray:
    """Which chosen edges (e,) belong to lines that go straight on at every node: others cut off a corner."""
    which = np.flatnonzero(chosen)
    if not len(which):
        return chosen
    node, edge = edges.nodes[which].ravel(), np.repeat(which, 2)
    count = int(node.max(initial=0)) + 1
    order = np.argsort(node, kind="stable")
    bends = np.zeros(count, dtype=bool)
    for lot in np.split(order, np.flatnonzero(np.diff(node[order])) + 1):
        along = edges.along[edge[lot]]
        bends[node[lot[0]]] = np.abs(along @ along[0]).min() < ALONG
    a, b = edges.nodes[which].T
    graph = sp.coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    line = np.asarray(connected_components(graph, directed=False)[1])
    bent = np.zeros(count, dtype=bool)
    bent[line[bends]] = True
    found = chosen.copy()
    found[which] = ~bent[line[a]]
    return found


def _even(edges: Edges, lone: BoolArray, sharp: BoolArray, facets: int) -> BoolArray:
    """Which edges (e,) that stand alone are amid like ones at even distances, over flats on both sides, or are such a
    neighbour."""
    if not lone.any():
        return lone
    flat = _joined(edges.facets[~lone & ~sharp & (np.abs(edges.turn) <= SLIGHT)], facets)
    which = np.flatnonzero(lone)
    found = np.zeros(len(lone), dtype=bool)
    distance = np.full((len(which), 2), np.inf)
    partner = np.full((len(which), 2), -1)
    number = np.full(len(lone), -1)
    number[which] = np.arange(len(which))
    owner, side = np.repeat(which, 2), np.tile([0, 1], len(which))
    patch = flat[edges.facets[owner, side]]
    order = np.argsort(patch, kind="stable")
    for lot in np.split(order, np.flatnonzero(np.diff(patch[order])) + 1):
        e, s = owner[lot], side[lot]
        inward = edges.inward[e, s]
        length = np.linalg.norm(edges.middle[e] - edges.middle[e[0]], axis=1).max(initial=0.0)
        for k in range(len(lot)):
            away = edges.middle[e] - edges.middle[e[k]]
            ahead = away @ inward[k]
            like = (edges.turn[e] * edges.turn[e[k]] > 0) & (np.abs(edges.along[e] @ edges.along[e[k]]) >= ALONG)
            ratio = np.abs(edges.turn[e] / edges.turn[e[k]])
            like &= (ratio <= LIKE) & (ratio >= 1.0 / LIKE) & (ahead > 1e-9 * length) & (e != e[k])
            if like.any():
                off = np.where(like, np.linalg.norm(away, axis=1), np.inf)
                best = int(np.argmin(off))
                distance[number[e[k]], s[k]] = ahead[best]
                partner[number[e[k]], s[k]] = e[best]
    near, far = distance.min(axis=1), distance.max(axis=1)
    amid = np.flatnonzero(np.isfinite(far) & (far <= EVEN * near))
    found[which[amid]] = True
    found[partner[amid].ravel()] = True
    return found


def _joined(pairs: IntArray, count: int) -> IntArray:
    """The number (count,) of the lot that each of so many belongs to, where pairs (p, 2) belong together."""
    graph = sp.coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _of_few_flats(
    edges: Edges, around: _Around, positions: Array, settled: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Which edges (e,) other than settled ones (e,) are between so few flats that these are as much those of a body as
    facets of a curve: first those of a body by the widths of the flats, then those of which that cannot be told.

    Of a curve three edges follow each other over two flats, or two flats beside each other have curved ones all round.
    """
    corners, size, none = around.corners, np.abs(edges.turn), np.zeros(len(edges.turn), dtype=bool)
    bent = ~settled & (size > SLIGHT) & (edges.own.max(axis=1) <= SLIGHT)
    if not bent.any():
        return none, none
    flat = _joined(edges.facets[~settled & (size <= SLIGHT)], len(corners))
    flats = int(flat.max()) + 1
    sides = flat[edges.facets]
    bent &= sides[:, 0] != sides[:, 1]
    piece = _joined(sides[bent], flats)
    # Flats with bent edges all round: of the sides of their facets all are within, or bent.
    within = ~settled & (sides[:, 0] == sides[:, 1])
    number = np.bincount(flat, weights=(corners >= 0).sum(axis=1), minlength=flats)
    number -= np.bincount(sides[bent | within].ravel(), minlength=flats)
    amid = (number == 0)[sides].all(axis=1) & bent
    curved = np.zeros(flats, dtype=bool)
    curved[piece[sides[amid, 0]]] = True
    which = np.flatnonzero(bent & ~curved[piece[sides[:, 0]]])
    if not len(which):
        return none, none
    # Most follow each other over one facet; only for the others all edges of a flat are looked through.
    partner = around.followed_by(bent, sides)
    told: BoolArray = np.asarray((partner >= 0).all(axis=1))
    rest = which[~told[which]]
    partner[rest] = _following(edges, sides, which, ~told)[~told[which]]
    amid = bent & (partner >= 0).all(axis=1)
    told = np.asarray(amid | ((partner >= 0) & amid[partner]).any(axis=1))
    told[partner[amid]] = True
    few = none.copy()
    few[which] = ~told[which]
    return _round_a_wide_one(edges, corners, positions, flat, piece, few)


def _following(edges: Edges, sides: IntArray, which: IntArray, asked: BoolArray) -> IntArray:
    """The nearest of edges (q,) along each of them that are asked for (e,) that turns alike on the other side of the
    flats on both sides (q, 2), −1 where none is."""
    partner = np.full((len(which), 2), -1, dtype=np.int64)
    owner, side = np.repeat(np.arange(len(which)), 2), np.tile([0, 1], len(which))
    patch = sides[which].ravel()
    order = np.argsort(patch, kind="stable")
    for lot in np.split(order, np.flatnonzero(np.diff(patch[order])) + 1):
        e = which[owner[lot]]
        rows, step = lot[asked[e]], max(1, 1_000_000 // len(lot))
        for some in (rows[k : k + step] for k in range(0, len(rows), step)):
            mine = which[owner[some]]
            away = edges.middle[e][None] - edges.middle[mine][:, None]
            off = np.linalg.norm(away, axis=2)
            ahead = np.einsum("ijd,id->ij", away, edges.inward[mine, side[some]])
            ratio = edges.turn[e][None] / edges.turn[mine][:, None]
            like = (ratio <= LIKE) & (ratio >= 1.0 / LIKE) & (mine[:, None] != e[None])
            like &= (np.abs(edges.along[mine] @ edges.along[e].T) >= ALONG) & (ahead > ACROSS * off)
            off = np.where(like, off, np.inf)
            best = np.argmin(off, axis=1)
            found = np.isfinite(off[np.arange(len(some)), best])
            partner[owner[some][found], side[some][found]] = e[best[found]]
    return partner


def _round_a_wide_one(
    edges: Edges, corners: IntArray, positions: Array, flat: IntArray, piece: IntArray, few: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Of few edges (e,) between flats, of which facets (f,) and pieces of the surface (flats,) are part, those of
    pieces with one flat that all others lie at and are far narrower than, and the rest."""
    wide = np.zeros(len(few), dtype=bool)
    sides = flat[edges.facets]
    which = np.flatnonzero(few)
    of = piece[sides[which, 0]]
    for lot in (which[of == k] for k in np.unique(of)):
        members = np.unique(sides[lot])
        reach = {}
        for one in members.tolist():
            nodes = np.unique(corners[flat == one])
            place = positions[nodes[nodes >= 0]]
            for e, s in zip(*np.nonzero(sides[lot] == one), strict=True):
                edge = int(lot[e])
                across = (place - edges.middle[edge]) @ edges.inward[edge, s]
                reach[edge, one] = float(across.max())
        for one in members.tolist():
            mine = lot[(sides[lot] == one).any(axis=1)]
            others = np.setdiff1d(np.unique(sides[mine]), [one])
            if len(others) + 1 < len(members):
                continue
            least = min(reach[int(e), one] for e in mine)
            most = max(reach[int(e), int(sides[e][sides[e] != one][0])] for e in mine)
            if least > LIKE * most:
                wide[lot] = True
    return wide, few & ~wide
