"""The unit of a number of a case, by its dotted path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from .model import Case
from .oddities import in_si_units
from .overrides import split_path
from .points import BoundaryRef, parse_location
from .usual import usual_at

FRICTION = "mu"  # of every contact
# Numbers with a unit but without a usual size of their own.
_OTHERS = {"DampingTable.mass": "1/s", "DampingTable.stiffness": "s"}


def unit_at(case: Case, path: str) -> str:
    """The unit of the number at a path as `Case.with_` takes it, "1" where it has none, "" where it is not known: in a
    case that is not in SI units, and where numbers of that name have no unit of their own."""
    if path == FRICTION:
        return "1"
    steps = split_path(path)
    here: Any = case
    table: BaseModel = case
    key = ""
    for step in steps:
        if isinstance(here, BaseModel):
            table, key = here, step
            here = getattr(here, step, None)
        elif isinstance(here, Mapping):
            here = here.get(step)
        elif isinstance(here, Sequence) and step.isdigit() and int(step) < len(here):
            here = here[int(step)]
        else:
            here = None
    area = steps[0] == "contacts" and len(steps) > 1 and steps[1] in case.contacts and _of_area(case, steps[1])
    usual = usual_at(type(table), key, path, area=area)
    if usual is None:
        known = next((_OTHERS[n] for b in type(table).__mro__ if (n := f"{b.__name__}.{key}") in _OTHERS), "")
        return known if in_si_units(case) else ""
    return "" if usual.scaled and not in_si_units(case) else usual.unit or "1"


def _of_area(case: Case, contact: str) -> bool:
    return isinstance(parse_location(case.contacts[contact].slave, case.bodies), BoundaryRef)
