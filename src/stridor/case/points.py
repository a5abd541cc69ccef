"""Point references: "body.point", or "body@distance", distance from the body's start along its axis [m]."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from ..errors import CaseError
from .schema import Body

_ROUNDING = 1e-12


@dataclass(frozen=True)
class PointRef:
    """A point of a body: the body's name and the distance [m] from its start along its axis."""

    body: str
    distance: float


def parse_point(reference: str, bodies: Mapping[str, Body], where: str = "point") -> PointRef:
    """The point that a reference names. Raises CaseError at `where` if there is no such point."""
    head, at, distance = reference.partition("@")
    point = ""
    if not at:
        head, _, point = reference.partition(".")
    if not head or not (distance if at else point):
        example = f"{next(iter(bodies), 'beam1')}.start"
        raise CaseError(
            where, reference, f'must be a point, "body.point" or "body@distance", such as {example}'
        )
    if head not in bodies:
        raise CaseError(where, reference, no_such("body", head, bodies))
    body = bodies[head]
    if at:
        return PointRef(head, _distance(reference, distance, head, body, where))
    if point not in body.point_names:
        raise CaseError(where, reference, f"no such point{choice(point, body.point_names, f'{head} has')}")
    return PointRef(head, body.point_distance(point))


def no_such(kind: str, name: str, known: Iterable[str]) -> str:
    """Say "no such body; did you mean 'beam1'? the case has: beam1, beam2"."""
    return f"no such {kind}{choice(name, known, 'the case has')}"


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


def _distance(reference: str, text: str, name: str, body: Body, where: str) -> float:
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
