"""Springs and dashpots between points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.checks import GROUND
from ..case.schema import Dashpot, Spring
from ..errors import CaseError
from ..typing import Array, Sparse
from .bodies import BuiltBody
from .view import nearest_node, point_position


@dataclass(frozen=True)
class Links:
    """Elongation rows (q, N) csr of all links with stiffness, cubic and damping factors (q,)."""

    rows: Sparse
    stiffness: Array
    cubic: Array
    damping: Array


def links_of(case: Case, bodies: dict[str, BuiltBody], total: int) -> Links:
    """Every spring and dashpot: the elongation is the motion of the first end against the second along the link.

    Raises CaseError where both ends are one node, or nodes at one place between which no line is given.
    """
    tables: list[Spring | Dashpot] = [*case.springs.values(), *case.dashpots.values()]
    names = [*(f"springs.{name}" for name in case.springs), *(f"dashpots.{name}" for name in case.dashpots)]
    rows = [_row(case, bodies, total, where, link) for where, link in zip(names, tables, strict=True)]
    return Links(
        sp.csr_array(sp.vstack(rows)) if rows else sp.csr_array((0, total)),
        np.array([getattr(link, "stiffness", 0.0) for link in tables]),
        np.array([getattr(link, "cubic", 0.0) for link in tables]),
        np.array([link.damping for link in tables]),
    )


def _row(case: Case, bodies: dict[str, BuiltBody], total: int, where: str, link: Spring | Dashpot) -> Sparse:
    ends = [case.point(reference) for reference in link.between if reference != GROUND]
    positions = [point_position(case, bodies, end) for end in ends]
    given = link.direction
    # Points of solids are their nearest nodes: two points may be one node, or two nodes at one place.
    if len(ends) == 2 and np.linalg.norm(positions[0] - positions[1]) <= 1e-12 * np.abs(positions).max():
        at = ", ".join(f"{x:.6g}" for x in positions[0])
        if ends[0].body == ends[1].body:
            accepted = f"both ends are the mesh node at ({at}) m; refine the mesh or move one of the points"
            raise CaseError(f"{where}.between", link.between, accepted)
        if given is None:
            accepted = f"missing – both ends are mesh nodes at ({at}) m, which gives no line; give direction = [x, y]"
            raise CaseError(f"{where}.direction", None, accepted)
    direction = positions[0] - positions[1] if given is None else np.array(given, dtype=float)
    direction = direction / np.abs(direction).max()  # so that squares do not underflow
    direction = direction / np.linalg.norm(direction)
    row = np.zeros(total)
    for sign, end in zip((1.0, -1.0), ends, strict=False):
        body = bodies[end.body]
        if body.beam is not None:
            freedoms, values = body.beam.interpolation(end.distance)
            row[body.offset + freedoms] += sign * (direction @ np.asarray(values)[: body.dimension])
        else:
            row[body.displacements(np.array([nearest_node(body, end)])).ravel()] += sign * direction
    return sp.csr_array(row[None, :])
