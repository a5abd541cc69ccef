"""What else has a say over the freedoms that a contact presses on: supports that hold them, ties that lead them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..case import Case
from ..case.bodies import ObstacleBody
from ..case.points import BoundaryRef
from ..contact.interface import Contact
from ..contact.surfaces import SurfaceContact
from ..errors import CaseError
from ..typing import Array, IntArray
from .repeats import master_nodes, slave_positions
from .sectors import lent_repeats
from .supports import boundary_nodes
from .view import View, nearest_node

# A row of relative displacements has weights of one; below this part of it, rounding is all that moves.
STIFF = 1e-9


def holders_of(
    case: Case, view: View, contacts: Sequence[Contact], surfaces: Sequence[SurfaceContact]
) -> dict[str, tuple[str, ...]]:
    """For each contact the supports and ties that take part at its nodes, as paths of the case.

    Raises CaseError for a rigid contact none of whose nodes can move along its normal: it could neither open nor give
    way, and its force would be rounding over rounding.
    """
    tied = {name: _slave_freedoms(case, view, tie.slave, f"ties.{name}.slave") for name, tie in case.ties.items()}
    found: dict[str, tuple[str, ...]] = {}
    for contact in (*contacts, *surfaces):
        touched = _touched(case, view, contact)
        supports = [f"supports.{c.name}" for c in view.constraints if np.isin(touched, c.freedoms).any()]
        ties = [f"ties.{name}" for name, freedoms in tied.items() if np.isin(touched, freedoms).any()]
        found[contact.name] = (*supports, *ties)
    for name, rows, rigid in _normals(contacts, surfaces):
        if rigid and len(rows) and float(rows.max()) < STIFF:
            by = f" ({', '.join(found[name])})" if found[name] else ""
            accepted = (
                f"rigid, and its bodies are held along its normal{by}, so that it can neither open nor press; free one "
                "of them along the normal, or remove the contact"
            )
            raise CaseError(f"contacts.{name}", None, accepted)
    return found


def _normals(
    contacts: Sequence[Contact], surfaces: Sequence[SurfaceContact]
) -> list[tuple[str, Array, bool]]:
    """Name, largest weights (m,) of the rows of normal displacement, and whether it is rigid, of each contact."""
    points = [(c.name, np.array([np.abs(c.normal_row).max(initial=0.0)]), c.compliance == 0.0) for c in contacts]
    others = [(s.name, abs(s.nodes.normal).max(axis=1).toarray().ravel(), bool(np.isinf(s.stiffness_per_area)))
              for s in surfaces if s.nodes.count]  # fmt: skip
    return [*points, *others]


def _slave_freedoms(case: Case, view: View, reference: str, where: str) -> IntArray:
    at = case.location(reference)
    body = view.bodies[at.body]
    if isinstance(at, BoundaryRef):
        return body.displacements(boundary_nodes(body, at, where)).ravel()
    if body.beam is not None:
        return body.offset + body.beam.interpolation(at.distance)[0]
    return body.displacements(np.array([nearest_node(body, at)])).ravel()


def _touched(case: Case, view: View, contact: Contact | SurfaceContact) -> IntArray:
    """Freedoms of the slave's nodes and of those nodes of the master that they face."""
    table = case.contacts[contact.name]
    slave = _slave_freedoms(case, view, table.slave, f"contacts.{contact.name}.slave")
    owner = table.master.partition(".")[0]
    if isinstance(case.bodies[owner], ObstacleBody):
        return slave
    body = view.bodies[owner]
    if isinstance(contact, Contact):
        nodes = np.array([contact.segment, contact.segment + 1])
    elif body.beam is not None:
        return slave  # a line under a whole boundary: its ends say little of what presses where
    else:
        where = f"contacts.{contact.name}"
        above = slave_positions(case, view.bodies, table.slave, f"{where}.slave")
        lent = lent_repeats(case, view.bodies, table)
        nodes = master_nodes(case, view.bodies, table.master, f"{where}.master", above, lent)[1]
        nodes = nodes[np.unique(contact.location.nodes[contact.location.weights != 0.0])]
    return np.concatenate([slave, body.displacements(nodes).ravel()])


def words(holders: Mapping[str, tuple[str, ...]], names: Sequence[str]) -> list[str]:
    """The paths of contacts with whatever else holds their nodes, each once."""
    return list(dict.fromkeys([*(f"contacts.{n}" for n in names), *(h for n in names for h in holders.get(n, ()))]))
