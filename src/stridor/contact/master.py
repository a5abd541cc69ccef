"""What every master surface answers: where slave points are on it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Protocol

from ..typing import Array, BoolArray, IntArray

CORNER_DEG = 40.0 - 1e-6  # what turns by 40° or more is an edge, whatever is around: nine facets all round, to rounding


@dataclass(frozen=True)
class Location:
    """Slave points (m,) on a master surface of k nodes.

    nodes (m, r) and weights (m, r): the master point is Σ weights · node positions (r = 0 for an obstacle; unused
    places hold node 0 with weight 0). point (m, d) [m], normal (m, d) unit, out of the master. gap (m,) [m] =
    normal · (slave − point), positive when open. facet (m,): where to begin the next search. inside (m,): False where
    the point has left the surface over its edge (the nearest point of the edge is then given). local (m, d−1):
    reference coordinates on the facet, none for an obstacle.
    """

    nodes: IntArray
    weights: Array
    point: Array
    normal: Array
    gap: Array
    facet: IntArray
    inside: BoolArray
    local: Array | None = None

    def only(self, index: IntArray) -> Location:
        """Some of the points."""
        local = None if self.local is None else self.local[index]
        return Location(
            self.nodes[index], self.weights[index], self.point[index], self.normal[index], self.gap[index],
            self.facet[index], self.inside[index], local,
        )  # fmt: skip

    def with_places(self, index: IntArray, others: Location) -> Location:
        """These points, with others (s,) in the place of those of an index (s,)."""
        values: dict[str, Any] = {}
        for part in fields(self):
            mine, theirs = getattr(self, part.name), getattr(others, part.name)
            values[part.name] = mine if mine is None else mine.copy()
            if mine is not None:
                values[part.name][index] = theirs
        return Location(**values)


class MasterSurface(Protocol):
    """A surface that slave nodes slide on; its k nodes are numbered as its rows of displacements are."""

    @property
    def node_count(self) -> int:
        """Number of nodes k, 0 for an obstacle."""
        ...

    @property
    def dimension(self) -> int:
        """2 or 3."""
        ...

    def locate(
        self, slaves: Array, displacement: Array | None = None, *, guess: IntArray | None = None
    ) -> Location:
        """Places of slave positions (m, d) [m] on the surface displaced by (k, d) [m] (None: undisplaced).

        guess (m,): facets of an earlier Location to begin with.
        """
        ...
