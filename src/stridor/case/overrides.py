"""Single values changed on the way in: `contacts.A.friction.coefficient=0.3`.

A path is keys joined by dots; an item of a list is reached by its number from 0 or by its name, so
`phases.1.duration` and `phases.slide.duration` may be the same. The value is written as in TOML; a bare word
is a text.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from typing import Any, cast

from ..errors import CaseError, Problem, shown
from .outsized import deep_line
from .points import choice, did_you_mean, nearest, no_such
from .schema import DEFAULT_PHASES, SINGULAR

_HOW = "write an override as path=value, such as contacts.A.friction.coefficient=0.3"
_VALUES = (
    'not a value; accepted: a number such as 0.3, true, false, a word, "a text", [a, list], { a = table }'
)
_DEEPEST = 20
_WORD = re.compile(r"[A-Za-z_]")


def parse_override(text: str) -> tuple[str, object]:
    """Path and value of "path=value". Raises CaseError."""
    path, equals, written = text.partition("=")
    path, written = path.strip(), written.strip()
    if not equals or not path:
        raise CaseError("override", text, _HOW)
    if not written:
        raise CaseError(path, None, f"no value given; {_HOW}")
    try:
        if deep_line(text):
            raise CaseError(path, written, "tables that are nested too deeply")
        read = tomllib.loads(f"value = {written}")
        if "\n" not in written and "\r" not in written:
            return path, read["value"]
    except (ValueError, RecursionError):  # TOMLDecodeError is one; a number may have too many digits
        if _WORD.match(written) and written.isprintable():
            return path, written
    raise CaseError(path, written, _VALUES)


def split_path(path: str) -> tuple[str, ...]:
    """Keys of a dotted path. Raises CaseError where one of them is empty."""
    given: Any = path
    if not isinstance(given, str):
        raise CaseError("override", given, _HOW)
    steps = tuple(step.strip() for step in path.split("."))
    if not all(steps) or len(steps) > _DEEPEST:
        raise CaseError("override", path, _HOW)
    return steps


def override(data: dict[str, Any], overrides: Iterable[str], *, of: str = "case") -> list[Problem]:
    """Apply overrides to the data of a case, in place and in turn; returns what could not be applied. of: what the data
    are called in words, "study" for those of one."""
    problems: list[Problem] = []
    for text in overrides:
        try:
            path, value = parse_override(text)
            problems.extend(apply(data, split_path(path), value, of=of))
        except CaseError as error:
            problems.extend(error.problems)
    return problems


def apply(data: dict[str, Any], path: tuple[str, ...], value: object, *, of: str = "case") -> list[Problem]:
    """Set the value at a path, in place; None removes it. Returns the problem if the path leads nowhere.

    A key that the schema does not know is set all the same: checking the whole then says what is accepted.
    """
    section = path[0]
    if section == "phases" and len(path) > 1 and not data.get("phases"):
        data["phases"] = [phase.model_dump(mode="json", exclude_unset=True) for phase in DEFAULT_PHASES]
    node: Any = data
    for depth, step in enumerate(path):
        here, last = ".".join(path[: depth + 1]), depth == len(path) - 1
        if isinstance(node, list):
            items = cast("list[Any]", node)
            number = _number(items, step)
            if number is None:
                return [Problem(here, None, _no_item(items, step))]
            if last:
                _put(items, number, value)
            else:
                node = items[number]
        elif isinstance(node, dict):
            table = cast("dict[str, Any]", node)
            if last:
                _put(table, step, value)
            elif depth == 1 and section in SINGULAR and step not in table:
                return [Problem(here, None, no_such(SINGULAR[section], step, table, of))]
            else:
                node = table.setdefault(step, {})
        else:
            return [Problem(".".join(path), None, f"{'.'.join(path[:depth])} is {shown(node)}, not a table")]
    return []


def number_at(data: dict[str, Any], path: str) -> float:
    """The number with decimals at a dotted path of the data of a case. Raises CaseError where there is none."""
    node: Any = data
    steps = split_path(path)
    for depth, step in enumerate(steps):
        here, before = ".".join(steps[: depth + 1]), ".".join(steps[:depth]) or "the case"
        if isinstance(node, list):
            items = cast("list[Any]", node)
            number = _number(items, step)
            if number is None:
                raise CaseError(here, None, _no_item(items, step))
            node = items[number]
        elif isinstance(node, dict) and step in node:
            node = cast("dict[str, Any]", node)[step]
        else:
            known = cast("dict[str, Any]", node) if isinstance(node, dict) else ()
            if len(steps) == 1 and step in (data.get("parameters") or {}):
                raise CaseError(here, None, f"an entry of [parameters], whose value is parameters.{step}.value")
            raise CaseError(here, None, f"no such number{choice(step, known, f'{before} has')}")
    if not isinstance(node, float):
        given = None if isinstance(node, dict) else node
        accepted = "the path of a number of the case that may have decimals, such as materials.steel.density"
        raise CaseError(path, given, accepted)
    return node


def _put(container: Any, key: str | int, value: object) -> None:
    container[key] = value
    if value is None:
        del container[key]


def _number(items: list[Any], step: str) -> int | None:
    names = _names(items)
    number = names.index(step) if step in names else int(step) if step.isdecimal() else -1
    return number if 0 <= number < len(items) else None


def _no_item(items: list[Any], step: str) -> str:
    names = _names(items)
    listed = ", ".join(f"{number} ({name})" if name else f"{number}" for number, name in enumerate(names))
    question = did_you_mean(nearest(step, filter(None, names)))
    return f"no such item{question or ';'} the list has: {listed or 'none'}"


def _names(items: list[Any]) -> list[str]:
    names: list[str] = []
    for item in items:
        table = cast("dict[str, Any]", item) if isinstance(item, dict) else {}
        names.append(str(table.get("name", "")))
    return names
