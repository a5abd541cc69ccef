"""What must hold of loads that act on whole bodies: weight and centrifugal load."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ..errors import Problem
from .bodies import AnyBody, MatrixBody, ObstacleBody
from .fields import is_zero
from .points import no_such
from .schema import CentrifugalTable, Load


def body_load_problems(where: str, load: Load, bodies: Mapping[str, AnyBody], known: list[str]) -> Iterator[Problem]:
    """Problems of a load with gravity or centrifugal; known: names of all bodies, also of those that are not sound."""
    placed = {"at": load.at, "force": load.force if any(load.force) else None}
    for key, value in {**placed, "moment": load.moment, "pressure": load.pressure}.items():
        if value:
            yield Problem(f"{where}.{key}", value, "gravity and centrifugal act on whole bodies; make it another load")
    for name in load.bodies or ():
        if name not in known:
            yield Problem(f"{where}.bodies", load.bodies, no_such("body", name, known))
        elif isinstance(bodies.get(name), ObstacleBody):
            yield Problem(f"{where}.bodies", load.bodies, f"{name} is an obstacle, rigid and held; nothing loads it")
    if load.bodies is not None and len(set(load.bodies)) < len(load.bodies):
        yield Problem(f"{where}.bodies", load.bodies, "must name each body once")
    if load.centrifugal is not None and load.bodies is None:
        yield Problem(f"{where}.bodies", None, "missing – give a list of the bodies that turn")
    chosen = {n: b for n, b in bodies.items() if (load.bodies is None or n in load.bodies) and b.type != "obstacle"}
    if load.gravity is not None:
        yield from _length_problems(f"{where}.gravity", load.gravity, chosen)
    if load.centrifugal is not None:
        yield from _centrifugal_problems(f"{where}.centrifugal", load.centrifugal, chosen)


def _centrifugal_problems(where: str, table: CentrifugalTable, chosen: Mapping[str, AnyBody]) -> Iterator[Problem]:
    if table.centre is not None:
        yield from _length_problems(f"{where}.centre", table.centre, chosen)
    if table.axis is not None and is_zero(table.axis):
        yield Problem(f"{where}.axis", table.axis, "must not be zero")
    elif table.axis is not None and any(table.axis[:2]) and any(body.dimension == 2 for body in chosen.values()):
        yield Problem(f"{where}.axis", table.axis, "in the plane bodies turn about z; leave it out")
    for name, body in chosen.items():
        if isinstance(body, MatrixBody) and body.mesh is None:
            accepted = f"{name} has no mesh to say where its nodes are; give bodies.{name}.mesh"
            yield Problem(where, None, accepted)


def _length_problems(where: str, given: tuple[float, ...], chosen: Mapping[str, AnyBody]) -> Iterator[Problem]:
    for name, body in chosen.items():
        if len(given) != body.dimension:
            accepted = f"must have {body.dimension} numbers, as {name} lives in {body.dimension} dimensions"
            yield Problem(where, given, accepted)
            return
