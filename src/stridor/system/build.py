"""A case becomes a System: bodies assembled, supports applied, contacts paired."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.schema import BeamBody
from ..case.schema import Contact as ContactCase
from ..contact.interface import Contact, Rows, pair
from ..errors import CaseError
from ..fe.assembly import assemble_beam
from ..fe.beam import DOF_PER_NODE, BeamElement, BeamMesh
from ..typing import IntArray, Sparse
from .model import Constraint, Line, PrescribedMotion, Structure, System, constrain

_DIRECTIONS = {"x": 0, "y": 1, "rotation": 2}


@dataclass(frozen=True)
class _Body:
    """A meshed body and where its freedoms start in the structure."""

    name: str
    mesh: BeamMesh
    offset: int

    @property
    def size(self) -> int:
        return DOF_PER_NODE * (self.mesh.elements + 1)


def build_system(case: Case) -> System:
    """Assemble a case. Raises CaseError where bodies that shall touch do not."""
    bodies, structure = _assemble(case)
    constraints = [_constraint(case, bodies, name) for name in case.supports]
    free, motion = constrain(structure, constraints)
    view = _View(bodies, structure.mass.shape[0], free, motion, constraints)
    references = {
        **{f"{name}.{point}": None for name, body in case.bodies.items() for point in body.point_names},
        **{at: None for at in case.temporal.watch},
    }
    points = {at: view.point_rows(case, at) for at in references}
    loads = {
        name: view.point_rows(case, load.at).free.T @ np.array([*load.force, load.moment])
        for name, load in case.loads.items()
    }
    contacts = tuple(_contact(case, view, name, contact) for name, contact in case.contacts.items())
    lines = tuple(
        Line(
            body.name,
            body.mesh.coordinates(),
            view.node_rows(body),
            np.flatnonzero((free >= body.offset) & (free < body.offset + body.size)),
        )
        for body in bodies.values()
    )
    return System(
        mass=structure.mass[free][:, free],
        damping=structure.damping[free][:, free],
        stiffness=structure.stiffness[free][:, free],
        contacts=contacts,
        loads=loads,
        motion=motion,
        points=points,
        lines=lines,
        dof_names=tuple(view.dof_name(int(i)) for i in free),
    )


def _assemble(case: Case) -> tuple[dict[str, _Body], Structure]:
    bodies: dict[str, _Body] = {}
    masses, dampings, stiffnesses = [], [], []
    offset = 0
    for name, body in case.bodies.items():
        mesh = _mesh(case, body)
        mass, stiffness = assemble_beam(mesh, lumped=body.mass == "lumped")
        masses.append(mass)
        stiffnesses.append(stiffness)
        dampings.append(body.damping.mass * mass + body.damping.stiffness * stiffness)
        bodies[name] = _Body(name, mesh, offset)
        offset += bodies[name].size
    block = [sp.block_diag(part, format="csr") for part in (masses, dampings, stiffnesses)]
    return bodies, Structure(*(sp.csr_array(b) for b in block))


def _mesh(case: Case, body: BeamBody) -> BeamMesh:
    material = case.materials[body.material]
    area = body.width * body.thickness
    second_moment = body.width * body.thickness**3 / 12
    element = BeamElement(
        length=body.length_m / body.elements,
        axial_stiffness=material.young_modulus * area,
        bending_stiffness=material.young_modulus * second_moment,
        line_density=material.density * area,
        direction=body.direction,
    )
    return BeamMesh(start=body.start, elements=body.elements, element=element)


def _constraint(case: Case, bodies: dict[str, _Body], name: str) -> Constraint:
    support = case.supports[name]
    at = case.point(support.at)
    body = bodies[at.body]
    node = body.mesh.node_at(at.distance)
    if node is None:
        raise CaseError(f"supports.{name}.at", support.at, "no mesh node there")
    freedoms = tuple(body.offset + DOF_PER_NODE * node + _DIRECTIONS[d] for d in support.fixed)
    velocity = tuple(float(support.velocity.get(d, 0.0)) for d in support.fixed)
    return Constraint(name, freedoms, velocity)


@dataclass(frozen=True)
class _View:
    """Rows on all freedoms turned into rows on free freedoms and prescribed motions."""

    bodies: dict[str, _Body]
    total: int
    free: IntArray
    motion: PrescribedMotion
    constraints: list[Constraint]

    def rows(self, full: Sparse) -> Rows:
        whole = np.zeros((self.total, len(self.motion.names)))
        whole[self.free] = self.motion.lift
        moving = [c for c in self.constraints if c.moves]
        for column, c in enumerate(moving):
            whole[list(c.freedoms), column] = c.velocity
        return Rows(sp.csr_array(full[:, self.free]), np.asarray(full @ whole))

    def point_rows(self, case: Case, reference: str) -> Rows:
        at = case.point(reference)
        body = self.bodies[at.body]
        freedoms, values = body.mesh.interpolation(at.distance)
        full = sp.lil_array((3, self.total))
        full[:, body.offset + freedoms] = values
        return self.rows(full.tocsr())

    def node_rows(self, body: _Body) -> Rows:
        """Rows (2k, n): x and y of each node in turn."""
        nodes = np.arange(body.mesh.elements + 1)
        columns = (body.offset + DOF_PER_NODE * nodes[:, None] + np.arange(2)).ravel()
        ones = np.ones(len(columns))
        full = sp.coo_array((ones, (np.arange(len(columns)), columns)), shape=(len(columns), self.total))
        return self.rows(full.tocsr())

    def dof_name(self, index: int) -> str:
        body = next(b for b in self.bodies.values() if b.offset <= index < b.offset + b.size)
        node, direction = divmod(index - body.offset, DOF_PER_NODE)
        return f"{body.name} node {node} {list(_DIRECTIONS)[direction]}"


def _contact(case: Case, view: _View, name: str, contact: ContactCase) -> Contact:
    at = case.point(contact.slave)
    master = view.bodies[contact.master]
    position = np.array(case.bodies[at.body].coordinates(at.distance))
    slave = view.point_rows(case, contact.slave)
    positions = master.mesh.coordinates()
    built = pair(
        name,
        slave=Rows(slave.free[:2], slave.lift[:2]),
        slave_position=position,
        master=view.node_rows(master),
        master_positions=positions,
        side=_side(case, name, contact, at.body),
        stiffness=np.inf if contact.stiffness == "rigid" else float(contact.stiffness),
        law=contact.friction.law_object(),
        sliding=contact.sliding,
    )
    if built is None:
        raise CaseError(
            f"contacts.{name}.slave",
            contact.slave,
            f"the point ({position[0]:g}, {position[1]:g}) m lies beyond the ends of {contact.master}; "
            "move a body so that the slave faces the master line",
        )
    return built


def _side(case: Case, name: str, contact: ContactCase, slave_body: str) -> int:
    """+1 where the slave body lies on the left of the master's direction, −1 on the right."""
    if contact.side is not None:
        return 1 if contact.side == "left" else -1
    body, master = case.bodies[slave_body], case.bodies[contact.master]
    middle = np.array(body.coordinates(body.length_m / 2)) - np.array(master.start)
    c, s = master.direction
    offset = float(c * middle[1] - s * middle[0])
    if abs(offset) < 1e-9 * body.length_m:
        raise CaseError(
            f"contacts.{name}",
            f"{slave_body} on {contact.master}",
            "the slave body's middle lies on the master line, so the side of the contact is open; "
            'write side = "left" or "right"',
        )
    return 1 if offset > 0 else -1
