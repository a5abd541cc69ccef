"""Values that are allowed but look like a slip of units or of a digit: said as warnings, never refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from .bodies import AnyBody, BeamBody, MassBody, SolidBody
from .checks import signed_distance
from .points import PointRef, parse_place
from .schema import Contact, MaterialTable, Spring

_SLENDER = 5.0  # length / thickness below which Euler–Bernoulli beams are off by percents


def oddities(
    materials: Mapping[str, MaterialTable],
    bodies: Mapping[str, AnyBody],
    contacts: Mapping[str, Contact],
    springs: Mapping[str, Spring] | None = None,
) -> Iterator[str]:
    """One line for each value that is probably not meant."""
    for name, material in materials.items():
        yield from _outside(f"materials.{name}.young_modulus", material.young_modulus, 1e3, 1e13, "Pa")
        yield from _outside(f"materials.{name}.density", material.density, 1e-1, 1e5, "kg/m³")
    for name, body in bodies.items():
        if isinstance(body, BeamBody):
            yield from _beam(name, body)
        elif isinstance(body, MassBody):
            yield from _outside(f"bodies.{name}.mass", body.mass, 1e-9, 1e6, "kg")
        elif isinstance(body, SolidBody):
            yield from _outside(f"bodies.{name}.thickness", body.thickness, 1e-8, 1e3, "m")
    yield from _idle_sliding(bodies, contacts)
    yield from _springs(springs or {})
    for name, contact in contacts.items():
        if contact.stiffness != "rigid":
            yield from _outside(f"contacts.{name}.stiffness", contact.stiffness, 1.0, 1e20, "N/m, N/m³ per area")
        coefficient = contact.friction.coefficient
        if coefficient > 2:
            yield f"contacts.{name}.friction.coefficient: {coefficient:.6g} is unusually high"
        slave = parse_place(contact.slave, bodies)
        body, master = bodies[slave.body], bodies.get(contact.master)
        if not (isinstance(slave, PointRef) and isinstance(body, BeamBody) and isinstance(master, BeamBody)):
            continue
        _, gap = signed_distance(master, *body.coordinates(slave.distance))
        if abs(gap) > 0.01 * master.length_m:
            yield f"contacts.{name}: {contact.slave} starts {abs(gap):.3g} m off the line of {contact.master}"


def _beam(name: str, body: BeamBody) -> Iterator[str]:
    yield from _outside(f"bodies.{name}.length", body.length_m, 1e-7, 1e4, "m")
    for key, value in (("width", body.width), ("thickness", body.thickness)):
        yield from _outside(f"bodies.{name}.{key}", value, 1e-8, 1e3, "m")
    if body.length_m < _SLENDER * body.thickness:
        ratio = body.length_m / body.thickness
        yield f"bodies.{name}: only {ratio:.3g} times as long as thick; shear matters, and is neglected"


def _idle_sliding(bodies: Mapping[str, AnyBody], contacts: Mapping[str, Contact]) -> Iterator[str]:
    """Material that slides through its mesh where nothing touches it."""
    touched = {place.partition(".")[0] for c in contacts.values() for place in (c.slave, c.master)}
    for name, body in bodies.items():
        if getattr(body, "sliding", None) is not None and name not in touched:
            yield f"bodies.{name}.sliding: no contact touches {name}, so that it has no effect"


def _springs(springs: Mapping[str, Spring]) -> Iterator[str]:
    for name, spring in springs.items():
        if spring.stiffness < 0:
            yield f"springs.{name}.stiffness: {spring.stiffness:.6g} N/m is negative: it drives its ends apart"
        elif not (spring.stiffness or spring.cubic or spring.damping):
            yield f"springs.{name}: no stiffness, no cubic part and no damping, so that it has no effect"


def _outside(where: str, value: float, least: float, most: float, unit: str) -> Iterator[str]:
    if not least <= value <= most:
        yield f"{where}: {value:.6g} {unit} is unusual; are the units SI ({unit})?"
