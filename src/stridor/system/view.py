"""From all freedoms of the bodies to the free ones: ties, supports and moving supports taken into account."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.points import PointRef
from ..contact.interface import Rows
from ..contact.ties import Bond
from ..typing import Array, IntArray, Sparse
from .bodies import BuiltBody
from .motion import Constraint, PrescribedMotion, columns


@dataclass(frozen=True)
class View:
    """Rows on all freedoms turned into rows on free freedoms and prescribed motions.

    tie (N, N) csr gives all freedoms from the independent ones, None without ties. repeats: the bonds of bodies that
    repeat.
    """

    bodies: dict[str, BuiltBody]
    total: int
    free: IntArray
    motion: PrescribedMotion
    constraints: list[Constraint]
    tie: Sparse | None = None
    repeats: tuple[Bond, ...] = ()

    def rows(self, full: Sparse) -> Rows:
        """Rows (r, N) on all freedoms as rows on the free ones."""
        if self.tie is not None:
            full = sp.csr_array(full @ self.tie)
        whole = np.zeros((self.total, len(self.motion.names)))
        whole[self.free] = self.motion.lift
        for column, c in enumerate(columns(self.constraints)):
            whole[list(c.freedoms), column] = c.values
        return Rows(sp.csr_array(full[:, self.free]), np.asarray(full @ whole))

    def pick(self, freedoms: IntArray) -> Rows:
        """Rows that take out freedoms (r,)."""
        full = sp.csr_array(
            (np.ones(len(freedoms)), (np.arange(len(freedoms)), freedoms)), shape=(len(freedoms), self.total)
        )
        return self.rows(full)

    def point_rows(self, case: Case, reference: str) -> Rows:
        """Displacements of a point, on a beam also its rotation."""
        at = case.point(reference)
        body = self.bodies[at.body]
        if body.beam is None:
            return self.pick(body.displacements(np.array([nearest_node(body, at)])).ravel())
        freedoms, values = body.beam.interpolation(at.distance)
        row, column = np.nonzero(values)
        where = row, body.offset + freedoms[column]
        return self.rows(sp.csr_array((values[row, column], where), shape=(len(values), self.total)))

    def node_rows(self, body: BuiltBody, nodes: IntArray | None = None) -> Rows:
        """Displacements (k d, n) of nodes in turn, of all nodes if none are given."""
        chosen = np.arange(len(body.points)) if nodes is None else nodes
        return self.pick(body.displacements(chosen).ravel())

    def freedoms_of(self, body: BuiltBody) -> IntArray:
        """Indices of a body's free freedoms in the system."""
        return np.flatnonzero((self.free >= body.offset) & (self.free < body.offset + body.size))


def nearest_node(body: BuiltBody, at: PointRef) -> int:
    """The node nearest to a point of a solid, or that of the number."""
    if at.node is not None:
        assert body.numbers is not None, "only nodes of other programs are called by their numbers"
        return int(np.flatnonzero(body.numbers == at.node)[0])
    assert at.coordinates is not None, "points of solids have coordinates"
    return int(np.argmin(np.linalg.norm(body.points - np.array(at.coordinates), axis=1)))


def point_position(case: Case, bodies: dict[str, BuiltBody], at: PointRef) -> Array:
    """Coordinates (d,) [m] of a point as it is computed with: on a solid its node's."""
    body = bodies[at.body]
    if body.beam is not None:
        return np.array(case.beams[at.body].coordinates(at.distance))
    return body.points[nearest_node(body, at)]
