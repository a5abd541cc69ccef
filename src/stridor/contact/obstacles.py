"""Rigid masters without nodes: a flat and a cylinder, in the plane or in space.

They stand still; that their material moves (a turning shaft, a belt) is said by the drift of the contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import CaseError
from ..typing import Array, IntArray
from .master import Location


@dataclass(frozen=True)
class Flat:
    """The half-space behind a plane (a line where d = 2) through ``point`` (d,) [m].

    normal (d,) points out of it, of any length. name stands in messages. Raises CaseError where the normal is zero or
    the dimensions do not agree.
    """

    point: Array
    normal: Array
    name: str = "obstacle"

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _vector(f"{self.name}.point", self.point))
        normal = _vector(f"{self.name}.normal", self.normal, like=self.point)
        object.__setattr__(self, "normal", _unit(f"{self.name}.normal", normal))

    @property
    def node_count(self) -> int:
        """0: an obstacle has no nodes."""
        return 0

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.point)

    def locate(self, slaves: Array, displacement: Array | None = None, *, guess: IntArray | None = None) -> Location:
        """Feet of the perpendiculars from the slave positions (m, d) [m]; displacement and guess mean nothing here."""
        del displacement, guess
        gap = (slaves - self.point) @ self.normal
        return _location(slaves, np.broadcast_to(self.normal, slaves.shape).copy(), gap)


@dataclass(frozen=True)
class Cylinder:
    """A shaft of ``radius`` [m] around ``centre`` (d,) [m], or with ``inside`` the bore of that radius.

    axis (3,): its direction in space, None in the plane, where it is a circle. It has no ends. The normal points away
    from the axis, in a bore towards it. name stands in messages. Raises CaseError for a radius that is not positive,
    an axis that is zero or missing in space or given in the plane.
    """

    centre: Array
    radius: float
    axis: Array | None = None
    inside: bool = False
    name: str = "obstacle"

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _vector(f"{self.name}.centre", self.centre))
        if not (math.isfinite(self.radius) and self.radius > 0):
            raise CaseError(f"{self.name}.radius", self.radius, "a cylinder needs a radius above 0 m")
        if (self.axis is None) != (self.dimension == 2):
            accepted = "a circle in the plane has no axis; leave it out"
            if self.axis is None:
                accepted = "a cylinder in space needs the direction of its axis, such as [0, 0, 1]"
            raise CaseError(f"{self.name}.axis", self.axis, accepted)
        if self.axis is not None:
            axis = _vector(f"{self.name}.axis", self.axis, like=self.centre)
            object.__setattr__(self, "axis", _unit(f"{self.name}.axis", axis))

    @property
    def node_count(self) -> int:
        """0: an obstacle has no nodes."""
        return 0

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.centre)

    def locate(self, slaves: Array, displacement: Array | None = None, *, guess: IntArray | None = None) -> Location:
        """Nearest points to slave positions (m, d) [m]; displacement and guess mean nothing here.

        A point on the axis has no nearest one: any normal to the axis is taken.
        """
        del displacement, guess
        offset = slaves - self.centre
        if self.axis is not None:
            offset = offset - (offset @ self.axis)[:, None] * self.axis
        distance = np.linalg.norm(offset, axis=1)
        any_normal = np.array([1.0, 0.0])
        if self.axis is not None:
            any_normal = np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))])
            any_normal = any_normal / np.linalg.norm(any_normal)
        on_axis = distance <= 1e-12 * self.radius
        normal = np.where(on_axis[:, None], any_normal, offset / np.where(on_axis, 1.0, distance)[:, None])
        if self.inside:
            return _location(slaves, -normal, self.radius - distance)
        return _location(slaves, normal, distance - self.radius)


def _location(slaves: Array, normal: Array, gap: Array) -> Location:
    count = len(slaves)
    return Location(
        nodes=np.zeros((count, 0), dtype=np.int64),
        weights=np.zeros((count, 0)),
        point=slaves - gap[:, None] * normal,
        normal=normal,
        gap=gap,
        facet=np.zeros(count, dtype=np.int64),
        inside=np.ones(count, dtype=bool),
        local=np.zeros((count, 0)),
    )


def _vector(where: str, value: Array, like: Array | None = None) -> Array:
    vector = np.array(value, dtype=float)
    sizes = (2, 3) if like is None else (len(like),)
    if vector.ndim != 1 or len(vector) not in sizes or not np.all(np.isfinite(vector)):
        raise CaseError(where, np.asarray(value).tolist(), f"expected {' or '.join(map(str, sizes))} finite numbers")
    return vector


def _unit(where: str, vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise CaseError(where, vector.tolist(), "expected a direction; zero has none")
    return vector / length
