"""What must hold between the tables of a case: names exist, points lie on bodies, supports on mesh nodes.

Works on whatever part of a case is sound, so that these problems are told together with those of single
values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ..errors import CaseError, Problem
from .points import PointRef, no_such, parse_point
from .schema import (
    DEFAULT_PHASES,
    Body,
    Comparison,
    Contact,
    CoulombTable,
    Load,
    MaterialTable,
    Modal,
    Phase,
    Reference,
    Support,
    Temporal,
)

NODE_TOLERANCE = 1e-6  # of an element, so that twelve printed digits still hit a node
_SIDE_TOLERANCE = 1e-9  # of the slave body's length
_LEAST_MASTER_ELEMENTS = 3  # a C1 spline needs neighbours on both sides


@dataclass
class Parts:
    """The sound tables of a case. `broken` holds the names whose tables are not: they exist, but say nothing.

    Names are (table, name); a whole broken table is (table, "*").
    """

    materials: Mapping[str, MaterialTable] = field(default_factory=dict[str, MaterialTable])
    bodies: Mapping[str, Body] = field(default_factory=dict[str, Body])
    supports: Mapping[str, Support] = field(default_factory=dict[str, Support])
    loads: Mapping[str, Load] = field(default_factory=dict[str, Load])
    contacts: Mapping[str, Contact] = field(default_factory=dict[str, Contact])
    phases: tuple[Phase, ...] = DEFAULT_PHASES
    modal: Modal = field(default_factory=Modal)
    temporal: Temporal = field(default_factory=Temporal)
    comparison: Comparison = field(default_factory=Comparison)
    reference: Reference | None = None
    broken: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])

    def names(self, table: str) -> list[str]:
        """Every name in a table of names, sound or broken."""
        return [*getattr(self, table), *(name for kind, name in sorted(self.broken) if kind == table)]

    def is_broken(self, table: str, name: str) -> bool:
        """True where a name is there, or may be there, but its table is not sound."""
        return (table, name) in self.broken or (table, "*") in self.broken


def problems_between(parts: Parts) -> list[Problem]:
    """Everything wrong between (not within) the values of the sound parts, in the order of the file."""
    shapes = [*_shape_problems(parts)]
    unsound = {problem.where.split(".")[1] for problem in shapes}
    if unsound:
        parts.bodies = {name: body for name, body in parts.bodies.items() if name not in unsound}
        parts.broken |= {("bodies", name) for name in unsound}
    return [
        *shapes,
        *_body_problems(parts),
        *_support_problems(parts),
        *_load_problems(parts),
        *_contact_problems(parts),
        *_phase_problems(parts),
        *_setting_problems(parts),
        *_reference_problems(parts),
    ]


def signed_distance(body: Body, x: float, y: float) -> tuple[float, float]:
    """How far (x, y) [m] lies along a body's line from its start, and how far off it, positive left [m]."""
    (x0, y0), (c, s) = body.start, body.direction
    return c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0)


def slave_side(slave: Body, master: Body) -> int:
    """+1 where the middle of the slave body lies left of the master's line, -1 right, 0 on the line."""
    _, off = signed_distance(master, *slave.coordinates(slave.length_m / 2))
    return 0 if abs(off) <= _SIDE_TOLERANCE * slave.length_m else int(math.copysign(1, off))


def _shape_problems(parts: Parts) -> Iterator[Problem]:
    """Bodies without one definite axis."""
    for name, body in parts.bodies.items():
        where = f"bodies.{name}"
        if body.end is not None:
            for key in ("angle_deg", "length"):
                if (given := getattr(body, key)) is not None:
                    yield Problem(
                        f"{where}.{key}", given, "not used with end; give end, or angle_deg and length"
                    )
            if math.dist(body.start, body.end) == 0.0:
                yield Problem(f"{where}.end", body.end, "must not be the start")
            continue
        if body.angle_deg is None and body.length is None:
            accepted = "has no direction – give angle_deg [degrees] and length [m], or end = [x, y] [m]"
            yield Problem(where, None, accepted)
            continue
        for key, unit in (("angle_deg", "degrees"), ("length", "m")):
            if getattr(body, key) is None:
                accepted = f"missing – give a number [{unit}], or only end = [x, y] [m]"
                yield Problem(f"{where}.{key}", None, accepted)


def _body_problems(parts: Parts) -> Iterator[Problem]:
    for name, body in parts.bodies.items():
        where = f"bodies.{name}"
        if body.material not in parts.materials and not parts.is_broken("materials", body.material):
            yield Problem(
                f"{where}.material",
                body.material,
                no_such("material", body.material, parts.names("materials")),
            )
        for point, distance in body.points.items():
            if point in ("start", "end"):
                yield Problem(
                    f"{where}.points.{point}", distance, "start and end always exist; choose another name"
                )
            elif distance > body.length_m:
                accepted = f"beyond the body; {name} reaches from 0 to {body.length_m:.9g} m"
                yield Problem(f"{where}.points.{point}", distance, accepted)


def _support_problems(parts: Parts) -> Iterator[Problem]:
    held: dict[tuple[str, int, str], str] = {}
    for name, support in parts.supports.items():
        where = f"supports.{name}"
        for direction in support.velocity:
            if direction not in support.fixed:
                accepted = f"a velocity needs {direction!r} in fixed, which has: {', '.join(support.fixed)}"
                yield Problem(f"{where}.velocity.{direction}", support.velocity[direction], accepted)
        if len(set(support.fixed)) < len(support.fixed):
            yield Problem(f"{where}.fixed", support.fixed, "must name each direction once")
        point = yield from _point(parts, support.at, f"{where}.at")
        if point is None:
            continue
        body = parts.bodies[point.body]
        position = point.distance * body.elements / body.length_m
        if abs(position - round(position)) > NODE_TOLERANCE:
            step = body.length_m / body.elements
            nearest = math.floor(position) * step, math.ceil(position) * step
            yield Problem(
                f"{where}.at",
                support.at,
                f"no mesh node at {point.distance:.9g} m; the nearest are at {nearest[0]:.12g} "
                f"and {nearest[1]:.12g} m: move the support or change bodies.{point.body}.elements",
            )
            continue
        for direction in dict.fromkeys(support.fixed):
            other = held.setdefault((point.body, round(position), direction), name)
            if other != name:
                accepted = f"{direction} of this point is already fixed by supports.{other}"
                yield Problem(f"{where}.fixed", support.fixed, accepted)


def _load_problems(parts: Parts) -> Iterator[Problem]:
    for name, load in parts.loads.items():
        yield from _point(parts, load.at, f"loads.{name}.at")


def _contact_problems(parts: Parts) -> Iterator[Problem]:
    for name, contact in parts.contacts.items():
        where = f"contacts.{name}"
        friction = contact.friction
        if not isinstance(friction, CoulombTable) and friction.static_coefficient < friction.coefficient:
            accepted = f"must be at least the coefficient, {friction.coefficient:.9g}"
            yield Problem(f"{where}.friction.static_coefficient", friction.static_coefficient, accepted)
        slave = yield from _point(parts, contact.slave, f"{where}.slave")
        master = parts.bodies.get(contact.master)
        if master is None:
            if not parts.is_broken("bodies", contact.master):
                yield Problem(
                    f"{where}.master", contact.master, no_such("body", contact.master, parts.names("bodies"))
                )
        elif slave is not None and slave.body == contact.master:
            yield Problem(f"{where}.master", contact.master, "must be another body than the slave's")
        else:
            if master.elements < _LEAST_MASTER_ELEMENTS:
                accepted = f"a master needs at least 3 elements; {contact.master} has {master.elements}"
                yield Problem(f"{where}.master", contact.master, accepted)
            if slave is not None:
                yield from _pairing_problems(parts, where, contact, slave, master)


def _pairing_problems(
    parts: Parts, where: str, contact: Contact, slave: PointRef, master: Body
) -> Iterator[Problem]:
    body = parts.bodies[slave.body]
    along, _ = signed_distance(master, *body.coordinates(slave.distance))
    if not -1e-9 <= along / master.length_m <= 1 + 1e-9:
        yield Problem(
            f"{where}.slave",
            contact.slave,
            f"lies beyond the ends of {contact.master}: at {along:.6g} m along it, which reaches from 0 to "
            f"{master.length_m:.6g} m; move one of the bodies",
        )
    if contact.side is None and slave_side(body, master) == 0:
        accepted = (
            f'missing – {slave.body} lies on the line of {contact.master}; give "left" or "right" of it'
        )
        yield Problem(f"{where}.side", None, accepted)


def _phase_problems(parts: Parts) -> Iterator[Problem]:
    seen: set[str] = set()
    moving = [name for name, support in parts.supports.items() if support.velocity]
    for number, phase in enumerate(parts.phases):
        where = f"phases.{number}"
        if phase.name in seen:
            yield Problem(f"{where}.name", phase.name, "another phase has this name")
        seen.add(phase.name)
        if phase.ramp > phase.duration:
            yield Problem(
                f"{where}.ramp", phase.ramp, f"must not be longer than the phase, {phase.duration:.9g} s"
            )
        for name, factor in phase.loads.items():
            if name not in parts.loads and not parts.is_broken("loads", name):
                yield Problem(f"{where}.loads.{name}", factor, no_such("load", name, parts.names("loads")))
        for name, factor in phase.velocities.items():
            if name in parts.supports and name not in moving:
                yield Problem(f"{where}.velocities.{name}", factor, f"supports.{name} has no velocity")
            elif name not in parts.supports and not parts.is_broken("supports", name):
                accepted = no_such("support with a velocity", name, moving)
                yield Problem(f"{where}.velocities.{name}", factor, accepted)


def _setting_problems(parts: Parts) -> Iterator[Problem]:
    for where, pair in (
        ("modal.friction_range", parts.modal.friction_range),
        ("comparison.bracket", parts.comparison.bracket),
    ):
        if pair is not None and pair[0] >= pair[1]:
            yield Problem(where, pair, "the first number must be below the second")
    temporal = parts.temporal
    if temporal.perturbation > 0 and temporal.initial != "steady-sliding":
        yield Problem("temporal.perturbation", temporal.perturbation, 'needs initial = "steady-sliding"')
    for number, reference in enumerate(temporal.watch):
        yield from _point(parts, reference, f"temporal.watch.{number}")


def _reference_problems(parts: Parts) -> Iterator[Problem]:
    for name in parts.reference.bodies if parts.reference else ():
        if name not in parts.bodies and not parts.is_broken("bodies", name):
            yield Problem(f"reference.bodies.{name}", None, no_such("body", name, parts.names("bodies")))


def _point(parts: Parts, reference: str, where: str) -> Iterator[Problem]:
    """The point, None where it cannot be known; yields the problem where it is the reference's fault."""
    head = reference.partition("@" if "@" in reference else ".")[0]
    if parts.is_broken("bodies", head):
        return None
    try:
        return parse_point(reference, parts.bodies, where)
    except CaseError as error:
        yield from error.problems
        return None
