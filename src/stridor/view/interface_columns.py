"""Where contact nodes are along their interface and how they look from its normal: geometry of drawings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..errors import CaseError
from ..typing import Array, IntArray
from .units import extent, length_unit

ALIGNED = 0.6  # mean length of unit tangents above which they count as one direction


@dataclass(frozen=True)
class NodeColumns:
    """Contact nodes in columns along the interface: value (m,) of a node with its axis label, column (m,) it is in,
    and edges (c + 1,) of the c columns in the same unit."""

    value: Array
    column: IntArray
    edges: Array
    label: str

    @property
    def count(self) -> int:
        """Number of columns c."""
        return len(self.edges) - 1


def columns_along(
    position: Array, tangents: Array | None, *, along: Array | None = None, about: Array | None = None
) -> NodeColumns:
    """Columns of contact nodes at position (m, d) [m] with tangents (m, d−1, d).

    In the plane: arc length through all nodes, growing along the tangents, a column for each node. In space: distance
    in direction ``along`` (3,), or angle about the point ``about`` (3,); without either, along the direction of sliding
    (the first tangents) where that is about the same everywhere, else the angle about the centre that they turn round.
    Raises CaseError for directions that are none.
    """
    if position.shape[1] == 2:
        return _lengths(arc_length(position, tangents), "position along the contact", len(position))
    first = None if tangents is None else tangents[:, 0]
    most = max(1, round(1.5 * np.sqrt(len(position))))
    if along is not None:
        direction = np.asarray(along, dtype=float)
        size = float(np.linalg.norm(direction)) if direction.shape == (3,) else 0.0
        if not size > 0 or not np.isfinite(size):
            raise CaseError("along", along, "a direction: three numbers, not all zero")
        return _lengths((position @ direction) / size, "position along the chosen direction", most)
    if about is not None:
        centre = np.asarray(about, dtype=float)
        if centre.shape != (3,):
            raise CaseError("about", about, "a point: three coordinates [m]")
        return _columns(_angle(position, centre, _axis(position, first)), "angle about the axis [°]", most)
    if first is not None and len(position):
        mean = first.mean(axis=0)
        if np.linalg.norm(mean) > ALIGNED:
            unit = mean / np.linalg.norm(mean)
            return _lengths(position @ unit, "position along the direction of sliding", most)
        axis = _axis(position, first)
        centre = _centre(position, first, axis)
        return _columns(_angle(position, centre, axis), "angle about the axis of sliding [°]", most)
    from_middle, axes = _spread(position)
    return _lengths(from_middle @ axes[0], "position along the contact", most)


def arc_length(position: Array, tangents: Array | None = None) -> Array:
    """Length (m,) [m] from one end to nodes (m, d) of a line, whatever their order, growing along the first tangents.

    From node to nearest node that is left, beginning at an end; a closed line begins at its first node.
    """
    order = _chain(position)
    steps = np.linalg.norm(np.diff(position[order], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])[: len(order)]
    length = np.empty(len(order))
    length[order] = along
    if tangents is not None and len(order) > 1:
        forward = np.sum(np.diff(position[order], axis=0) * tangents[order[:-1], 0])
        if forward < 0:
            length = along[-1] - length
    return length


def seen_from_normal(position: Array, tangents: Array | None) -> tuple[Array, Array]:
    """Coordinates (m,), (m,) [m] of nodes (m, 3) in their mean plane, the first along the mean first tangent."""
    from_middle, axes = _spread(position)
    first = axes[0]
    if tangents is not None and len(tangents):
        mean = tangents[:, 0].mean(axis=0)
        flat = mean - (mean @ axes[2]) * axes[2]
        if np.linalg.norm(flat) > ALIGNED:
            first = flat / np.linalg.norm(flat)
    second = np.cross(axes[2], first)
    if tangents is not None and len(tangents) and float(np.sum(tangents[:, 1] @ second)) < 0:
        second = -second
    return from_middle @ first, from_middle @ second


def _lengths(value: Array, label: str, most: int) -> NodeColumns:
    """Columns of nodes by a length (m,) [m], in the unit that its range asks for."""
    unit, its_name = length_unit(extent(value[:, None]))
    return _columns(value / unit, f"{label} [{its_name}]", most)


def _columns(value: Array, label: str, most: int) -> NodeColumns:
    """Columns of nodes by value: one for each where two nodes or more share most of them, else ``most`` alike."""
    if not len(value):
        return NodeColumns(value, np.zeros(0, dtype=np.int64), np.array([0.0, 1.0]), label)
    low, high = float(value.min()), float(value.max())
    width = (high - low) or 1.0
    fine = np.round((value - low) / width * 1e6)
    kinds, column = np.unique(fine, return_inverse=True)
    if len(kinds) > max(most, len(value) // 2):
        kinds, column = np.unique(np.minimum((value - low) / width * most, most - 1).astype(int), return_inverse=True)
    middle = np.bincount(column.ravel(), weights=value) / np.bincount(column.ravel())
    if len(middle) == 1:
        return NodeColumns(value, column.ravel(), middle + np.array([-0.5, 0.5]), label)
    inner = 0.5 * (middle[1:] + middle[:-1])
    ends = 2 * middle[[0, -1]] - inner[[0, -1]]
    return NodeColumns(value, column.ravel(), np.concatenate([ends[:1], inner, ends[1:]]), label)


def _chain(position: Array) -> IntArray:
    """Nodes (m,) in order along a line."""
    count = len(position)
    if count < 3:
        return np.argsort(position[:, 0], kind="stable") if count else np.zeros(0, dtype=np.int64)
    left = np.ones(count, dtype=bool)
    order = np.empty(count, dtype=np.int64)
    at = _end(position)
    for k in range(count):
        order[k] = at
        left[at] = False
        distance = np.where(left, np.linalg.norm(position - position[at], axis=1), np.inf)
        at = int(np.argmin(distance))
    return order


def _end(position: Array) -> int:
    """A node at an end of a line: both its nearest neighbours on one side; of several the farthest from the middle."""
    near = cKDTree(position).query(position, k=3)[1][:, 1:]
    towards = position[near] - position[:, None]
    towards /= np.maximum(np.linalg.norm(towards, axis=2, keepdims=True), 1e-300)
    ends = np.flatnonzero(np.sum(towards[:, 0] * towards[:, 1], axis=1) > 0)
    if not len(ends):
        return 0
    return int(ends[np.argmax(np.linalg.norm(position[ends] - position.mean(axis=0), axis=1))])


def _spread(position: Array) -> tuple[Array, Array]:
    """Nodes about their middle and the axes (3, 3) of their spread, widest first."""
    from_middle = position - position.mean(axis=0) if len(position) else position
    return from_middle, _axes_of(from_middle)


def _axes_of(vectors: Array) -> Array:
    """Principal axes (3, 3) of vectors (m, 3), the longest first."""
    axes = np.linalg.eigh(vectors.T @ vectors)[1].T[::-1]
    # Signs that do not depend on rounding: the largest component is positive.
    return axes * np.sign(axes[np.arange(len(axes)), np.argmax(np.abs(axes), axis=1)])[:, None]


def _axis(position: Array, first: Array | None) -> Array:
    """Axis of sliding (3,): what all first tangents are most perpendicular to; without them, the mean normal."""
    return _axes_of(first)[2] if first is not None else _spread(position)[1][2]


def _centre(position: Array, first: Array, axis: Array) -> Array:
    """Point (3,) that the tangents turn round: (x − c) · t = 0, by least squares."""
    flat = position - np.outer(position @ axis, axis)
    return np.linalg.lstsq(first, np.sum(flat * first, axis=1), rcond=1e-9)[0]


def _angle(position: Array, centre: Array, axis: Array) -> Array:
    """Angle (m,) [°] of nodes about an axis through a centre, from the widest gap between them on."""
    east = np.eye(3)[np.argmin(np.abs(axis))]
    east = east - (east @ axis) * axis
    east /= np.linalg.norm(east)
    offset = position - centre
    angle = np.degrees(np.arctan2(offset @ np.cross(axis, east), offset @ east))
    ordered = np.sort(angle)
    gaps = np.diff(np.append(ordered, ordered[0] + 360.0))
    widest = int(np.argmax(gaps))
    # Equal gaps all round: cut at ±180°. Otherwise no patch is cut in two.
    if widest == len(gaps) - 1 or gaps[widest] < 1.5 * float(np.median(gaps[gaps > 1e-6]) if len(gaps) > 1 else 0.0):
        return angle
    return np.where(angle > ordered[widest], angle - 360.0, angle)
