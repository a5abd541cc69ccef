"""What must hold between the tables of a case: names exist, points lie on bodies, supports on mesh nodes.

Works on whatever part of a case is sound, so that these problems are told together with those of single
values.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

from ..errors import CaseError, Problem
from .bodies import AnyBody, BeamBody, MassBody, MatrixBody, SolidBody
from .body_checks import body_problems, shape_problems
from .fields import PLACE, is_zero
from .load_checks import body_load_problems
from .matrix_checks import matrix_problems
from .points import BoundaryRef, Location, PointRef, no_such, parse_location, parse_point
from .schema import (
    DEFAULT_PHASES,
    Comparison,
    Contact,
    Dashpot,
    Friction,
    Load,
    MaterialTable,
    Modal,
    Parameter,
    Phase,
    Reference,
    Spring,
    Steady,
    SteadyStep,
    Support,
    TabulatedTable,
    Temporal,
    Tie,
)
from .usual import MOST_FRICTION, TOO_MUCH

NODE_TOLERANCE = 1e-6  # of an element, so that twelve printed digits still hit a node
_SIDE_TOLERANCE = 1e-9  # of the slave body's length
GROUND = "ground"
_LEAST_MASTER_ELEMENTS = 3  # a C1 spline needs neighbours on both sides


@dataclass
class SoundTables:
    """The sound tables of a case. `broken` holds the names whose tables are not: they exist, but say nothing.

    Names are (table, name); a whole broken table is (table, "*").
    """

    parameters: Mapping[str, Parameter] = field(default_factory=dict[str, Parameter])
    materials: Mapping[str, MaterialTable] = field(default_factory=dict[str, MaterialTable])
    bodies: Mapping[str, AnyBody] = field(default_factory=dict[str, AnyBody])
    supports: Mapping[str, Support] = field(default_factory=dict[str, Support])
    loads: Mapping[str, Load] = field(default_factory=dict[str, Load])
    contacts: Mapping[str, Contact] = field(default_factory=dict[str, Contact])
    ties: Mapping[str, Tie] = field(default_factory=dict[str, Tie])
    springs: Mapping[str, Spring] = field(default_factory=dict[str, Spring])
    dashpots: Mapping[str, Dashpot] = field(default_factory=dict[str, Dashpot])
    phases: tuple[Phase, ...] = DEFAULT_PHASES
    steady: Steady = field(default_factory=Steady)
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


def problems_between(parts: SoundTables) -> list[Problem]:
    """Everything wrong between (not within) the values of the sound parts, in the order of the file."""
    shapes = [*shape_problems(parts.bodies)]
    unsound = {problem.where.split(".")[1] for problem in shapes}
    if unsound:
        parts.bodies = {name: body for name, body in parts.bodies.items() if name not in unsound}
        parts.broken |= {("bodies", name) for name in unsound}
    return [
        *shapes,
        *_material_problems(parts),
        *body_problems(parts.bodies, whole=not any(table == "bodies" for table, _ in parts.broken)),
        *matrix_problems(parts.bodies, parts.parameters, parts.names("parameters"), parts.contacts),
        *_support_problems(parts),
        *_load_problems(parts),
        *_contact_problems(parts),
        *_tie_problems(parts),
        *_link_problems(parts),
        *_phase_problems(parts),
        *_steady_problems(parts),
        *_setting_problems(parts),
        *_reference_problems(parts),
    ]


def signed_distance(body: BeamBody, x: float, y: float) -> tuple[float, float]:
    """How far (x, y) [m] lies along a body's line from its start, and how far off it, positive left [m]."""
    (x0, y0), (c, s) = body.start, body.direction
    return c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0)


def slave_side(slave: BeamBody, master: BeamBody) -> int:
    """+1 where the middle of the slave body lies left of the master's line, -1 right, 0 on the line."""
    _, off = signed_distance(master, *slave.coordinates(slave.length_m / 2))
    return 0 if abs(off) <= _SIDE_TOLERANCE * slave.length_m else int(math.copysign(1, off))


def _material_problems(parts: SoundTables) -> Iterator[Problem]:
    for name, body in parts.bodies.items():
        if not isinstance(body, BeamBody | SolidBody):
            continue
        if body.material is None:
            if not isinstance(body, BeamBody) and not (body.file or "").lower().endswith(".inp"):
                accepted = "missing – give the NAME of a [materials.NAME] (only an Abaqus file may bring its own)"
                yield Problem(f"bodies.{name}.material", None, accepted)
        elif body.material not in parts.materials and not parts.is_broken("materials", body.material):
            yield Problem(
                f"bodies.{name}.material",
                body.material,
                no_such("material", body.material, parts.names("materials")),
            )


_AXES = {2: ("x", "y"), 3: ("x", "y", "z")}


def _support_problems(parts: SoundTables) -> Iterator[Problem]:
    held: dict[tuple[str, int, str], str] = {}
    for name, support in parts.supports.items():
        where = f"supports.{name}"
        for direction in support.velocity:
            if direction not in support.fixed:
                accepted = f"a velocity needs {direction!r} in fixed, which has: {', '.join(support.fixed)}"
                yield Problem(f"{where}.velocity.{direction}", support.velocity[direction], accepted)
        for direction in support.displacement:
            if direction not in support.fixed:
                accepted = f"a displacement needs {direction!r} in fixed, which has: {', '.join(support.fixed)}"
                yield Problem(f"{where}.displacement.{direction}", support.displacement[direction], accepted)
        if len(set(support.fixed)) < len(support.fixed):
            yield Problem(f"{where}.fixed", support.fixed, "must name each direction once")
        point = yield from _location(parts, support.at, f"{where}.at")
        if point is None:
            continue
        body = parts.bodies[point.body]
        known = ("x", "y", "rotation") if isinstance(body, BeamBody) else _AXES[body.dimension]
        if isinstance(body, MatrixBody) and "rotation" in support.fixed:
            for key, moved in (("velocity", support.velocity), ("displacement", support.displacement)):
                if "rotation" in moved:
                    accepted = "rotations of imported matrices can be held, not moved"
                    yield Problem(f"{where}.{key}.rotation", moved["rotation"], accepted)
            known = (*known, "rotation")  # whether they have any shows when they are read
        for direction in dict.fromkeys(support.fixed):
            if direction not in known:
                accepted = f"{point.body} moves along {', '.join(known)} only"
                yield Problem(f"{where}.fixed", direction, accepted)
        if isinstance(body, BeamBody) and isinstance(point, PointRef):
            yield from _beam_support_problems(name, support, point, body, held)


def _beam_support_problems(
    name: str, support: Support, point: PointRef, body: BeamBody, held: dict[tuple[str, int, str], str]
) -> Iterator[Problem]:
    where = f"supports.{name}"
    position = point.distance * body.elements / body.length_m
    if not math.isfinite(position):
        yield Problem(f"{where}.at", support.at, f"not told where on a beam of {body.length_m:.9g} m; give it a length")
        return
    if abs(position - round(position)) > NODE_TOLERANCE:
        step = body.length_m / body.elements
        nearest = math.floor(position) * step, math.ceil(position) * step
        yield Problem(
            f"{where}.at",
            support.at,
            f"no mesh node at {point.distance:.9g} m; the nearest are at {nearest[0]:.12g} "
            f"and {nearest[1]:.12g} m: move the support or change bodies.{point.body}.elements",
        )
        return
    for direction in dict.fromkeys(support.fixed):
        other = held.setdefault((point.body, round(position), direction), name)
        if other != name:
            accepted = f"{direction} of this point is already fixed by supports.{other}"
            yield Problem(f"{where}.fixed", support.fixed, accepted)


def _load_problems(parts: SoundTables) -> Iterator[Problem]:
    for name, load in parts.loads.items():
        where = f"loads.{name}"
        if load.acts_on_bodies:
            yield from body_load_problems(where, load, parts.bodies, parts.names("bodies"))
            continue
        if load.bodies is not None:
            yield Problem(f"{where}.bodies", load.bodies, "only used with gravity or centrifugal")
        if load.at is None:
            yield Problem(f"{where}.at", None, f"missing – give {PLACE}")
            continue
        location = yield from _location(parts, load.at, f"{where}.at")
        if location is None:
            continue
        body = parts.bodies[location.body]
        if len(load.force) != body.dimension and any(load.force):
            accepted = f"must have {body.dimension} numbers, as {location.body} lives in {body.dimension} dimensions"
            yield Problem(f"{where}.force", load.force, accepted)
        if load.moment and not isinstance(body, BeamBody):
            yield Problem(f"{where}.moment", load.moment, "only a beam takes a moment; give a pair of forces")
        if load.pressure and not isinstance(location, BoundaryRef):
            yield Problem(f"{where}.pressure", load.pressure, "a pressure acts on a boundary; a point takes a force")


def _contact_problems(parts: SoundTables) -> Iterator[Problem]:
    pairs: dict[frozenset[str], str] = {}
    for name, contact in parts.contacts.items():
        where = f"contacts.{name}"
        yield from law_problems(where, contact.friction, contact.stiffness, contact.cubic)
        if contact.interference and contact.sliding == "finite":
            accepted = 'needs sliding = "small": finite sliding finds the gaps anew from the places of the nodes'
            yield Problem(f"{where}.interference", contact.interference, accepted)
        pair = frozenset((contact.slave, contact.master))
        if pair in pairs:
            accepted = f"slides on {contact.master} in contacts.{pairs[pair]} already"
            yield Problem(f"{where}.slave", contact.slave, accepted)
            continue
        pairs[pair] = name
        slave = yield from _location(parts, contact.slave, f"{where}.slave")
        if slave is not None and _is_placeless(parts.bodies[slave.body]):
            accepted = f"{slave.body} has no mesh to say where its nodes are; give bodies.{slave.body}.mesh"
            yield Problem(f"{where}.slave", contact.slave, accepted)
            continue
        owner, _, boundary = contact.master.partition(".")
        master = parts.bodies.get(owner)
        if master is None:
            if not parts.is_broken("bodies", owner):
                yield Problem(f"{where}.master", contact.master, no_such("body", owner, parts.names("bodies")))
            continue
        if slave is not None and slave.body == owner:
            yield Problem(f"{where}.master", contact.master, "must be another body than the slave's")
            continue
        if isinstance(master, MassBody):
            yield Problem(f"{where}.master", contact.master, "a point mass has no surface to slide on")
        elif isinstance(master, SolidBody | MatrixBody):
            if not boundary:
                accepted = f'must be a boundary of it, such as "{owner}.top"'
                yield Problem(f"{where}.master", contact.master, accepted)
            else:
                yield from _location(parts, contact.master, f"{where}.master", boundary=True)
        elif boundary:
            kind = "a beam" if isinstance(master, BeamBody) else "an obstacle"
            yield Problem(f"{where}.master", contact.master, f'{kind} is a master as a whole; write "{owner}"')
        elif isinstance(master, BeamBody):
            if master.elements < _LEAST_MASTER_ELEMENTS:
                accepted = f"a master needs at least 3 elements; {owner} has {master.elements}"
                yield Problem(f"{where}.master", contact.master, accepted)
            if isinstance(slave, PointRef):
                yield from _pairing_problems(parts, where, contact, slave, master)
            elif slave is not None and contact.side is None:
                yield Problem(f"{where}.side", None, f'missing – give "left" or "right" of {contact.master}')
        if contact.side is not None and not isinstance(master, BeamBody):
            accepted = "only a beam has sides; a boundary and an obstacle know theirs"
            yield Problem(f"{where}.side", contact.side, accepted)


def law_problems(
    where: str, friction: Friction, stiffness: float | Literal["rigid"], cubic: float
) -> Iterator[Problem]:
    """What does not fit together of the laws of a contact."""
    yield from _friction_problems(f"{where}.friction", friction)
    if cubic and stiffness == "rigid":
        accepted = "nothing – rigid contact has no approach to take the cube of; give the contact a stiffness"
        yield Problem(f"{where}.cubic", cubic, accepted)


def _friction_problems(where: str, friction: Friction) -> Iterator[Problem]:
    least = getattr(friction, "coefficient", 0.0)
    called = "the coefficient"
    if isinstance(friction, TabulatedTable):
        least, called = friction.coefficients[0], "the first of coefficients, that at rest"
        for before, after in pairwise(friction.speeds):
            if after <= before:
                accepted = f"must rise from one to the next; {after:.9g} follows {before:.9g}"
                yield Problem(f"{where}.speeds", friction.speeds, accepted)
                break
        if len(friction.coefficients) != len(friction.speeds):
            accepted = f"must be as many as speeds, {len(friction.speeds)}, not {len(friction.coefficients)}"
            yield Problem(f"{where}.coefficients", friction.coefficients, accepted)
    static = getattr(friction, "static_coefficient", None)
    if static is not None and static < least:
        yield Problem(f"{where}.static_coefficient", static, f"must be at least {called}, {least:.9g}")


def _pairing_problems(
    parts: SoundTables, where: str, contact: Contact, slave: PointRef, master: BeamBody
) -> Iterator[Problem]:
    body = parts.bodies[slave.body]
    position = body.coordinates(slave.distance) if isinstance(body, BeamBody) else slave.coordinates
    if contact.side is None and not isinstance(body, BeamBody):
        yield Problem(f"{where}.side", None, f'missing – give "left" or "right" of {contact.master}')
    if position is None or len(position) != 2:  # None: a node whose place shows when the mesh is read
        return
    along, _ = signed_distance(master, *position)
    if not -1e-9 <= along / master.length_m <= 1 + 1e-9:
        yield Problem(
            f"{where}.slave",
            contact.slave,
            f"lies beyond the ends of {contact.master}: at {along:.6g} m along it, which reaches from 0 to "
            f"{master.length_m:.6g} m; move one of the bodies",
        )
    if contact.side is None and isinstance(body, BeamBody) and slave_side(body, master) == 0:
        accepted = (
            f'missing – {slave.body} lies on the line of {contact.master}; give "left" or "right" of it'
        )
        yield Problem(f"{where}.side", None, accepted)


def _tie_problems(parts: SoundTables) -> Iterator[Problem]:
    for name, tie in parts.ties.items():
        where = f"ties.{name}"
        slave = yield from _location(parts, tie.slave, f"{where}.slave", boundary=True)
        master = yield from _location(parts, tie.master, f"{where}.master", boundary=True)
        if slave is not None and master is not None:
            yield from _repetition_problems(parts, where, tie, slave, master)
        for other, contact in parts.contacts.items():
            if {contact.slave, contact.master} == {tie.slave, tie.master}:
                accepted = f"what is bonded cannot slide on it in contacts.{other} as well; remove one of them"
                yield Problem(f"{where}.slave", tie.slave, accepted)


def _repetition_problems(
    parts: SoundTables, where: str, tie: Tie, slave: Location, master: Location
) -> Iterator[Problem]:
    """Ties within a body without a way from one of its sides to the other, and ways that are none."""
    dimension = parts.bodies[slave.body].dimension
    if tie.translation is None and tie.rotation is None:
        if slave.body == master.body:
            accepted = (
                "must belong to another body than the slave's; of one that repeats give translation or rotation from "
                "the master to the slave"
            )
            yield Problem(f"{where}.master", tie.master, accepted)
        return
    if tie.slave == tie.master:
        yield Problem(f"{where}.master", tie.master, "must be another boundary than the slave")
    if tie.translation is not None and tie.rotation is not None:
        yield Problem(f"{where}.rotation", None, "not used with translation; give one of them")
    if tie.translation is not None:
        if len(tie.translation) != dimension:
            yield Problem(f"{where}.translation", tie.translation, f"must have {dimension} numbers")
        elif is_zero(tie.translation):
            yield Problem(f"{where}.translation", tie.translation, "must not be zero")
    if tie.rotation is not None:
        turn = tie.rotation
        if turn.angle_deg % 360.0 == 0.0:
            yield Problem(f"{where}.rotation.angle_deg", turn.angle_deg, "must not be zero or full turns")
        if is_zero(turn.axis):
            yield Problem(f"{where}.rotation.axis", turn.axis, "must not be zero")
        elif dimension == 2 and any(turn.axis[:2]):
            yield Problem(f"{where}.rotation.axis", turn.axis, "in the plane the axis is z; leave it out")
        if turn.centre is not None and len(turn.centre) != dimension:
            yield Problem(f"{where}.rotation.centre", turn.centre, f"must have {dimension} numbers")


def _link_problems(parts: SoundTables) -> Iterator[Problem]:
    """Springs and dashpots."""
    links: list[tuple[str, Spring | Dashpot]] = [
        *((f"springs.{name}", link) for name, link in parts.springs.items()),
        *((f"dashpots.{name}", link) for name, link in parts.dashpots.items()),
    ]
    for where, link in links:
        first, second = link.between
        if first == GROUND:
            yield Problem(f"{where}.between.0", first, "only the second end may be ground; turn them round")
            continue
        point = yield from _point(parts, first, f"{where}.between.0")
        other = None
        if second != GROUND:
            other = yield from _point(parts, second, f"{where}.between.1")
        if point is None:
            continue
        if point == other:
            yield Problem(f"{where}.between", link.between, "both ends are the same point")
            continue
        dimension = parts.bodies[point.body].dimension
        placeless = [p.body for p in (point, other) if p is not None and _is_placeless(parts.bodies[p.body])]
        if link.direction is None and placeless:
            accepted = f"missing – {placeless[0]} has no mesh to give a line to act along; give direction = [x, y]"
            yield Problem(f"{where}.direction", None, accepted)
        elif link.direction is None and (second == GROUND or (other is not None and _same(parts, point, other))):
            accepted = "missing – its ends give no line to act along; give direction = [x, y]"
            yield Problem(f"{where}.direction", None, accepted)
        elif link.direction is not None:
            if len(link.direction) != dimension:
                yield Problem(f"{where}.direction", link.direction, f"must have {dimension} numbers")
            elif is_zero(link.direction):
                yield Problem(f"{where}.direction", link.direction, "must not be zero")


def _is_placeless(body: AnyBody) -> bool:
    """Whether nothing says where its nodes are."""
    return isinstance(body, MatrixBody) and body.mesh is None


def _same(parts: SoundTables, first: PointRef, second: PointRef) -> bool:
    if first.node or second.node:
        return False  # known once the mesh is read
    ends = [position_of(parts.bodies[p.body], p) for p in (first, second)]
    return math.dist(*ends) == 0.0 if len(ends[0]) == len(ends[1]) else False


def position_of(body: AnyBody, point: PointRef) -> tuple[float, ...]:
    """Coordinates [m] of a point of a body."""
    if isinstance(body, BeamBody):
        return body.coordinates(point.distance)
    assert point.coordinates is not None
    return point.coordinates


def _phase_problems(parts: SoundTables) -> Iterator[Problem]:
    seen: set[str] = set()
    moving = _moving(parts)
    for name in sorted(set(parts.supports) & set(parts.bodies)):
        if moving.count(name) > 1:
            yield Problem(f"supports.{name}", None, f"bodies.{name} slides under the same name; rename the support")
    placed = [name for name, support in parts.supports.items() if support.displacement]
    placed += [name for name, contact in parts.contacts.items() if contact.interference]
    for name in sorted(set(placed)):
        if placed.count(name) > 1:
            yield Problem(f"supports.{name}", None, f"contacts.{name} has an interference; rename the support")
    for number, phase in enumerate(parts.phases):
        where = f"phases.{number}"
        for name, factor in phase.displacements.items():
            if name not in placed and not any(parts.is_broken(t, name) for t in ("supports", "contacts")):
                accepted = no_such("support with a displacement or contact with an interference", name, placed)
                yield Problem(f"{where}.displacements.{name}", factor, accepted)
        if phase.name in seen:
            yield Problem(f"{where}.name", phase.name, "another phase has this name")
        seen.add(phase.name)
        if phase.ramp > phase.duration:
            yield Problem(
                f"{where}.ramp", phase.ramp, f"must not be longer than the phase, {phase.duration:.9g} s"
            )
        yield from _factor_problems(parts, where, phase, moving)


def _factor_problems(parts: SoundTables, where: str, phase: Phase | SteadyStep, moving: list[str]) -> Iterator[Problem]:
    """Factors of loads and motions that are not there; moving: names of the motions."""
    for name, factor in phase.loads.items():
        if name not in parts.loads and not parts.is_broken("loads", name):
            yield Problem(f"{where}.loads.{name}", factor, no_such("load", name, parts.names("loads")))
    for name, factor in phase.velocities.items():
        if name in parts.supports and name not in moving:
            yield Problem(f"{where}.velocities.{name}", factor, f"supports.{name} has no velocity")
        elif name in parts.bodies and name not in moving:
            yield Problem(f"{where}.velocities.{name}", factor, f"bodies.{name} has no sliding")
        elif name not in moving and not any(parts.is_broken(t, name) for t in ("supports", "bodies")):
            accepted = no_such("support with a velocity", name, moving)
            yield Problem(f"{where}.velocities.{name}", factor, accepted)


def _moving(parts: SoundTables) -> list[str]:
    """Names of what moves with a prescribed velocity."""
    moving = [name for name, support in parts.supports.items() if support.velocity]
    return moving + [name for name, body in parts.bodies.items() if getattr(body, "sliding", None) is not None]


def _steady_problems(parts: SoundTables) -> Iterator[Problem]:
    steady = parts.steady
    if steady.friction == "sliding" and steady.steps:
        accepted = 'nothing – load steps have no effect where every contact slides; write friction = "stick-slip"'
        yield Problem("steady.steps", f"{len(steady.steps)} steps", accepted)
    if steady.friction == "stick-slip" and not parts.contacts and not parts.names("contacts"):
        yield Problem("steady.friction", steady.friction, "needs contacts that can stick, and the case has none")
    distances = [f"supports.{name}.displacement" for name, s in parts.supports.items() if s.displacement]
    distances += [f"contacts.{name}.interference" for name, c in parts.contacts.items() if c.interference]
    if steady.friction == "stick-slip" and distances:
        accepted = (
            f"load steps do not take {', '.join(distances)}; give a support a velocity and a step a duration, which "
            "goes the same distance"
        )
        yield Problem("steady.friction", steady.friction, accepted)
    kept = [name for name, c in parts.contacts.items() if c.closed]
    if steady.friction == "stick-slip" and kept:
        accepted = f"load steps take contacts that may open only; leave out closed = true of contacts.{kept[0]}"
        yield Problem("steady.friction", steady.friction, accepted)
    for number, step in enumerate(steady.steps):
        where = f"steady.steps.{number}"
        yield from _factor_problems(parts, where, step, _moving(parts))
        if step.duration is not None and not _moving(parts):
            accepted = "nothing – no support moves, so that the step takes no time"
            yield Problem(f"{where}.duration", step.duration, accepted)


def _setting_problems(parts: SoundTables) -> Iterator[Problem]:
    for where, pair in (
        ("modal.friction_range", parts.modal.friction_range),
        ("comparison.bracket", parts.comparison.bracket),
    ):
        if pair is not None and pair[0] >= pair[1]:
            yield Problem(where, pair, "the first number must be below the second")
        elif pair is not None and pair[1] > MOST_FRICTION:
            yield Problem(where, pair, TOO_MUCH)
    if parts.comparison.mu and max(parts.comparison.mu) > MOST_FRICTION:
        yield Problem("comparison.mu", parts.comparison.mu, TOO_MUCH)
    temporal = parts.temporal
    if temporal.perturbation > 0 and temporal.initial != "steady-sliding":
        yield Problem("temporal.perturbation", temporal.perturbation, 'needs initial = "steady-sliding"')
    if temporal.initial == "steady-sliding" and parts.phases and parts.phases[0].ramp > 0:
        accepted = "must be 0 when starting from steady sliding (temporal.initial)"
        yield Problem("phases.0.ramp", parts.phases[0].ramp, accepted)
    for number, reference in enumerate(temporal.watch):
        yield from _point(parts, reference, f"temporal.watch.{number}")


def _reference_problems(parts: SoundTables) -> Iterator[Problem]:
    for name in parts.reference.bodies if parts.reference else ():
        if name not in parts.bodies and not parts.is_broken("bodies", name):
            yield Problem(f"reference.bodies.{name}", None, no_such("body", name, parts.names("bodies")))


def _location(
    parts: SoundTables, reference: str, where: str, *, boundary: bool = False
) -> Generator[Problem, None, Location | None]:
    """The point or boundary, None where it cannot be known; yields the problem where it is the reference's fault."""
    head = reference.partition("@" if "@" in reference else ".")[0]
    if parts.is_broken("bodies", head):
        return None
    try:
        location = parse_location(reference, parts.bodies, where)
    except CaseError as error:
        yield from error.problems
        return None
    if boundary and isinstance(location, PointRef):
        yield Problem(where, reference, 'must be a boundary, "body.boundary"')
        return None
    return location


def _point(parts: SoundTables, reference: str, where: str) -> Generator[Problem, None, PointRef | None]:
    """The point, None where it cannot be known; yields the problem where it is the reference's fault."""
    head = reference.partition("@" if "@" in reference else ".")[0]
    if parts.is_broken("bodies", head):
        return None
    try:
        return parse_point(reference, parts.bodies, where)
    except CaseError as error:
        yield from error.problems
        return None
