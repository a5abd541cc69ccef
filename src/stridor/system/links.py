"""Springs and dashpots between points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.checks import GROUND
from ..case.schema import Dashpot, Spring
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
    """Every spring and dashpot: the elongation is the motion of the first end against the second along the link."""
    tables: list[Spring | Dashpot] = [*case.springs.values(), *case.dashpots.values()]
    rows = [_row(case, bodies, total, link) for link in tables]
    return Links(
        sp.csr_array(sp.vstack(rows)) if rows else sp.csr_array((0, total)),
        np.array([getattr(link, "stiffness", 0.0) for link in tables]),
        np.array([getattr(link, "cubic", 0.0) for link in tables]),
        np.array([link.damping for link in tables]),
    )


def _row(case: Case, bodies: dict[str, BuiltBody], total: int, link: Spring | Dashpot) -> Sparse:
    ends = [case.point(reference) for reference in link.between if reference != GROUND]
    positions = [point_position(case, bodies, end) for end in ends]
    given = link.direction
    direction = positions[0] - positions[1] if given is None else np.array(given, dtype=float)
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
