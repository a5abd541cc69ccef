"""References: "body.point", "body@distance" (from a beam's start along its axis [m]), "body.boundary"."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from ..errors import CaseError
from .bodies import MASS_POINT, AnyBody, BeamBody, MassBody, MatrixBody, ObstacleBody, SolidBody

_ROUNDING = 1e-12
FULL_TURN = 360.0 * (1 - 1e-9)
BOUNDARIES = {
    "rectangle": ("left", "right", "bottom", "top"),
    "quadrilateral": ("left", "right", "bottom", "top"),
    "annulus": ("inner", "outer", "start", "end"),
    "block": ("left", "right", "front", "back", "bottom", "top"),
    "disc": ("inner", "outer", "bottom", "top"),
    "pad": ("inner", "outer", "start", "end", "bottom", "top"),
}


@dataclass(frozen=True)
class PointRef:
    """A point of a body: on a beam its distance [m] from the start along the axis, else its coordinates [m], or the
    number of a node of another program."""

    body: str
    distance: float
    coordinates: tuple[float, ...] | None = None
    node: int | None = None


@dataclass(frozen=True)
class BoundaryRef:
    """A boundary of a solid body; the whole line where the body is a beam."""

    body: str
    boundary: str


Location = PointRef | BoundaryRef


def parse_point(reference: str, bodies: Mapping[str, AnyBody], where: str = "point") -> PointRef:
    """The point that a reference names. Raises CaseError at `where` if there is no such point."""
    location = parse_location(reference, bodies, where, boundary=False)
    if isinstance(location, PointRef):
        return location
    body = bodies[location.body]
    points = list(getattr(body, "points", ()))
    known = [f"{location.body}.{name}" for name in points]
    have = f"{location.body} has: {', '.join(known)}" if known else f"give one in bodies.{location.body}.points"
    if isinstance(body, SolidBody) and location.boundary in boundary_names(body):
        raise CaseError(where, reference, f"a boundary, where a point is wanted; {have}")
    raise CaseError(where, reference, f"no such point{did_you_mean(nearest(location.boundary, points))}; {have}")


def parse_location(
    reference: str, bodies: Mapping[str, AnyBody], where: str = "at", *, boundary: bool = True
) -> Location:
    """The point or the boundary that a reference names. Raises CaseError at `where` if there is none.

    Whether the mesh of a file has the boundary shows when it is read. boundary False: messages do not offer one.
    """
    head, at, distance = reference.partition("@")
    point = ""
    if not at:
        head, _, point = reference.partition(".")
    body = bodies.get(head)
    if isinstance(body, MassBody) and not at and point in ("", MASS_POINT):
        return PointRef(head, 0.0, body.position)
    if isinstance(body, ObstacleBody):
        raise CaseError(where, reference, "an obstacle has no points or boundaries; only a contact's master is one")
    if head and body is None and not at and not point and any(isinstance(b, MassBody) for b in bodies.values()):
        raise CaseError(where, reference, no_such("body", head, bodies))
    if not head or not (distance if at else point):
        first = head if body is not None else next(iter(bodies), "beam1")
        example = f"{first}.{_first_point(bodies.get(first), boundary=boundary)}"
        if boundary and any(isinstance(b, SolidBody | MatrixBody) for b in bodies.values()):
            accepted = f'must be a point, "body.point", or a boundary, "body.boundary", such as {example}'
        else:
            accepted = f'must be a point, "body.point" or "body@distance", such as {example}'
        raise CaseError(where, reference, accepted)
    if body is None:
        raise CaseError(where, reference, no_such("body", head, bodies))
    if isinstance(body, MassBody):
        raise CaseError(where, reference, f'a mass is one point; write "{head}"')
    if isinstance(body, SolidBody):
        return _of_solid(reference, head, body, point, where, boundary=boundary)
    if isinstance(body, MatrixBody):
        return _of_matrices(reference, head, body, point, where)
    if at:
        return PointRef(head, _distance(reference, distance, head, body, where))
    if point not in body.point_names:
        raise CaseError(where, reference, f"no such point{choice(point, body.point_names, f'{head} has')}")
    return PointRef(head, body.point_distance(point))


def _first_point(body: AnyBody | None, *, boundary: bool) -> str:
    if isinstance(body, SolidBody):
        names = [*boundary_names(body), *body.points] if boundary else [*body.points]
        return next(iter(names), "boundary" if boundary else "point")
    if isinstance(body, MatrixBody):
        return next(iter(body.points), "boundary" if boundary and body.mesh is not None else "point")
    return MASS_POINT if isinstance(body, MassBody) else "start"


def _of_solid(reference: str, name: str, body: SolidBody, point: str, where: str, *, boundary: bool) -> Location:
    if not point:
        raise CaseError(where, reference, f'a solid has no axis; name a point in bodies.{name}.points')
    if point in body.points:
        return PointRef(name, 0.0, body.points[point])
    known = boundary_names(body)
    if body.mesh is not None and point not in known and boundary:
        raise CaseError(
            where, reference, f"no such point or boundary{choice(point, [*body.points, *known], f'{name} has')}"
        )
    return BoundaryRef(name, point)


def _of_matrices(reference: str, name: str, body: MatrixBody, point: str, where: str) -> Location:
    if point in body.points:
        at = body.points[point]
        return PointRef(name, 0.0, None, at) if isinstance(at, int) else PointRef(name, 0.0, at)
    if not point:
        raise CaseError(where, reference, f"a body of matrices has no axis; name a node in bodies.{name}.points")
    if body.mesh is None:
        known = choice(point, [f"{name}.{p}" for p in body.points], f"{name} has")
        raise CaseError(where, reference, f"no such point{known}; boundaries need its mesh: give bodies.{name}.mesh")
    return BoundaryRef(name, point)


def boundary_names(body: SolidBody) -> tuple[str, ...]:
    """Boundaries of a built-in mesh; none for a file, which must be read to know them."""
    mesh = body.mesh
    if mesh is None:
        return ()
    names = BOUNDARIES[mesh.shape]
    if mesh.shape == "annulus":
        full = mesh.sweep_deg >= FULL_TURN
        return tuple(
            n for n in names if not (full and n in ("start", "end")) and not (mesh.inner_radius == 0 and n == "inner")
        )
    return names


def no_such(kind: str, name: str, known: Iterable[str], of: str = "case") -> str:
    """Say "no such body; did you mean 'beam1'? the case has: beam1, beam2"; of: what it is that has them."""
    return f"no such {kind}{choice(name, known, f'the {of} has')}"


def choice(word: str, known: Iterable[str], introduction: str) -> str:
    """Say "; did you mean 'tip'? beam1 has: start, tip, end"; no question where no word comes close."""
    names = list(known)
    question = did_you_mean(nearest(word, names))
    return f"{question or ';'} {introduction}: {', '.join(names) or 'none'}"


def nearest(word: str, known: Iterable[str]) -> str:
    """The known word that looks most like a word, "" where none comes close."""
    return next(iter(get_close_matches(word, list(known), n=1)), "")


def did_you_mean(word: str) -> str:
    """Say "; did you mean 'tip'?", or nothing for no word."""
    return f"; did you mean {word!r}?" if word else ""


def _distance(reference: str, text: str, name: str, body: BeamBody, where: str) -> float:
    try:
        distance = float(text)
    except ValueError:
        raise CaseError(
            where, reference, f"the part after @ must be a distance [m] from {name}.start"
        ) from None
    length = body.length_m
    if not 0.0 <= distance <= length * (1.0 + _ROUNDING):
        raise CaseError(where, reference, f"beyond the body; {name} reaches from 0 to {length:.9g} m")
    return min(distance, length)
