"""Where a line of straight segments has an edge though it turns by little: a kink that stands alone.

The segments of a curve turn by a like amount at nodes that follow each other: on an arc, whatever their lengths, by at
most twice the larger turn beside (half of a turn or more comes from the longer of a node's two segments, and the node
at the other end of that has this part too). A chamfer turns once, between runs of segments in line.
"""

from __future__ import annotations

import numpy as np

from ..typing import Array, BoolArray, IntArray

# Times the turns of the nodes beside: those of a chamfer are in line, those beside an inflection or where a fillet
# begins turn by a third or a fifth. On an arc, whatever the lengths of its segments, it is 2 at most.
RATIO = 10.0
# Turns of one curve differ by no more from node to node.
LIKE = 3.0
# rad: coordinates of five digits turn a straight line by less.
SLIGHT = np.radians(0.2)
# Runs between kinks of a curve that was divided without being rounded differ by no more.
EVEN = 2.0


def lone_kinks(turn: Array, length: Array, middle: BoolArray, sharp: BoolArray, *, closed: bool) -> BoolArray:
    """Of the nodes (c,) where the c segments of a line begin: whether there is an edge that the angle alone does not
    tell.

    turn (c,) [rad] at each node, signed, and length (c,) [m] of the segment from it; middle (c,): middle nodes of
    facets, which may lie on the chord of facets whose ends are on a curve; sharp (c,): edges by their angle. The first
    node of an open line has no turn, and the end of its last segment is none of the nodes.

    Three kinks or more that turn by a like amount the same way, at even distances, are a curve whose facets were
    divided, and no edges. Ends, and edges that turn by far more, say nothing of the curvature beside them: there the
    two nodes on the other side have to be in line.
    """
    size, count = np.abs(turn), len(turn)
    beside = [_beside(np.arange(count), step, middle) for step in (-1, 1)]
    beyond = [_beside(nodes, step, middle) for nodes, step in zip(beside, (-1, 1), strict=True)]

    def straight(nodes: IntArray) -> tuple[BoolArray, BoolArray]:
        """Whether there are such nodes that say something of the curvature, and that say there is next to none."""
        there = closed | ((nodes > 0) & (nodes < count))
        at = nodes % count
        there &= ~sharp[at] | (size[at] <= LIKE * size)
        return there, there & (size > SLIGHT + RATIO * size[at])

    (left, no_left), (right, no_right) = (straight(nodes) for nodes in beside)
    (_, none_behind), (_, none_ahead) = (straight(nodes) for nodes in beyond)
    # Beside an end, or an edge, a single node in line is one of a curve that turns back there as well.
    lone = (no_left & no_right) | (~left & no_right & none_ahead) | (~right & no_left & none_behind)
    lone &= ~sharp
    if not closed:
        lone[0] = False
    return lone & ~_even(np.flatnonzero(lone), turn, length, sharp, closed=closed)


def _beside(nodes: IntArray, step: int, middle: BoolArray) -> IntArray:
    """The nodes (c,) beside others, by a step of one, over middle ones to the next end of a facet; not wrapped."""
    count = len(middle)
    other = nodes + step
    return other + step * (middle[other % count] & ~middle[nodes % count])


def _even(kinks: IntArray, turn: Array, length: Array, sharp: BoolArray, *, closed: bool) -> BoolArray:
    """Which nodes (c,) are kinks amid like ones at even distances, or follow such a one."""
    found = np.zeros(len(turn), dtype=bool)
    place = np.concatenate([[0.0], np.cumsum(length)])
    marks = np.union1d(kinks, np.flatnonzero(sharp))  # edges end what may be one curve
    at = {int(mark): k for k, mark in enumerate(marks)}

    def next_like(kink: int, step: int) -> tuple[int, float]:
        """The kink beside, and how far off; −1 where that is an edge, none, or of another turn."""
        k = at[kink] + step
        if not closed and not 0 <= k < len(marks):
            return -1, 0.0
        other = int(marks[k % len(marks)])
        one, two = float(turn[kink]), float(turn[other])
        if other == kink or sharp[other] or one * two <= 0 or not 1 / LIKE <= one / two <= LIKE:
            return -1, 0.0
        return other, step * float(place[other] - place[kink]) % float(place[-1])

    for kink in kinks.tolist():
        (left, back), (right, ahead) = next_like(kink, -1), next_like(kink, 1)
        if min(left, right) >= 0 and left != right and max(back, ahead) <= EVEN * min(back, ahead):
            found[[left, kink, right]] = True
    return found
