"""Whether contacts of a body that repeats press on places of their own.

Two pads to a sector lie beside each other in it. Where one is an image of the other's place, two sectors on, both press
on one place of the one sector that stands for all: no whole has room for them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from ..case import Case
from ..errors import CaseError
from ..typing import Array, BoolArray
from .bodies import BuiltBody
from .repeats import SAME, TOUCHING, Repeat, between, tied_as_they_lie
from .sectors import ALONG, NEAR, Side, motion_words, samples_of, side_of, surface_of

KEYS = ("slave", "master")


def require_places_of_their_own(
    case: Case, bodies: dict[str, BuiltBody], held: Callable[[str], bool]
) -> None:
    """Raises CaseError where what touches a body that repeats lies in the place of an image of what touches it in
    another contact. held: whether all nodes of a side are, which then feels neither."""
    sides = {
        name: found
        for name, contact in case.contacts.items()
        if (found := [side_of(case, bodies, f"contacts.{name}.{key}", getattr(contact, key)) for key in KEYS])
        and any(side is not None and side.repeats for side in found)
    }
    for (first, one), (second, two) in itertools.combinations(sides.items(), 2):
        for k, m in itertools.product((0, 1), (0, 1)):
            moving, also, here, there = one[k], two[m], one[1 - k], two[1 - m]
            if moving is None or also is None or here is None or there is None or not moving.repeats:
                continue
            if not here.facets or not there.facets or here.reference == there.reference:
                continue
            if also.reference.partition(".")[0] not in tied_as_they_lie(case, moving.reference.partition(".")[0]):
                continue
            for repeat in moving.repeats:
                if not _in_one_place(repeat, moving.ways, here, there):
                    continue
                if held(moving.reference) or held(also.reference):
                    continue
                accepted = (
                    f"lies in the place of an image of {here.reference} (contacts.{first}.{here.name}), as "
                    f"{also.reference} repeats by {motion_words(repeat)}: both would press on one place of the sector. "
                    "Let what touches it lie beside each other, its images too, or take the whole, without its tie"
                )
                raise CaseError(f"contacts.{second}.{there.name}", there.reference, accepted)


def _in_one_place(repeat: Repeat, ways: Array, here: Side, there: Side) -> bool:
    """Whether facets of one side, moved by what a third body repeats by, lie in the place of those of another. ways
    (t, d) [m]: all translations of that body."""
    samples, normals, _ = samples_of(here.points, here.facets)
    size = np.linalg.norm(np.ptp(there.points, axis=0))
    low, high = there.points.min(axis=0) - size * NEAR, there.points.max(axis=0) + size * NEAR
    surface = None
    widths = samples_of(there.points, there.facets)[2]
    for moved, turned in _moved(repeat, ways, here, there, samples, normals):
        if np.any(moved.min(axis=0) > high) or np.any(moved.max(axis=0) < low):
            continue
        surface = surface_of(there) if surface is None else surface
        found = surface.locate(moved)
        hit: BoolArray = found.inside & (np.abs(found.gap) <= NEAR * float(widths.min()))
        if bool(np.any(hit & (np.sum(turned * found.normal, axis=1) > ALONG))):
            return True
    return False


def _moved(
    repeat: Repeat, ways: Array, here: Side, there: Side, samples: Array, normals: Array
) -> Iterator[tuple[Array, Array]]:
    """Samples (q, d) [m] and normals (q, d) of one side at the places of its images that can reach another side."""
    if repeat.rotation is None:
        inverse = np.linalg.pinv(ways)
        mine, other = here.points @ inverse, there.points @ inverse
        first = np.ceil(other.min(axis=0) - mine.max(axis=0) + TOUCHING).astype(int).tolist()
        last = np.floor(other.max(axis=0) - mine.min(axis=0) - TOUCHING).astype(int).tolist()
        for steps in itertools.product(*(range(a, b + 1) for a, b in zip(first, last, strict=True))):
            if any(steps):
                yield samples + np.array(steps) @ ways, normals
        return
    around = round(repeat.around)
    whole = around >= 1 and abs(repeat.around - around) <= SAME
    reach = [between(repeat.places(side.points, ways), around) for side in (here, there)]
    for times in range(1, around) if whole else (1, -1):
        mine, other = reach
        if whole and mine is not None and other is not None:
            # By how much the image begins after the other side, within one turn.
            after = math.fmod(mine[0] + times - other[0], around) % around
            if after >= other[1] - other[0] - TOUCHING and after + mine[1] - mine[0] <= around + TOUCHING:
                continue
        moved, turn = repeat.moved(samples, times)
        yield moved, normals @ turn.T
