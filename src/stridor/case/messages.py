"""Pydantic's findings in plain English: one Problem each, at the path a user would write.

The schema is walked along with each finding, so that a path never shows how a union was tried, and the
description of the field that was reached says what it must be.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Union, cast, get_args, get_origin

from pydantic import BaseModel, ValidationError

from ..errors import Problem
from .fields import MOST
from .points import choice, did_you_mean, nearest
from .schema import NAME_RULE

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


@dataclass
class _WalkPosition:
    """Where the walk has come to: the path, the type wanted and the value written there, and what it must be.

    table: the table that the last key belongs to, with its alternatives where a tag chose it among several;
    around: the table that holds that one; keys: the only keys accepted here, where they are words of a list rather than
    names.
    """

    path: tuple[str | int, ...]
    annotation: Any
    value: object
    description: str = ""
    table: type[BaseModel] | None = None
    alternatives: tuple[type[BaseModel], ...] = ()
    around: type[BaseModel] | None = None
    keys: tuple[str, ...] = ()


def dotted(path: Sequence[str | int]) -> str:
    """A path as in an override, keys quoted where they need it."""
    return ".".join(key if _BARE_KEY.fullmatch(key) else f'"{key}"' for key in map(str, path))


def problems_of(error: ValidationError, data: object, root: type[BaseModel]) -> list[Problem]:
    """One Problem for each place that `error` found wrong in `data`, validated as `root`."""
    found: dict[str, Problem] = {}
    misspelt: set[str] = set()
    missing: dict[str, tuple[str | int, ...]] = {}
    unknown: dict[tuple[str | int, ...], str] = {}  # the first unclear key of a table
    for item in error.errors(include_url=False, include_input=False, include_context=False):
        kind, loc = item["type"], item["loc"]
        location = _reach(loc, data, root)
        if kind == "extra_forbidden":
            problem, meant = _unknown_key(location)
            if meant:
                misspelt.add(dotted((*location.path[:-1], meant)))
            else:
                unknown.setdefault(location.path[:-1], problem.where)
        elif kind == "missing" and not isinstance(loc[-1], int):
            problem = Problem(dotted(location.path), None, f"missing – give {location.description}")
            missing[problem.where] = location.path
        elif loc and loc[-1] == "[key]":
            problem = _bad_key(location)
        elif kind in ("union_tag_not_found", "union_tag_invalid"):
            problem = _bad_tag(location)
        else:
            problem = _bad_value(location)
        found.setdefault(problem.where, problem)
    for where, path in missing.items():
        if where in misspelt:
            del found[where]
        elif path[:-1] in unknown:
            # Most likely the one under another name: one line for both.
            other = found[unknown[path[:-1]]]
            said = f"{other.accepted}; {path[-1]} is missing"
            found[other.where] = Problem(other.where, other.given, said)
            del found[where]
    return list(found.values())


def _reach(loc: Sequence[str | int], data: object, root: type[BaseModel]) -> _WalkPosition:
    """Follow a location of pydantic's as far as it names something that a user wrote or should write."""
    location = _WalkPosition((), root, data)
    for step in loc:
        if step == "[key]":  # the key itself is wrong
            break
        tables = _tables(location.annotation)
        if len(tables) > 1:  # the step is the tag of the alternative that was tried
            chosen = next(table for table in tables if step in _tags(table))
            location = replace(location, annotation=chosen, alternatives=tables)
            continue
        here = replace(location, path=(*location.path, step), value=_item(location.value, step))
        if tables:
            field = tables[0].model_fields.get(str(step))
            description = (field.description or "") if field else ""
            alternatives = location.alternatives if tables[0] in location.alternatives else tables
            annotation = field.annotation if field else None
            location = replace(
                here,
                annotation=annotation,
                description=description,
                table=tables[0],
                alternatives=alternatives,
                around=location.table,
            )
        elif (entries := _entries(location.annotation, step)) is not None:
            keys, annotation = entries
            description = location.description.partition(", each ")[2] or location.description
            location = replace(here, annotation=annotation, description=description, keys=keys)
        else:
            break
    return location


def _unknown_key(location: _WalkPosition) -> tuple[Problem, str]:
    """The problem, and the key that was probably meant ("" if unclear)."""
    assert location.table is not None, "only tables have unknown keys"
    key, where, accepted = str(location.path[-1]), dotted(location.path), ", ".join(location.table.model_fields)
    if (problem := _too_deep(location.path[:-1], key, location.value, location.around)) is not None:
        return problem, ""
    if any(key in table.model_fields for table in location.alternatives):
        tag = _tags(location.table)[0]
        return Problem(where, location.value, f"not used by {tag!r}; accepted: {accepted}"), ""
    unknown = f"unknown key{choice(key, location.table.model_fields, 'accepted')}"
    return Problem(where, None, unknown), nearest(key, location.table.model_fields)


def _known(key: str, tables: Sequence[type[BaseModel]]) -> bool:
    return any(key in table.model_fields for table in tables)


def _too_deep(
    path: tuple[str | int, ...], key: str, value: object, around: type[BaseModel] | None
) -> Problem | None:
    """The problem of a key in the table at a path that belongs to the table around it; None where it does not."""
    if around is None or len(path) < 2 or key not in around.model_fields or path[-1] not in around.model_fields:
        return None
    instead = ", instead of mesh" if (path[-1], key) == ("mesh", "file") else ""
    accepted = f"belongs one table further out: {dotted((*path[:-1], key))}{instead}"
    return Problem(dotted((*path, key)), value, accepted)


def _bad_key(location: _WalkPosition) -> Problem:
    where, key = dotted(location.path), str(location.path[-1])
    if location.keys:
        return Problem(where, None, f"unknown key{choice(key, location.keys, 'accepted')}")
    return Problem(where, None, f"not a name; a name is {NAME_RULE}")


def _bad_tag(location: _WalkPosition) -> Problem:
    tables = _tables(location.annotation)
    tag = next(name for name, field in tables[0].model_fields.items() if _words(field.annotation))
    where, given = dotted((*location.path, tag)), _item(location.value, tag)
    accepted = tables[0].model_fields[tag].description
    if given is None:
        keys = [key for key in cast("Mapping[str, object]", location.value) if not _known(key, tables)]
        deep = (_too_deep(location.path, key, _item(location.value, key), location.table) for key in keys)
        return next((problem for problem in deep if problem), Problem(where, None, f"missing – give {accepted}"))
    suggestion = nearest(str(given), [word for table in tables for word in _tags(table)])
    return Problem(where, given, f"must be {accepted}{did_you_mean(suggestion)}")


def _bad_value(location: _WalkPosition) -> Problem:
    where, given = dotted(location.path), location.value
    tables = _tables(location.annotation)
    if len(tables) == 1 and not isinstance(given, Mapping):
        return Problem(where, given, f"must be a table with the keys {', '.join(tables[0].model_fields)}")
    return Problem(where, given, f"must be {location.description}{_hint(location)}")


def _hint(location: _WalkPosition) -> str:
    """What probably went wrong with a value of the wrong kind, "" if unclear."""
    given, number = location.value, "number" in location.description
    if isinstance(given, str):
        if number and _NUMBER.fullmatch(given.strip()):
            return "; write it without quotes"
        return did_you_mean(nearest(given, _words(location.annotation)))
    if number and isinstance(given, float) and not math.isfinite(given):
        return "; it must be finite"
    if number and isinstance(given, float) and abs(given) > MOST:
        return f"; at most {MOST:g} can be computed with"
    if number and isinstance(given, list | tuple):
        items = [item for item in cast("Sequence[object]", given) if isinstance(item, float)]
        if not all(math.isfinite(item) for item in items):
            return "; all of them must be finite"
        if any(abs(item) > MOST for item in items):
            return f"; at most {MOST:g} can be computed with"
    if "whole number" in location.description and isinstance(given, float) and given.is_integer():
        return "; write it without a decimal point"
    return ""


# -- the schema, as far as paths need it ---------------------------------------------------------------------


def _plain(annotation: Any) -> Any:
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return annotation


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    annotation = _plain(annotation)
    if get_origin(annotation) in (Union, types.UnionType):
        options = [option for option in get_args(annotation) if option is not type(None)]
        # A union may hold another one, as that of tables told apart by a key, or nothing.
        return tuple(inner for option in options for inner in _alternatives(option))
    return (annotation,)


def _tables(annotation: Any) -> tuple[type[BaseModel], ...]:
    """The tables that the annotation accepts; more than one where a key says which."""
    options = _alternatives(annotation)
    return tuple(option for option in options if isinstance(option, type) and issubclass(option, BaseModel))


def _words(annotation: Any) -> list[str]:
    """The words that the annotation accepts."""
    return [
        value for option in _alternatives(annotation) for value in get_args(option) if isinstance(value, str)
    ]


def _tags(table: type[BaseModel]) -> list[str]:
    """The word that tells the table from its alternatives."""
    words = (_words(field.annotation) for field in table.model_fields.values())
    return next((tag for tag in words if len(tag) == 1), [])


def _entries(annotation: Any, step: str | int) -> tuple[tuple[str, ...], Any] | None:
    """Words accepted as keys (none: any name) and type of the entries of a table or a list of tables.

    None for anything that is better shown as a whole, such as a list of numbers.
    """
    for option in _alternatives(annotation):
        arguments, origin = get_args(option), get_origin(option)
        if isinstance(origin, type) and issubclass(origin, Mapping):
            return tuple(_words(arguments[0])), arguments[1]
        if origin is tuple and isinstance(step, int) and _tables(arguments[0]):
            return (), arguments[0]
    return None


def _item(value: object, step: str | int) -> object:
    if isinstance(value, Mapping):
        return cast("Mapping[str | int, object]", value).get(step)
    if isinstance(value, list | tuple) and isinstance(step, int):
        items = cast("Sequence[object]", value)
        return items[step] if step < len(items) else None
    return None
